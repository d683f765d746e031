"""Saves what is on screen: PNG, EXR, and a scene file that `deferred-ir render` renders to the same pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .. import scene_file
from ..camera import Camera
from ..errors import OutputError
from ..image import check_folder, write_whole
from ..lights import Spotlight
from ..motion import CameraMotion, LissajousMotion, ModelMotion, SpotlightMotion
from ..scene_file import ModelEntry
from .session import Session


def save(session: Session, folder: Path) -> Path:
    """Write NAME.png, NAME.exr and NAME.toml into `folder`, NAME the first free one; the scene file's path.

    Raises OutputError where they cannot be written.
    """
    stem = _free(folder, session.scene.name)
    target = folder / f"{stem}.toml"
    check_folder(target)
    image = session.settled()
    image.save(folder / f"{stem}.png")
    image.save(folder / f"{stem}.exr")
    text = _text(session, stem)
    write_whole(target, lambda part: _write(part, text))
    return target


def _write(part: Path, text: str) -> None:
    part.write_text(text, encoding="utf-8")


def _free(folder: Path, name: str) -> str:
    stems = (f"{name}-{number}" for number in range(1, 100000))
    found = next((stem for stem in stems if not any(folder.glob(f"{stem}.*"))), None)
    if found is None:
        raise OutputError(f"{folder}: holds too many pictures of {name}; move some away")
    return found


def _text(session: Session, stem: str) -> str:
    import tomli_w

    frames = session.accumulation.frames if session.accumulation else 1
    averaged = f" --accumulate {frames}" if frames > 1 else ""
    return f"# deferred-ir render {stem}.toml -o {stem}.png{averaged}\n{tomli_w.dumps(table(session))}"


def table(session: Session) -> dict[str, Any]:
    """The scene file of what is on screen, as TOML's tables."""
    scene, path = session.scene, session.scene.path
    entries = scene_file.read(path).models if path.suffix.lower() == ".toml" else (ModelEntry(path),)
    camera, light = session.kept_motions()
    render: dict[str, Any] = {
        "graph": _graph(session.graph),
        "size": list(session.size),
        "seed": session.seed,
    }
    if session.settings:
        render["set"] = dict(session.settings)
    return {
        "name": scene.name,
        "model": [_model(entry, session.time) for entry in entries],
        "camera": _camera(camera),
        "spotlight": _spotlight(light),
        "render": render,
    }


def _graph(graph: str) -> str:
    """A name, or a file's whole path: one beside the scene file would be looked for there."""
    return str(Path(graph).resolve()) if graph.endswith(".toml") else graph


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
