// Adds to each lonely pixel the light of its missing shares' VPLs in one block.
#include "lib/shares/askers.glsl"
#include "lib/lights/vpl.glsl"
#include "lib/shares/lonely.glsl"
#if HAS_SHADOWS
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/vpl_visibility.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#endif

layout(binding = UNIT_LONELY_PIXELS) uniform usampler2D lonely_pixels;
layout(binding = UNIT_LONELY_COUNT) uniform usampler2D lonely_count;
layout(binding = UNIT_MISSING) uniform usampler2D missing;
layout(binding = 0, rgba32f) uniform image2D irradiance;
uniform ivec2 ranges[INTERLEAVE * INTERLEAVE];  // where in the block the VPLs of each share begin and end

float visibility(Vpl vpl, Pixel p) {
#if HAS_SHADOWS
    return vpl_visibility(shadows, vpl, p.position, p.normal);
#else
    return 1.0;
#endif
}

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy), size = textureSize(normals, 0);
    if (list_entry(place, size) >= texelFetch(lonely_count, ivec2(0), 0).r) return;
    ivec2 pixel = pixel_of(texelFetch(lonely_pixels, place, 0).r, size.x);
    Pixel p;
    read_asker(pixel, p);
    vec3 sum = vec3(0.0);
    uvec2 bits = texelFetch(missing, place, 0).rg;
    const int shares = INTERLEAVE * INTERLEAVE;
    for (int share = 0; share < shares; ++share) {
        bool wanted = ((bits[share >> 5] >> (share & 31)) & 1u) == 1u;
        int end = wanted ? ranges[share].y : 0;  // the loop is empty where no pixel of the group misses the share
        for (int i = ranges[share].x; i < end; ++i)
            sum += vpl_irradiance(vpls[i], p.position, p.normal, p.shading_normal) * visibility(vpls[i], p);
    }
    imageStore(irradiance, pixel, imageLoad(irradiance, pixel) + vec4(sum, 0.0));
}
