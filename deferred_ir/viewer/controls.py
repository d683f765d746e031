"""Keys and mouse: what they do, stated once in `KEYS` for the code and for the help in the panel."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.gl.window import Window
from deferred_ir.scene.camera import Camera
from deferred_ir.viewer.navigation import as_camera, as_light, moved, turned
from deferred_ir.viewer.session import Session

SCENES = ("cornell", "atrium", "colors")
"""Keys 1, 2, 3."""
SPEED = 0.2
"""Diagonals of the scene a second."""
SLOWEST = 0.1
"""Seconds that a slow frame counts at most, so that a step is never a leap."""
TURN = 0.005
"""Radians a pixel of the mouse's way."""

HELP = (
    ("1 2 3", "scenes: " + ", ".join(SCENES)),
    ("W A S D, Q E", "fly; down and up"),
    ("left mouse button", "look around"),
    ("wheel", "forward and back"),
    ("arrows, page up/down", "move the light, as the camera sees it"),
    ("right mouse button", "the same; with Shift it turns the light"),
    ("L", "put the light at the camera"),
    ("V", "see from the light; what flies now is the light"),
    ("F", "draw light and VPLs as local frames"),
    ("M", "the shadow map in the corner"),
    ("P", "play motions"),
    ("Space", "progressive: average frames where nothing moves"),
    ("Tab", "hide or show the panel"),
    ("Ctrl S", "save picture and scene file"),
)


class Controls:
    """Takes the input of a frame. `switches` are what single keys turn on and off."""

    def __init__(self, window: Window, session: Session) -> None:
        from imgui_bundle import imgui

        self._imgui, self._window, self._session = imgui, window, session
        self.switches = {"frames": False, "map": False, "panel": True}
        self.saving = False

    def take(self) -> None:
        """Change the session as keys and mouse say."""
        io = self._imgui.get_io()
        if not io.want_text_input:
            self._keys(io)
        if not io.want_capture_mouse:
            self._mouse(io)

    def _pressed(self, key: Any) -> bool:
        return bool(self._imgui.is_key_pressed(key, repeat=False))

    def _axis(self, less: Any, more: Any) -> float:
        return float(self._imgui.is_key_down(more)) - float(self._imgui.is_key_down(less))

    def _keys(self, io: Any) -> None:
        key, session = self._imgui.Key, self._session
        for number, name in zip((key._1, key._2, key._3), SCENES, strict=True):
            if self._pressed(number):
                session.open(name)
        for letter, switch in ((key.f, "frames"), (key.m, "map"), (key.tab, "panel")):
            if self._pressed(letter):
                self.switches[switch] = not self.switches[switch]
        if io.key_ctrl:
            self.saving = self.saving or self._pressed(key.s)
            return
        if self._pressed(key.l):
            self.light_to_camera()
        if self._pressed(key.v):
            session.from_light = not session.from_light
            session.moved()
        if self._pressed(key.p):
            session.playing = not session.playing
        if self._pressed(key.space):
            session.progressive = not session.progressive
        step = SPEED * session.scene.geometry.diagonal * min(io.delta_time, SLOWEST)
        fly = self._axis(key.a, key.d), self._axis(key.q, key.e), self._axis(key.s, key.w)
        if any(fly):
            self._fly(moved(session.eye, tuple(np.multiply(fly, step))))
        push = (
            self._axis(key.left_arrow, key.right_arrow),
            self._axis(key.page_down, key.page_up),
            self._axis(key.down_arrow, key.up_arrow),
        )
        if any(push):
            self._push(tuple(np.multiply(push, step)))

    def _mouse(self, io: Any) -> None:
        session, button = self._session, self._imgui.MouseButton_
        x, y = io.mouse_delta.x, io.mouse_delta.y
        if io.mouse_wheel:
            self._fly(moved(session.eye, (0.0, 0.0, io.mouse_wheel * SPEED / 4 * session.scene.geometry.diagonal)))
        if not (x or y):
            return
        # The way to where a button goes down is no part of the drag.
        if any(self._imgui.is_mouse_clicked(one) for one in (button.left, button.right)):
            return
        if self._imgui.is_mouse_down(button.left):
            self._fly(turned(session.eye, x * TURN, -y * TURN))
        elif self._imgui.is_mouse_down(button.right) and io.key_shift:
            light = session.spotlight
            session.shine(as_light(light, turned(as_camera(light), x * TURN, -y * TURN)))
        elif self._imgui.is_mouse_down(button.right):
            height = max(self._window.size[1], 1)
            scale = session.scene.geometry.diagonal / 2 / height
            self._push((x * scale, -y * scale, 0.0))

    def _fly(self, eye: Camera) -> None:
        if self._session.from_light:
            self._session.shine(as_light(self._session.spotlight, eye))
        else:
            self._session.look(eye)

    def _push(self, step: tuple[float, ...]) -> None:
        """Move the light along the axes of the camera."""
        session = self._session
        by = np.asarray(step) @ session.camera.axes
        light = as_camera(session.spotlight)
        own = by @ light.axes.T
        session.shine(as_light(session.spotlight, moved(light, (own[0], own[1], own[2]))))

    def light_to_camera(self) -> None:
        """Put the light where the camera is."""
        self._session.shine(as_light(self._session.spotlight, self._session.camera))
