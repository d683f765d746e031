"""Do shadow maps agree with rays? Pairs of a pixel and a light, asked of both, one row a projection and map size.

A frame pairs each pixel with one light (visibility_pairs.py), and Embree says whether something lies between the two.
The next frame has other VPLs, other pairs, and a camera turned by less than a pixel. Pairs of one frame share their
maps and are no independent samples, so a standard error goes by the spread of the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from deferred_ir.camera import Camera
from deferred_ir.config import load_graph
from deferred_ir.lights import NEAR
from deferred_ir.params import specs
from deferred_ir.renderer import Renderer
from deferred_ir.scene import Scene
from deferred_ir.tracing import Tracer
from deferred_ir.typing import Array

from .visibility_pairs import FOLDER, VisibilityPairs

LEAST_FRAMES = 8
"""Fewer would not tell a standard error."""
MOST_FRAMES = 1024
PROJECTION = "projection"
PERSPECTIVE = "perspective"

Progress = Callable[[int, int], None]
"""Called with the pairs drawn so far and those that there will be."""


@dataclass(frozen=True)
class Options:
    """What is measured. size: (width, height). pairs: at least so many a row. vpl_sizes: of VPLs' maps, texels.

    settings: {"pass.param": value} for all rows. projections: None for all that the maps have.
    """

    size: tuple[int, int] = (256, 256)
    pairs: int = 200_000
    vpl_sizes: Sequence[int] = (256, 512)
    projections: Sequence[str] | None = None
    seed: int = 0
    device: str = "auto"
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Share:
    """A share of all pairs, or of all light, and its standard error; None where there are no pairs."""

    value: float | None
    error: float | None


@dataclass(frozen=True)
class Row:
    """What was found of the lights of one kind ("spotlight", "vpls") in maps of one projection and size (texels).

    mismatch: pairs where map and ray disagree, the sum of leaks (lit by the map, blocked for the ray) and false_shadows
    (the reverse). A map that says half or more counts as lit. light_wrong, light_leaked and light_lost: the same with
    the map's answer as it is, weighted by the irradiance of the pair without shadow.
    """

    scene: str
    scene_hash: str
    lights: str
    projection: str
    map_size: int
    frames: int
    pairs: int
    mismatch: Share
    leaks: Share
    false_shadows: Share
    light_wrong: Share
    light_leaked: Share
    light_lost: Share

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def projections(settings: Mapping[str, Any]) -> list[str]:
    """The projections that shadow maps can have; the one that `settings` ask for, if they do."""
    params = load_graph("deferred", settings).nodes["shadow_maps"].work.params
    known = specs(type(params))
    if PROJECTION not in known:
        return [PERSPECTIVE]
    return [params.projection] if f"shadow_maps.{PROJECTION}" in settings else list(known[PROJECTION].choices)


def rows(scene: Scene, options: Options, progress: Progress | None = None) -> Iterator[Row]:
    """Measure `scene`: for each projection a row for the spotlight, then one for the VPLs with each size of map."""
    for projection in options.projections or projections(options.settings):
        for vpl_size in options.vpl_sizes:
            settings = {**options.settings, "shadow_maps.vpl_size": vpl_size}
            if projections({}) != [PERSPECTIVE]:
                settings[f"shadow_maps.{PROJECTION}"] = projection
            with Renderer(
                options.size,
                FOLDER / "visibility.toml",
                options.device,
                set=settings,
                passes={"visibility_pairs": VisibilityPairs},
            ) as renderer:
                nodes = renderer.graph().nodes
                sizes = {"vpls": vpl_size, "spotlight": nodes["shadow_maps"].work.params.spot_size}
                kinds = ["spotlight"] if vpl_size == options.vpl_sizes[0] else []
                kinds += ["vpls"] if nodes["vpl"].work.params.count else []
                for kind in kinds:
                    sums = _frames(renderer, scene, kind, options, progress)
                    yield _row(scene, kind, projection, sizes[kind], sums)


def _frames(renderer: Renderer, scene: Scene, kind: str, options: Options, progress: Progress | None) -> Array:
    """Sums over the pairs of each frame, (frames, 6): see `_judge`."""
    plan = renderer.plan(scene, outputs=[kind])
    rng = np.random.default_rng(options.seed)
    sums: list[Array] = []
    done = 0
    while len(sums) < LEAST_FRAMES or (done < options.pairs and len(sums) < MOST_FRAMES):
        moved = replace(scene, camera=_turned(scene.at(0).camera, options.size, rng.random(2) - 0.5))
        renderer.draw(moved, plan, seed=options.seed * MOST_FRAMES + len(sums))
        sums.append(_judge(renderer, moved, plan.outputs[kind][0]))
        done += int(sums[-1][0])
        if progress:
            progress(done, max(options.pairs, done))
        if done == 0 and len(sums) == LEAST_FRAMES:
            break  # the camera sees nothing that faces a light
    return np.array(sums)


def _turned(camera: Camera, size: tuple[int, int], pixels: Array) -> Camera:
    """The camera turned to the right and up by `pixels` (2,) of an image of `size`."""
    right, up, forward = camera.ray_axes(size)
    away = np.linalg.norm(np.subtract(camera.look_at, camera.position))
    aim = np.asarray(camera.position) + away * (
        forward + right * (2 * pixels[0] / size[0]) + up * (2 * pixels[1] / size[1])
    )
    return replace(camera, look_at=(float(aim[0]), float(aim[1]), float(aim[2])), motion=None)


def _judge(renderer: Renderer, scene: Scene, source: str) -> Array:
    """Of the frame drawn last: number of pairs, leaks and false shadows, then light in all, leaked and lost, (6,)."""
    with renderer.gpu.ctx:
        pairs = renderer.executor.resource((source, "pairs")).read()[::-1]
        facing = renderer.executor.resource((source, "facing")).read()[::-1]
        records = renderer.executor.resource(("vpl", "lights")).records
    counts = pairs[..., 2] > 0  # what faces away, or lies outside the cone, gets nothing
    number, visible, irradiance, depth = pairs[counts].astype(np.float64).T
    near = np.float32(NEAR * scene.geometry.diagonal)
    position = np.asarray(scene.camera.position) + scene.camera.rays(renderer.size)[counts] * (near / depth)[:, None]
    lit = ~blocked(renderer.tracer(), position, facing[counts, :3].astype(np.float64), records[number.astype(int)])
    shown = visible >= 0.5
    return np.array(
        [
            len(lit),
            (shown & ~lit).sum(),
            (~shown & lit).sum(),
            irradiance.sum(),
            irradiance @ np.maximum(visible - lit, 0),
            irradiance @ np.maximum(lit - visible, 0),
        ]
    )


def blocked(tracer: Tracer, position: Array, normal: Array, lights: np.ndarray) -> Any:
    """Whether anything lies between surface points (n, 3) with unit `normal` (n, 3) and the LIGHT records (n,)."""
    target = lights["position"].astype(np.float64)
    on_surface = lights["tile"] >= 0  # a VPL; the spotlight hangs free
    target[on_surface] = tracer.lift(target[on_surface], lights["z_axis"][on_surface].astype(np.float64))
    return tracer.occluded(tracer.lift(position, normal), target)


def _row(scene: Scene, kind: str, projection: str, map_size: int, sums: Array) -> Row:
    pairs, leaks, false_shadows, light, leaked, lost = sums.T
    return Row(
        scene.name,
        scene.hash,
        kind,
        projection,
        map_size,
        len(sums),
        int(pairs.sum()),
        _share(leaks + false_shadows, pairs),
        _share(leaks, pairs),
        _share(false_shadows, pairs),
        _share(leaked + lost, light),
        _share(leaked, light),
        _share(lost, light),
    )


def _share(parts: Array, wholes: Array) -> Share:
    """sum(parts) / sum(wholes) and its standard error by the spread of the frames, those of a ratio estimator."""
    whole, count = wholes.sum(), len(wholes)
    if whole == 0:
        return Share(None, None)
    share = parts.sum() / whole
    off = parts - share * wholes
    return Share(float(share), float(np.sqrt(count / (count - 1) * (off**2).sum()) / whole))
