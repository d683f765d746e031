// Of DRAWS VPLs of the list of a tile near the sample, spread over the whole list, RAYS are kept: one of each of as many
// stretches of the curve, so that they differ.
#include "lib/pool/samples.glsl"
#include "lib/pool/list.glsl"
#include "lib/pool/hash.glsl"

layout(binding = UNIT_POSITIONS) uniform sampler2D positions;
layout(binding = UNIT_SAMPLE_NORMALS) uniform sampler2D sample_normals;
layout(binding = UNIT_PIXELS) uniform usampler2D pixels;
layout(binding = UNIT_LIST_POSITIONS) uniform sampler2D list_positions;
layout(binding = UNIT_LIST_NORMALS) uniform sampler2D list_normals;
uniform int frame_seed;
uniform float area;  // makes the kernel a number without unit

struct Choices {  // four a layer
    uvec4 places[CHOICE_LAYERS];  // in the lists, tile by tile
    vec4 weights[CHOICE_LAYERS];
};

const int STRIDE = LIST_ENTRIES / DRAWS, EACH = DRAWS / RAYS;
const float GOLDEN_RATIO = 0.618034;

// A tile at most half a tile from the sample's own: between tiles, samples mix, and no edge shows.
int choose_tile(ivec2 place, ivec2 size, uint random) {
    uint number = texelFetch(pixels, place, 0).r;
    vec2 at = (vec2(number % uint(size.x), number / uint(size.x)) + 0.5) / vec2(size) * float(TILES);
    vec2 shift = vec2(random & 0xffffu, random >> 16) / 65536.0 - 0.5;
    ivec2 tile = clamp(ivec2(floor(at + shift)), ivec2(0), ivec2(TILES - 1));
    return tile.y * TILES + tile.x;
}

Choices choose_vpls(ivec2 place) {
    Choices chosen;
    for (int layer = 0; layer < CHOICE_LAYERS; ++layer) {
        chosen.places[layer] = uvec4(NOBODY);
        chosen.weights[layer] = vec4(0.0);
    }
    ivec2 size = textureSize(positions, 0);
    Sample s = read_sample(positions, sample_normals, place);
    if (s.depth <= 0.0) return chosen;
    uint random = hash(place, uint(frame_seed)), block = hash(place >> 2, uint(frame_seed) ^ 0x5bd1e995u);
    int tile = choose_tile(place, size, random);
    // The samples of a block start at different entries, each as often at one as at another, and their random numbers are
    // stratified. The nearest four differ most.
    uint nearest = uint(place.x & 1) | uint(place.y & 1) << 1, number = nearest | uint(place.x & 2) << 1 | uint(place.y & 2) << 2;
    int start = int((number + (block >> 4)) % uint(STRIDE));
    float stratum = (float(number * 7u + block & 15u) + unit(hash(random))) / 16.0;
    for (int k = 0; k < RAYS; ++k) {
        float sum = 0.0, kept = 0.0, u = fract(stratum + float(k) * GOLDEN_RATIO);
        int choice = 0;
        for (int j = 0; j < EACH; ++j) {
            int candidate = start + (k * EACH + j) * STRIDE;
            Entry entry = read_entry(list_positions, list_normals, tile, candidate);
            float brings = entry.power * entry_kernel(entry, s.position, s.normal, s.shading_normal) * area;
            sum += brings;
            float chance = brings / max(sum, TINY);
            bool take = u < chance;
            // What is left of the random number is one for those to come.
            u = take ? u / max(chance, TINY) : (u - chance) / max(1.0 - chance, TINY);
            kept = take ? brings : kept;
            choice = take ? candidate : choice;
        }
        if (kept > 0.0) {
            chosen.places[k / 4][k % 4] = uint(tile * LIST_ENTRIES + choice);
            chosen.weights[k / 4][k % 4] = sum / kept * float(STRIDE);
        }
    }
    return chosen;
}
