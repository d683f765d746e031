// Where the bits of tiles and VPLs are (passes/cull_lights.py): LIGHT_TILES x LIGHT_TILES texels for each group of VPLs.

const int LIGHT_GROUP = 64;  // VPLs of a texel

ivec2 tile_of(ivec2 pixel, ivec2 size) {
    return pixel * LIGHT_TILES / size;
}

// First pixel of the tiles in column and row `tile`; the last one lies before that of the next.
ivec2 tile_begin(ivec2 tile, ivec2 size) {
    return (tile * size + LIGHT_TILES - 1) / LIGHT_TILES;
}

// The texel of a tile for the group that begins with VPL `first` of a block.
ivec2 tile_texel(ivec2 tile, int block, int first) {
    int group = (block * VPLS_PER_BLOCK + first) / LIGHT_GROUP;
    return ivec2(group % LIGHT_GROUPS_ACROSS, group / LIGHT_GROUPS_ACROSS) * LIGHT_TILES + tile;
}
