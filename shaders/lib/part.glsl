// What a fragment of a paraboloid map is told of its triangle, as the members of an interface block.
#if SPLIT
// ndc: in the map. edges: planes through the light and an edge, in the light's frame; a direction within the triangle is
// on their inner sides. plane: the depth is its xyz times the direction, its w the least that the triangle has.
#define PART { vec2 ndc; flat int light; flat mat3 edges; flat vec4 plane; }
#elif STRAIGHT
#define PART { vec2 ndc; flat int light; vec3 seen; }
#else
#define PART { vec3 seen; }  // from the light, between the corners
#endif
