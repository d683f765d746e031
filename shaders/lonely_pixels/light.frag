// VPLs of a block whose shares are missing at a pixel of the list; added to what is known there.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/lights/vpl.glsl"
#include "lib/shares/lonely.glsl"
#if HAS_SHADOWS
#include "lib/shadows/atlas.glsl"
#include "lib/shadows/vpl_visibility.glsl"
layout(binding = UNIT_SHADOWS) uniform sampler2DArrayShadow shadows;
#endif

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
layout(binding = 0, rgba32f) uniform image2D irradiance;
uniform ivec2 ranges[INTERLEAVE * INTERLEAVE];  // where in the block the VPLs of each share begin and end

float visibility(Vpl vpl, vec3 position, vec3 normal) {
#if HAS_SHADOWS
    return vpl_visibility(shadows, vpl, position, normal);
#else
    return 1.0;
#endif
}

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy), size = textureSize(depth, 0);
    if (uint(place.y * size.x + place.x) >= imageLoad(count, ivec2(0)).r) return;
    ivec2 pixel = thin_place(imageLoad(thin, place).r, size.x);
    vec3 position = unproject((vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0, texelFetch(depth, pixel, 0).r);
    vec4 code = texelFetch(normals, pixel, 0);
    vec3 shading_normal, normal;
    decode_normals(code, shading_normal, normal);
    vec3 sum = vec3(0.0);
    uvec2 bits = imageLoad(missing, pixel).rg;
    const int shares = INTERLEAVE * INTERLEAVE;
    for (int share = 0; share < shares; ++share) {
        bool wanted = ((bits[share >> 5] >> (share & 31)) & 1u) == 1u;
        int end = wanted ? ranges[share].y : 0;  // nothing is looped over where no pixel wants it
        for (int i = ranges[share].x; i < end; ++i)
            sum += vpl_irradiance(vpls[i], position, normal, shading_normal) * visibility(vpls[i], position, normal);
    }
    imageStore(irradiance, pixel, imageLoad(irradiance, pixel) + vec4(sum, 0.0));
}
