"""The tables of a sweep: a row for each point, ours and the peers', the time of each pass, and a trace."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from deferred_ir.base.files import write_whole
from deferred_ir.profiling.peers.points import PeerPoint
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.truth.reference_noise import ReferenceNoise


def row(point: Point) -> dict[str, Any]:
    """Return a row for a point of ours."""
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
        "flagged": point.reference_about.noise.flag(point.relmse),
        "vpls_alive": point.vpls_alive,
        "scene_hash": point.key.scene_hash,
        "graph_hash": point.key.graph_hash,
        "device": point.device,
        "relmse_masked": point.relmse_masked,
        "spp": None,
    }


def peer_row(point: PeerPoint, noise: ReferenceNoise) -> dict[str, Any]:
    """Return a row for a peer's point, with the same columns: its name is the graph, its version the device.

    noise: of the reference; by it the masked error is flagged.
    """
    return {
        "graph": point.key.peer,
        "vpls": None,
        "seed": point.key.seed,
        "frame_ms": point.ms,
        "relmse": point.relmse,
        "relmse_untrimmed": point.relmse_untrimmed,
        "bias": point.bias,
        "flip": None,
        "memory": None,
        "flagged": "" if point.relmse_masked is None else noise.flag(point.relmse_masked),
        "vpls_alive": None,
        "scene_hash": point.key.scene_hash,
        "graph_hash": None,
        "device": point.about,
        "relmse_masked": point.relmse_masked,
        "spp": point.key.spp,
    }


def pass_rows(points: Iterable[Point]) -> list[dict[str, Any]]:
    """Return quartiles over frames and seeds of the times of each pass, of all passes of a frame, and of the frame."""
    times: dict[tuple[str, int], dict[str, list[tuple[float, float]]]] = {}
    walls: dict[tuple[str, int], list[float]] = {}
    for point in points:
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


def trace(points: Sequence[Point]) -> dict[str, Any]:
    """Return Chrome trace events: the median frame of each graph with the most VPLs and the first seed, CPU and GPU."""
    events: list[dict[str, Any]] = []
    best = {point.graph: point for point in sorted(points, key=lambda point: (point.key.vpls, -point.key.seed))}
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


def write_csv(file: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows, at least one, with the columns of the first."""
    out = io.StringIO()
    writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(file, out.getvalue())


def write_text(file: Path, text: str) -> None:
    """Write UTF-8 whole or not at all."""

    def fill(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    write_whole(file, fill)
