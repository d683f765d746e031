"""Measure the error against the clamp distance for several numbers of VPLs: the basis for the default of vpl.clamp.

    python -m deferred_ir.profiling.studies.clamp -o out/clamp cornell colors atrium --fov 150

VPLs with ray-cast visibility, which keeps errors of shadow maps out, are compared with a path-traced reference: trimmed
relMSE, mean over seeds. Writes clamp.json and clamp.svg; needs the extra `report`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deferred_ir.base.files import write_json
from deferred_ir.base.progress import progress_bar
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown, panels
from deferred_ir.profiling.study import command_line, run
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
    """Return the relMSE for each number of VPLs, a list over CLAMPS."""
    tracer = Tracer(scene)
    judge = PathTracer(scene, tracer)
    truth = judge.estimate(SIZE, SPP)
    seen, reference = judge.trace_camera_rays(SIZE), truth.direct + truth.indirect
    errors = {str(count): [0.0] * len(CLAMPS) for count in COUNTS}
    with progress_bar(scene.name, len(COUNTS) * SEEDS * len(CLAMPS)) as bar:
        for count in COUNTS:
            for seed in range(SEEDS):
                vpls = cast(scene.emitters, tracer, count, "sobol", seed)
                for i, clamp in enumerate(CLAMPS):
                    limits = VplLimits.from_angle(fov, clamp * scene.geometry.diagonal)
                    indirect = sum_radiance(tracer, seen, vpls, limits)
                    image = truth.direct + indirect.reshape(reference.shape)
                    errors[str(count)][i] += relmse(image, reference, truth.hit)[0] / SEEDS
                    bar.advance()
    return errors


def plot(results: dict[str, Any], path: Path) -> None:
    """Draw relMSE over the clamp distance, log-log, a panel for each scene."""
    with panels(results, path, "relMSE") as axes:
        for panel, errors in zip(axes, results.values(), strict=True):
            for count, line in errors.items():
                panel.loglog(CLAMPS, line, "o-", ms=3, label=f"{count} VPLs")
            panel.axvline(0.02, color="grey", lw=0.8, ls=":")
            panel.set_xlabel("clamp distance / diagonal")


def table(results: dict[str, Any]) -> str:
    """Return relMSE as a Markdown table."""
    rows = [
        [name, count, *(f"{value:.4f}" for value in line)]
        for name, errors in results.items()
        for count, line in errors.items()
    ]
    return markdown(["scene", "VPLs", *map(str, CLAMPS)], rows)


def report(chosen: argparse.Namespace) -> None:
    """Measure each scene, write the files and print the table."""
    results = {(scene := load(name)).name: measure(scene, chosen.fov) for name in chosen.scenes}
    settings = {"clamps": CLAMPS, "fov": chosen.fov, "seeds": SEEDS, "size": SIZE}
    write_json(chosen.output / "clamp.json", {**settings, "relmse": results})
    plot(results, chosen.output / "clamp.svg")
    print(table(results))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, output=True, fov=150.0), report, words)


if __name__ == "__main__":
    main()
