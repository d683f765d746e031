// The list of pixels that need all VPLs: packed into rows as wide as the frame.
layout(binding = 1, r32ui) uniform uimage2D thin;
layout(binding = 2, r32ui) uniform uimage2D count;

ivec2 thin_place(uint number, int width) {
    return ivec2(number % uint(width), number / uint(width));
}
