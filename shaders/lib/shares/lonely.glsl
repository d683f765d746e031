// The list of pixels beside which shares are missing: the image `thin` has their numbers, packed into rows as wide as the
// frame. `missing` has bit s of 64 for share s, at the pixel itself; bits beyond the last share mean nothing here.
layout(binding = 1, r32ui) uniform uimage2D thin;
layout(binding = 2, r32ui) uniform uimage2D count;
layout(binding = 3, rg32ui) uniform uimage2D missing;

ivec2 thin_place(uint number, int width) {
    return ivec2(number % uint(width), number / uint(width));
}
