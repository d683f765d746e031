"""Saves what is on screen: PNG, EXR, and a scene file that `deferred-ir render` renders to the same pixels.

A graph that is no built-in one is written, too, whole and with the settings in it: its own file may change any time.
"""

from __future__ import annotations

from collections.abc import Mapping
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import check_folder, write_whole
from deferred_ir.graph.file import graph_names
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.params import specs
from deferred_ir.loading import scene_file
from deferred_ir.loading.scene_file import ModelEntry
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.scene.motion import CameraMotion, LissajousMotion, ModelMotion, SpotlightMotion
from deferred_ir.viewer.session import Session

GRAPH = "-graph.toml"
"""What a saved graph file's name adds to NAME."""


def save(session: Session, folder: Path) -> Path:
    """Write NAME.png, NAME.exr, NAME.toml and perhaps NAME-graph.toml into `folder`; the scene file's path.

    NAME is the scene's, with the first number that is free.

    Raises OutputError where they cannot be written.
    """
    stem = _free(folder, session.scene.name)
    target = folder / f"{stem}.toml"
    check_folder(target)
    image = session.settled()
    image.save(folder / f"{stem}.png")
    image.save(folder / f"{stem}.exr")
    if not _builtin(session.graph):
        _write(folder / f"{stem}{GRAPH}", graph_table(session.renderer.graph()))
    frames = session.accumulation.frames if session.accumulation else 1
    averaged = f" --accumulate {frames}" if frames > 1 else ""
    _write(target, table(session, stem), f"# deferred-ir render {stem}.toml -o {stem}.png{averaged}\n")
    return target


def _write(target: Path, tables: Mapping[str, Any], comment: str = "") -> None:
    import tomli_w

    text = comment + tomli_w.dumps(tables)

    def write(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    write_whole(target, write)


def _free(folder: Path, name: str) -> str:
    stems = (f"{name}-{number}" for number in range(1, 100000))
    found = next((stem for stem in stems if not any(folder.glob(f"{escape(stem)}[.-]*"))), None)
    if found is None:
        raise OutputError(f"{folder}: holds too many pictures of {name}; move some away")
    return found


def table(session: Session, stem: str) -> dict[str, Any]:
    """The scene file NAME.toml of what is on screen, as TOML's tables; stem: NAME."""
    scene, path = session.scene, session.scene.path
    entries = scene_file.read(path).models if path.suffix.lower() == ".toml" else (ModelEntry(path),)
    camera, light = session.kept_motions()
    render: dict[str, Any] = {
        "graph": session.graph if _builtin(session.graph) else f"{stem}{GRAPH}",
        "size": list(session.size),
        "seed": session.seed,
    }
    if session.settings and _builtin(session.graph):
        render["set"] = dict(session.settings)
    return {
        "name": scene.name,
        "model": [_model(entry, session.time) for entry in entries],
        "camera": _camera(camera),
        "spotlight": _spotlight(light),
        "render": render,
    }


def _builtin(graph: str) -> bool:
    return graph in graph_names()


def graph_table(graph: Graph) -> dict[str, Any]:
    """The file of a graph, as TOML's tables: all passes with their inputs, and the parameters that are not defaults."""
    passes = {}
    for node in graph.nodes.values():
        kind, defaults = type(node.work).__module__.rpartition(".")[2], node.work.Params()
        made: dict[str, Any] = {} if kind == node.name else {"type": kind}
        values = {name: getattr(node.work.params, name) for name in specs(node.work.Params)}
        made |= {name: value for name, value in values.items() if value != getattr(defaults, name)}
        if node.inputs:
            made["inputs"] = dict(node.inputs)
        passes[node.name] = made
    return {"outputs": dict(graph.outputs), "passes": passes}


def _model(entry: ModelEntry, time: float) -> dict[str, Any]:
    """With its motion if it is where that begins, else at rest where it is."""
    made: dict[str, Any] = {"path": str(entry.path.resolve()), "scale": entry.scale, "translate": list(entry.translate)}
    if entry.motion:
        begins = np.array_equal(entry.motion.matrix(time), entry.motion.matrix(0.0))
        made["motion"] = _model_motion(entry.motion if begins else entry.motion.held(time))
    return made


def _model_motion(motion: ModelMotion) -> dict[str, Any]:
    return {
        "times": list(motion.times),
        "translations": [list(p) for p in motion.translations],
        "rotations": [list(q) for q in motion.rotations],
    }


def _camera(camera: Camera) -> dict[str, Any]:
    made: dict[str, Any] = {
        "position": list(camera.position),
        "look_at": list(camera.look_at),
        "up": list(camera.up),
        "fov": camera.fov,
    }
    if camera.motion:
        made["motion"] = _path(camera.motion)
    return made


def _spotlight(light: Spotlight) -> dict[str, Any]:
    made: dict[str, Any] = {
        "position": list(light.position),
        "look_at": list(light.look_at),
        "fov": light.fov,
        "emission": list(light.emission),
        "radius": light.radius,
    }
    if light.motion:
        made["motion"] = _spotlight_motion(light.motion)
    return made


def _spotlight_motion(motion: SpotlightMotion) -> dict[str, Any]:
    if isinstance(motion, LissajousMotion):
        return {"kind": "lissajous", "amplitude": list(motion.amplitude), "speed": list(motion.speed)}
    return {"kind": "keyframes", **_path(motion)}


def _path(motion: Any) -> dict[str, Any]:
    path: CameraMotion = motion  # a spotlight's keyframes have the same shape
    return {
        "times": list(path.times),
        "positions": [list(p) for p in path.positions],
        "look_ats": [list(p) for p in path.look_ats],
    }
