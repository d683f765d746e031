// The list of lonely pixels, beside which shares are missing: entry i is a texel of `lonely_pixels` and of `missing`, which
// are as large as the frame. It fills pairs of rows column by column: pixels that a processor takes together, of two rows,
// are then of one neighbourhood, and miss much the same shares.

ivec2 list_place(uint entry, ivec2 size) {
    uint width = uint(size.x), paired = 2u * width * uint(size.y / 2), within = entry % (2u * width);
    if (entry >= paired) return ivec2(entry - paired, size.y - 1);  // an odd row is left
    return ivec2(within / 2u, entry / (2u * width) * 2u + within % 2u);
}

uint list_entry(ivec2 place, ivec2 size) {
    uint x = uint(place.x), y = uint(place.y), width = uint(size.x);
    return place.y >= size.y / 2 * 2 ? y * width + x : y / 2u * 2u * width + 2u * x + y % 2u;
}

ivec2 pixel_of(uint number, int width) {
    return ivec2(number % uint(width), number / uint(width));
}
