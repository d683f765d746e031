"""Reads the lights of a scene file: [spotlight] and [[light]]. A kind's keys are the fields of its class."""

from __future__ import annotations

from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from deferred_ir.base.arrays import Vec3
from deferred_ir.base.errors import SceneError, did_you_mean, format_value
from deferred_ir.base.toml_tables import Table
from deferred_ir.scene.camera import find_view_fault
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.fields import COLOURS, POINTS, LightError
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.motion import KeyframedLight, LightMotion, LissajousMotion, ViewKeyframes

MOTIONS = ("lissajous", "keyframes")
SPOTLIGHT = "spotlight"
"""The kind of the table [spotlight]."""
MOST_LIGHTS = 4096


def read_lights(root: Table, folder: Path) -> tuple[Light, ...]:
    """Read all lights, that of [spotlight] first. folder: the scene file's, which images are relative to."""
    found = []
    if (spotlight := root.data.get(SPOTLIGHT)) is not None:
        if isinstance(spotlight, dict):
            found.append(_read_light(root, SPOTLIGHT, spotlight, SPOTLIGHT, folder))
        else:
            root.fault(SPOTLIGHT, f"must be a table, not {format_value(spotlight)}")
    entries = root.data.get("light", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        root.fault("light", 'must be an array of tables; write [[light]] and, below it, kind = "point" and so on')
        return ()
    if len(entries) > MOST_LIGHTS:
        root.fault("light", f"{len(entries)} lights, and {MOST_LIGHTS} are the most; let surfaces emit instead")
        return ()
    kinds = find_kinds()
    for index, entry in enumerate(entries):
        name = "light" if len(entries) == 1 else f"light[{index}]"
        kind = entry.get("kind")
        if kind is None:
            root.fault(f"{name}.kind", f"missing; give one of {', '.join(kinds)}")
        elif not isinstance(kind, str) or kind not in kinds:
            hint = did_you_mean(kind, kinds) if isinstance(kind, str) else f"; known: {', '.join(kinds)}"
            root.fault(f"{name}.kind", f"unknown kind of light {format_value(kind)}{hint}")
        else:
            found.append(_read_light(root, name, {k: v for k, v in entry.items() if k != "kind"}, kind, folder))
    return tuple(light for light in found if light is not None)


def _read_light(root: Table, name: str, data: dict[str, Any], kind: str, folder: Path) -> Light | None:
    """Read one light; None after a fault."""
    make = find_kinds()[kind]
    own = {field.name: field for field in fields(make)}
    before = len(root.faults.found)
    table = Table(root.faults, name, data, tuple(own))
    values = {}
    for key, field in own.items():
        needed = field.default is MISSING or (key in COLOURS and field.default is not None)
        value = _read_motion(table, "look_at" in own) if key == "motion" else _read_value(table, key, needed, folder)
        if value is not None:
            values[key] = value
    if len(root.faults.found) > before:
        return None
    try:
        light: Light = make(**values)
        light.at(0.0)
    except LightError as error:
        for key, what in error.faults:
            table.fault(key, what)
        return None
    except SceneError as error:
        table.fault("image", str(error))
        return None
    return light


def _read_value(table: Table, key: str, needed: bool, folder: Path) -> Any:
    """Read the value of a key; None where it is missing or faulty."""
    if key in POINTS or key in COLOURS:
        return table.vec3(key, needed)
    if key == "size":
        return table.vector(key, 2, needed)
    if key == "image":
        path = table.string(key)
        return None if path is None else folder / path
    if key in table.data:
        return table.number(key, 0.0)
    if needed:
        table.fault(key, "missing; give a number")
    return None


def _read_motion(light: Table, aims: bool) -> LightMotion | None:
    """Read the motion of a light. aims: it looks at something."""
    table = light.table("motion", ("kind", "amplitude", "speed", "times", "positions", "look_ats"))
    kind = table.string("kind", needed=True, mend=f"one of {', '.join(MOTIONS)}") if table else None
    if table is None or kind is None:
        return None
    own = {"lissajous": ("amplitude", "speed"), "keyframes": ("times", "positions", "look_ats")}
    if kind not in own:
        table.fault("kind", f"unknown motion {format_value(kind)}{did_you_mean(kind, MOTIONS)}")
        return None
    for key in table.data:
        if key != "kind" and key not in own[kind] and any(key in keys for keys in own.values()):
            table.fault(key, f'does not belong to kind = "{kind}"; take it away')
    if kind == "lissajous":
        amplitude, speed = table.vec3("amplitude"), table.vector("speed", 2)
        return LissajousMotion(amplitude, (speed[0], speed[1])) if amplitude and speed else None
    if not aims:
        times = table.times()
        positions = table.vec3s("positions", times)
        if "look_ats" in table.data:
            table.fault("look_ats", "does not belong to a light that shines all around; take it away")
        return None if times is None or positions is None else KeyframedLight(times, positions)
    path = read_keyframes(table)
    if path is None:
        return None
    for index, (position, look_at) in enumerate(zip(path.positions, path.look_ats, strict=True)):
        check_view(table, f"look_ats[{index}]", position, look_at)
    return KeyframedLight(path.times, path.positions, path.look_ats)


def read_keyframes(table: Table) -> ViewKeyframes | None:
    """Read times, positions and look_ats of a camera or a light."""
    times = table.times()
    positions, look_ats = table.vec3s("positions", times), table.vec3s("look_ats", times)
    if times is None or positions is None or look_ats is None:
        return None
    return ViewKeyframes(times, positions, look_ats)


def check_view(table: Table, key: str, position: Vec3, look_at: Vec3, up: Vec3 | None = None) -> None:
    """Note a fault if the view has no direction, or `up` lies along it. key: that of look_at."""
    fault = find_view_fault(position, look_at, up)
    if fault:
        name, why = fault
        table.fault(key if "[" in key or name == "look_at" else name, why)
