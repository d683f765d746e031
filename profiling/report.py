"""The files of a sweep: tables, a plot, a trace and a page that needs no network, all made from its points."""

from __future__ import annotations

import base64
import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from statistics import mean, median, quantiles
from typing import Any

from deferred_ir.errors import SettingError
from deferred_ir.image import write_whole
from deferred_ir.run_record import write

from . import points
from .points import Point
from .sweep_reference import SHARE

BUDGET = 50.0
"""Milliseconds for which the page gives advice."""
NOISY = "reference_noise"
SAME = 0.01
"""Relative difference of errors below which a slower choice is not on the Pareto front."""


@dataclass(frozen=True)
class Group:
    """All seeds of a graph and a number of VPLs: means, and the smallest and largest relMSE. Times in milliseconds."""

    graph: str
    vpls: int
    seeds: int
    frame_ms: float
    relmse: float
    relmse_low: float
    relmse_high: float
    flagged: bool
    pareto: bool = False


def check_libraries() -> None:
    """Raise SettingError if what the report is made with is not installed: better before the work than after it."""
    try:
        import jinja2
        import matplotlib as mpl
    except ImportError as error:
        raise SettingError(f"{error.name}: not installed; pip install 'deferred-ir[report]'") from error
    del jinja2, mpl


def write_all(folder: Path, found: Sequence[Point]) -> str:
    """Write every file of the report for these points, at least one; the sentence of advice."""
    groups = grouped(found)
    rows = [_row(point) for point in found]
    _write_csv(folder / "error_vs_time.csv", rows)
    _write_csv(folder / "passes.csv", pass_rows(found))
    first = found[0]
    about = {
        "scene": first.scene,
        "scene_hash": first.key.scene_hash,
        "size": first.key.size,
        "reference": {"hash": first.reference, "noise": first.reference_noise},
        "devices": sorted({point.device for point in found}),
        "flip_parameters": first.flip_parameters,
    }
    write(folder / "error_vs_time.json", {**about, "rows": rows, "groups": [asdict(group) for group in groups]})
    plot = svg(groups, first.scene)
    _write_text(folder / "error_vs_time.svg", plot)
    write(folder / "trace.json", trace(found))
    advice = advise(groups)
    _write_text(folder / "report.html", _page(folder, found, about, groups=groups, plot=plot, advice=advice))
    return advice


def flagged(point: Point) -> bool:
    """The reference's own noise is too large beside this error, or unknown."""
    return point.reference_noise is None or point.reference_noise > SHARE * point.relmse


def grouped(found: Iterable[Point]) -> list[Group]:
    """Points by graph and number of VPLs, those on the Pareto front marked."""
    seeds: dict[tuple[str, int], list[Point]] = {}
    for point in found:
        seeds.setdefault((point.graph, point.key.vpls), []).append(point)
    groups = []
    for (graph, vpls), many in seeds.items():
        errors = [point.relmse for point in many]
        time = round(mean(point.frame_ms for point in many), 4)
        noisy = any(flagged(point) for point in many)
        groups.append(Group(graph, vpls, len(many), time, mean(errors), min(errors), max(errors), noisy))
    return [replace(group, pareto=not any(_beats(other, group) for other in groups)) for group in groups]


def _beats(other: Group, group: Group) -> bool:
    """Faster and not worse, or as fast and better. Graphs of the same lights differ by roundings, which are no gain."""
    if other.frame_ms == group.frame_ms:
        return other.relmse < group.relmse
    return other.frame_ms < group.frame_ms and other.relmse <= (1 + SAME) * group.relmse


def advise(groups: Sequence[Group], budget: float = BUDGET) -> str:
    """Which graph and how many VPLs to take for `budget` milliseconds, in a sentence."""
    within = [group for group in groups if group.frame_ms <= budget]
    if within:
        least = min(group.relmse for group in within)
        # Of choices as good as each other, rounding aside, the fastest.
        best = min((g for g in within if g.relmse <= least * (1 + SAME)), key=lambda group: group.frame_ms)
        start = f"For {budget:g} ms: "
    else:
        best = min(groups, key=lambda group: group.frame_ms)
        start = f"Nothing here takes {budget:g} ms or less; the fastest: "
    doubt = "; the noise of the reference is not small beside that" if best.flagged else ""
    return f"{start}{best.graph}, {best.vpls} VPLs, relMSE {best.relmse:.2g} in {best.frame_ms:.3g} ms{doubt}."


def _row(point: Point) -> dict[str, Any]:
    return {
        "graph": point.graph,
        "vpls": point.key.vpls,
        "seed": point.key.seed,
        "frame_ms": point.frame_ms,
        "relmse": point.relmse,
        "relmse_untrimmed": point.relmse_untrimmed,
        "bias": point.bias,
        "flip": point.flip,
        "memory": sum(point.memory.values()),
        "flagged": NOISY if flagged(point) else "",
        "vpls_alive": point.vpls_alive,
        "scene_hash": point.key.scene_hash,
        "graph_hash": point.key.graph_hash,
        "device": point.device,
    }


