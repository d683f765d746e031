"""Compare the two references, VPLs with ray-cast visibility and the path tracer: do they agree within their noise?

    python -m deferred_ir.profiling.checks.agreement cornell colors --size 128x128

Both use the same clamp and cone; the VPLs are 16 scrambles of 1024 Sobol points. Blocks of 8x8 pixels agree if their
means differ by no more than three standard errors (of both) in each channel.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from deferred_ir.base.progress import track
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, run
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance

BLOCK = 8
SCRAMBLES, COUNT, SPP = 16, 1024, 256
HEAD = "scene", "blocks within 3 standard errors", "lit blocks", "indirect light, VPLs / paths"


def average_blocks(image: np.ndarray) -> np.ndarray:
    """Return the means of blocks of BLOCK x BLOCK pixels, (H / BLOCK, W / BLOCK, 3)."""
    height, width, channels = image.shape
    means: np.ndarray = image.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels).mean(axis=(1, 3))
    return means


def measure(scene: Scene, size: tuple[int, int], clamp: float, fov: float) -> dict[str, Any]:
    """Return the fraction of the lit blocks that agree, their number, and the ratio of the mean indirect light."""
    tracer = Tracer(scene)
    judge = PathTracer(scene, tracer, clamp=clamp, fov=fov)
    seen, traced = judge.trace_camera_rays(size), judge.estimate(size, SPP, seed=7)
    if traced.variance is None:
        raise ValueError(f"{SPP} paths a pixel are too few for a variance")
    limits, sums = VplLimits.from_angle(fov, clamp * scene.geometry.diagonal), []
    for seed in track(range(SCRAMBLES), scene.name):
        vpls = cast(scene.emitters, tracer, COUNT, "sobol", seed)
        sums.append(average_blocks(sum_radiance(tracer, seen, vpls, limits).reshape(traced.indirect.shape)))
    ours, paths = np.array(sums), average_blocks(traced.indirect)
    variance = ours.var(axis=0, ddof=1) / SCRAMBLES + average_blocks(traced.variance) / BLOCK**2
    lit = (paths > 0).all(axis=-1)
    off = np.abs(ours.mean(axis=0) - paths)[lit] / np.sqrt(variance[lit])
    return {
        "within": float((off <= 3).all(axis=-1).mean()),
        "blocks": int(lit.sum()),
        "ratio": float(ours.mean() / paths.mean()),
    }


def report(chosen: argparse.Namespace) -> None:
    """Print a row for each scene."""
    rows = []
    for name in chosen.scenes:
        scene = load(name)
        result = measure(scene, chosen.size, chosen.clamp, chosen.fov)
        rows.append([scene.name, f"{result['within']:.1%}", f"{result['blocks']}", f"{result['ratio']:.4f}"])
    print(markdown(HEAD, rows))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study; sizes have to be multiples of BLOCK."""
    parser = command_line(__doc__, size=(256, 256), fov=180.0)
    parser.add_argument("--clamp", type=float, default=0.02, metavar="DIAGONALS", help="clamp distance")
    run(parser, report, words)


if __name__ == "__main__":
    main()
