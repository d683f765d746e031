"""The files of a sweep's report: tables, a plot, a trace and an HTML page that needs no network."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_json
from deferred_ir.profiling.peers.points import PeerPoint
from deferred_ir.profiling.report import tables
from deferred_ir.profiling.report.plot import draw_svg
from deferred_ir.profiling.sweep import equal_error, points
from deferred_ir.profiling.sweep.equal_error import Row, Rung
from deferred_ir.profiling.sweep.groups import BUDGET, Group, advise, group_points
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import FILE
from deferred_ir.profiling.sweep.run import Results
from deferred_ir.report.origin import Origin
from deferred_ir.truth import reference_noise
from deferred_ir.truth.reference_noise import ReferenceNoise


def check_libraries() -> None:
    """Raise SettingError if a library of the report is not installed: better before the work than after it."""
    try:
        import jinja2
        import matplotlib as mpl
    except ImportError as error:
        raise SettingError(f"{error.name}: not installed; pip install 'deferred-ir[report]'") from error
    del jinja2, mpl


@dataclass(frozen=True, eq=False)
class _Figures:
    """What the report computes from the points. compared: the groups with the errors that peers have as well."""

    groups: Sequence[Group]
    compared: Sequence[Group]
    rungs: Sequence[Rung]
    equal: Sequence[Row]
    retaining: Mapping[str, int]


def write_all(folder: Path, results: Results, budget: float = BUDGET) -> str:
    """Write every file of the report. Returns the recommendation for `budget` milliseconds a frame, one sentence."""
    measured = results.points
    figures = _compute(results)
    about = _describe(results)
    noise = _find_noise(results)
    rows = [*map(tables.row, measured), *(tables.peer_row(point, noise) for point in results.peers.points)]
    tables.write_csv(folder / "error_vs_time.csv", rows)
    tables.write_csv(folder / "passes.csv", tables.pass_rows(measured))
    data = {
        **about,
        "rows": rows,
        "groups": [_make_group_row(group) for group in figures.groups],
        "peers": [{**asdict(rung), "flagged": noise.flag(rung.relmse)} for rung in figures.rungs],
        "peer_notes": dict(results.peers.notes),
        "equal_error": [row.as_dict() for row in figures.equal],
    }
    write_json(folder / "error_vs_time.json", data)
    plot = draw_svg(figures.compared, measured[0].scene, figures.rungs, noise)
    tables.write_text(folder / "error_vs_time.svg", plot)
    write_json(folder / "trace.json", tables.trace(measured))
    advice = advise(figures.groups, measured[0].key.size, budget)
    tables.write_text(folder / "report.html", _render_page(folder, results, figures, about, plot=plot, advice=advice))
    return advice


def _find_noise(results: Results) -> ReferenceNoise:
    """Return the noise of the reference, which is the same for all points."""
    return results.points[0].reference_about.noise


def _make_group_row(group: Group) -> dict[str, Any]:
    row = asdict(group)
    del row["noise"]
    return {**row, "flagged": group.noise.flag(group.relmse)}


def _list_origins(results: Results) -> list[Origin]:
    """Return the runs that measured points, by their dates."""
    points: list[Point | PeerPoint] = [*results.points, *results.peers.points]
    return sorted(dict.fromkeys(point.origin for point in points), key=lambda origin: origin.date)


def _compute(results: Results) -> _Figures:
    groups = group_points(results.points)
    rungs = equal_error.group_rungs(results.peers.points)
    compared = group_points(results.points, masked=True) if rungs else groups
    equal = equal_error.rows(compared, rungs, _find_noise(results))
    return _Figures(groups, compared, rungs, equal, equal_error.find_retaining(groups))


def _describe(results: Results) -> dict[str, Any]:
    """Return what all points have in common."""
    first = results.points[0]
    return {
        "scene": first.scene,
        "scene_hash": first.key.scene_hash,
        "time": first.time,
        "size": first.key.size,
        "reference": {"hash": first.reference, **asdict(first.reference_about)},
        "devices": sorted({point.device for point in results.points}),
        "drivers": sorted({point.driver for point in results.points}),
        "origins": [asdict(origin) for origin in _list_origins(results)],
        "flip_parameters": first.flip_parameters,
        "left_out_by_mask": results.mask.left_out if results.mask else None,
    }


def _render_page(
    folder: Path, results: Results, figures: _Figures, about: Mapping[str, Any], *, plot: str, advice: str
) -> str:
    import jinja2

    source = files("deferred_ir.profiling.report").joinpath("report.html.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    left_out = {(point.graph, entry.what): entry for point in results.points for entry in point.left_out}
    return environment.from_string(source).render(
        about=about,
        advice=advice,
        plot=plot[plot.index("<svg") :],  # without the XML header, which may only stand at a file's beginning
        pictures=[_picture(folder, point) for point in results.points if point.pictures],
        passes=tables.pass_rows(results.points),
        left_out=[(graph, entry) for (graph, _), entry in left_out.items()],
        software=any(point.software for point in results.points),
        flip_notes=sorted({point.flip_note for point in results.points if point.flip_note}),
        noise=_find_noise(results),
        own_reference=about["reference"]["file"] == FILE,
        most_noise=reference_noise.MOST,
        total=len(results.points),
        compared=figures.compared,
        whole={(group.graph, group.vpls): group.relmse for group in figures.groups},
        rungs=figures.rungs,
        equal=figures.equal,
        retaining=figures.retaining,
        notes=results.peers.notes,
    )


def _picture(folder: Path, point: Point) -> dict[str, Any]:
    return {
        "title": f"{point.graph}, {point.key.vpls} VPLs",
        "relmse": point.relmse,
        "bias": point.bias,
        "images": [_data_uri(points.path(folder, point.key.name, suffix)) for suffix in points.PICTURES],
    }


def _data_uri(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()
