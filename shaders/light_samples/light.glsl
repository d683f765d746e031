// Irradiance of a sample: what each of its choices that it sees brings, by the choice's weight.
#include "lib/pool/samples.glsl"
#include "lib/pool/list.glsl"

layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
layout(binding = UNIT_SAMPLE_NORMALS) uniform sampler2D sample_normals;
layout(binding = UNIT_LIST_POSITIONS) uniform sampler2D list_positions;
layout(binding = UNIT_LIST_NORMALS) uniform sampler2D list_normals;
layout(binding = UNIT_LIST_EMISSIONS) uniform sampler2D list_emissions;  // times weight
layout(binding = UNIT_CHOICES) uniform usampler2DArray choices;  // four a layer
layout(binding = UNIT_WEIGHTS) uniform sampler2DArray weights;
layout(binding = UNIT_SEEN) uniform usampler2D seen;
#if HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif

vec4 light_sample(ivec2 place) {
    vec4 irradiance = vec4(0.0);
    Sample s = read_sample(positions, sample_normals, place);
    if (s.depth <= 0.0) return irradiance;
    uint bits = texelFetch(seen, place, 0).r;
    uvec4 chosen;
    vec4 weight;
    for (int k = 0; k < RAYS; ++k) {
        if (k % 4 == 0) {
            chosen = texelFetch(choices, ivec3(place, k / 4), 0);
            weight = texelFetch(weights, ivec3(place, k / 4), 0);
        }
        if ((bits >> k & 1u) == 0u) continue;
        int tile = int(chosen[k % 4] / uint(LIST_ENTRIES)), number = int(chosen[k % 4] % uint(LIST_ENTRIES));
        float kernel = entry_kernel(read_entry(list_positions, list_normals, tile, number), s.position, s.normal, s.shading_normal);
        irradiance.rgb += texelFetch(list_emissions, ivec2(number, tile), 0).rgb * (weight[k % 4] * kernel);
    }
#if HAS_NEAR_FIELD
    irradiance.rgb += texelFetch(near_field, place, 0).rgb;
#endif
    return irradiance;
}
