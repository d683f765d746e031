// An entry, a column, of the list of a tile, a row: a group by the tile's chances, and a VPL of the group by power. The
// groups of a list are drawn systematically along the curve, so that a list keeps the pool's stratification.
#include "lib/pool/hash.glsl"
#include "lib/pool/pool.glsl"

layout(binding = UNIT_POOL) uniform sampler2D pool;
layout(binding = UNIT_CHANCES) uniform sampler2D chances;  // of a group and all before it
uniform int vpls;    // of the pool
uniform int groups;  // of the pool
uniform int frame_seed;

struct Listed {
    uint number;  // in the pool
    vec4 position, normal, emission;
};

float before_group(int tile, int group) {
    return group == 0 ? 0.0 : texelFetch(chances, ivec2(group - 1, tile), 0).r;
}

// In the order of the curve, over the power of its group.
float power_up_to(int vpl) {
    return texelFetch(pool, pool_place(vpl, 2), 0).a;
}

Listed draw_entry(int entry, int tile) {
    Listed drawn = Listed(0u, vec4(0.0), vec4(0.0), vec4(0.0));
    uint seed = uint(frame_seed);
    float start = unit(hash(uint(tile) ^ hash(seed)));
    float mark = (float(entry) + 1.0 - start) / float(LIST_ENTRIES), part = 1.0 - unit(hash(ivec2(entry, tile), ~seed));

    int low = 0, high = groups;  // the first group whose chances reach the mark
    while (low < high) {
        int middle = (low + high) / 2;
        if (texelFetch(chances, ivec2(middle, tile), 0).r < mark) low = middle + 1;
        else high = middle;
    }
    if (low >= groups) return drawn;  // a pool without power
    int group = low;
    int first = group * vpls / groups, last = (group + 1) * vpls / groups - 1;
    low = first;
    high = last;
    while (low < high) {
        int middle = (low + high) / 2;
        if (power_up_to(middle) < part) low = middle + 1;
        else high = middle;
    }
    float chance = before_group(tile, group + 1) - before_group(tile, group);
    float within = power_up_to(low) - (low == first ? 0.0 : power_up_to(low - 1));
    float weight = 1.0 / (float(LIST_ENTRIES) * chance * within);  // once over how often a list holds it
    drawn.number = uint(low);
    drawn.position = texelFetch(pool, pool_place(low, 0), 0);
    drawn.normal = texelFetch(pool, pool_place(low, 1), 0);
    drawn.position.a *= weight;
    drawn.emission = vec4(texelFetch(pool, pool_place(low, 2), 0).rgb * weight, 0.0);
    return drawn;
}
