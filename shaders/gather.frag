// The mean irradiance of a window of INTERLEAVE^2 pixels, of those on the pixel's own surface.
#include "lib/frame.glsl"
#include "lib/gbuffer.glsl"
#include "lib/interleave.glsl"
#include "lib/thin.glsl"

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

void main() {
    Centre c;
    c.pixel = ivec2(gl_FragCoord.xy);
    c.size = textureSize(depth, 0);
    c.depth = texelFetch(depth, c.pixel, 0).r;
    irradiance = vec4(0.0, 0.0, 0.0, 1.0);
    if (c.depth <= 0.0) return;  // background
    vec4 code = texelFetch(normals, c.pixel, 0);
    c.shading_normal = from_octahedral(code.xy);
    c.normal = from_octahedral(code.zw);
    c.across = frame.ray[0].xyz * (2.0 / float(c.size.x));
    c.up = frame.ray[1].xyz * (2.0 / float(c.size.y));
    c.ray = frame.ray[0].xyz * ndc.x + frame.ray[1].xyz * ndc.y + frame.ray[2].xyz;
    // At the image's border the window moves inwards, so that it has every share.
    ivec2 corner = clamp(c.pixel - N / 2 + side, ivec2(0), max(c.size - N, 0));
    vec4 sum = vec4(0.0);
    uvec2 found = uvec2(0u);  // a bit for each share
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x) {
            ivec2 other = corner + ivec2(x, y);
            vec4 one = neighbour(c, other);
            int share = share_of(other);
            sum += one;
            found[share >> 5] |= uint(one.a) << (share & 31);
        }
    bool lonely = sum.a <= fewest && sum.a < float(SHARES);
#if HAS_NEAR_FIELD
    // It is no share's: neighbours have parts of it whichever they are.
    vec4 given = vec4(0.0);
    int alone = lonely ? N : 0;
    for (int y = 0; y < alone; ++y)
        for (int x = 0; x < N; ++x) {
            ivec2 other = corner + ivec2(x, y);
            given += texelFetch(near_field, other, 0) * neighbour(c, other).a;
        }
    vec3 near = given.rgb / max(given.a, 1e-3);
#else
    const vec4 given = vec4(0.0);
    const vec3 near = vec3(0.0);
#endif
    if (lonely) {
        irradiance.rgb = (sum.rgb - given.rgb) / float(SHARES) + near;
        ivec2 place = thin_place(imageAtomicAdd(count, ivec2(0), 1u), c.size.x);
        imageStore(thin, place, uvec4(c.pixel.y * c.size.x + c.pixel.x));
        imageStore(missing, place, uvec4(~found, 0u, 0u));
        return;
    }
    // A share that is missing on one side of the pixel may be there on the other. (Where a loop has nothing to do for a
    // group of pixels it is skipped; a branch may not be.)
    int taps = sum.a < float(SHARES) ? SHARES : 0;
    for (int tap = 0; tap < taps; ++tap) {
        ivec2 other = corner + ivec2(tap % N, tap / N), turn = N - 2 * N * ivec2(greaterThanEqual(other, c.pixel));
        int share = share_of(other), tries = (found[share >> 5] >> (share & 31) & 1u) == 1u ? 0 : 3;
        vec4 one = vec4(0.0);
        for (int i = 0; i < tries && one.a == 0.0; ++i)  // to the other side in x, in y, in both
            one = neighbour(c, other + turn * ivec2(i != 1, i != 0));
        sum += one;
    }
    irradiance.rgb = sum.rgb / sum.a;
}
