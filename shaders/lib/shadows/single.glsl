// A map in a texture of its own: what lib/shadows/atlas.glsl says of the atlas, for lib/shadows/filter.glsl
// and lib/shadows/soft.glsl.
#include "lib/shadows/projection.glsl"

#define MAP sampler2DShadow
#define DEPTHS sampler2D
#define map_place(light) vec4(0.0, 0.0, 1.0, 0.0)

float compared(MAP map, vec4 place, float size, vec3 at) {
    return texture(map, vec3(at.xy / size, at.z));
}

float spot_depth(DEPTHS map, ivec2 texel) {
    return texelFetch(map, texel, 0).r;
}
