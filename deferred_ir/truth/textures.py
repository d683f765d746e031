"""Values of textures for the path tracer, by code of its own: level 0, filtered and wrapped as the sampler says."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import linear_from_srgb, srgb_table
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Texture, TextureRef, Wrap


def look_up(scene: Scene, image: TextureRef, faces: Ints, weights: Array) -> Array | None:
    """Return linear RGBA, (n, 4), at places of faces by barycentric weights (n, 3); None without coordinates for it."""
    geometry = scene.geometry
    stored = geometry.second_uvs if image.uv_set else geometry.uvs
    if stored is None:
        return None
    u, v = np.einsum("ni,nij->jn", weights, stored[geometry.faces[faces]].astype(float))
    a, b, c, d, e, f = image.transform
    texture, sampler = scene.textures[image.number], image.sampler
    height, width = texture.pixels.shape[:2]
    x, y = (a * u + b * v + c) * width - 0.5, (1 - (d * u + e * v + f)) * height - 0.5
    if sampler.magnify == "nearest":
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    found = np.zeros((len(u), 4))
    for i, across in ((0, 1 - (x - left)), (1, x - left)):
        for j, down in ((0, 1 - (y - top)), (1, y - top)):
            column, row = _wrap(left + i, width, sampler.wrap[0]), _wrap(top + j, height, sampler.wrap[1])
            found += _decode(texture, row, column) * (across * down)[:, None]
    return found


def _wrap(texel: Ints, size: int, mode: Wrap) -> Ints:
    """Return the texels that stand at places (n,) of a line of texels without end."""
    if mode == "clamp":
        return np.minimum(np.maximum(texel, 0), size - 1)
    if mode == "mirror":
        # A sawtooth of two lengths, folded about the end of the first.
        return np.minimum(texel % (2 * size), (-1 - texel) % (2 * size))
    return texel % size


def _decode(texture: Texture, row: Ints, column: Ints) -> Array:
    """Return texels as linear RGBA, (n, 4)."""
    values = texture.pixels[row, column]
    decoded = np.ones((len(values), 4))
    if values.dtype == np.uint8:
        decoded[:, :3] = srgb_table()[values[:, :3]]
    else:
        decoded[:, :3] = linear_from_srgb(values[:, :3] / 65535)
    if values.shape[1] > 3:
        decoded[:, 3] = values[:, 3] / np.iinfo(values.dtype).max
    return decoded
