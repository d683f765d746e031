"""Do the two references estimate the same integral? VPLs with perfect visibility against the path tracer, by blocks.

    python -m deferred_ir.profiling.studies.agreement cornell colors --size 128x128

Both with the same clamp and cone, 16 scrambles of 1024 Sobol VPLs; blocks of 8x8 pixels whose difference is within
three standard errors (of both) in all channels count as equal.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.image_size import parse_size
from deferred_ir.base.progress import track
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import arguments
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance

BLOCK = 8
SCRAMBLES, COUNT, SPP = 16, 1024, 256


def blocks(image: np.ndarray) -> np.ndarray:
    """Means of BLOCK x BLOCK pixels, (H / BLOCK, W / BLOCK, 3)."""
    height, width, channels = image.shape
    means: np.ndarray = image.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels).mean(axis=(1, 3))
    return means


def measure(scene: Scene, size: tuple[int, int], clamp: float, fov: float) -> dict[str, Any]:
    """Share of lit blocks that agree, how many there are, and the ratio of the mean indirect light."""
    tracer = Tracer(scene)
    judge = PathTracer(scene, tracer, clamp=clamp, fov=fov)
    seen, traced = judge.seen(size), judge.estimate(size, SPP, seed=7)
    if traced.variance is None:
        raise ValueError(f"{SPP} paths a pixel tell no variance")
    limits, sums = VplLimits.from_angle(fov, clamp * scene.geometry.diagonal), []
    for seed in track(range(SCRAMBLES), scene.name):
        vpls = cast(scene.spotlight, tracer, COUNT, "sobol", seed)
        sums.append(blocks(sum_radiance(tracer, seen, vpls, limits).reshape(traced.indirect.shape)))
    ours, paths = np.array(sums), blocks(traced.indirect)
    variance = ours.var(axis=0, ddof=1) / SCRAMBLES + blocks(traced.variance) / BLOCK**2
    lit = (paths > 0).all(axis=-1)
    off = np.abs(ours.mean(axis=0) - paths)[lit] / np.sqrt(variance[lit])
    return {
        "within": float((off <= 3).all(axis=-1).mean()),
        "blocks": int(lit.sum()),
        "ratio": float(ours.mean() / paths.mean()),
    }


def main() -> None:
    """Print a Markdown table."""
    parser = arguments(__doc__, output=False)
    parser.add_argument("--size", type=parse_size, default=(256, 256), help="multiples of 8")
    parser.add_argument("--clamp", type=float, default=0.02)
    parser.add_argument("--fov", type=float, default=180.0)
    chosen = parser.parse_args()
    print("| scene | blocks within 3 standard errors | lit blocks | indirect light, VPLs / paths |\n|---|---|---|---|")
    for name in chosen.scenes:
        scene = load(name)
        found = measure(scene, chosen.size, chosen.clamp, chosen.fov)
        print(f"| {scene.name} | {found['within']:.1%} | {found['blocks']} | {found['ratio']:.4f} |", flush=True)


if __name__ == "__main__":
    main()
