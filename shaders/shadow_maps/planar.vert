// One instance a light: the scene as that light sees it, moved into its tile of the atlas.
#if LAYER_FROM_VERTEX
#extension GL_ARB_shader_viewport_layer_array : require
#endif
#include "lib/shadows/atlas.glsl"

in int light_index;  // in its block; one an instance
in vec3 position;
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
    Light light = lights[light_index];
    vec4 clip = planar_clip(light, position);
    vec4 tile = atlas_tile(light);
    // The four sides of the map: the hardware clips at those of the whole layer only.
    gl_ClipDistance[0] = clip.w + clip.x;
    gl_ClipDistance[1] = clip.w - clip.x;
    gl_ClipDistance[2] = clip.w + clip.y;
    gl_ClipDistance[3] = clip.w - clip.y;
    gl_Position = in_tile(clip, tile);
#if LAYER_FROM_VERTEX
    gl_Layer = int(tile.w);
#else
    layer = int(tile.w);
#endif
}
