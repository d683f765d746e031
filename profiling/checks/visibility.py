"""Compare shadow maps with rays: for pairs of a pixel and a light, do both see the same? A row a projection and size.

A frame pairs each pixel with one light (visibility_pass.py), and Embree says whether something lies between the two.
The next frame has other VPLs, other pairs, and a camera turned by less than a pixel. Pairs of one frame share their
maps and are no independent samples, so a standard error goes by the spread of the frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.progress import Progress
from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.facts import collect_facts
from deferred_ir.frame.frame import NEAR
from deferred_ir.graph.compile import compile
from deferred_ir.graph.file import graph_hash, load_graph
from deferred_ir.graph.params import specs
from deferred_ir.profiling.checks.visibility_pass import FOLDER, VisibilityPairs
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import DirectLight, end_outside
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene
from deferred_ir.shadows.layout import lay_out
from deferred_ir.shadows.settings import MapParams
from deferred_ir.shadows.views import WIDEST_PLANAR

GRAPH = FOLDER / "visibility.toml"
PASSES = {"visibility_pairs": VisibilityPairs}
SOURCES = {
    "direct": ("spotlight_pairs", ("lights", "lights")),
    "vpls": ("vpl_pairs", ("vpl", "vpls")),
}
"""By output of the graph: which pass pairs pixels with lights, and where the records of these are."""
MAPS = "shadow_maps"
VPL_SIZE = f"{MAPS}.vpl_size"
LEAST_FRAMES = 8
"""Fewest frames for a standard error."""
MOST_FRAMES = 256
"""Most frames: where hardly a pixel faces a light, all the pairs asked for would take too long."""


@dataclass(frozen=True)
class Options:
    """What is measured. size: (width, height), pixels. pairs: at least so many a row. vpl_sizes: of VPLs' maps, texels.

    settings: {"pass.param": value} for all rows.
    """

    size: tuple[int, int] = (256, 256)
    pairs: int = 200_000
    vpl_sizes: Sequence[int] = (256, 512)
    seed: int = 0
    device: str = "auto"
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Fraction:
    """A fraction of all pairs or of all light, and its standard error; both None without pairs or light."""

    value: float | None
    error: float | None


@dataclass(frozen=True)
class Row:
    """The result for a kind of direct lights, or "vpls", and maps of one projection and size (texels).

    mismatch: pairs on which map and ray disagree, the sum of leaks (lit by the map, blocked for the ray) and
    false_shadows (the reverse). A map that says half or more counts as lit. light_wrong, light_leaked and light_lost:
    the same with the map's answer as it is, weighted by the irradiance that the pair has without shadow.
    vpls: rays that were cast for them. size: of a frame, (width, height).
    """

    scene: str
    scene_hash: str
    graph_hash: str
    size: tuple[int, int]
    vpls: int
    seed: int
    device: str
    lights: str
    projection: str
    map_size: int
    frames: int
    pairs: int
    mismatch: Fraction
    leaks: Fraction
    false_shadows: Fraction
    light_wrong: Fraction
    light_leaked: Fraction
    light_lost: Fraction

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class _Maps:
    """A kind of maps to measure. lights: whose maps they are. only: the light that is measured alone, None for VPLs."""

    lights: str
    projection: str
    size: int
    only: DirectLight | None = None

    def pick(self, scene: Scene) -> Scene:
        """Return the scene with the light that is measured."""
        return scene if self.only is None else replace(scene, lights=(self.only,))


def rows(scene: Scene, options: Options, progress: Progress | None = None) -> Iterator[Row]:
    """Yield a row for the first direct light of each kind, and for the VPLs with each projection and map size.

    Points of lights are among the VPLs. Yields none if nothing shines. Raises GraphError before the first row for
    settings that do not fit any.
    """
    scene = recentre(scene)  # as the maps and Embree have it
    for settings, chosen in _choose_maps(scene, options):
        with Renderer(options.size, GRAPH, options.device, set=settings, passes=PASSES) as renderer:
            for maps in chosen:
                yield _row(
                    renderer,
                    scene,
                    options,
                    maps,
                    _measure_frames(renderer, maps.pick(scene), maps.lights, options, progress),
                )


def _choose_maps(scene: Scene, options: Options) -> list[tuple[dict[str, Any], list[_Maps]]]:
    """Return settings, each with the kinds of maps to measure with them; no kind twice."""
    chosen, known = list[tuple[dict[str, Any], list[_Maps]]](), set[_Maps]()
    if not scene.emits:
        return chosen
    direct = {light.kind: light for light in reversed(scene.direct_lights) if any(light.emission)}
    for choice in _projections(options.settings):
        for vpl_size in options.vpl_sizes:
            settings = {**options.settings, **choice, VPL_SIZE: vpl_size}
            graph = load_graph(GRAPH, settings, PASSES)
            steps = compile(graph, list(graph.outputs), collect_facts(scene)).steps
            step = next(step for step in steps if step.name == MAPS)
            parts = [part for part in step.work.subpasses(step.descriptions) if part["light"] == "vpl 0"]
            kinds = [_describe_maps(light, scene, step.work.params) for light in reversed(direct.values())]
            kinds += [_Maps("vpls", part["projection"], part["size"]) for part in parts]
            chosen.append((settings, [maps for maps in kinds if maps not in known]))
            known |= set(kinds)
    return [(settings, maps) for settings, maps in chosen if maps]


def _describe_maps(light: DirectLight, scene: Scene, params: Any) -> _Maps:
    """Return what maps a light has where it is the only one."""
    views = light.list_views(scene.bounds)
    sizes = lay_out([view.halvings for view in views], params, max(params.spot_size, params.vpl_size)).sizes
    wide = "paraboloid" if views[0].fov > WIDEST_PLANAR else "perspective"
    return _Maps(light.kind, wide if views[0].fov else "orthographic", sizes[0], light)


def _projections(settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the settings of each projection, or only of the one that `settings` name."""
    name = f"{MAPS}.projection"
    choices = [settings[name]] if name in settings else specs(MapParams)["projection"].choices
    return [{name: choice} for choice in choices]


