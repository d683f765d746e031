"""What the measurements share: a row of panels, and files that are the same for the same figures."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deferred_ir.base.files import write_whole


def arguments(doc: str | None, output: bool = True) -> argparse.ArgumentParser:
    """A parser that takes scenes and, if it writes files, their folder; its help is the first line of `doc`."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    if output:
        parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    return parser


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))


@contextmanager
def panels(names: Iterable[str], path: Path, y_label: str = "", share_y: bool = False) -> Iterator[list[Any]]:
    """Matplotlib axes in a row, one for each name; written as SVG at the end, lines with a grid and a legend."""
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
