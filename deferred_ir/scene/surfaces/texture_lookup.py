"""Values of textures at texture coordinates, level 0 alone: what shaders read where nothing is made smaller."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import linear_from_srgb, srgb_table
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.surfaces.materials import IDENTITY, Sampler, Texture, TextureRef, Wrap


def sample_texture(
    texture: Texture, uvs: Array, sampler: Sampler | None = None, *, channels: int = 3, color: bool = True
) -> Array:
    """Return the first `channels` of a texture at `uvs` (n, 2), float64 (n, channels): decoded, then filtered.

    color: red, green and blue are sRGB. Texel centres lie at (i + 0.5) / width, v = 1 is the top edge.
    """
    sampler = sampler or Sampler()
    height, width = texture.pixels.shape[:2]
    x, y = (
        _place(axis, size, wrap) for axis, size, wrap in zip(_flip(uvs), (width, height), sampler.wrap, strict=True)
    )
    if sampler.magnify == "nearest":
        rows, columns = (np.floor(place + 0.5).astype(np.int64) for place in (y, x))
        return _decode(
            texture.pixels[_wrap(rows, height, sampler.wrap[1]), _wrap(columns, width, sampler.wrap[0]), :channels],
            color=color,
        )
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, down = (x - left)[:, None], (y - top)[:, None]
    columns = [_wrap(left + i, width, sampler.wrap[0]) for i in (0, 1)]
    rows = [_wrap(top + i, height, sampler.wrap[1]) for i in (0, 1)]
    upper, lower = (
        _decode(texture.pixels[row, columns[0], :channels], color=color) * (1 - across)
        + _decode(texture.pixels[row, columns[1], :channels], color=color) * across
        for row in rows
    )
    result: Array = upper * (1 - down) + lower * down
    return result


def has_uvs(geometry: Geometry, texture: TextureRef) -> bool:
    """Return whether a texture's coordinates are there."""
    return (geometry.uvs, geometry.second_uvs)[texture.uv_set] is not None


def find_uvs(geometry: Geometry, texture: TextureRef, faces: Ints, weights: Array) -> Array:
    """Return where a texture is read, float64 (n, 2), at points of faces, which have such texture coordinates."""
    stored = (geometry.uvs, geometry.second_uvs)[texture.uv_set]
    assert stored is not None
    blend = np.asarray(weights, dtype=np.float64)[..., None]
    uvs: Array = (stored[geometry.faces[faces]] * blend).sum(axis=1)
    if texture.transform == IDENTITY:
        return uvs
    rows = np.reshape(texture.transform, (2, 3))
    moved: Array = uvs @ rows[:, :2].T + rows[:, 2]
    return moved


def _flip(uvs: Array) -> tuple[Array, Array]:
    """Return u, and v downwards from the top edge, where rows of pixels begin."""
    u, v = np.asarray(uvs, dtype=np.float64).T
    return u, 1 - v


def _place(axis: Array, size: int, wrap: Wrap) -> Array:
    """Return places in texels, counted from the centre of the first; `axis` may start at any whole number."""
    # Of what repeats the fraction alone: large coordinates would lose digits.
    base = axis - np.floor(axis) if wrap == "repeat" else axis
    return base * size - 0.5


def _wrap(index: Ints, size: int, wrap: Wrap) -> Ints:
    """Return the texels that stand at places `index`."""
    if wrap == "clamp":
        return np.clip(index, 0, size - 1)
    if wrap == "mirror":
        within = index % (2 * size)
        return np.where(within < size, within, 2 * size - 1 - within)
    return index % size


def _decode(values: Any, *, color: bool) -> Array:
    """Return texels (n, c) as linear numbers in 0 to 1; the fourth is linear as stored."""
    top = np.iinfo(values.dtype).max
    decoded: Array
    if not color:
        decoded = values / top
        return decoded
    if values.shape[1] > 3:
        return np.concatenate([_decode(values[:, :3], color=True), values[:, 3:] / top], axis=1)
    if top == 255:
        decoded = srgb_table().astype(np.float64)[values]
        return decoded
    return linear_from_srgb(values / top)
