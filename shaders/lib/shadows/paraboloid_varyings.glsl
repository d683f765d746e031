// Varyings from a triangle to the fragment shader of a paraboloid map, as the members of an interface block.
#if SPLIT
// ndc: in the map. edges: planes through the view and an edge, in the view's axes; a direction within the triangle is
// on their inner sides. chords: lines of the map, by which the triangle reaches beyond an edge that small neighbours draw
// straight; what is on their inner sides is within it, too. plane: the depth is its xyz times the direction, its w the
// least that the triangle has. gap: how far it reaches over its sides, an angle.
#if CUT
// cut_places: takes a direction to the place in the image where it meets the triangle, as a fraction: u, v over the third.
#define PART { vec2 ndc; flat int view; flat mat3 edges; flat mat3 chords; flat vec4 plane; flat float gap; flat mat3 cut_places; flat int cut_material; }
#else
#define PART { vec2 ndc; flat int view; flat mat3 edges; flat mat3 chords; flat vec4 plane; flat float gap; }
#endif
#elif STRAIGHT
#define PART { vec2 ndc; flat int view; vec3 seen; }
#else
#define PART { vec3 seen; }  // from the view, between the corners
#endif

const float BLUNT = 0.2;  // 1 + cosine of the angle between the normals of two sides: sharper corners move less
