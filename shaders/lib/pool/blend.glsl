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

// The light of a pixel that takes `shares` (passes/sample_pixels.py) of the samples around it: of those of the grid that lie
// on its surface, or of its own sample.
vec3 blended(sampler2D light, uint shares, ivec2 pixel, ivec2 offset) {
    ivec2 size = textureSize(light, 0);
    bool lonely = (shares & LONELY) != 0u;
    if (lonely) {
        int place = int(shares & ~LONELY);
        return texelFetch(light, ivec2(place % size.x, place / size.x), 0).rgb;
    }
    Corner corner = find_corner(pixel, offset, size);
    vec3 sum = vec3(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; ++i) {
        float share = float(shares >> (7 * i) & 127u);
        sum += share * texelFetch(light, corner_place(corner, i), 0).rgb;
        total += share;
    }
    return sum / max(total, 1.0);
}
