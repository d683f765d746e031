// Where the pixels of a frame stand in the sub-buffers of interleaved sampling (deferred_ir/vpls/interleaving.py). INTERLEAVE
// is the edge of a block, a power of two.

// Where the part begins that holds the pixels with x mod INTERLEAVE = `share`.
ivec2 part_start(ivec2 share, ivec2 size) {
    return share * (size / INTERLEAVE) + min(share, size % INTERLEAVE);
}

ivec2 split_place(ivec2 pixel, ivec2 size) {
    uvec2 place = uvec2(pixel);  // unsigned: dividing by a power of two is a shift
    return part_start(ivec2(place % uint(INTERLEAVE)), size) + ivec2(place / uint(INTERLEAVE));
}

ivec2 whole_place(ivec2 place, ivec2 share, ivec2 size) {
    return (place - part_start(share, size)) * INTERLEAVE + share;
}
