// A step of the filter: the mean of 3 x 3 samples `apart` from each other, of those on the sample's own surface.
#include "lib/camera/frame.glsl"
#include "lib/colour.glsl"
#include "lib/lights/light.glsl"
#include "lib/pool/blend.glsl"
#include "lib/pool/samples.glsl"

layout(binding = UNIT_IRRADIANCE) uniform sampler2D irradiance;  // alpha: standard deviation, from the second step on
layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
layout(binding = UNIT_SAMPLE_NORMALS) uniform sampler2D sample_normals;
uniform ivec2 grid;  // samples
uniform int apart;
uniform float tolerance;
uniform float cosine;  // of the largest angle between normals
uniform float slack;   // of planes, in pixels

#if FIRST
layout(binding = UNIT_PIXELS) uniform usampler2D pixels;
layout(binding = UNIT_BLEND) uniform usampler2D blend;
#endif

bool on_surface(Sample s, Sample t, float off) {
    return t.depth > 0.0 && abs(dot(t.position - s.position, s.normal)) <= off
        && dot(t.shading_normal, s.shading_normal) >= cosine;
}

#if FIRST
// The mean of the samples of the list among the 5 x 5 pixels around a lonely one.
vec3 mean_of_lonely(ivec2 place, Sample s, float off) {
    ivec2 size = textureSize(pixels, 0);
    int number = int(texelFetch(pixels, place, 0).r);
    vec3 sum = vec3(0.0);
    float total = 0.0;
    for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x) {
            ivec2 other = ivec2(number % size.x + x, number / size.x + y);
            if (any(greaterThanEqual(uvec2(other), uvec2(size)))) continue;
            uint shares = texelFetch(blend, other, 0).r;
            if ((shares & LONELY) == 0u) continue;
            ivec2 at = ivec2(int(shares & ~LONELY) % size.x, int(shares & ~LONELY) / size.x);
            // The sample itself counts: a rounded normal's cosine to itself may be below 1.
            bool counts = at == place || on_surface(s, read_sample(positions, sample_normals, at), off);
            float weight = counts ? 1.0 : 0.0;
            sum += weight * texelFetch(irradiance, at, 0).rgb;
            total += weight;
        }
    return sum / total;
}
#endif

// Filtered irradiance of the sample in a texel; alpha: standard deviation of its luminance.
vec4 filter_sample(ivec2 place) {
    vec4 own = texelFetch(irradiance, place, 0), filtered = vec4(own.rgb, 0.0);
    Sample s = read_sample(positions, sample_normals, place);
    if (s.depth <= 0.0 || apart == 0) return filtered;
    float pixel = 2.0 * length(frame.ray[1].xyz) * s.depth / float(textureSize(positions, 0).y);
    if (any(greaterThanEqual(place, grid))) {
#if FIRST
        filtered.rgb = mean_of_lonely(place, s, slack * pixel);
#endif
        return filtered;
    }
    float off = slack * pixel * float(apart), level = luminance(own.rgb);
#if !FIRST
    float reciprocal = 0.5 / max(tolerance * own.a + 1e-3 * level, TINY);
#endif
    vec3 sum = vec3(0.0);
    float total = 0.0, mean = 0.0, most = TINY, weights[9], values[9];
    for (int i = 0; i < 9; ++i) {
        ivec2 step = ivec2(i % 3 - 1, i / 3 - 1), other = place + step * apart, inside = clamp(other, ivec2(0), grid - 1);
        Sample t = read_sample(positions, sample_normals, inside);
        vec4 light = texelFetch(irradiance, inside, 0);
        bool counts = other == place || (other == inside && on_surface(s, t, off));
        float l = luminance(light.rgb), weight = counts ? 1.0 : 0.0;
#if FIRST
        mean += weight * l;
        values[i] = abs(l - level);
#else
        float deviations = (l - level) * reciprocal;
        // A B-spline in space; a parabola over the difference in light.
        weight *= (step.x == 0 ? 1.0 : 0.667) * (step.y == 0 ? 1.0 : 0.667) * max(1.0 - deviations * deviations, 0.0);
        values[i] = light.a;
#endif
        weights[i] = weight;
        most = max(most, weight > 0.0 ? values[i] : 0.0);
        sum += weight * light.rgb;
        total += weight;
    }
    filtered.rgb = sum / total;
    float squares = 0.0;  // over those of `most`: squares of light itself may leave the range of floats
    for (int i = 0; i < 9; ++i) {
        float value = weights[i] > 0.0 ? values[i] / most : 0.0;
#if FIRST
        squares += weights[i] * value * value;
#else
        squares += weights[i] * weights[i] * value * value;
#endif
    }
#if FIRST
    float shift = (mean / total - level) / most;
    filtered.a = most * sqrt(max(squares / total - shift * shift, 0.0) / max(total - 1.0, 1.0));
#else
    filtered.a = most * sqrt(squares) / total;
#endif
    return filtered;
}
