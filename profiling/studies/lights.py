"""Compare light of every kind: the path tracer with Mitsuba at equal paths, and graphs with the path tracer.

    python -m deferred_ir.profiling.studies.lights --kinds point,mixture --size 256x256
    python -m deferred_ir.profiling.studies.lights --without-mitsuba --graphs accurate,deferred
    python -m deferred_ir.profiling.studies.lights --kinds "white metal 0.1,copper 0.2" --size 128x128

The scenes are those of light_scenes.py, and on request those of material_scenes.py. Mitsuba's pixels are means over
their area, so that ours are jittered here as well. Blocks of 8x8 pixels agree if their means differ by no more than
three standard errors (of both) in each channel; the errors come from the spread over `--seeds` images with `--spp`
paths a pixel in all. Mitsuba's pattern of samples is darker by 0.1 % under the grey sky where an image has only 4 or 8
paths a pixel, and is not with 64.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError, did_you_mean
from deferred_ir.base.progress import track
from deferred_ir.engine.renderer import Renderer
from deferred_ir.profiling import light_scenes, material_scenes
from deferred_ir.profiling.checks.agreement import average_blocks
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.peers import mitsuba
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import Reference, trace_reference

SCENES = {**light_scenes.SCENES, **material_scenes.SCENES}
WITHIN = 3.0
"""Standard errors."""
ROUNDING = 1e-5
"""What 32-bit numbers may differ by, as a fraction of the mean: a constant sky has no spread."""
MITSUBA_HEAD = "blocks within 3 standard errors", "mean, ours / Mitsuba", "standard error"
GRAPH_HEAD = "relMSE", "mean", "relMSE of direct light"


@dataclass(frozen=True)
class JitteredCamera(Camera):
    """A camera whose rays go through random places of pixels instead of their centres, the same for the same seed."""

    seed: int = 0

    def rays(self, size: tuple[int, int]) -> Array:
        """Return directions at view depth 1, float64 (H, W, 3), top row first."""
        width, height = size
        place = np.random.default_rng([self.seed, 1]).random((height, width, 2))
        a, b, c = self.ray_axes(size)
        x = (np.arange(width) + place[..., 0]) / width * 2 - 1
        y = 1 - (np.arange(height)[:, None] + place[..., 1]) / height * 2
        directions: Array = x[..., None] * a + y[..., None] * b + c
        return directions


@dataclass(frozen=True)
class Agreement:
    """within: fraction of the blocks that agree. ratio: of the means of both images. error: standard error of that."""

    within: float
    ratio: float
    error: float


def compare(ours: Sequence[Array], theirs: Sequence[Array]) -> Agreement:
    """Compare two renderers by independent images (H, W, 3) of each."""
    blocks = [np.array([average_blocks(image.astype(np.float64)) for image in images]) for images in (ours, theirs)]
    variance = sum(images.var(axis=0, ddof=1) / len(images) for images in blocks)
    off = np.abs(blocks[0].mean(axis=0) - blocks[1].mean(axis=0))
    means = [images.mean(axis=(1, 2, 3)) for images in blocks]
    spread = sum(mean.var(ddof=1) / len(mean) / mean.mean() ** 2 for mean in means)
    return Agreement(
        within=float((off <= WITHIN * np.sqrt(variance) + ROUNDING * blocks[1].mean()).all(axis=-1).mean()),
        ratio=float(means[0].mean() / means[1].mean()),
        error=float(np.sqrt(spread)),
    )


def compare_with_mitsuba(scene: Scene, size: tuple[int, int], spp: int, seeds: int, bounces: int = 1) -> Agreement:
    """Render `seeds` images of a scene each way, spp / seeds paths a pixel each, and compare them."""
    each = max(1, spp // seeds)
    peer = mitsuba.Peer(scene, size, bounces)
    theirs = [peer.render(each, seed).radiance for seed in track(range(seeds), f"{scene.name}, Mitsuba")]
    camera = scene.camera
    ours = [
        trace_reference(
            replace(scene, camera=JitteredCamera(camera.position, camera.look_at, camera.up, camera.fov, seed=seed)),
            size,
            spp=each,
            bounces=bounces,
            seed=seed,
        ).radiance
        for seed in track(range(seeds), f"{scene.name}, paths")
    ]
    return compare(ours, theirs)


def measure_graph(scene: Scene, truth: Reference, graph: str, vpls: int) -> tuple[float, float, float]:
    """Compare a picture of a graph with the reference.

    Returns relMSE of all pixels less the reference's noise, the ratio of the means, and relMSE of direct light without
    the worst thousandth of the pixels, with the reference's noise where a light has an area.
    """
    height, width, _ = truth.radiance.shape
    with Renderer((width, height), graph) as renderer:
        image = renderer.render(scene, vpls=vpls).radiance
        direct = renderer.render(scene, vpls=0).radiance
    ratio = float(image[truth.hit].mean() / truth.radiance[truth.hit].mean())
    straight = relmse(direct, truth.direct + truth.emission, truth.hit)[0]
    return relmse(image, truth.radiance, truth.hit)[1] - truth.meta["noise"], ratio, straight


def report(chosen: argparse.Namespace) -> None:
    """Print a table with a row for each scene: against Mitsuba unless that is switched off, then each graph."""
    for name in chosen.kinds:
        if name not in SCENES:
            raise SettingError(f"--kinds: no scene '{name}'{did_you_mean(name, list(SCENES))}")
    graphs = chosen.graphs if chosen.graphs != ["none"] else []
    if chosen.without_mitsuba and not graphs:
        raise SettingError("--without-mitsuba: leaves nothing to compare; give --graphs")
    head = ["scene", *([] if chosen.without_mitsuba else MITSUBA_HEAD)]
    head += [
        *(f"`{graph}`, {what}" for graph in graphs for what in GRAPH_HEAD),
        *(["noise of the reference"] if graphs else []),
    ]
    rows = []
    for name in chosen.kinds:
        scene = SCENES[name]()
        row = [name]
        if not chosen.without_mitsuba:
            found = compare_with_mitsuba(scene, chosen.size, chosen.spp, chosen.seeds, chosen.bounces)
            row += [f"{found.within:.1%}", f"{found.ratio:.4f}", f"{found.error:.2%}"]
        if graphs:
            truth = trace_reference(scene, chosen.size, spp=chosen.spp)
            for graph in graphs:
                error, ratio, direct = measure_graph(scene, truth, graph, chosen.vpls)
                row += [f"{error:.5f}", f"{ratio:.4f}", f"{direct:.5f}"]
            row.append(f"{truth.meta['noise']:.2g}")
        rows.append(row)
        print(" | ".join(row), flush=True)
    print(f"\n{markdown(head, rows)}")


def main(words: Sequence[str] | None = None) -> None:
    """Run the study; sizes have to be multiples of 8."""
    parser = command_line(__doc__, scenes=False, size=(256, 256), spp=256, seeds=32, vpls=1024, graphs=["none"])
    names: Callable[[str], list[str]] = lambda text: text.split(",")  # noqa: E731
    lights = list(light_scenes.SCENES)
    parser.add_argument("--kinds", type=names, default=lights, metavar="A,B", help="scenes; those of lights without it")
    parser.add_argument("--bounces", type=int, default=1, help="beside Mitsuba; default 1")
    parser.add_argument("--without-mitsuba", action="store_true", help="compare graphs with the path tracer only")
    run(parser, report, words)


if __name__ == "__main__":
    main()
