// A step of the filter of reflections: the mean of 3 x 3 pixels `apart` from each other, of those on the pixel's own
// surface, while the pixel's lobe is wider than that.
#include "lib/surface/pixel.glsl"
#include "lib/lights/light.glsl"
#if HAS_BLEND
#include "lib/pool/blend.glsl"
layout(binding = UNIT_BLEND) uniform usampler2D blend;
uniform ivec2 offset;
#endif

layout(binding = UNIT_REFLECTIONS) uniform sampler2D reflections;
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
layout(binding = UNIT_MATERIAL) uniform sampler2D material;
uniform int apart;     // 0: copy
uniform float reach;   // part of the lobe's width
uniform float cosine;  // of the largest angle between normals

in vec2 ndc;
layout(location = 0) out vec4 filtered;

float roughness_at(ivec2 pixel) {
    return texelFetch(material, pixel, 0).r;
}

#if HAS_BLEND
// Reflections of a pixel for which the samples around it traced.
vec4 from_samples(ivec2 pixel, ivec2 size) {
    uint shares = texelFetch(blend, pixel, 0).r;
    Corner corner = find_corner(pixel, offset, size);
    vec3 sum = vec3(0.0);
    float total = 0.0, inverse = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 other = grid_pixel(corner_place(corner, i), offset, size);
        vec4 light = texelFetch(reflections, other, 0);
        if (light.a <= 0.0 || abs(roughness_at(other) - roughness_at(pixel)) > ALIKE) continue;
        float share = float(shares >> (7 * i) & 127u);
        sum += share * light.rgb;
        inverse += share / light.a;
        total += share;
    }
    return total > 0.0 ? vec4(sum / total, total / inverse) : vec4(0.0);
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(depth, 0);
    filtered = texelFetch(reflections, pixel, 0);
#if HAS_BLEND
    if (filtered.a < 0.0) filtered = from_samples(pixel, size);
#endif
    if (apart == 0 || filtered.a <= 0.0) return;
    float d = texelFetch(depth, pixel, 0).r, view = frame.near / d;
    Pixel p = read_pixel(normals, pixel, ndc, d);
    float roughness = roughness_at(pixel), alpha = roughness * roughness;
    // As an angle at the camera: what lies close behind a surface is blurred less than the lobe is wide.
    float pixel_angle = 2.0 * length(frame.ray[1].xyz) / float(size.y);
    float width = reach * alpha * filtered.a / (filtered.a + view) / pixel_angle;
    if (width < float(apart)) return;
    float off = pixel_angle * view * float(apart);
    vec4 sum = filtered;
    float total = 1.0, inverse = 1.0 / filtered.a;
    for (int i = 0; i < 9; ++i) {
        ivec2 step = ivec2(i % 3 - 1, i / 3 - 1), other = pixel + step * apart;
        if (i == 4 || any(greaterThanEqual(uvec2(other), uvec2(size)))) continue;
        vec4 light = texelFetch(reflections, other, 0);
        if (light.a <= 0.0) continue;
        Pixel q = read_pixel(normals, other, centre_ndc(other, size), texelFetch(depth, other, 0).r);
        bool same = abs(dot(q.position - p.position, p.normal)) <= off && dot(q.shading_normal, p.shading_normal) >= cosine;
        if (!same || abs(roughness_at(other) - roughness) > ALIKE) continue;
        float weight = (step.x == 0 ? 1.0 : 0.667) * (step.y == 0 ? 1.0 : 0.667);
        sum.rgb += weight * light.rgb;
        inverse += weight / light.a;
        total += weight;
    }
    filtered = vec4(sum.rgb / total, total / inverse);
}
