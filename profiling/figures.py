"""Tables in Markdown, and plots whose files are the same for the same figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.files import write_whole


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))


def format_ms(ms: float) -> str:
    """Format a time with three digits: "77 ms", "1.65 s"."""
    return f"{ms:.3g} ms" if ms < 999.5 else f"{ms / 1e3:.3g} s"


@contextmanager
def panels(names: Iterable[str], path: Path, y_label: str = "", share_y: bool = False) -> Iterator[list[Any]]:
    """Open a row of Matplotlib axes, one for each name, and write them as SVG at the end.

    Panels with labelled lines get a grid and a legend. Needs the extra `report`.
    """
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = path.name
    import matplotlib.pyplot as plt

    titles = list(names)
    figure, axes = plt.subplots(1, len(titles), figsize=(4.2 * len(titles), 3.8), sharey=share_y, squeeze=False)
    yield list(axes[0])
    for panel, title in zip(axes[0], titles, strict=True):
        panel.set_title(title)
        if panel.get_legend_handles_labels()[0]:
            panel.grid(alpha=0.3)
            panel.legend(fontsize=7)
    axes[0][0].set_ylabel(y_label)
    figure.tight_layout()
    write_whole(path, lambda part: figure.savefig(part, format="svg", metadata={"Date": None}))
    plt.close(figure)


def picture_panels(images: dict[str, Array], white: float, path: Path) -> None:
    """Write linear images side by side as SVG, in sRGB (gamma 2.2); radiance `white` is full brightness."""
    with panels(images, path) as axes:
        for panel, image in zip(axes, images.values(), strict=True):
            panel.imshow(np.clip(image / white, 0, 1) ** (1 / 2.2), interpolation="none")
            panel.set_axis_off()
