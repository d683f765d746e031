// The window of n x n pixels around a pixel, n = INTERLEAVE: wherever it lies, it has every share once. Tap t of it is
// the pixel (t mod n, t / n) from its corner.
uniform ivec2 side;  // 0 or 1: an even window has a pixel more before its centre or behind it

const int N = INTERLEAVE, TAPS = N * N;
const int GROUP = min(TAPS, 16), GROUPS = TAPS / GROUP;  // taps in a layer of the texture `window`, and its layers

// At the image's border the window moves inwards.
ivec2 window_corner(ivec2 pixel, ivec2 size) {
    return clamp(pixel - N / 2 + side, ivec2(0), max(size - N, 0));
}

ivec2 tap_pixel(ivec2 corner, int tap) {
    uint number = uint(tap);  // unsigned: dividing by a power of two is a shift
    return corner + ivec2(number % uint(N), number / uint(N));
}

// The steps in x and in y to the pixels of the same share on the other side of `pixel`.
ivec2 other_side(ivec2 tap_pixel, ivec2 pixel) {
    return N - 2 * N * ivec2(greaterThanEqual(tap_pixel, pixel));
}

// A texel of `window` for the taps of one group, a bit for each: `counts`, the tap lies on the pixel's own surface;
// otherwise, the pixel of its share that does lies on the other side in `x`, in `y`, or in both; without either bit there
// is none. `lonely`: too few taps count.
struct WindowGroup {
    uint counts, x, y;
    bool lonely;
};

uvec4 pack_group(WindowGroup g) {
    return uvec4(g.counts | g.x << 16, g.y | uint(g.lonely) << 16, 0u, 0u);
}

WindowGroup unpack_group(uvec2 texel) {
    return WindowGroup(texel.x & 0xffffu, texel.x >> 16, texel.y & 0xffffu, texel.y >> 16 != 0u);
}
