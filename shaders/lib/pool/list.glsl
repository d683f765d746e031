// Lists of LIST_ENTRIES VPLs, a row for each tile of the image (passes/list_vpls.py).
#include "lib/lights/vpl_kernel.glsl"

const uint NOBODY = 0xffffffffu;  // a choice of no VPL

struct Entry {
    vec3 position;
    float power;          // its luminous power over the pool's, times its weight; 0: no VPL
    vec3 normal;
    float clamp_squared;  // below 0: at infinity
};

Entry read_entry(sampler2D positions, sampler2D normals, int tile, int number) {
    vec4 a = texelFetch(positions, ivec2(number, tile), 0), b = texelFetch(normals, ivec2(number, tile), 0);
    return Entry(a.xyz, a.w, b.xyz, b.w);
}

float entry_kernel(Entry entry, vec3 position, vec3 normal, vec3 shading_normal) {
    vec3 from = way_from(entry.position, entry.normal, position, entry.clamp_squared);
    return vpl_kernel(from, entry.normal, normal, shading_normal, POOL_EDGE, entry.clamp_squared);
}
