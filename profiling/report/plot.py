"""The plot of a sweep: error against run time."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from deferred_ir.profiling.sweep.equal_error import Rung
from deferred_ir.profiling.sweep.groups import Group


def svg(groups: Sequence[Group], title: str, peers: Sequence[Rung] = ()) -> str:
    """relMSE over frame time, log-log: means with the span over the seeds, the Pareto front ringed and joined.

    peers: with squares, and then all errors are masked, `groups` too.
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
        means = [group.relmse for group in line]
        below = [group.relmse - group.relmse_low for group in line]
        above = [group.relmse_high - group.relmse for group in line]
        panel.errorbar([g.frame_ms for g in line], means, (below, above), fmt="o-", ms=4, capsize=3, label=graph)
        for group in line:
            panel.annotate(f"{group.vpls}", (group.frame_ms, group.relmse), (5, 4), textcoords="offset points", size=8)
    for peer in dict.fromkeys(rung.peer for rung in peers):
        ladder = [rung for rung in peers if rung.peer == peer]
        means = [rung.relmse for rung in ladder]
        below = [rung.relmse - rung.relmse_low for rung in ladder]
        above = [rung.relmse_high - rung.relmse for rung in ladder]
        panel.errorbar([r.ms for r in ladder], means, (below, above), fmt="s--", ms=4, lw=1, capsize=3, label=peer)
        for rung in ladder:
            panel.annotate(f"{rung.spp}", (rung.ms, rung.relmse), (5, 4), textcoords="offset points", size=6)
    front = sorted((group for group in groups if group.pareto), key=lambda group: group.frame_ms)
    style: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": ":", "marker": "o", "mfc": "none", "ms": 10}
    panel.plot([group.frame_ms for group in front], [group.relmse for group in front], label="Pareto front", **style)
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
    with mpl.rc_context({"svg.hashsalt": "profile"}):  # the same figures give the same file
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return out.getvalue()