def _measure_frames(
    renderer: Renderer, scene: Scene, lights: str, options: Options, progress: Progress | None
) -> Array:
    """Draw frames until there are enough pairs. Returns the sums of each, (frames, 6), as in `Pairs.sums`."""
    plan = renderer.plan(scene, outputs=[name_output(lights)])
    rng = np.random.default_rng(options.seed)
    sums: list[Array] = []
    done = 0
    while len(sums) < LEAST_FRAMES or (done < options.pairs and len(sums) < MOST_FRAMES):
        moved = replace(scene, camera=_turn(scene.at(0).camera, options.size, rng.random(2) - 0.5))
        renderer.draw(moved, plan, seed=options.seed * MOST_FRAMES + len(sums))
        sums.append(trace_pairs(renderer, moved, lights).sums())
        done += int(sums[-1][0])
        if progress:
            progress(done, max(options.pairs, done))
        if done == 0 and len(sums) == LEAST_FRAMES:
            break  # the camera sees nothing that faces a light
    return np.array(sums)


def _turn(camera: Camera, size: tuple[int, int], pixels: Array) -> Camera:
    """Turn the camera to the right and up by `pixels` (2,) of an image of `size`."""
    right, up, forward = camera.ray_axes(size)
    away = np.linalg.norm(np.subtract(camera.look_at, camera.position))
    aim = np.asarray(camera.position) + away * (
        forward + right * (2 * pixels[0] / size[0]) + up * (2 * pixels[1] / size[1])
    )
    return replace(camera, look_at=(float(aim[0]), float(aim[1]), float(aim[2])), motion=None)


