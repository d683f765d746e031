// The list of lonely pixels, beside which shares are missing: entry i is a texel of `lonely_pixels` and of `missing`,
// whose rows are as wide as the frame.

ivec2 list_place(uint entry, int width) {
    return ivec2(entry % uint(width), entry / uint(width));
}

ivec2 pixel_of(uint number, int width) {
    return ivec2(number % uint(width), number / uint(width));
}
