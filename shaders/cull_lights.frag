// Bits of the VPLs of one block that may light a tile: a texel for each tile and LIGHT_GROUP VPLs.
#include "lib/camera/frame.glsl"
#include "lib/lights/vpl.glsl"
#include "lib/lights/tiles.glsl"

layout(binding = UNIT_DEPTH) uniform sampler2D depth;
uniform int count;     // VPLs of the block
uniform float margin;  // by which roundings may move what the test compares, as a fraction of the largest coordinates
uniform float reach;   // largest coordinate of the camera

layout(location = 0) out uvec2 tiles;

// A tile's frustum: NDC of its sides, and the distances of the nearest and of the farthest surface along the view axis.
struct Frustum {
    vec2 low, high, distances;
};

// Whether the tile shows a surface.
bool find_frustum(ivec2 tile, out Frustum frustum) {
    ivec2 size = textureSize(depth, 0), low = tile_begin(tile, size), high = tile_begin(tile + 1, size);
    float nearest = 0.0, farthest = 2.0;  // reversed depths, 1 at most
    for (int y = low.y; y < high.y; ++y) {
        for (int x = low.x; x < high.x; ++x) {
            float d = texelFetch(depth, ivec2(x, y), 0).r;
            nearest = max(nearest, d);
            if (d > 0.0) farthest = min(farthest, d);
        }
    }
    frustum = Frustum(vec2(low) / vec2(size) * 2.0 - 1.0, vec2(high) / vec2(size) * 2.0 - 1.0,
                      frame.near / vec2(nearest, farthest));
    return nearest > 0.0;
}

// Largest dot product of a point of the frustum, relative to the camera, with a vector; along: of frame.ray with it.
float support(Frustum f, vec3 along) {
    vec2 side = max(f.low * along.xy, f.high * along.xy);
    vec2 ends = (side.x + side.y + along.z) * f.distances;
    return max(ends.x, ends.y);
}

vec3 along_rays(vec3 axis) {
    return vec3(dot(frame.ray[0].xyz, axis), dot(frame.ray[1].xyz, axis), dot(frame.ray[2].xyz, axis));
}

float largest(vec3 v) {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int first = texel.x / LIGHT_TILES % (VPLS_PER_BLOCK / LIGHT_GROUP) * LIGHT_GROUP;
    tiles = uvec2(0u);
    Frustum f;
    if (first >= count || !find_frustum(texel % LIGHT_TILES, f)) return;
    vec2 side = max(abs(f.low), abs(f.high));
    vec3 corner = (abs(frame.ray[0].xyz) * side.x + abs(frame.ray[1].xyz) * side.y + abs(frame.ray[2].xyz)) * f.distances.y;
    float far = reach + largest(corner);
    for (int i = first; i < min(first + LIGHT_GROUP, count); ++i) {
        if (vpls[i].emission == vec3(0.0)) continue;
        if (vpls[i].tan_half == 0.0) {  // at infinity
            tiles[(i - first) / 32] |= 1u << (i & 31);
            continue;
        }
        vec3 x = vpls[i].x_axis, y = vpls[i].y_axis, z = vpls[i].z_axis, from = frame.camera - vpls[i].position;
        vec3 ax = along_rays(x), ay = along_rays(y), az = along_rays(z);
        float slack = margin * (far + largest(vpls[i].position));
        // The VPL's plane, and the four sides of the pyramid.
        bool lit = support(f, az) + dot(z, from) > -slack * length(z)
                && support(f, az + ax) + dot(z + x, from) > -slack * length(z + x)
                && support(f, az - ax) + dot(z - x, from) > -slack * length(z - x)
                && support(f, az + ay) + dot(z + y, from) > -slack * length(z + y)
                && support(f, az - ay) + dot(z - y, from) > -slack * length(z - y);
        if (lit) tiles[(i - first) / 32] |= 1u << (i & 31);
    }
}
