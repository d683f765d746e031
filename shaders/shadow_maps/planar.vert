// One instance a view: the scene as that view sees it, moved into its place in the atlas.
#if LAYER_FROM_VERTEX
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/shadows/drawn_view.glsl"
#include "lib/shadows/projection.glsl"

in int view_index;  // in its block; one an instance
in vec3 position;
#if CUT
in vec3 cut_corner;
#if LAYER_FROM_VERTEX
out vec3 corner;
#else
out vec3 corner_of_vertex;
#endif
#endif
#if LAYER_FROM_VERTEX
out float gl_ClipDistance[4];
#else
out gl_PerVertex {  // as the geometry shader reads it
    vec4 gl_Position;
    float gl_ClipDistance[4];
};
flat out int layer;
#endif

void main() {
    View view = drawn_view(view_index);
    vec4 clip = flat_clip(view, position);
    // The four sides of the map: the hardware clips at those of the whole layer only.
    gl_ClipDistance[0] = clip.w + clip.x;
    gl_ClipDistance[1] = clip.w - clip.x;
    gl_ClipDistance[2] = clip.w + clip.y;
    gl_ClipDistance[3] = clip.w - clip.y;
    gl_Position = in_rectangle(clip, view.rectangle);
#if CUT && LAYER_FROM_VERTEX
    corner = cut_corner;
#elif CUT
    corner_of_vertex = cut_corner;
#endif
#if LAYER_FROM_VERTEX
    gl_Layer = int(view.rectangle.w);
#else
    layer = int(view.rectangle.w);
#endif
}
