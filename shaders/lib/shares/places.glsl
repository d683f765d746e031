// Where the pixels of a frame stand in the sub-buffers of interleaved sampling (deferred_ir/vpls/interleaving.py). INTERLEAVE
// is the edge of a block, a power of two.

// Where the part begins that holds the pixels with x mod INTERLEAVE = `share`.
ivec2 part_start(ivec2 share, ivec2 size) {
    return share * (size / INTERLEAVE) + min(share, size % INTERLEAVE);
}

ivec2 split_place(ivec2 pixel, ivec2 size) {
    return part_start(pixel % INTERLEAVE, size) + pixel / INTERLEAVE;
}

ivec2 whole_place(ivec2 place, ivec2 share, ivec2 size) {
    return (place - part_start(share, size)) * INTERLEAVE + share;
}

// The code of a normal (lib/surface/gbuffer.glsl) as a whole number below 2^24, which a float holds exactly.
float pack_normal(vec2 code) {
    vec2 steps = floor(code * 4095.0 + 0.5);
    return steps.x * 4096.0 + steps.y;
}

vec2 unpack_normal(float number) {
    float x = floor(number * (1.0 / 4096.0));
    return vec2(x, number - x * 4096.0) * (1.0 / 4095.0);
}
