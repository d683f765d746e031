// The parts of a triangle, their outline moved outwards by `margin`, each corner where its direction lies in the map.
#if LAYER_FROM_VERTEX
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/shadows/paraboloid.glsl"

layout(quads, equal_spacing, ccw) in;

patch in int view_of_patch;
patch in vec3 corners[4];
patch in vec4 inwards[4];
patch in float turn;
patch in float margin;
patch in mat3 edges;
patch in mat3 chords;
patch in vec4 plane;
patch in float gap;
#if CUT
patch in mat3 cut_places;
patch in int cut_material;
#endif

// The direction that divides the edge from corner i to the next by angle, moved out.
vec3 on_edge(int i, float t) {
    vec3 normal = inwards[i].xyz;
    float angle = t * inwards[i].w;
    return cos(angle) * corners[i] + sin(angle) * turn * cross(normal, corners[i]) - margin * normal;
}

// Both edges are moved by `margin`; a needle's tip is not drawn out for ever.
vec3 at_corner(int i) {
    vec3 before = inwards[(i + 3) % 4].xyz, behind = inwards[i].xyz;
    return corners[i] - (before + behind) * (margin / max(1.0 + dot(before, behind), BLUNT));
}

void main() {
    float u = gl_TessCoord.x, v = gl_TessCoord.y;
    bool side_u = u == 0.0 || u == 1.0, side_v = v == 0.0 || v == 1.0;
    vec3 direction;
    if (side_u && side_v) direction = at_corner(v == 0.0 ? int(u) : 3 - int(u));
    else if (side_v) direction = v == 0.0 ? on_edge(0, u) : on_edge(2, 1.0 - u);
    else if (side_u) direction = u == 0.0 ? on_edge(3, 1.0 - v) : on_edge(1, v);
    else direction = corners[0] + corners[1] + corners[2] + corners[3];
    part.view = view_of_patch;
    part.edges = edges;
    part.chords = chords;
    part.plane = plane;
    part.gap = gap;
#if CUT
    part.cut_places = cut_places;
    part.cut_material = cut_material;
#endif
    part.ndc = place(drawn_view(view_of_patch), direction);
}
