"""The plot of a sweep: error against frame time."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from deferred_ir.profiling.sweep.equal_error import Rung
from deferred_ir.profiling.sweep.groups import Group
from deferred_ir.truth.reference_noise import ReferenceNoise

NEAR = 30
"""The reference's noise is drawn unless the least error is more than so many times as large."""


def draw_svg(groups: Sequence[Group], title: str, peers: Sequence[Rung], noise: ReferenceNoise) -> str:
    """Draw relMSE over frame time, log-log: means with the span over the seeds, and the Pareto front. Returns SVG.

    peers: drawn with squares; with peers all errors have to be masked, those of `groups` as well. Graphs that retain
    samples are drawn hollow. noise: of the reference, a grey band up to twice of it.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(7, 4.6), layout="constrained")
    FigureCanvasSVG(figure)
    panel = figure.add_subplot()
    for graph in dict.fromkeys(group.graph for group in groups):
        line = sorted((group for group in groups if group.graph == graph), key=lambda group: group.vpls)
        points = [(group.frame_ms, group.vpls, group) for group in line]
        if any(group.retains_samples for group in line):
            _draw_line(panel, f"{graph} (retains samples)", points, fmt="o-.", lw=1, size=8, mfc="white")
        else:
            _draw_line(panel, graph, points, fmt="o-", lw=1.5, size=8)
    for peer in dict.fromkeys(rung.peer for rung in peers):
        ladder = [(rung.ms, rung.spp, rung) for rung in peers if rung.peer == peer]
        _draw_line(panel, peer, ladder, fmt="s--", lw=1, size=6)
    front = sorted((group for group in groups if group.pareto), key=lambda group: group.frame_ms)
    style: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": ":", "marker": "o", "mfc": "none", "ms": 10}
    panel.plot([group.frame_ms for group in front], [group.relmse for group in front], label="Pareto front", **style)
    least = min([*(group.relmse for group in groups), *(rung.relmse for rung in peers)])
    if noise.relmse and least < NEAR * noise.relmse:
        panel.axhspan(noise.relmse / 2, 2 * noise.relmse, color="grey", alpha=0.15, lw=0, label="the reference's noise")
        panel.axhline(noise.relmse, color="grey", lw=0.8)
    panel.margins(0.08)
    panel.set_xscale("log")
    panel.set_yscale("log")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    panel.set_xlabel("frame time [ms]")
    panel.set_ylabel(f"relMSE (trimmed{', no edge pixels' if peers else ''})")
    panel.set_title(f"{title}: error against run time, numbers are VPLs{', of peers paths' if peers else ''}")
    panel.grid(alpha=0.3, which="both")
    panel.legend(fontsize=8)
    out = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "profile"}):  # so that the same figures give the same file
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return out.getvalue()


def _draw_line(
    panel: Any,
    label: str,
    points: Sequence[tuple[float, int, Group | Rung]],
    *,
    fmt: str,
    lw: float,
    size: int,
    mfc: str | None = None,
) -> None:
    """Draw (milliseconds, number beside the point, errors) with the span over the seeds."""
    means = [errors.relmse for *_, errors in points]
    below = [errors.relmse - errors.relmse_low for *_, errors in points]
    above = [errors.relmse_high - errors.relmse for *_, errors in points]
    style: dict[str, Any] = {"fmt": fmt, "ms": 4, "lw": lw, "mfc": mfc, "capsize": 3, "label": label}
    panel.errorbar([ms for ms, *_ in points], means, (below, above), **style)
    for ms, number, errors in points:
        panel.annotate(f"{number}", (ms, errors.relmse), (5, 4), textcoords="offset points", size=size)
