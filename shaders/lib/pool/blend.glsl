// The four samples of the grid around a pixel (deferred_ir/pool/layout.py). SCALE: pixels from sample to sample.

const uint LONELY = 0x80000000u;  // flag of a pixel that is a sample of its own; the other bits are its texel

struct Corner {
    ivec2 place;     // of the lower left sample in the grid
    ivec2 last;      // of the grid
    vec2 fraction;   // of the way to the next sample
};

ivec2 grid_pixel(ivec2 place, ivec2 offset, ivec2 size) {
    return min(place * SCALE + offset, size - 1);
}

Corner find_corner(ivec2 pixel, ivec2 offset, ivec2 size) {
    ivec2 from = pixel - offset + SCALE;  // not negative
    return Corner(from / SCALE - 1, (size + SCALE - 1) / SCALE - 1, vec2(from % SCALE) / float(SCALE));
}

ivec2 corner_place(Corner corner, int i) {
    return clamp(corner.place + ivec2(i & 1, i >> 1), ivec2(0), corner.last);
}

float corner_weight(Corner corner, int i) {
    vec2 share = mix(1.0 - corner.fraction, corner.fraction, vec2(i & 1, i >> 1));
    return share.x * share.y;
}
