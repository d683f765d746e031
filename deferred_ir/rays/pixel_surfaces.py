"""The surfaces that pixels show, decoded on the CPU from a G-buffer that was read back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The surfaces that n pixels show, without the background.

    pixel: int (n,), row * width + column, bottom row first, ascending.
    position, normal (geometric), shading_normal: float32 (n, 3), world space, both normals towards the viewer.
    """

    pixel: Ints
    position: Array
    normal: Array
    shading_normal: Array

    def rows(self, chosen: Ints | slice) -> Surfaces:
        """Return the surfaces `chosen`, indices (m,) or a slice."""
        normal = self.normal[chosen]
        smooth = normal if self.shading_normal is self.normal else self.shading_normal[chosen]
        return Surfaces(self.pixel[chosen], self.position[chosen], normal, smooth)


@dataclass(frozen=True, eq=False)
class PixelJob:
    """Work for rays from the surfaces behind an image's pixels, whose result is an image that is made to be filtered.

    size: (width, height) of the image. block: pixels along the edge of a block, 1, 2, 4 or 8; samples are spread over
    each window of block x block pixels together. Results depend on the seed, not on the number of threads; None is as
    many as the machine has.
    """

    tracer: Tracer
    seen: Surfaces
    size: tuple[int, int]
    block: int = 1
    seed: int = 0
    threads: int | None = None


def decode_gbuffer(camera: Camera, near: float, depth: Array, normals: Array, *, smooth: bool = True) -> Surfaces:
    """Decode reversed `depth` (H, W) and octahedral `normals` (H, W, 4), float32, bottom row first.

    near: the camera's near plane, in world units. smooth: the scene has shading normals; else both normals are one
    array. The same as `unproject` and `from_octahedral` in shaders/lib.
    """
    height, width = depth.shape
    pixel = np.flatnonzero(depth > 0)
    y, x = np.divmod(pixel.astype(np.int32), np.int32(width))
    a, b, c = camera.ray_axes((width, height))
    across = np.multiply.outer((np.arange(width) + 0.5) / width * 2 - 1, a).astype(np.float32)
    up = (np.multiply.outer((np.arange(height) + 0.5) / height * 2 - 1, b) + c).astype(np.float32)
    position = across[x] + up[y]
    position *= (np.float32(near) / depth.reshape(-1)[pixel])[:, None]
    position += np.asarray(camera.position, np.float32)
    code = normals.reshape(-1, 4)[pixel]
    normal = _from_octahedral(code[:, 2:])
    return Surfaces(pixel, position, normal, _from_octahedral(code[:, :2]) if smooth else normal)


def decode_samples(positions: Array, normals: Array, *, smooth: bool = True) -> Surfaces:
    """Decode surfaces that are stored with their position and depth of view (H, W, 4), float32, 0 where there is none.

    normals: octahedral, (H, W, 4). smooth: as for `decode_gbuffer`.
    """
    at = positions.reshape(-1, 4)
    pixel = np.flatnonzero(at[:, 3] > 0)
    code = normals.reshape(-1, 4).take(pixel, axis=0)
    normal = _from_octahedral(code[:, 2:])
    position = at.take(pixel, axis=0)[:, :3]
    return Surfaces(pixel, position, normal, _from_octahedral(code[:, :2]) if smooth else normal)


def _from_octahedral(code: Array) -> Array:
    """Decode unit vectors (n, 3) from codes (n, 2) in [0, 1] (Cigolle et al. 2014), as gbuffer.glsl does."""
    # By columns: along rows of two and three, NumPy is seven times slower.
    x, y = (code[:, i] * np.float32(2) - np.float32(1) for i in range(2))
    z = np.float32(1) - (np.abs(x) + np.abs(y))
    fold = np.maximum(-z, 0)
    x -= np.copysign(fold, x)
    y -= np.copysign(fold, y)
    length = np.sqrt(x * x + y * y + z * z)
    vectors = np.empty((len(code), 3), np.float32)
    for i, column in enumerate((x, y, z)):
        np.divide(column, length, out=vectors[:, i])
    return vectors
