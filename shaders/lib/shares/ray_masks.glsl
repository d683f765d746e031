// Which VPLs of its share a pixel sees, asked by rays (passes/shadow_rays.py), for passes with an input `rays`.
layout(binding = UNIT_RAYS) uniform usampler2DArray rays;

// Of VPL `number` of the share, for a fragment that stands in its sub-buffer.
float ray_visibility(int number) {
    uint word = texelFetch(rays, ivec3(ivec2(gl_FragCoord.xy), number >> 5), 0).r;
    return float((word >> (number & 31)) & 1u);
}
