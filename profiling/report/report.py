"""The files of a sweep: tables, a plot, a trace and a page that needs no network, all made from its points."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_json
from deferred_ir.profiling.peers.points import Peers
from deferred_ir.profiling.report import tables
from deferred_ir.profiling.report.plot import svg
from deferred_ir.profiling.sweep import edge_mask, equal_error, points
from deferred_ir.profiling.sweep.groups import advise, flagged, grouped
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import SHARE


def check_libraries() -> None:
    """Raise SettingError if what the report is made with is not installed: better before the work than after it."""
    try:
        import jinja2
        import matplotlib as mpl
    except ImportError as error:
        raise SettingError(f"{error.name}: not installed; pip install 'deferred-ir[report]'") from error
    del jinja2, mpl


def write_all(folder: Path, found: Sequence[Point], peers: Peers) -> str:
    """Write every file of the report for these points, at least one, and what there is of peers; advice in a sentence.

    The mask of pixels that count is taken from the folder.
    """
    first = found[0]
    groups = grouped(found)
    rungs = equal_error.rungs(peers.points)
    compared = grouped(found, masked=True) if rungs else groups
    equal = equal_error.rows(compared, rungs, first.reference_noise)
    rows = [*map(tables.row, found), *map(tables.peer_row, peers.points)]
    tables.write_csv(folder / "error_vs_time.csv", rows)
    tables.write_csv(folder / "passes.csv", tables.pass_rows(found))
    mask = edge_mask.read(folder, first.key.scene_hash, (first.key.size[0], first.key.size[1]))
    about = {
        "scene": first.scene,
        "scene_hash": first.key.scene_hash,
        "time": first.time,
        "size": first.key.size,
        "reference": {"hash": first.reference, "noise": first.reference_noise},
        "devices": sorted({point.device for point in found}),
        "flip_parameters": first.flip_parameters,
        "left_out_by_mask": mask.left_out if mask else None,
    }
    told = {
        **about,
        "rows": rows,
        "groups": [asdict(group) for group in groups],
        "peers": [asdict(rung) for rung in rungs],
        "peer_notes": dict(peers.notes),
        "equal_error": [row.as_dict() for row in equal],
    }
    write_json(folder / "error_vs_time.json", told)
    plot = svg(compared, first.scene, rungs)
    tables.write_text(folder / "error_vs_time.svg", plot)
    write_json(folder / "trace.json", tables.trace(found))
    advice = advise(groups)
    figures = {"groups": groups, "rungs": rungs, "equal": equal, "notes": peers.notes}
    tables.write_text(folder / "report.html", _page(folder, found, about, plot=plot, advice=advice, figures=figures))
    return advice


def _page(
    folder: Path,
    found: Sequence[Point],
    about: Mapping[str, Any],
    *,
    plot: str,
    advice: str,
    figures: Mapping[str, Any],
) -> str:
    import jinja2

    source = files("deferred_ir.profiling.report").joinpath("report.html.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    left_out = {(point.graph, entry.what): entry for point in found for entry in point.left_out}
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
        pictures=pictures,
        passes=tables.pass_rows(found),
        left_out=[(graph, entry) for (graph, _), entry in left_out.items()],
        software=any(point.software for point in found),
        flip_notes=sorted({point.flip_note for point in found if point.flip_note}),
        noisy=sum(flagged(point) for point in found),
        total=len(found),
        share=SHARE,
        **figures,
    )


def _data_uri(file: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()