@dataclass(frozen=True, eq=False)
class Pairs:
    """n pairs of a frame that face each other, with the pixel in the light's cone. Arrays are float64.

    light: its number in its buffer, int (n,). position, normal: the pixel's surface, (n, 3). shown: visibility by the
    map, (n,) from 0 to 1. lit: visibility by the ray, bool (n,). irradiance: luminance of the unshadowed irradiance,
    (n,).
    """

    light: Ints
    position: Array
    normal: Array
    shown: Array
    lit: Bools
    irradiance: Array

    def sums(self) -> Array:
        """Return the number of pairs, leaks and false shadows, then all light, leaked and lost light, (6,)."""
        shown, lit = self.shown >= 0.5, self.lit
        leaked, lost = (self.irradiance @ np.maximum(off, 0) for off in (self.shown - lit, lit - self.shown))
        return np.array([len(lit), (shown & ~lit).sum(), (~shown & lit).sum(), self.irradiance.sum(), leaked, lost])


def name_output(lights: str) -> str:
    """Return the output of the graph that has the pairs with `lights`: a kind of direct lights, or "vpls"."""
    return "vpls" if lights == "vpls" else "direct"


def trace_pairs(renderer: Renderer, scene: Scene, lights: str) -> Pairs:
    """Read the pairs of the last frame, of `scene` and `lights`, and trace a ray for each.

    lights: "vpls", or the kind of the scene's first direct light.
    """
    source, records_of = SOURCES[name_output(lights)]
    with renderer.gpu.ctx:
        pairs, facing = (renderer.executor.resource((source, port)).read()[::-1] for port in ("pairs", "facing"))
        records = renderer.executor.resource(records_of).records
    counts = pairs[..., 2] > 0  # pixels that face away or lie outside the cone get no light
    number, shown, irradiance, depth = pairs[counts].astype(np.float64).T
    away = np.float32(NEAR * scene.geometry.scale) / depth
    position = np.asarray(scene.camera.position) + scene.camera.rays(renderer.size)[counts] * away[:, None]
    normal, light = facing[counts, :3].astype(np.float64), number.astype(int)
    target, tracer = records["position"][light].astype(np.float64), renderer.tracer()
    if lights == "vpls":  # they lie on surfaces, unlike direct lights
        axis = records["z_axis"][light].astype(np.float64)
        far = (records["tan_half"][light] == 0)[:, None]
        target = np.where(far, end_outside(position, -axis, scene.bounds), tracer.lift(target, axis))
    elif lights == "directional":
        target = end_outside(position, -records["axis"][light].astype(np.float64), scene.bounds)
    lit = ~tracer.occluded(tracer.lift(position, normal), target)
    return Pairs(light, position, normal, shown, lit, irradiance)


def _row(renderer: Renderer, scene: Scene, options: Options, maps: _Maps, sums: Array) -> Row:
    pairs, leaks, false_shadows, light, leaked, lost = sums.T
    graph = renderer.graph()
    return Row(
        scene=scene.name,
        scene_hash=scene.hash,
        graph_hash=graph_hash(graph),
        size=renderer.size,
        vpls=graph.nodes["vpl"].work.params.count,
        seed=options.seed,
        device=renderer.gpu.device.name,
        lights=maps.lights,
        projection=maps.projection,
        map_size=maps.size,
        frames=len(sums),
        pairs=int(pairs.sum()),
        mismatch=_divide(leaks + false_shadows, pairs),
        leaks=_divide(leaks, pairs),
        false_shadows=_divide(false_shadows, pairs),
        light_wrong=_divide(leaked + lost, light),
        light_leaked=_divide(leaked, light),
        light_lost=_divide(lost, light),
    )


def _divide(parts: Array, wholes: Array) -> Fraction:
    """Return sum(parts) / sum(wholes) and the standard error of this ratio estimator, by the spread of the frames."""
    whole, count = wholes.sum(), len(wholes)
    if whole == 0:
        return Fraction(None, None)
    ratio = parts.sum() / whole
    off = parts - ratio * wholes
    return Fraction(float(ratio), float(np.sqrt(count / (count - 1) * (off**2).sum()) / whole))
