"""Reads TOML scene files into plain checked values; docs/scene-file.md says what the keys mean.

Nothing of the file is run, and no model is opened here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deferred_ir.base.arrays import Vec3
from deferred_ir.base.errors import SceneError, format_value
from deferred_ir.base.image_size import parse_size
from deferred_ir.base.toml_tables import Faults, Table, read_toml
from deferred_ir.loading.light_tables import check_view, read_keyframes, read_lights
from deferred_ir.loading.material_tables import MaterialOverride, read_materials
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.motion import CameraMotion, ModelMotion
from deferred_ir.scene.scene import RenderDefaults

NAME = re.compile(r"[^/\\%\x00-\x1f\x7f]{1,100}")


@dataclass(frozen=True)
class ModelEntry:
    """One [[model]]: its file (resolved against the scene file's folder), `scale`, then `translate`.

    lights: whether what its file says to shine does.
    """

    path: Path
    scale: float = 1.0
    translate: Vec3 = (0.0, 0.0, 0.0)
    motion: ModelMotion | None = None
    lights: bool = True


@dataclass(frozen=True)
class SceneFile:
    """The contents of a scene file; camera is None where it leaves that out. lights: a [spotlight] first.

    materials: what replaces values of the models' materials, by name.
    """

    name: str
    models: tuple[ModelEntry, ...]
    camera: Camera | None = None
    lights: tuple[Light, ...] = ()
    render: RenderDefaults = field(default_factory=RenderDefaults)
    materials: Mapping[str, MaterialOverride] = field(default_factory=dict)


def read(path: Path) -> SceneFile:
    """Read and check a scene file. Raises SceneError: one line with all faults, each with its key and the mend."""
    faults = Faults(str(path))
    data = read_toml(path, str(path), SceneError)
    root = Table(faults, "", data, ("name", "model", "camera", "spotlight", "light", "material", "render"))
    name = root.string("name")
    if name and not NAME.fullmatch(name):
        root.fault(
            "name", f"{format_value(name)}: names pictures; leave slashes, percent and control characters out of it"
        )
    models = _read_models(root, path.parent)
    camera, lights = _read_camera(root), read_lights(root, path.parent)
    render, materials = _read_render(root, path.parent), read_materials(root)
    if faults.found:
        faults.fail()
    return SceneFile(name or path.stem, models, camera, lights, render, materials)


def _read_models(root: Table, folder: Path) -> tuple[ModelEntry, ...]:
    entries = root.data.get("model")
    if not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        what = "missing" if entries is None else "must be an array of tables"
        root.fault("model", f'{what}; write [[model]] and, below it, path = "FILE"')
        return ()
    models = []
    for index, entry in enumerate(entries):
        name = "model" if len(entries) == 1 else f"model[{index}]"
        table = Table(root.faults, name, entry, ("path", "scale", "translate", "motion", "lights"))
        path = table.string("path", needed=True, mend="the model's file")
        scale = table.number("scale", 1.0)
        if scale <= 0:
            table.fault("scale", f"must be above 0, not {scale}")
        translate = table.vec3("translate", needed=False) or (0.0, 0.0, 0.0)
        lights = table.boolean("lights", default=True)
        models.append(ModelEntry(folder / (path or ""), scale, translate, _read_model_motion(table), lights))
    return tuple(models)


def _read_model_motion(model: Table) -> ModelMotion | None:
    table = model.table("motion", ("times", "translations", "rotations"))
    if table is None:
        return None
    times = table.times()
    translations = table.vec3s("translations", times)
    quaternions = table.vectors("rotations", 4, times)
    if times is None or translations is None or quaternions is None:
        return None
    rotations = []
    for index, quaternion in enumerate(quaternions):
        # Divided by the largest part first: squares of very small numbers would underflow.
        size = max(abs(part) for part in quaternion)
        if size == 0:
            table.fault(f"rotations[{index}]", "a quaternion of zeros is no rotation; none is [0, 0, 0, 1]")
            return None
        length = math.hypot(*(part / size for part in quaternion))
        x, y, z, w = (part / size / length for part in quaternion)
        rotations.append((x, y, z, w))
    return ModelMotion(times, translations, tuple(rotations))


def _read_camera(root: Table) -> Camera | None:
    table = root.table("camera", ("position", "look_at", "up", "fov", "motion"))
    if table is None:
        return None
    position, look_at = table.vec3("position"), table.vec3("look_at")
    up = table.vec3("up", needed=False) or (0.0, 1.0, 0.0)
    fov = _read_fov(table, Camera.fov)
    motion = _read_camera_motion(table, up)
    if position is None or look_at is None:
        return None
    check_view(table, "look_at", position, look_at, up)
    return Camera(position, look_at, up, fov, motion)


def _read_camera_motion(camera: Table, up: Vec3) -> CameraMotion | None:
    table = camera.table("motion", ("times", "positions", "look_ats"))
    path = read_keyframes(table) if table else None
    if table is None or path is None:
        return None
    for index, (position, look_at) in enumerate(zip(path.positions, path.look_ats, strict=True)):
        check_view(table, f"look_ats[{index}]", position, look_at, up)
    return CameraMotion(path.times, path.positions, path.look_ats)


def _read_fov(table: Table, default: float) -> float:
    fov = table.number("fov", default)
    if not 0 < fov < 180:
        table.fault("fov", f"must lie between 0 and 180 degrees, not {fov}")
        return default
    return fov


def _read_render(root: Table, folder: Path) -> RenderDefaults:
    table = root.table("render", ("graph", "size", "vpls", "seed", "set"))
    if table is None:
        return RenderDefaults()
    graph = table.string("graph")
    if graph is not None and graph.endswith(".toml"):
        graph = str(folder / graph)  # like a model's path, relative to the scene file
    size = _read_size(table)
    settings = table.data.get("set", {})
    if not isinstance(settings, dict):
        table.fault("set", f'must be a table such as {{"tonemap.exposure" = 1.0}}, not {format_value(settings)}')
        settings = {}
    for key, value in settings.items():
        _check_setting(table, key, value)
    return RenderDefaults(graph, size, table.integer("vpls"), table.integer("seed"), settings)


def _check_setting(table: Table, key: str, value: Any) -> None:
    if isinstance(value, dict):
        table.fault(f"set.{key}", f'write pass and parameter as one key in quotes: "{key}.parameter" = value')
    elif not re.fullmatch(r"[^.\s]+\.[^.\s]+", key):
        table.fault(f"set.{format_value(key)}", 'must name pass and parameter, such as "tonemap.exposure"')
    elif not isinstance(value, str | int | float) or (isinstance(value, float) and not math.isfinite(value)):
        table.fault(f"set.{key}", f"must be a string, a finite number, true or false, not {format_value(value)}")


def _read_size(table: Table) -> tuple[int, int] | None:
    value = table.data.get("size")
    if value is None:
        return None
    if isinstance(value, list) and len(value) == 2:
        whole = all(isinstance(side, int) and not isinstance(side, bool) and side > 0 for side in value)
        size = (value[0], value[1]) if whole else None
    else:
        size = parse_size(value) if isinstance(value, str) else None
    if size is None:
        table.fault("size", f'must be "512x512" or [512, 512], 1 pixel or more, not {format_value(value)}')
    return size
