// Lists of LIST_ENTRIES VPLs, a row for each tile of the image, four texels a VPL (passes/propose_vpls.py).
#include "lib/lights/vpl_kernel.glsl"

const int TEXELS = 4;
const uint NOBODY = 0xffffffffu;  // a choice of no VPL

struct Entry {
    vec3 position;
    float power;          // its luminous power over the pool's, times its weight; 0: no VPL
    vec3 normal;
    float clamp_squared;
};

Entry read_entry(sampler2D lists, int tile, int number) {
    ivec2 first = ivec2(TEXELS * number, tile);
    vec4 a = texelFetch(lists, first, 0), b = texelFetch(lists, first + ivec2(1, 0), 0);
    return Entry(a.xyz, a.w, b.xyz, b.w);
}

// Its emission times its weight.
vec3 read_emission(sampler2D lists, int tile, int number) {
    vec4 c = texelFetch(lists, ivec2(TEXELS * number + 2, tile), 0);
    return c.rgb * c.a;
}

float entry_kernel(Entry entry, vec3 position, vec3 normal, vec3 shading_normal) {
    return vpl_kernel(position - entry.position, entry.normal, normal, shading_normal, POOL_EDGE, entry.clamp_squared);
}
