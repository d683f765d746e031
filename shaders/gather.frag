// The mean irradiance of a window of INTERLEAVE^2 pixels, of those on the pixel's own surface. Which those are is found,
// with KEEP noted in `missing` for frames that follow, or with KNOWN read from there.
#include "lib/camera/frame.glsl"
#include "lib/surface/gbuffer.glsl"
#include "lib/shares/places.glsl"
#include "lib/shares/lonely.glsl"

layout(binding = UNIT_SHARES) uniform sampler2D shares;
layout(binding = UNIT_DEPTH) uniform sampler2D depth;
layout(binding = UNIT_NORMALS) uniform sampler2D normals;
#if HAS_NEAR_FIELD
layout(binding = UNIT_NEAR_FIELD) uniform sampler2D near_field;
#endif
uniform float cosine_squared;  // of the largest angle between normals, at most 90 degrees
uniform float sine_squared;    // of the largest angle off the pixel's plane
uniform float fewest;          // neighbours
uniform ivec2 side;            // 0 or 1: where the window has a pixel more, before the centre or behind it

in vec2 ndc;
layout(location = 0) out vec4 irradiance;

const int N = INTERLEAVE, SHARES = N * N;

struct Centre {
    ivec2 pixel, size;
    float depth;
    vec3 ray, across, up;  // the pixel's ray, and how rays change from pixel to pixel
    vec3 normal, shading_normal;
};

// What the pixel `other` adds: its irradiance and 1 if there is one and it lies on the same surface, else 0.
vec4 neighbour(Centre c, ivec2 other) {
    float d = texelFetch(depth, other, 0).r;
    vec4 found = texelFetch(shares, split_place(other, c.size), 0);
    vec2 away = vec2(other - c.pixel);
    // From the centre's point to the other's, times both depths / near: no division, and 0 for the centre itself.
    vec3 off = (c.ray + c.across * away.x + c.up * away.y) * c.depth - c.ray * d;
    float height = dot(c.normal, off);
    vec3 n = octahedron(unpack_normal(found.a));
    float likeness = dot(c.shading_normal, n);
    bool inside = all(lessThan(uvec2(other), uvec2(c.size)));
    bool same = inside && d > 0.0 && likeness >= 0.0 && likeness * likeness >= cosine_squared * dot(n, n)
             && height * height <= sine_squared * dot(off, off);
    return same ? vec4(found.rgb, 1.0) : vec4(0.0);
}

int share_of(ivec2 pixel) {
    ivec2 place = pixel % N;
    return place.y * N + place.x;
}

bool has(uvec2 found, int share) {
    return ((SHARES > 32 ? found[share >> 5] : found.x) >> (share & 31) & 1u) == 1u;
}

// What `missing` holds: bits of the shares that are; and where 16 are enough, then of those that are there on the other
// side in x, in y, in both.
uvec4 noted(uvec2 found, uvec3 beyond) {
    if (SHARES > 16) return uvec4(~found, 0u, 0u);
    return uvec4(~found.x & 0xffffu | beyond.x << 16, beyond.y | beyond.z << 16, 0u, 0u);
}

Centre centre(ivec2 pixel, ivec2 size) {
    Centre c;
    c.pixel = pixel;
    c.size = size;
    c.depth = texelFetch(depth, pixel, 0).r;
    vec4 code = texelFetch(normals, pixel, 0);
    decode_normals(code, c.shading_normal, c.normal);
    c.across = frame.ray[0].xyz * (2.0 / float(size.x));
    c.up = frame.ray[1].xyz * (2.0 / float(size.y));
    c.ray = frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz;
    return c;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy), size = textureSize(depth, 0);
    irradiance = vec4(0.0, 0.0, 0.0, 1.0);
    // At the image's border the window moves inwards, so that it has every share.
    ivec2 corner = clamp(pixel - N / 2 + side, ivec2(0), max(size - N, 0));
    vec4 sum = vec4(0.0);
    uvec2 found = uvec2(0u);  // a bit for each share
#if KNOWN
    uvec2 note = imageLoad(missing, pixel).rg;
    found = SHARES > 16 ? ~note : uvec2(~note.x & 0xffffu, 0u);
    if (found == uvec2(0u)) return;  // background; on a surface the pixel finds its own share
#else
    Centre c = centre(pixel, size);
    if (c.depth <= 0.0) {  // background
#if KEEP
        imageStore(missing, pixel, noted(uvec2(0u), uvec3(0u)));
#endif
        return;
    }
#endif
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x) {
            ivec2 other = corner + ivec2(x, y);
            int share = share_of(other);
#if KNOWN
            vec3 color = texelFetch(shares, split_place(other, size), 0).rgb;
            sum += has(found, share) ? vec4(color, 1.0) : vec4(0.0);
#else
            vec4 one = neighbour(c, other);
            sum += one;
            found[share >> 5] |= uint(one.a) << (share & 31);
#endif
        }
    bool lonely = sum.a <= fewest && sum.a < float(SHARES);
#if HAS_NEAR_FIELD
    // It is no share's: neighbours have parts of it whichever they are.
    vec4 given = vec4(0.0);
    int alone = lonely ? N : 0;
    for (int y = 0; y < alone; ++y)
        for (int x = 0; x < N; ++x) {
            ivec2 other = corner + ivec2(x, y);
            if (has(found, share_of(other))) given += texelFetch(near_field, other, 0);
        }
    vec3 near = given.rgb / max(given.a, 1e-3);
#else
    const vec4 given = vec4(0.0);
    const vec3 near = vec3(0.0);
#endif
    if (lonely) {
#if !KNOWN
        imageStore(missing, pixel, noted(found, uvec3(0u)));
#endif
        irradiance.rgb = (sum.rgb - given.rgb) / float(SHARES) + near;
        imageStore(thin, thin_place(imageAtomicAdd(count, ivec2(0), 1u), size.x), uvec4(pixel.y * size.x + pixel.x));
        return;
    }
    // A share that is missing on one side of the pixel may be there on the other. (Where a loop has nothing to do for a
    // group of pixels it is skipped; a branch may not be.)
    int taps = sum.a < float(SHARES) ? SHARES : 0;
#if KNOWN && INTERLEAVE > 4
    Centre c;
    for (int once = 0; once < min(taps, 1); ++once) c = centre(pixel, size);
#endif
    uvec3 beyond = uvec3(0u);
    for (int tap = 0; tap < taps; ++tap) {
        ivec2 other = corner + ivec2(tap % N, tap / N), turn = N - 2 * N * ivec2(greaterThanEqual(other, pixel));
        int share = share_of(other);
        vec4 one = vec4(0.0);
#if KNOWN && INTERLEAVE <= 4
        bvec3 there = notEqual(uvec3(note.x >> 16, note.y, note.y >> 16) & 1u << share, uvec3(0u));
        ivec2 by = turn * ivec2(there.x || there.z, there.y || there.z);
        int fetches = any(there) ? 1 : 0;
        for (int i = 0; i < fetches; ++i) one = vec4(texelFetch(shares, split_place(other + by, size), 0).rgb, 1.0);
#else
        int tries = has(found, share) ? 0 : 3;
        for (int i = 0; i < tries && one.a == 0.0; ++i) {  // to the other side in x, in y, in both
            one = neighbour(c, other + turn * ivec2(i != 1, i != 0));
            beyond[i] |= uint(one.a) << (share & 15);
        }
#endif
        sum += one;
    }
#if KEEP && !KNOWN
    imageStore(missing, pixel, noted(found, beyond));
#endif
    irradiance.rgb = sum.rgb / sum.a;  // at least the pixel itself lies on its surface
}
