"""The port that says which VPLs may light which tiles of the screen, a bit for each pair in a texture. No OpenGL.

For each group of GROUP VPLs the texture has TILES x TILES texels, ACROSS groups side by side and further ones above.
shaders/lib/lights/tiles.glsl finds the same places.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.graph.ports import Output, Texture

TILES = 32
"""Tiles along an edge of the screen, whatever its size: what a tile can skip depends on how much of the scene it shows.
On 512x512 pixels they are of 16x16, four to an edge of llvmpipe's own tiles."""
GROUP = 64
"""VPLs of a texel."""
PER_BLOCK = VPLS_PER_BLOCK // GROUP
ACROSS = 5 * PER_BLOCK


def describe_output(records: int) -> Output:
    """Return the port of the bits of up to `records` VPLs."""
    groups = max(-(-records // GROUP), 1)
    size = TILES * min(groups, ACROSS), TILES * -(-groups // ACROSS)
    defines = {"LIGHT_TILES": TILES, "LIGHT_GROUPS_ACROSS": ACROSS}
    return Output(f"bits of the VPLs that may light each tile, {GROUP} a texel", Texture("rg32ui", size), defines)


def find_block(block: int) -> tuple[int, int, int, int]:
    """Return the rectangle (x, y, width, height) of the texels of a block of VPLs."""
    row, column = divmod(block * PER_BLOCK, ACROSS)
    return column * TILES, row * TILES, PER_BLOCK * TILES, TILES


def count_pairs(texels: np.ndarray) -> int:
    """Return how many pairs of a tile and a VPL the texels list."""
    return int.from_bytes(texels.tobytes(), "little").bit_count()
