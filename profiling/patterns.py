"""Error against the number of VPLs for the four sample patterns, with fitted slopes.

    python -m deferred_ir.profiling.patterns -o out/patterns cornell colors atrium

Each image is held against the limit of the same graph (same maps, same clamp) as the number of VPLs grows: the mean of
many seeds, so that only the sampling error is left. Writes patterns.json and patterns.svg; needs the extra `report`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from deferred_ir.image import write_whole
from deferred_ir.loading import load
from deferred_ir.renderer import Renderer
from deferred_ir.sampling import PATTERNS
from deferred_ir.scene import Scene

SIZE = (96, 96)
COUNTS = (16, 32, 64, 128, 256, 512)
SEEDS = 8
LIMIT_COUNT, LIMIT_SEEDS = 1024, 32


def _images(scene: Scene, pattern: str, count: int, seeds: range, bar: tqdm) -> np.ndarray:
    """Radiance of each seed, float64 (seeds, H, W, 3)."""
    images = []
    with Renderer(SIZE, set={"vpl.pattern": pattern}) as renderer:
        plan = renderer.plan(scene, count, ["radiance"])
        for seed in seeds:
            renderer.draw(scene, plan, seed=seed)
            images.append(renderer.read(plan).radiance.astype(np.float64))
            bar.update(count)
    return np.array(images)


def measure(scene: Scene) -> dict[str, Any]:
    """RMSE over the mean of the limit, for each pattern, count and seed; and the slope of its mean in log-log."""
    total = LIMIT_COUNT * LIMIT_SEEDS + len(PATTERNS) * SEEDS * sum(COUNTS)
    with tqdm(total=total, unit="vpl", desc=scene.name, disable=None) as bar:
        # Seeds of the limit are none of those that are held against it.
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
    """A log-log panel for each scene: mean over seeds, and a band from the smallest to the largest."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "patterns"  # the same figures give the same file
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(results), figsize=(4.2 * len(results), 3.8), sharey=True, squeeze=False)
    for panel, (name, result) in zip(panels[0], results.items(), strict=True):
        for pattern, data in result["patterns"].items():
            errors = np.array(data["errors"])
            label = f"{pattern}, slope {data['slope']:.2f}"
            (line,) = panel.loglog(COUNTS, errors.mean(axis=1), "o-", ms=3, label=label)
            panel.fill_between(COUNTS, errors.min(axis=1), errors.max(axis=1), color=line.get_color(), alpha=0.15, lw=0)
        panel.axhline(result["limit_noise"], color="grey", lw=0.8, ls=":")
        panel.set_title(name)
        panel.set_xlabel("VPLs")
        panel.set_xticks(COUNTS, [str(count) for count in COUNTS])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
        panel.legend(fontsize=7)
    panels[0][0].set_ylabel("RMSE / mean radiance")
    figure.tight_layout()
    write_whole(path, lambda part: figure.savefig(part, format="svg", metadata={"Date": None}))


def table(results: dict[str, Any]) -> str:
    """The mean errors as a Markdown table."""
    rows = ["| scene | pattern | " + " | ".join(map(str, COUNTS)) + " | slope |", "|---" * (len(COUNTS) + 3) + "|"]
    for name, result in results.items():
        for pattern, data in result["patterns"].items():
            means = " | ".join(f"{value:.4f}" for value in np.mean(data["errors"], axis=1))
            rows.append(f"| {name} | {pattern} | {means} | {data['slope']:.2f} |")
    return "\n".join(rows)


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    results = {(scene := load(name)).name: measure(scene) for name in arguments.scenes}
    text = json.dumps({"counts": COUNTS, "seeds": SEEDS, "size": SIZE, "scenes": results}, indent=1)

    def fill(part: Path) -> None:
        part.write_text(text + "\n", encoding="utf-8")

    write_whole(arguments.output / "patterns.json", fill)
    plot(results, arguments.output / "patterns.svg")
    print(table(results))


if __name__ == "__main__":
    main()
