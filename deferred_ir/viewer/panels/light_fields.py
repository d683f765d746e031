"""Widgets for the fields of a light, made from its class: all fields, whatever its kind."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

from deferred_ir.base.arrays import Vec3
from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.fields import COLOURS, POINTS

BRIGHTEST = 100.0
"""Upper end of a slider of strength, over the strength that the light came with."""
ANGLES = {"fov": (1.0, 179.0), "inner_fov": (0.0, 179.0), "angle": (0.0, 90.0), "rotation": (-180.0, 180.0)}
"""Fields in degrees, and the range of their sliders."""
STEP = 0.002
"""Diagonals of the scene that a pixel of the mouse's way moves a point or changes a length."""
GROWTH = 0.01
"""Part of a number without unit that a pixel of the mouse's way changes."""


def split_strength(colour: Vec3, base: Vec3) -> tuple[Vec3, float]:
    """Return a colour whose largest channel is 1, and its strength; black has the colour of `base`."""
    strength = max(colour)
    if strength == 0:
        base = base if any(base) else (1.0, 1.0, 1.0)
        return split_strength(base, base)[0], 0.0
    red, green, blue = (channel / strength for channel in colour)
    return (red, green, blue), strength


def name_field(name: str) -> str:
    """Return the label of a field."""
    return name.replace("_", " ").replace("fov", "FOV")


def draw_strong_colour(imgui: Any, name: str, value: Vec3, base: Vec3) -> Vec3 | None:
    """Draw a colour whose channels have no upper bound: their ratio, and the largest. Returns a new one, or None.

    base: the colour that it came with, which the slider's range is taken from.
    """
    label = name_field(name)
    colour, strength = split_strength(value, base)
    flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.no_alpha
    picked, new = imgui.color_edit3(f"colour##{name}", list(colour), flags)
    imgui.set_item_tooltip(f"linear RGB of the {label}, over its largest channel")
    most = BRIGHTEST * (max(base) or 1.0)
    moved, power = imgui.slider_float(label, strength, 0.0, most, "%.4g", imgui.SliderFlags_.logarithmic)
    imgui.set_item_tooltip("The largest channel. Ctrl and click to type a number.")
    if picked and any(new):
        colour = split_strength((new[0], new[1], new[2]), base)[0]
    if not (picked or moved):
        return None
    return colour[0] * power, colour[1] * power, colour[2] * power


class LightFields:
    """Draws a row a field. Returns the edits that the user makes instead of making them."""

    def __init__(self, imgui: Any) -> None:
        self._imgui = imgui

    def draw(self, light: Any, origin: Any, diagonal: float) -> tuple[str, Any] | None:
        """Draw all fields of a light. Returns the name of the one that was touched and its new value, None if none was.

        origin: the light as it came into the list; diagonal: of the scene.
        """
        edit = None
        for one in fields(light):
            if one.name != "motion":
                value = self._draw_field(one.name, getattr(light, one.name), getattr(origin, one.name), diagonal)
                edit = edit if value is None else (one.name, value)
        return edit

    def _draw_field(self, name: str, value: Any, base: Any, diagonal: float) -> Any:
        """Draw one field. Returns its new value, None if it was not touched."""
        if name in COLOURS:
            return self._draw_colour(name, value, base)
        if name in POINTS:
            return self._draw_point(name, value, 1.0 if name == "up" else diagonal)
        if isinstance(value, tuple):
            return self._draw_lengths(name, value, diagonal)
        return self._draw_number(name, value, diagonal) if isinstance(value, float) else self._draw_image(name, value)

    def _draw_colour(self, name: str, value: Vec3 | None, base: Vec3 | None) -> Vec3 | None:
        imgui, label = self._imgui, name_field(name)
        if value is None:
            return (1.0, 1.0, 1.0) if imgui.button(f"constant {label}") else None
        return draw_strong_colour(imgui, name, value, base or (1.0, 1.0, 1.0))

    def _draw_point(self, name: str, value: Vec3, diagonal: float) -> Vec3 | None:
        touched, new = self._imgui.drag_float3(name_field(name), list(value), STEP * diagonal, 0.0, 0.0, "%.4g")
        return (new[0], new[1], new[2]) if touched else None

    def _draw_lengths(self, name: str, value: tuple[float, float], diagonal: float) -> tuple[float, float] | None:
        touched, new = self._imgui.drag_float2(name_field(name), list(value), STEP * diagonal, 0.0, math.inf, "%.4g")
        return (new[0], new[1]) if touched else None

    def _draw_number(self, name: str, value: float, diagonal: float) -> float | None:
        imgui, label = self._imgui, name_field(name)
        if name in ANGLES:
            touched, new = imgui.slider_float(label, value, *ANGLES[name], "%.1f degrees")
        else:
            speed = STEP * diagonal if name == "radius" else GROWTH * max(abs(value), GROWTH)
            touched, new = imgui.drag_float(label, value, speed, 0.0, 0.0, "%.4g")
        return float(new) if touched else None

    def _draw_image(self, name: str, value: EnvironmentImage | None) -> Path | None:
        imgui = self._imgui
        shown = value.name if value else ""
        entered, new = imgui.input_text(name_field(name), shown, imgui.InputTextFlags_.enter_returns_true)
        imgui.set_item_tooltip("A file of latitude and longitude: .hdr, .exr or .png. Return reads it.")
        return Path(new) if entered and new else None
