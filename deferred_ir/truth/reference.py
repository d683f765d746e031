"""Trace references, by paths or by VPLs with perfect visibility, and estimate their error."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.errors import OutputError, SettingError, did_you_mean
from deferred_ir.base.files import check_folder, write_json, write_whole
from deferred_ir.base.progress import Progress
from deferred_ir.frame.vpl_params import CastParams
from deferred_ir.graph.params import parse
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.patterns import warn_unbalanced
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import NONE, cast
from deferred_ir.vpls.ray_sum import sum_radiance

DEFAULT_SPP = 64
"""Paths a pixel."""
DISC_SAMPLES = 256
"""Points of a disc light for the direct light beside VPLs."""

MOST_PIXELS = 1 << 24
MOST_BOUNCES = 64
SETTINGS = ("vpl.fov", "vpl.clamp", "vpl.pattern")
"""Keys that `settings` may have; all are about VPLs. The number of bounces is an argument of its own."""

VPL_ERROR = "one set of VPLs cannot tell its own error, which all pixels share; compare several seeds"
ONE_SAMPLE = "a single sample a pixel cannot tell its own error; take more"


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference: radiance and the parts that it is the sum of, float32 (H, W, 3), linear RGB, top row first.

    emission: what the camera sees shining itself, the environment behind all included. hit: where the camera ray hits a
    surface, bool (H, W). standard_error: that of each value of `radiance`, float32 (H, W, 3), or None if it is unknown
    (`meta["note"]` says why). meta: the content of OUT.json.
    """

    radiance: Array
    direct: Array
    indirect: Array
    emission: Array
    hit: Bools
    standard_error: Array | None
    meta: Mapping[str, Any]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write OUT.npy and OUT.json beside it; each appears whole or not at all."""
        path = Path(path)
        check_path(path)

        def fill(part: Path) -> None:
            with part.open("wb") as file:
                np.save(file, self.radiance)
            # Written last before the image gets its name, so that neither file is there without the other.
            write_json(path.with_suffix(".json"), dict(self.meta))

        write_whole(path, fill)


def check_path(path: Path) -> None:
    """Raise OutputError if a reference cannot be written at `path`."""
    if path.suffix.lower() != ".npy":
        raise OutputError(f"{path}: a reference is written as .npy, with a .json beside it; name a .npy")
    for file in (path, path.with_suffix(".json")):
        check_folder(file)


def trace_reference(
    scene: Scene,
    size: tuple[int, int],
    *,
    spp: int | None = None,
    vpls: int | None = None,
    bounces: int = 1,
    seed: int = 0,
    time: float = 0.0,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Reference:
    """Trace an image of `scene` at `time` seconds, of `size` (width, height).

    spp: paths a pixel of the path tracer, 64 unless `vpls` is passed. vpls: the number of VPLs, cast as in a render,
    with ray-cast visibility. bounces: those of indirect light, 0 for direct light alone. settings:
    {"vpl.param": value} for VPLs, with the defaults of a render. The result does not depend on the number of `threads`
    (None: all). progress: called with the work done and all work. Raises SettingError and DeviceError (no embreex).
    """
    settings = settings or {}
    _check(size, settings, spp=spp, vpls=vpls, bounces=bounces, seed=seed)
    start = clock.perf_counter()
    meta: dict[str, Any] = {"scene": scene.name, "scene_hash": scene.hash, "size": list(size), "bounces": bounces}
    meta["time"] = time if scene.moves else 0.0
    scene = recentre(scene.at(time))
    paths = PathTracer(scene, Tracer(scene), bounces)
    if vpls is None:
        spp = DEFAULT_SPP if spp is None else spp
        traced = _trace_paths(paths, size, spp, seed=seed, threads=threads, progress=progress)
        meta |= {"spp": spp, "seed": seed, "settings": {}}
    else:
        params = make_vpl_params({**settings, "vpl.count": vpls, "vpl.bounces": max(bounces, 1)})
        traced = _sum_vpls(paths, size, params, seed=seed, threads=threads, progress=progress)
        meta |= {"vpls": vpls, "seed": seed, "settings": {name: getattr(params, name[4:]) for name in SETTINGS}}
    broken = int((~np.isfinite(traced.radiance)).any(axis=-1).sum())
    if broken:
        raise OutputError(f"{scene.path}: {broken} pixels of the reference are not finite; look for extreme numbers")
    meta["hit_fraction"] = float(traced.hit.mean())
    return replace(traced, meta={**meta, **traced.meta, "seconds": round(clock.perf_counter() - start, 3)})


def _check(
    size: tuple[int, int], settings: Mapping[str, Any], *, spp: int | None, vpls: int | None, bounces: int, seed: int
) -> None:
    if spp is not None and vpls is not None:
        raise SettingError("spp and vpls: a reference is either of paths or of VPLs; give one of the two")
    numbers = {"width": size[0], "height": size[1], "spp": spp, "vpls": vpls, "bounces": bounces, "seed": seed}
    if bounces > MOST_BOUNCES:
        raise SettingError(f"bounces: is {bounces}, but {MOST_BOUNCES} are the most")
    for name, number in numbers.items():
        least = 0 if name in ("bounces", "seed") else 1
        if number is not None and number < least:
            raise SettingError(f"{name}: is {number}, but wants a whole number from {least} up")
    if size[0] * size[1] > MOST_PIXELS:
        raise SettingError(f"size {size[0]}x{size[1]}: a reference has at most {MOST_PIXELS} pixels; take fewer")
    for name in settings:
        if name not in SETTINGS:
            raise SettingError(f"set {name}: no such setting of a reference{did_you_mean(name, SETTINGS)}")
    if settings and vpls is None:
        raise SettingError(f"set {min(settings)}: belongs to VPLs, and paths have none; give --vpls N, or leave it out")


def make_vpl_params(settings: Mapping[str, Any]) -> CastParams:
    """Return the parameters of VPLs with the defaults of a render and `settings` on top; cones may open to 180 degrees.

    Shadow maps end a little short of the hemisphere, rays do not.
    """
    fov = settings.get("vpl.fov")
    whole = isinstance(fov, int | float) and fov == 180
    rest = {name: value for name, value in settings.items() if not (whole and name == "vpl.fov")}
    faults: list[str] = []
    params: CastParams = parse(CastParams, {name.partition(".")[2]: rest[name] for name in rest}, "vpl", faults)
    if faults:
        raise SettingError("; ".join(faults))
    warn_unbalanced(params.pattern, params.count)
    return replace(params, fov=180.0) if whole else params


def _trace_paths(
    paths: PathTracer, size: tuple[int, int], spp: int, *, seed: int, threads: int | None, progress: Progress | None
) -> Reference:
    estimate = paths.estimate(size, spp, seed, threads, progress)
    radiance = estimate.direct + estimate.indirect + estimate.emission
    error: dict[str, Any] = {"standard_error": None, "noise": None, "note": ONE_SAMPLE}
    if estimate.variance is not None:
        error = estimate_errors(radiance, estimate.variance, estimate.hit)
    return Reference(
        radiance.astype(np.float32),
        estimate.direct.astype(np.float32),
        estimate.indirect.astype(np.float32),
        estimate.emission.astype(np.float32),
        estimate.hit,
        None if estimate.variance is None else np.sqrt(estimate.variance).astype(np.float32),
        error,
    )


def estimate_errors(radiance: Array, variance: Array, hit: Bools) -> dict[str, float]:
    """Estimate the error of an image (H, W, 3) from the variance of its values, over the pixels that are `hit`.

    Returns standard_error, the mean standard error of a value over the mean radiance, and noise, the (untrimmed) relMSE
    to expect against the exact image.
    """
    mean = float(radiance[hit].mean()) if hit.any() else 0.0
    if mean == 0:
        return {"standard_error": 0.0, "noise": 0.0}
    relative = variance[hit] / (radiance[hit] ** 2 + 0.01 * mean**2)
    return {"standard_error": float(np.sqrt(variance[hit]).mean() / mean), "noise": float(relative.mean())}


def _sum_vpls(
    paths: PathTracer, size: tuple[int, int], params: Any, *, seed: int, threads: int | None, progress: Progress | None
) -> Reference:
    scene, tracer, bounces = paths.scene, paths.tracer, paths.bounces
    seen = paths.trace_camera_rays(size)
    direct = paths.estimate_direct(size, DISC_SAMPLES, seed, threads)
    emits = bounces > 0 and scene.emits
    vpls = cast(scene.emitters, tracer, params.count, params.pattern, seed, bounces=bounces) if emits else NONE
    limits = params.limits(scene.geometry.diagonal)
    indirect = sum_radiance(tracer, seen, vpls, limits, threads=threads, progress=progress).reshape(direct.shape)
    emission = paths.find_emission(size, seen).reshape(direct.shape)
    return Reference(
        (direct + indirect + emission).astype(np.float32),
        direct.astype(np.float32),
        indirect.astype(np.float32),
        emission.astype(np.float32),
        seen.hit.reshape(direct.shape[:2]),
        None,
        {"vpls_alive": len(vpls), "standard_error": None, "noise": None, "note": VPL_ERROR},
    )
