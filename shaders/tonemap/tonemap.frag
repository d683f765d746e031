// Exposure, tone curve, sRGB.
#include "lib/colour.glsl"

layout(binding = UNIT_RADIANCE) uniform sampler2D radiance;
#ifndef OPERATOR
uniform int operator_number;  // neutral, reinhard, aces, none
#define OPERATOR operator_number
#endif

layout(location = 0) out vec4 color;
flat in float exposure;

// Khronos PBR Neutral: colours below 0.8 - 0.04 keep their value, brighter ones bend towards white.
vec3 neutral(vec3 c) {
    const float start = 0.8 - 0.04, desaturation = 0.15;
    float low = min(c.r, min(c.g, c.b));
    float offset = low < 0.08 ? low - 6.25 * low * low : 0.04;
    c -= offset;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < start) return c;
    const float d = 1.0 - start;
    float bent = 1.0 - d * d / (peak + d - start);
    c *= bent / peak;  // peak is at least `start` here
    // The bent peak is the lower one.
    return mix(c, vec3(bent), 1.0 - 1.0 / (desaturation * (peak - bent) + 1.0));
}

vec3 reinhard(vec3 c) {
    return c / (1.0 + luminance(c));
}

vec3 aces(vec3 c) {
    c *= 0.6;  // the fit's own exposure
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}

vec3 srgb(vec3 c) {
    c = clamp(c, 0.0, 1.0);
    return mix(1.055 * pow(max(c, 1e-9), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

void main() {
    vec3 c = texelFetch(radiance, ivec2(gl_FragCoord.xy), 0).rgb * exposure;
    c = min(c, 1e6);  // the curves square their argument
    if (OPERATOR == 0) c = neutral(c);
    else if (OPERATOR == 1) c = reinhard(c);
    else if (OPERATOR == 2) c = aces(c);
    color = vec4(srgb(c), 1.0);
}
