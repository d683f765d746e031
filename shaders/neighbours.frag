// Which pixels of the window of INTERLEAVE^2 pixels, or on the other side of the pixel, lie on the pixel's own surface;
// and the list of lonely pixels, for which too few do. Where samples ask, a pixel is a sample here, and its place a texel.
#include "lib/shares/askers.glsl"
#include "lib/shares/places.glsl"
#include "lib/shares/window.glsl"
#include "lib/shares/lonely.glsl"

layout(location = TARGET_WINDOW) out uvec4 window[GROUPS];
layout(binding = 0, r32ui) uniform writeonly uimage2D lonely_pixels;
layout(binding = 1, rg32ui) uniform writeonly uimage2D missing;
layout(binding = 2, r32ui) uniform uimage2D lonely_count;
uniform float cosine_squared;  // of the largest angle between normals, at most 90 degrees
uniform float sine_squared;    // of the largest angle off the pixel's plane
uniform float fewest;          // taps; with no more the pixel is lonely

in vec2 ndc;

struct Centre {
    ivec2 pixel, size;
    float depth;           // 0 for the background
    vec3 ray, across, up;  // the pixel's ray, and how rays change from pixel to pixel; for a sample its position, 0 and 0
    vec3 normal, shading_normal;
    vec2 code;  // of the shading normal
};

Centre read_centre(ivec2 pixel, ivec2 size) {
    Centre c;
    c.pixel = pixel;
    c.size = size;
    vec4 code = texelFetch(normals, pixel, 0);
    decode_normals(code, c.shading_normal, c.normal);
    c.code = code.xy;
#if HAS_POSITIONS
    vec4 at = texelFetch(positions, pixel, 0);
    c.depth = at.w;
    c.ray = at.xyz;
    c.across = c.up = vec3(0.0);
#else
    c.depth = texelFetch(depth, pixel, 0).r;
    c.across = frame.ray[0].xyz * (2.0 / float(size.x));
    c.up = frame.ray[1].xyz * (2.0 / float(size.y));
    c.ray = frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz;
#endif
    return c;
}

// Whether the surface at `other`, a pixel on the ray `ray`, lies in the plane of the centre's.
bool in_plane(Centre c, ivec2 other, vec3 ray) {
#if HAS_POSITIONS
    vec4 at = texelFetch(positions, other, 0);
    float d = at.w;
    vec3 off = at.xyz - c.ray;
#else
    // From the centre's point to the other's, times both depths / near: no division, and 0 for the centre itself.
    float d = texelFetch(depth, other, 0).r;
    vec3 off = ray * c.depth - c.ray * d;
#endif
    float height = dot(c.normal, off);
    return d > 0.0 && height * height <= sine_squared * dot(off, off);
}

vec2 read_code(ivec2 pixel) {
    return texelFetch(normals, pixel, 0).xy;
}

// Whether a shading normal with this code is like the centre's.
bool alike(Centre c, vec2 code) {
    vec3 n = octahedron(round_normal(code));
    float likeness = dot(c.shading_normal, n);
    return likeness >= 0.0 && likeness * likeness >= cosine_squared * dot(n, n);
}

// Whether the pixel `other`, anywhere, lies in the frame and on the centre's surface.
bool counts(Centre c, ivec2 other) {
    vec2 away = vec2(other - c.pixel);
    bool inside = all(lessThan(uvec2(other), uvec2(c.size)));
    return inside && in_plane(c, other, c.ray + c.across * away.x + c.up * away.y) && alike(c, read_code(other));
}

// Sets of up to 64 numbers, in words of 32 bits.
const int WORDS = (TAPS + 31) / 32;
const uint ALL = TAPS < 32 ? (1u << (TAPS & 31)) - 1u : ~0u;  // of a word

uvec2 only(int number) {
    uint one = 1u << (number & 31);
    return TAPS > 32 ? uvec2(number < 32 ? one : 0u, number < 32 ? 0u : one) : uvec2(one, 0u);
}

