"""Measure the error against the number of VPLs for the four sample patterns, with fitted slopes.

    python -m deferred_ir.profiling.studies.patterns -o out/patterns cornell colors atrium

Each image is compared with the mean of many seeds of the same graph with many VPLs (same maps, same clamp), so that
only the sampling error is left. Writes patterns.json and patterns.svg; needs the extra `report`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.files import write_json
from deferred_ir.base.progress import ProgressBar, progress_bar
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown, panels
from deferred_ir.profiling.study import command_line, run
from deferred_ir.sampling.patterns import PATTERNS
from deferred_ir.scene.scene import Scene

SIZE = (96, 96)
COUNTS = (16, 32, 64, 128, 256, 512)
SEEDS = 8
LIMIT_COUNT, LIMIT_SEEDS = 1024, 32


def _images(scene: Scene, pattern: str, count: int, seeds: range, bar: ProgressBar) -> np.ndarray:
    """Render each seed. Returns radiance, float64 (seeds, H, W, 3)."""
    images = []
    with Renderer(SIZE, set={"vpl.pattern": pattern}) as renderer:
        plan = renderer.plan(scene, count, ["radiance"])
        for seed in seeds:
            renderer.draw(scene, plan, seed=seed)
            images.append(renderer.read(plan).radiance.astype(np.float64))
            bar.advance(count)
    return np.array(images)


def measure(scene: Scene) -> dict[str, Any]:
    """Return RMSE over the limit's mean for each pattern, count and seed, and the log-log slope of its mean."""
    total = LIMIT_COUNT * LIMIT_SEEDS + len(PATTERNS) * SEEDS * sum(COUNTS)
    with progress_bar(scene.name, total) as bar:
        # The limit's seeds are different from those compared with it.
        limits = _images(scene, "sobol", LIMIT_COUNT, range(1000, 1000 + LIMIT_SEEDS), bar)
        limit = limits.mean(axis=0)
        noise = np.sqrt(((limits - limit) ** 2).mean() / (LIMIT_SEEDS - 1))
        result: dict[str, Any] = {"limit_noise": float(noise / limit.mean()), "patterns": {}}
        for pattern in PATTERNS:
            errors = np.array(
                [
                    np.sqrt(((_images(scene, pattern, count, range(SEEDS), bar) - limit) ** 2).mean(axis=(1, 2, 3)))
                    for count in COUNTS
                ]
            )
            errors /= limit.mean()
            slope = np.polyfit(np.log(COUNTS), np.log(errors.mean(axis=1)), 1)[0]
            result["patterns"][pattern] = {"errors": errors.tolist(), "slope": float(slope)}
    return result


def plot(results: dict[str, Any], path: Path) -> None:
    """Draw a log-log panel for each scene: the mean over seeds, and a band from the smallest to the largest."""
    with panels(results, path, "RMSE / mean radiance", share_y=True) as axes:
        for panel, result in zip(axes, results.values(), strict=True):
            for pattern, data in result["patterns"].items():
                errors = np.array(data["errors"])
                label = f"{pattern}, slope {data['slope']:.2f}"
                (line,) = panel.loglog(COUNTS, errors.mean(axis=1), "o-", ms=3, label=label)
                low, high = errors.min(axis=1), errors.max(axis=1)
                panel.fill_between(COUNTS, low, high, color=line.get_color(), alpha=0.15, lw=0)
            panel.axhline(result["limit_noise"], color="grey", lw=0.8, ls=":")
            panel.set_xlabel("VPLs")
            panel.set_xticks(COUNTS, [str(count) for count in COUNTS])
            panel.minorticks_off()


def table(results: dict[str, Any]) -> str:
    """Return the mean errors as a Markdown table."""
    rows = [
        [name, pattern, *(f"{value:.4f}" for value in np.mean(data["errors"], axis=1)), f"{data['slope']:.2f}"]
        for name, result in results.items()
        for pattern, data in result["patterns"].items()
    ]
    return markdown(["scene", "pattern", *map(str, COUNTS), "slope"], rows)


def report(chosen: argparse.Namespace) -> None:
    """Measure each scene, write the files and print the table."""
    results = {(scene := load(name)).name: measure(scene) for name in chosen.scenes}
    write_json(chosen.output / "patterns.json", {"counts": COUNTS, "seeds": SEEDS, "size": SIZE, "scenes": results})
    plot(results, chosen.output / "patterns.svg")
    print(table(results))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, output=True), report, words)


if __name__ == "__main__":
    main()
