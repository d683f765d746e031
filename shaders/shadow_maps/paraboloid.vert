// The scene in a paraboloid map: triangles that are small in the map go there as they are, others to paraboloid.tesc.
#if LAYER_FROM_VERTEX && !SPLIT
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/shadows/drawn_view.glsl"
#if SPLIT
flat out int view_of_corner;
out vec3 corner;  // from the view
#if CUT
in vec3 cut_corner;
out vec3 cut_of_corner;
#endif
#else
#include "lib/shadows/paraboloid.glsl"
#endif

in int view_index;  // in its block; one an instance
in vec3 position;

void main() {
    View view = drawn_view(view_index);
    vec3 d = position - view.position;
#if SPLIT
    view_of_corner = view_index;
    corner = d;
#if CUT
    cut_of_corner = cut_corner;
#endif
#else
    part.seen = d;
    vec2 map_ndc = place(view, d);
#if STRAIGHT
    part.ndc = map_ndc;
    part.view = view_index;
#endif
#endif
}
