// A pixel's light: that of the samples of the grid around it which lie on its surface, or of its own sample.
#include "lib/pool/blend.glsl"

layout(binding = UNIT_LIGHT) uniform sampler2D light;
#if SCALE > 1
layout(binding = UNIT_BLEND) uniform usampler2D blend;
uniform ivec2 offset;
#endif

layout(location = 0) out vec4 irradiance;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(light, 0);
#if SCALE > 1
    uint shares = texelFetch(blend, pixel, 0).r;
    irradiance = vec4(0.0);
    if ((shares & LONELY) != 0u) {
        int place = int(shares & ~LONELY);
        irradiance = vec4(texelFetch(light, ivec2(place % size.x, place / size.x), 0).rgb, 1.0);
        return;
    }
    Corner corner = find_corner(pixel, offset, size);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        float share = float(shares >> (7 * i) & 127u);
        irradiance.rgb += share * texelFetch(light, corner_place(corner, i), 0).rgb;
        total += share;
    }
    irradiance = vec4(irradiance.rgb / max(total, 1.0), 1.0);
#else
    irradiance = vec4(texelFetch(light, pixel, 0).rgb, 1.0);
#endif
}
