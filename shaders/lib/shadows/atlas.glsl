// The shadow atlas: layers of ATLAS_SIZE^2 texels; the spotlight owns layer 0, VPL tile t a square of VPL_SIZE^2 on the
// layers behind it, row by row.
#include "lib/shadows/projection.glsl"

const int TILES = ATLAS_SIZE / VPL_SIZE;  // in a row

// xy: lower left corner, z: edge, in [0, 1] of the layer; w: the layer.
vec4 atlas_tile(Light light) {
    if (light.tile < 0.0) return vec4(0.0, 0.0, float(SPOT_SIZE) / float(ATLAS_SIZE), 0.0);
    uint tile = uint(light.tile), on_layer = tile % uint(TILES * TILES);
    const float edge = float(VPL_SIZE) / float(ATLAS_SIZE);
    return vec4(vec2(on_layer % uint(TILES), on_layer / uint(TILES)) * edge, edge, 1u + tile / uint(TILES * TILES));
}

// Clip position in the atlas of what has the clip position `clip` in the map.
vec4 in_tile(vec4 clip, vec4 tile) {
    return vec4(clip.xy * tile.z + (tile.xy * 2.0 + tile.z - 1.0) * clip.w, clip.zw);
}

// For lib/shadows/filter.glsl: the sampler, a light's place in it, and a comparison of 2x2 texels of the map. For lib/shadows/soft.glsl:
// the atlas without comparison, and a texel of the spotlight's map.
#define MAP sampler2DArrayShadow
#define DEPTHS sampler2DArray
#define map_place atlas_tile

float compared(MAP atlas, vec4 tile, float size, vec3 at) {
    return texture(atlas, vec4(tile.xy + at.xy / size * tile.z, tile.w, at.z));
}

float spot_depth(DEPTHS atlas, ivec2 texel) {
    return texelFetch(atlas, ivec3(texel, 0), 0).r;
}