uvec4 group(int g, uvec2 found, uvec2 x, uvec2 y, bool lonely) {
    uvec3 bits = uvec3(found[g >> 1], x[g >> 1], y[g >> 1]) >> (16 * (g & 1)) & 0xffffu;
    return pack_group(WindowGroup(bits.x, bits.y, bits.z, lonely));
}

void write_window(uvec2 found, uvec2 x, uvec2 y, bool lonely) {
    uvec4 groups[GROUPS];
    for (int g = 0; g < GROUPS; ++g) groups[g] = group(g, found, x, y, lonely);
    window = groups;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = askers_size(), corner = window_corner(pixel, size);
    Centre c = read_centre(pixel, size);
    uvec2 found = uvec2(0u), x = uvec2(0u), y = uvec2(0u);  // taps
    if (c.depth <= 0.0) {  // background
        write_window(found, x, y, false);
        return;
    }
    uvec2 bent = uvec2(0u);  // taps in the plane with a normal of their own
    vec3 columns[N];
    for (int i = 0; i < N; ++i) columns[i] = c.ray + c.across * float(corner.x + i - pixel.x);
    uint inside = (1u << min(N, size.x)) - 1u;  // a frame may be smaller than the window
    for (int row = 0; row < min(N, size.y); ++row) {
        vec3 up = c.up * float(corner.y + row - pixel.y);
        uint same = 0u, other = 0u;
        for (int i = 0; i < N; ++i) {
            ivec2 tap = corner + ivec2(i, row);
            bool plane = in_plane(c, tap, columns[i] + up), equal = read_code(tap) == c.code;
            same |= uint(plane && equal) << i;
            other |= uint(plane && !equal) << i;
        }
        int word = WORDS > 1 ? row * N >> 5 : 0;
        found[word] |= (same & inside) << (row * N & 31);
        bent[word] |= (other & inside) << (row * N & 31);
    }
    bool listed = any(greaterThanEqual(pixel, size));  // a sample of the list
    if (listed) found = bent = uvec2(0u);
    if (!alike(c, c.code)) found = uvec2(0u);
    // Few normals are to be compared where surfaces are flat. The loop takes as many turns as the pixel with most has.
    for (int word = 0; word < WORDS; ++word)
        for (uint taps = bent[word]; taps != 0u; taps &= taps - 1u) {
            int tap = word * 32 + findLSB(taps);
            if (alike(c, read_code(tap_pixel(corner, tap)))) found |= only(tap);
        }
    int number = bitCount(found.x) + bitCount(found.y);
    bool lonely = float(number) <= fewest && number < TAPS;
    uvec2 absent = uvec2(0u);  // shares
    ivec2 texture_size = textureSize(normals, 0);
    int tries = lonely ? 0 : 3;
    for (int word = 0; word < WORDS; ++word)
        for (uint gaps = ~found[word] & ALL; gaps != 0u; gaps &= gaps - 1u) {  // as often as the pixel with most gaps has
            int tap = word * 32 + findLSB(gaps);
            ivec2 other = tap_pixel(corner, tap), away = other_side(other, pixel), place = other % N;
            absent |= only(place.y * N + place.x);
            bool there = false;
            for (int i = 0; i < tries && !there; ++i) {  // in x, in y, in both
                there = counts(c, other + away * ivec2(i != 1, i != 0));
                if (there && i != 1) x |= only(tap);
                if (there && i != 0) y |= only(tap);
            }
        }
    write_window(found, x, y, lonely);
    if (lonely) {
        ivec2 place = list_place(imageAtomicAdd(lonely_count, ivec2(0), 1u), texture_size);
        imageStore(lonely_pixels, place, uvec4(pixel.y * texture_size.x + pixel.x));
        imageStore(missing, place, uvec4(absent, 0u, 0u));
    }
}
