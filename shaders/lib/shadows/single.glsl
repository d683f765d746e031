// A map in a texture of its own: what lib/shadows/atlas.glsl says of the atlas, for lib/shadows/filter.glsl and
// lib/shadows/soft.glsl.

#define MAP sampler2DShadow
#define DEPTHS sampler2D

float compared(MAP map, vec4 rectangle, float size, vec3 at) {
    return texture(map, vec3(at.xy / size, at.z));
}

float depth_at(DEPTHS map, vec4 rectangle, ivec2 texel) {
    return texelFetch(map, texel, 0).r;
}
