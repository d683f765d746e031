"""Writes TOML scene files that scene_file.py reads back as they were."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from deferred_ir.base.files import write_whole
from deferred_ir.loading.light_tables import SPOTLIGHT
from deferred_ir.loading.material_tables import MaterialOverride
from deferred_ir.loading.scene_file import ModelEntry, SceneFile
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.motion import LightMotion, LissajousMotion, ModelMotion, ViewKeyframes
from deferred_ir.scene.scene import RenderDefaults


def write(path: Path, scene: SceneFile, comment: str = "") -> None:
    """Write a scene file with `comment` as its first lines. Raises OutputError.

    Paths of models and graphs are written as they are: relative ones hang on the folder of the file.
    """
    write_toml(path, make_tables(scene), comment)


def write_toml(path: Path, tables: Mapping[str, Any], comment: str = "") -> None:
    """Write a TOML file, whole or not at all. Raises OutputError."""
    import tomli_w

    lines = "".join(f"# {line}\n" for line in comment.splitlines())
    text = lines + tomli_w.dumps(tables)

    def fill(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    write_whole(path, fill)


def make_tables(scene: SceneFile) -> dict[str, Any]:
    """Build the tables of a scene file, without those that are None."""
    first = int(bool(scene.lights) and scene.lights[0].kind == SPOTLIGHT)
    tables = {
        "name": scene.name,
        "model": [_make_model(entry) for entry in scene.models],
        "camera": _make_camera(scene.camera) if scene.camera else None,
        "spotlight": _make_light(scene.lights[0]) if first else None,
        "light": [{"kind": light.kind, **_make_light(light)} for light in scene.lights[first:]] or None,
        "material": {name: _make_material(override) for name, override in scene.materials.items()} or None,
        "render": _make_render(scene.render) or None,
    }
    return {key: table for key, table in tables.items() if table is not None}


def _make_model(entry: ModelEntry) -> dict[str, Any]:
    table: dict[str, Any] = {"path": str(entry.path), "scale": entry.scale, "translate": list(entry.translate)}
    if not entry.lights:
        table["lights"] = False
    if entry.motion:
        table["motion"] = _make_model_motion(entry.motion)
    return table


def _make_model_motion(motion: ModelMotion) -> dict[str, Any]:
    return {
        "times": list(motion.times),
        "translations": [list(point) for point in motion.translations],
        "rotations": [list(quaternion) for quaternion in motion.rotations],
    }


def _make_camera(camera: Camera) -> dict[str, Any]:
    table: dict[str, Any] = {
        "position": list(camera.position),
        "look_at": list(camera.look_at),
        "up": list(camera.up),
        "fov": camera.fov,
    }
    if camera.motion:
        table["motion"] = _make_keyframes(camera.motion)
    return table


def _make_material(override: MaterialOverride) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in override.given.items()}


def _make_light(light: Light) -> dict[str, Any]:
    """Build the table of a light: the fields of its class."""
    table: dict[str, Any] = {}
    for field in fields(light):  # type: ignore[arg-type]  # every kind is a dataclass
        value = getattr(light, field.name)
        if value is None:
            continue
        if field.name == "motion":
            table["motion"] = _make_light_motion(value)
        elif isinstance(value, EnvironmentImage):
            table[field.name] = value.name
        else:
            table[field.name] = list(value) if isinstance(value, tuple) else value
    return table


def _make_light_motion(motion: LightMotion) -> dict[str, Any]:
    if isinstance(motion, LissajousMotion):
        return {"kind": "lissajous", "amplitude": list(motion.amplitude), "speed": list(motion.speed)}
    return {"kind": "keyframes", **_make_keyframes(motion)}


def _make_keyframes(path: ViewKeyframes) -> dict[str, Any]:
    aims = {"look_ats": [list(point) for point in path.look_ats]} if path.look_ats else {}
    return {"times": list(path.times), "positions": [list(point) for point in path.positions], **aims}


def _make_render(defaults: RenderDefaults) -> dict[str, Any]:
    values = {
        "graph": defaults.graph,
        "size": list(defaults.size) if defaults.size else None,
        "vpls": defaults.vpls,
        "seed": defaults.seed,
        "set": dict(defaults.set) or None,
    }
    return {key: value for key, value in values.items() if value is not None}
