"""Saves what is on screen: PNG, EXR, and a scene file that `deferred-ir render` renders to the same pixels.

A graph that renews its VPLs over many frames (`incremental`) shows what earlier frames left, which no file can hold:
its scene file renders to other pixels, and says so. A graph that is not built in is written as well, whole and with the
settings in it: its own file may change any time.
"""

from __future__ import annotations

from dataclasses import replace
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import check_folder
from deferred_ir.graph.file import graph_names
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.params import specs
from deferred_ir.loading import scene_file, scene_file_writer
from deferred_ir.loading.material_tables import merge_overrides
from deferred_ir.loading.scene_file import ModelEntry, SceneFile
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import RenderDefaults
from deferred_ir.viewer.session import Session

GRAPH = "-graph.toml"
"""What a saved graph file's name adds to NAME."""


def save(session: Session, folder: Path) -> Path:
    """Write NAME.png, NAME.exr, NAME.toml and perhaps NAME-graph.toml into `folder`. Returns the scene file's path.

    NAME is the scene's, with the first number that is free. Raises OutputError.
    """
    stem = _find_free_stem(folder, session.scene.name)
    target = folder / f"{stem}.toml"
    check_folder(target)
    image = session.image()
    image.save(folder / f"{stem}.png")
    image.save(folder / f"{stem}.exr")
    if not _is_builtin(session.graph):
        scene_file_writer.write_toml(folder / f"{stem}{GRAPH}", make_graph_tables(session.renderer.graph()))
    scene_file_writer.write(target, describe_scene(session, stem), _describe_command(session, stem))
    return target


def _describe_command(session: Session, stem: str) -> str:
    """Say how to render the scene file again, and how near that comes to the picture."""
    frames = session.accumulation.frames if session.accumulation else 1
    command = f"deferred-ir render {stem}.toml -o {stem}.png"
    if frames > 1:
        return f"{command} --accumulate {frames}"
    fill = session.plan.frames_to_fill
    if fill == 1:
        return command
    return f"{command} --frames {fill}\nOther pixels than {stem}.png: its VPLs are those that earlier frames left."


def _find_free_stem(folder: Path, name: str) -> str:
    """Return NAME-1, NAME-2, ...: the first that no file in `folder` begins with."""
    stems = (f"{name}-{number}" for number in range(1, 100000))
    free = next((stem for stem in stems if not any(folder.glob(f"{escape(stem)}[.-]*"))), None)
    if free is None:
        raise OutputError(f"{folder}: holds too many pictures of {name}; move some away")
    return free


def _is_builtin(graph: str) -> bool:
    return graph in graph_names()


def describe_scene(session: Session, stem: str) -> SceneFile:
    """Return the content of the scene file NAME.toml of what is on screen; stem: NAME."""
    scene, path = session.scene, session.scene.path
    is_file = path.suffix.lower() == ".toml"
    described = scene_file.read(path) if is_file else SceneFile(path.stem, (ModelEntry(path),))
    builtin = _is_builtin(session.graph)
    render = RenderDefaults(
        graph=session.graph if builtin else f"{stem}{GRAPH}",
        size=session.size,
        seed=session.seed,
        set=session.settings if builtin else {},
    )
    models = tuple(_place_model(entry, session.time) for entry in described.models)
    materials = merge_overrides(described.materials, session.materials.overrides)
    return SceneFile(scene.name, models, _choose_camera(session), describe_lights(session), render, materials)


def _choose_camera(session: Session) -> Camera:
    """Return the view on screen, with the camera's motion if it is where that begins."""
    start = replace(session.scene.at(0.0).camera, motion=None)
    return session.scene.camera if session.eye == start else session.eye


def describe_lights(session: Session) -> tuple[Light, ...]:
    """Return the lights that are on, with their motions if they are where those begin.

    Where all are off and no surface emits, that is a black one: for a file without any light one would be chosen.
    """
    lights = tuple(_resolve_image(entry.with_motion) for entry in session.lights.entries if entry.on)
    if lights or session.shown.emits:
        return lights
    return (Spotlight(session.camera.position, session.camera.look_at, emission=(0.0, 0.0, 0.0)),)


def _resolve_image(light: Any) -> Light:
    """Return a light whose image, if it has one, has a name that holds in any folder."""
    image = getattr(light, "image", None)
    resolved: Light = replace(light, image=replace(image, name=str(Path(image.name).resolve()))) if image else light
    return resolved


def _place_model(entry: ModelEntry, time: float) -> ModelEntry:
    """Return a model with its motion if it is where the motion begins, else at rest where it is at `time`."""
    motion = entry.motion
    if motion and not np.array_equal(motion.matrix(time), motion.matrix(0.0)):
        motion = motion.freeze(time)
    return replace(entry, path=entry.path.resolve(), motion=motion)


def make_graph_tables(graph: Graph) -> dict[str, Any]:
    """Build the TOML tables of a graph file: all passes, their inputs, and the parameters that are not defaults."""
    passes = {}
    for node in graph.nodes.values():
        kind, defaults = type(node.work).__module__.rpartition(".")[2], node.work.Params()
        table: dict[str, Any] = {} if kind == node.name else {"type": kind}
        values = {name: getattr(node.work.params, name) for name in specs(node.work.Params)}
        table |= {name: value for name, value in values.items() if value != getattr(defaults, name)}
        if node.inputs:
            table["inputs"] = dict(node.inputs)
        passes[node.name] = table
    return {"outputs": dict(graph.outputs), "passes": passes}
