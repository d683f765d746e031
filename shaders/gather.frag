// The mean irradiance of the pixels that lie on the pixel's own surface (passes/neighbours.py). Lonely pixels get the
// light of the shares that they have; that of missing shares is added later.
#include "lib/shares/places.glsl"
#include "lib/shares/window.glsl"

layout(binding = UNIT_SHARES) uniform sampler2D shares;
layout(binding = UNIT_WINDOW) uniform usampler2DArray window;
#if HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif

#if HAS_LAYOUT
uniform ivec2 grid;  // samples; those of the list, beyond it, are lonely
#endif

layout(location = 0) out vec4 irradiance;

bool has(uint set, int number) {
    return (set >> number & 1u) == 1u;
}

void main() {
#if HAS_LAYOUT
    ivec2 size = grid;
#else
    ivec2 size = textureSize(shares, 0);
#endif
    ivec2 pixel = ivec2(gl_FragCoord.xy), corner = window_corner(pixel, size);
    irradiance = vec4(0.0, 0.0, 0.0, 1.0);
    vec3 sum = vec3(0.0);
    int number = 0;  // of pixels in the sum
    bool lonely = false;
    uint others = 0u;  // not 0: pixels on the other side count
    for (int g = 0; g < GROUPS; ++g) {
        WindowGroup group = unpack_group(texelFetch(window, ivec3(pixel, g), 0).rg);
        number += bitCount(group.counts);
        lonely = group.lonely;
        others |= group.x | group.y;
        for (int i = 0; i < GROUP; ++i) {
            vec3 color = texelFetch(shares, split_place(tap_pixel(corner, g * GROUP + i), size), 0).rgb;
            sum += has(group.counts, i) ? color : vec3(0.0);
        }
    }
    if (number == 0) return;  // background: a surface counts for itself
    // Where a loop has nothing to do for a group of pixels it is skipped; a branch may not be.
    int groups = others != 0u ? GROUPS : 0;
    for (int g = 0; g < groups; ++g) {
        WindowGroup group = unpack_group(texelFetch(window, ivec3(pixel, g), 0).rg);
        for (uint taps = group.x | group.y; taps != 0u; taps &= taps - 1u) {
            int i = findLSB(taps);
            ivec2 other = tap_pixel(corner, g * GROUP + i);
            other += other_side(other, pixel) * ivec2(has(group.x, i), has(group.y, i));
            sum += texelFetch(shares, split_place(other, size), 0).rgb;
            ++number;
        }
    }
#if HAS_NEAR_FIELD
    // The near field belongs to no share: any neighbours estimate it, and what they have of it in `sum` is replaced.
    vec4 given = vec4(0.0);
    groups = lonely ? GROUPS : 0;
    for (int g = 0; g < groups; ++g) {
        WindowGroup group = unpack_group(texelFetch(window, ivec3(pixel, g), 0).rg);
        for (int i = 0; i < GROUP; ++i)
            if (has(group.counts, i)) given += texelFetch(near_field, tap_pixel(corner, g * GROUP + i), 0);
    }
    vec3 near = given.rgb / max(given.a, 1e-3);
    vec3 alone = (sum - given.rgb) / float(TAPS) + near;
#else
    vec3 alone = sum / float(TAPS);
#endif
    irradiance.rgb = lonely ? alone : sum / float(number);
}
