"""Check the error that `render --error` tells against traced references: the images' true relMSE, over seeds.

    python -m deferred_ir.profiling.checks.error_estimates cornell colors atrium --targets 0.03,0.01,0.003 --seeds 10

The noise of the reference is subtracted from the true errors. A run is right if estimate and truth differ by a factor
of 1.5 at most.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from deferred_ir.base.errors import SettingError
from deferred_ir.base.progress import progress_bar, track
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import Reference, trace_reference

RIGHT = 1.5
"""Factor within which an estimate is right."""


@dataclass(frozen=True)
class Run:
    """One image of a given error. truth: its relMSE, the reference's noise taken off."""

    frames: int
    estimate: float
    truth: float

    @property
    def ratio(self) -> float:
        """Estimate over truth; infinite where the noise of the reference is all there is."""
        return self.estimate / self.truth if self.truth > 0 else float("inf")

    @property
    def right(self) -> bool:
        """Whether the estimate is."""
        return 1 / RIGHT <= self.ratio <= RIGHT


def measure(renderer: Renderer, scene: Scene, target: float, seeds: int, truth: Reference) -> list[Run]:
    """Render images of error `target`, one a seed."""
    runs = []
    for seed in track(range(seeds), f"{scene.name}, {target:g}"):
        image = renderer.render(scene, seed=seed, error=target)
        found = relmse(image.radiance, truth.radiance, truth.hit)[0] - float(truth.meta["noise"])
        runs.append(Run(image.frames, image.error_estimate or 0.0, found))
    return runs


def make_row(scene: Scene, target: float, runs: Sequence[Run]) -> list[str]:
    """Return the cells of a table's row: medians, and the range of the ratios."""
    ratios = [one.ratio for one in runs]
    return [
        scene.name,
        f"{target:g}",
        f"{median(one.frames for one in runs):g}",
        f"{median(one.estimate for one in runs):.5f}",
        f"{median(one.truth for one in runs):.5f}",
        f"{median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
        f"{sum(one.right for one in runs)} of {len(runs)}",
    ]


def report(chosen: argparse.Namespace) -> None:
    """Print a Markdown table, a row for each scene and target."""
    rows = []
    with Renderer(chosen.size, device=chosen.device) as renderer:
        for name in chosen.scenes:
            scene = load(name)
            with progress_bar(f"reference of {scene.name}") as bar:
                truth = trace_reference(scene, chosen.size, spp=chosen.spp, progress=bar.show)
            for target in chosen.targets:
                rows.append(make_row(scene, target, measure(renderer, scene, target, chosen.seeds, truth)))
    heads = ["scene", "asked for", "frames", "estimate", "truth", "estimate / truth", f"within {RIGHT:g}"]
    print(markdown(heads, rows))


def _parse_targets(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise SettingError(f"--targets {text}: wants numbers, such as 0.03,0.01") from None


def main(words: Sequence[str] | None = None) -> None:
    """Run the check."""
    parser = command_line(__doc__, size=(128, 128), spp=2048, seeds=10, device="auto")
    parser.add_argument("--targets", default=[0.03, 0.01, 0.003], type=_parse_targets, metavar="A,B", help="relMSEs")
    run(parser, report, words)


if __name__ == "__main__":
    main()