def pass_rows(found: Iterable[Point]) -> list[dict[str, Any]]:
    """Quartiles of each pass over frames and seeds, of their sum in a frame, and of the wall time of whole frames."""
    times: dict[tuple[str, int], dict[str, list[tuple[float, float]]]] = {}
    walls: dict[tuple[str, int], list[float]] = {}
    for point in found:
        group = point.graph, point.key.vpls
        walls.setdefault(group, []).extend(point.frames)
        passes = times.setdefault(group, {})
        for laps in point.laps:
            for name, gpu, cpu in laps:
                passes.setdefault(name, []).append((gpu, cpu))
            whole = sum(gpu for _, gpu, _ in laps), sum(cpu for _, _, cpu in laps)
            passes.setdefault("(sum)", []).append(whole)
    rows = []
    for (graph, vpls), passes in times.items():
        order = sorted(passes, key=lambda name: name == "(sum)")
        columns = {name: _quartiles("gpu_ms", [gpu for gpu, _ in passes[name]]) for name in order}
        for name in order:
            columns[name] |= _quartiles("cpu_ms", [cpu for _, cpu in passes[name]])
            rows.append({"graph": graph, "vpls": vpls, "pass": name, **columns[name]})
        no_gpu = dict.fromkeys(name for name in columns["(sum)"] if name.startswith("gpu_ms"))
        wall = _quartiles("cpu_ms", walls[graph, vpls])
        rows.append({"graph": graph, "vpls": vpls, "pass": "(frame)", **no_gpu, **wall})
    return rows


def _quartiles(name: str, values: Sequence[float]) -> dict[str, float]:
    low, _, high = quantiles(values, n=4, method="inclusive") if len(values) > 1 else [*values] * 3
    return {f"{name}_q1": round(low, 4), f"{name}_median": round(median(values), 4), f"{name}_q3": round(high, 4)}


def trace(found: Sequence[Point]) -> dict[str, Any]:
    """Chrome trace events: of each graph one frame, that of the first seed with the most VPLs; CPU and GPU tracks."""
    events: list[dict[str, Any]] = []
    best = {point.graph: point for point in sorted(found, key=lambda point: (point.key.vpls, -point.key.seed))}
    for process, (graph, point) in enumerate(best.items(), start=1):
        middle = min(range(len(point.frames)), key=lambda i: abs(point.frames[i] - point.frame_ms))
        title = f"{graph}, {point.key.vpls} VPLs"
        events.append({"ph": "M", "pid": process, "tid": 0, "name": "process_name", "args": {"name": title}})
        laps = point.laps[middle]
        tracks = {"GPU": [(name, gpu) for name, gpu, _ in laps], "CPU": [(name, cpu) for name, _, cpu in laps]}
        for thread, (track, spans) in enumerate(tracks.items(), start=1):
            events.append({"ph": "M", "pid": process, "tid": thread, "name": "thread_name", "args": {"name": track}})
            start = 0.0
            for label, ms in spans:
                when = {"ts": round(1e3 * start, 1), "dur": round(1e3 * ms, 1)}
                events.append({"ph": "X", "pid": process, "tid": thread, "name": label, "cat": "pass", **when})
                start += ms
    return {"traceEvents": events, "displayTimeUnit": "ms"}


def svg(groups: Sequence[Group], title: str) -> str:
    """relMSE over frame time, log-log: means with the span over the seeds, the Pareto front ringed and joined."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

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
    front = sorted((group for group in groups if group.pareto), key=lambda group: group.frame_ms)
    style: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": ":", "marker": "o", "mfc": "none", "ms": 10}
    panel.plot([group.frame_ms for group in front], [group.relmse for group in front], label="Pareto front", **style)
    panel.margins(0.08)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("frame time [ms]")
    panel.set_ylabel("relMSE (trimmed)")
    panel.set_title(f"{title}: error against run time, numbers are VPLs")
    panel.grid(alpha=0.3, which="both")
    panel.legend(fontsize=8)
    out = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "profile"}):  # the same figures give the same file
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return out.getvalue()


def _page(
    folder: Path, found: Sequence[Point], about: Mapping[str, Any], *, groups: Sequence[Group], plot: str, advice: str
) -> str:
    import jinja2

    source = files("deferred_ir.profiling").joinpath("report.html.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    left_out = {(point.graph, what): why for point in found for what, why in point.left_out.items()}
    pictured = [point for point in found if point.pictures]
    pictures = [
        {
            "title": f"{point.graph}, {point.key.vpls} VPLs",
            "relmse": point.relmse,
            "bias": point.bias,
            "images": [_data_uri(points.path(folder, point.key.name, suffix)) for suffix in points.PICTURES],
        }
        for point in pictured
    ]
    return environment.from_string(source).render(
        about=about,
        advice=advice,
        plot=plot[plot.index("<svg") :],  # without the XML header, which stands only at a file's beginning
        groups=groups,
        pictures=pictures,
        passes=pass_rows(found),
        left_out=[(graph, what, why) for (graph, what), why in left_out.items()],
        software=any(point.software for point in found),
        flip_notes=sorted({point.flip_note for point in found if point.flip_note}),
        noisy=sum(flagged(point) for point in found),
        total=len(found),
        share=SHARE,
    )


def _data_uri(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()


def _write_csv(file: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    _write_text(file, out.getvalue())


def _write_text(file: Path, text: str) -> None:
    def fill(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    write_whole(file, fill)
