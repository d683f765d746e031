"""Widgets for parameters, built from their declarations (params.specs): range, choices and tooltip."""

from __future__ import annotations

from typing import Any

from deferred_ir.graph.params import Spec

WIDE = 100.0
"""A range whose ends differ by more than this factor gets a logarithmic slider."""


def draw_widget(imgui: Any, label: str, spec: Spec, value: Any) -> Any:
    """Draw the widget of one parameter. Returns its new value, None if it was not touched or does not fit."""
    touched, new = False, value
    if spec.number is bool:
        touched, new = imgui.checkbox(label, value)
    elif spec.number is None:
        touched, new = _draw_choice(imgui, label, spec, value)
    else:
        chosen = isinstance(value, str)
        for choice in spec.choices:
            pressed, on = imgui.checkbox(f"{choice}##{label}", value == choice)
            imgui.set_item_tooltip(spec.doc)
            imgui.same_line()
            if pressed:
                touched, new = True, choice if on else _pick_number(spec)
        if chosen:
            imgui.text_disabled(label)
        else:
            moved, number = _draw_number(imgui, label, spec, value)
            touched, new = (True, number) if moved else (touched, new)
    imgui.set_item_tooltip(f"{spec.doc}\n{spec.wants()}; default {spec.default}")
    return new if touched and new != value and spec.fault(new) is None else None


def _draw_choice(imgui: Any, label: str, spec: Spec, value: str) -> tuple[bool, str]:
    touched, index = imgui.combo(label, spec.choices.index(value), list(spec.choices))
    return touched, spec.choices[index]


def _draw_number(imgui: Any, label: str, spec: Spec, value: float) -> tuple[bool, float]:
    flags = imgui.SliderFlags_.always_clamp
    if spec.lo is None or spec.hi is None:
        return _draw_input(imgui, label, spec, value)
    if spec.hi > WIDE * max(spec.lo, 1.0):
        flags |= imgui.SliderFlags_.logarithmic
    if spec.number is int:
        touched, new = imgui.slider_int(label, value, int(spec.lo), int(spec.hi), "%d", flags)
        return touched, new
    touched, new = imgui.slider_float(label, value, spec.lo, spec.hi, "%.4g", flags)
    return touched, new


def _draw_input(imgui: Any, label: str, spec: Spec, value: float) -> tuple[bool, float]:
    if spec.number is int:
        touched, new = imgui.input_int(label, value)
    else:
        touched, new = imgui.input_float(label, value)
    return touched, new


def _pick_number(spec: Spec) -> float:
    """Return a number to begin with where a choice such as `auto` is turned off."""
    lo = spec.lo if spec.lo is not None else 0.0
    hi = spec.hi if spec.hi is not None else max(lo, 0.0)
    number = min(max(0.0, lo), hi)
    return int(number) if spec.number is int else number
