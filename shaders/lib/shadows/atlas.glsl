// The shadow atlas: layers of ATLAS_SIZE^2 texels. Views of direct lights own a layer each, the first ones; tile t of
// the VPLs is a square of VPL_SIZE^2 on the layers behind them, row by row.

const int TILES = ATLAS_SIZE / VPL_SIZE;  // in a row

// Where tile `number` lies, as View.rectangle.
vec4 tile_rectangle(float number) {
    uint tile = uint(number), on_layer = tile % uint(TILES * TILES);
    const float edge = float(VPL_SIZE) / float(ATLAS_SIZE);
    return vec4(vec2(on_layer % uint(TILES), on_layer / uint(TILES)) * edge, edge,
                uint(FIRST_TILE_LAYER) + tile / uint(TILES * TILES));
}

// Clip position in the atlas of what has the clip position `clip` in the map.
vec4 in_rectangle(vec4 clip, vec4 rectangle) {
    return vec4(clip.xy * rectangle.z + (rectangle.xy * 2.0 + rectangle.z - 1.0) * clip.w, clip.zw);
}

// For lib/shadows/filter.glsl and lib/shadows/soft.glsl: the sampler, a comparison of 2x2 texels of the map, and its
// depths.
#define MAP sampler2DArrayShadow
#define DEPTHS sampler2DArray

float compared(MAP atlas, vec4 rectangle, float size, vec3 at) {
    return texture(atlas, vec4(rectangle.xy + at.xy / size * rectangle.z, rectangle.w, at.z));
}

float depth_at(DEPTHS atlas, vec4 rectangle, ivec2 texel) {
    return texelFetch(atlas, ivec3(ivec2(rectangle.xy * float(ATLAS_SIZE)) + texel, int(rectangle.w)), 0).r;
}
