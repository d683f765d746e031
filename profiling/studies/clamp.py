"""Error against the clamp distance, for several numbers of VPLs: what the default of vpl.clamp rests on.

    python -m deferred_ir.profiling.studies.clamp -o out/clamp cornell colors atrium --fov 150

VPLs with ray-cast visibility (so that no shadow map has a part in it) against a path-traced reference, relMSE trimmed,
mean over seeds. Writes clamp.json and clamp.svg; needs the extra `report`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deferred_ir.base.files import write_json
from deferred_ir.base.progress import progress_bar
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import arguments, panels
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance

SIZE = (96, 96)
CLAMPS = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1)
COUNTS = (64, 256, 1024)
SEEDS = 4
SPP = 1024


def measure(scene: Scene, fov: float) -> dict[str, list[float]]:
    """relMSE of each number of VPLs: a list over CLAMPS."""
    tracer = Tracer(scene)
    judge = PathTracer(scene, tracer)
    truth = judge.estimate(SIZE, SPP)
    seen, reference = judge.seen(SIZE), truth.direct + truth.indirect
    errors = {str(count): [0.0] * len(CLAMPS) for count in COUNTS}
    with progress_bar(scene.name, len(COUNTS) * SEEDS * len(CLAMPS)) as bar:
        for count in COUNTS:
            for seed in range(SEEDS):
                vpls = cast(scene.spotlight, tracer, count, "sobol", seed)
                for i, clamp in enumerate(CLAMPS):
                    limits = VplLimits.from_angle(fov, clamp * scene.geometry.diagonal)
                    indirect = sum_radiance(tracer, seen, vpls, limits)
                    image = truth.direct + indirect.reshape(reference.shape)
                    errors[str(count)][i] += relmse(image, reference, truth.hit)[0] / SEEDS
                    bar.advance()
    return errors


def plot(results: dict[str, Any], path: Path) -> None:
    """A log-log panel for each scene."""
    with panels(results, path, "relMSE") as axes:
        for panel, errors in zip(axes, results.values(), strict=True):
            for count, line in errors.items():
                panel.loglog(CLAMPS, line, "o-", ms=3, label=f"{count} VPLs")
            panel.axvline(0.02, color="grey", lw=0.8, ls=":")
            panel.set_xlabel("clamp distance / diagonal")


def table(results: dict[str, Any]) -> str:
    """relMSE as a Markdown table."""
    rows = ["| scene | VPLs | " + " | ".join(map(str, CLAMPS)) + " |", "|---" * (len(CLAMPS) + 2) + "|"]
    for name, errors in results.items():
        for count, line in errors.items():
            rows.append(f"| {name} | {count} | " + " | ".join(f"{value:.4f}" for value in line) + " |")
    return "\n".join(rows)


def main() -> None:
    """Measure, write, print."""
    parser = arguments(__doc__)
    parser.add_argument("--fov", type=float, default=150.0, help="of the VPLs' cones, degrees")
    chosen = parser.parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)
    results = {(scene := load(name)).name: measure(scene, chosen.fov) for name in chosen.scenes}
    settings = {"clamps": CLAMPS, "fov": chosen.fov, "seeds": SEEDS, "size": SIZE}
    write_json(chosen.output / "clamp.json", {**settings, "relmse": results})
    plot(results, chosen.output / "clamp.svg")
    print(table(results))


if __name__ == "__main__":
    main()
