"""Indirect light by VPLs with ray-cast visibility: what a render of the same VPLs would be with perfect shadow maps.

The sum is that of shaders/lib/lights/light.glsl, term by term: round cone, clamp, and no light through the back of a
face.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.parallel import in_order
from deferred_ir.base.progress import Progress
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.lights.spot import one_minus_cos
from deferred_ir.vpls.cast import Vpls

PIXELS = 1 << 14
"""Pixels of a task: few enough for their arrays to stay in a core's cache."""

VPLS = 64
"""VPLs of a task."""

TINY = np.float32(1e-37)


@dataclass(frozen=True, eq=False)
class Lights:
    """VPLs as the inner loop wants them: float32 (n, 3) each, `position` as in `Patch`."""

    position: Array
    normal: Array
    lifted: Array  # off their surface, where they are
    emission: Array  # float64
    edge: np.float32  # squared cosine of the half cone angle
    clamp: np.float32  # c^2, in diagonals

    @classmethod
    def of(cls, tracer: Tracer, vpls: Vpls, *, fov: float, clamp: float) -> Lights:
        """From VPLs; fov and clamp as in `indirect`."""
        return cls(
            _centred(tracer, vpls.position).astype(np.float32),
            vpls.normal.astype(np.float32),
            tracer.lift(vpls.position, vpls.normal).astype(np.float32),
            vpls.emission,
            np.float32((1 - one_minus_cos(fov)) ** 2) if fov < 180 else np.float32(0),
            np.float32((clamp * tracer.scene.geometry.diagonal / tracer.scene.geometry.scale) ** 2),
        )


class Patch:
    """Some pixels' surfaces, coordinate by coordinate. Positions are about the scene's middle, in its scale.

    There single precision is finest, and fourth powers of distances fit in it, whatever the scene's unit.
    """

    def __init__(self, tracer: Tracer, seen: Hits) -> None:
        self.tracer = tracer
        self.position = np.ascontiguousarray(_centred(tracer, seen.position).T, np.float32)
        self.normal = np.ascontiguousarray(seen.normal.T, np.float32)
        self.shading_normal = np.ascontiguousarray(seen.shading_normal.T, np.float32)
        self.lifted = tracer.lift(seen.position, seen.normal).astype(np.float32)

    def kernels(self, lights: Lights) -> Array:
        """cos cos V / max(d^2, c^2) for all n pixels and all m VPLs, times the squared scale, float32 (n, m)."""
        position, normal = (np.ascontiguousarray(part.T)[:, None] for part in (lights.position, lights.normal))
        way = self.position[..., None] - position
        normals = self.normal[..., None], self.shading_normal[..., None]
        result = _kernel(way, normal, *normals, edge=lights.edge, clamp=lights.clamp)
        pixel, vpl = np.nonzero(result)
        hidden = self.tracer.occluded(self.lifted[pixel], lights.lifted[vpl], lifted=True)
        result[pixel[hidden], vpl[hidden]] = 0
        return result

    def irradiance(self, lights: Lights, chosen: slice) -> Array:
        """Irradiance by the VPLs `chosen`, times the squared scale, float64 (3, n)."""
        total = np.zeros(self.position.shape)
        for i in range(chosen.start, chosen.stop):
            if not lights.emission[i].any():
                continue
            way = self.position - lights.position[i][:, None]
            kernel = _kernel(
                way, lights.normal[i], self.normal, self.shading_normal, edge=lights.edge, clamp=lights.clamp
            )
            lit = np.flatnonzero(kernel)
            if len(lit) == 0:
                continue
            targets = np.broadcast_to(lights.lifted[i], (len(lit), 3))
            kernel[lit[self.tracer.occluded(self.lifted[lit], targets, lifted=True)]] = 0
            for channel in range(3):
                total[channel] += kernel * lights.emission[i, channel]
        return total


def _kernel(
    way: Array, vpl_normal: Array, normal: Array, shading_normal: Array, *, edge: np.float32, clamp: np.float32
) -> Array:
    """cos cos / max(d^2, c^2) without visibility, float32 (...), as in shaders/lib/lights/light.glsl.

    way: from VPLs to surfaces, in scales of the scene. Coordinates are the first axis of `way` and of the normals,
    the rest is broadcast. edge: squared cosine of the half cone angle. clamp: c^2.
    """
    square = _dot(way, way)
    leaving = np.maximum(_dot(vpl_normal, way), 0)
    arriving = np.maximum(-_dot(shading_normal, way), 0)
    result: Array = leaving * arriving / np.maximum(square * np.maximum(square, clamp), TINY)
    result[(leaving * leaving < edge * square) | (_dot(normal, way) >= 0)] = 0
    return result


def _centred(tracer: Tracer, positions: Array) -> Array:
    geometry = tracer.scene.geometry
    centred: Array = (positions - geometry.middle) / geometry.scale
    return centred


def _dot(a: Array, b: Array) -> Array:
    """Products of vectors whose coordinates are the first axis, added up."""
    total: Array = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def indirect(
    tracer: Tracer,
    seen: Hits,
    vpls: Vpls,
    *,
    fov: float,
    clamp: float,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Array:
    """Radiance that surfaces `seen` (n) reflect of all `vpls`, float64 (n, 3); 0 in rows that hit nothing.

    fov: full opening angle of the VPLs' cones, degrees, to 180. clamp: 1/d^2 is taken as 1/max(d^2, c^2), c in
    diagonals of the scene. The same for any number of threads.
    """
    pixels = np.flatnonzero(seen.hit)
    lights = Lights.of(tracer, vpls, fov=fov, clamp=clamp)
    patches = [pixels[start : start + PIXELS] for start in range(0, len(pixels), PIXELS)]
    blocks = [slice(start, min(start + VPLS, len(vpls))) for start in range(0, len(vpls), VPLS)]
    made = [Patch(tracer, seen.rows(rows)) for rows in patches]
    tasks = [(patch, block) for patch in range(len(patches)) for block in blocks]
    total = np.zeros((len(seen.face), 3))
    with closing(in_order(lambda task: made[task[0]].irradiance(lights, task[1]), tasks, threads)) as results:
        for done, ((patch, _), part) in enumerate(zip(tasks, results, strict=True), start=1):
            total[patches[patch]] += part.T
            if progress:
                progress(done, len(tasks))
    radiance: Array = total * seen.albedo / (np.pi * tracer.scene.geometry.scale**2)
    return radiance
