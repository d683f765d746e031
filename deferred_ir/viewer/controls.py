"""Keys and mouse. `KEYS` is what they do, for the code, for the help in the panel and for docs/viewer.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.gl.window import Window
from deferred_ir.loading.load import builtin_scenes
from deferred_ir.scene.camera import Camera
from deferred_ir.viewer.edits.lights import make_light
from deferred_ir.viewer.navigation import as_light, looks, move, turn, turn_light
from deferred_ir.viewer.session import Session

FIRST = "cornell"
"""The scene of key 1; the other built-in ones follow by name."""
SCENES = sorted((name for name, _ in builtin_scenes()), key=lambda name: (name != FIRST, name))[:9]
SPEED = 0.2
"""Diagonals of the scene a second."""
SLOWEST = 0.1
"""Seconds that a slow frame counts at most, so that a step is never a leap."""
TURN = 0.005
"""Radians a pixel of the mouse's way."""
NOTCH = SPEED / 4
"""Diagonals of the scene a notch of the wheel."""
BESIDE = 0.05, 0.0, 0.0
"""Where a copy of a light appears: to the right, in diagonals of the scene."""

Step = tuple[float, float, float]


class Controls:
    """Takes the input of a frame. `switches` are what single keys turn on and off; saving: whether to save."""

    def __init__(self, window: Window, session: Session) -> None:
        from imgui_bundle import imgui

        self._imgui, self._window, self._session = imgui, window, session
        self.switches = {"frames": False, "outlines": False, "map": False, "panel": True}
        self.saving = False

    def take(self) -> None:
        """Change the session as keys and mouse say, unless the panel has them."""
        io = self._imgui.get_io()
        for binding in KEYS:
            captured = io.want_text_input if isinstance(binding, Press | Hold) else io.want_capture_mouse
            if not captured:
                binding.take(self, self._imgui, io)

    def toggle(self, switch: str) -> None:
        """Turn one of the switches on or off."""
        self.switches[switch] = not self.switches[switch]

    def save(self) -> None:
        """Ask for a saved picture, once the frame is drawn."""
        self.saving = True

    def open_scene(self, number: int) -> None:
        """Open a built-in scene by its number, from 0."""
        self._session.open(SCENES[number])

    def play(self) -> None:
        """Start or stop the scene's motions."""
        self._session.playing = not self._session.playing

    def average(self) -> None:
        """Start or stop averaging frames."""
        self._session.progressive = not self._session.progressive

    def swap_view(self) -> None:
        """See from the light if it looks anywhere, or from the camera again."""
        self._session.from_light = looks(self._session.light) and not self._session.from_light
        self._session.invalidate()

    def select_next(self) -> None:
        """Select the next light."""
        self._session.lights.select_next()

    def switch_light(self) -> None:
        """Switch the selected light off, or on again."""
        lights = self._session.lights
        if lights.entries:
            lights.switch(lights.selected)

    def move_light_to_camera(self) -> None:
        """Put the light where the camera is, and let it look the same way."""
        self._session.lights.edit(lambda light: as_light(light, self._session.camera))

    def add_light(self, kind: Any) -> None:
        """Add a light of a kind in front of the camera, and show where the lights are."""
        session = self._session
        way = self._measure_way()
        session.lights.add(make_light(kind, session.camera, way, session.lights.shining, session.scene.bounds))
        self.switches["outlines"] = True

    def duplicate_light(self) -> None:
        """Add a copy of the selected light beside it."""
        x, y, z = (np.asarray(self._scale(BESIDE)) @ self._session.camera.axes).tolist()
        self._session.lights.duplicate((x, y, z))

    def fly(self, diagonals: Step) -> None:
        """Move what flies by (right, up, forward) along its own axes."""
        self._see(move(self._session.eye, self._scale(diagonals)))

    def look_around(self, x: float, y: float) -> None:
        """Turn what flies by a way of the mouse, pixels."""
        self._see(turn(self._session.eye, x * TURN, -y * TURN))

    def push_light(self, diagonals: Step) -> None:
        """Move the light by (right, up, forward) along the axes of the camera."""
        x, y, z = (np.asarray(self._scale(diagonals)) @ self._session.camera.axes).tolist()
        self._session.lights.edit(lambda light: light.translate((x, y, z)))

    def drag_light(self, x: float, y: float) -> None:
        """Move the light by a way of the mouse, pixels; with Shift turn it."""
        if self._imgui.get_io().key_shift:
            self._session.lights.edit(lambda light: turn_light(light, x * TURN, -y * TURN))
        else:
            height = max(self._window.size[1], 1)
            self.push_light((x / 2 / height, -y / 2 / height, 0.0))

    def _see(self, eye: Camera) -> None:
        """Take `eye` for what flies: the camera, or the light while the picture is seen from it."""
        if self._session.sees_from_light:
            self._session.lights.edit(lambda light: as_light(light, eye))
        else:
            self._session.look(eye)

    def _measure_way(self) -> float:
        """Return how far the surface in the middle of the camera's picture is, world units; without one, a guess."""
        session = self._session
        camera, geometry = session.camera, session.scene.geometry
        if session.drawn is None:
            return geometry.diagonal / 2
        origin = np.subtract([camera.position], geometry.centre)
        found = session.renderer.tracer().closest(origin, camera.axes[2:])
        way = float(np.linalg.norm(found.position[0] - origin[0]))
        return way if found.hit[0] and way > 0 else geometry.diagonal / 2

    def _scale(self, diagonals: Step) -> Step:
        """Convert diagonals of the scene to world units."""
        x, y, z = (self._session.scene.geometry.diagonal * value for value in diagonals)
        return x, y, z


@dataclass(frozen=True)
class Press:
    """Keys that act once as they go down: `label` names them, "F", "Ctrl S" or "1 2 3".

    act: gets the number of the key in the label, from 0.
    """

    label: str
    text: str
    act: Callable[[Controls, int], None]

    def take(self, controls: Controls, imgui: Any, io: Any) -> None:
        """Act on the keys that went down for this frame."""
        names = self.label.removeprefix("Ctrl ").split()
        if io.key_ctrl != self.label.startswith("Ctrl "):
            return
        for number, name in enumerate(names):
            if imgui.is_key_pressed(_find_key(imgui, name), repeat=False):
                self.act(controls, number)


@dataclass(frozen=True)
class Hold:
    """Keys that act as long as they are down. axes: for each axis the key of its negative and of its positive way."""

    label: str
    text: str
    axes: tuple[tuple[str, str], tuple[str, str], tuple[str, str]]
    act: Callable[[Controls, Step], None]

    def take(self, controls: Controls, imgui: Any, io: Any) -> None:
        """Act by the time that the last frame took."""
        down = [[float(imgui.is_key_down(_find_key(imgui, name))) for name in pair] for pair in self.axes]
        if io.key_ctrl or all(less == more for less, more in down):
            return
        way = SPEED * min(io.delta_time, SLOWEST)
        x, y, z = (way * (more - less) for less, more in down)
        self.act(controls, (x, y, z))


@dataclass(frozen=True)
class Drag:
    """A mouse button that acts while the mouse moves."""

    label: str
    text: str
    button: str
    act: Callable[[Controls, float, float], None]

    def take(self, controls: Controls, imgui: Any, io: Any) -> None:
        """Act by the way of the mouse, but not by its way to where a button goes down."""
        x, y, buttons = io.mouse_delta.x, io.mouse_delta.y, imgui.MouseButton_
        clicked = any(imgui.is_mouse_clicked(button) for button in (buttons.left, buttons.right))
        if (x or y) and not clicked and imgui.is_mouse_down(getattr(buttons, self.button)):
            self.act(controls, x, y)


@dataclass(frozen=True)
class Wheel:
    """The mouse wheel."""

    label: str
    text: str
    act: Callable[[Controls, float], None]

    def take(self, controls: Controls, imgui: Any, io: Any) -> None:
        """Act by the notches that the wheel was turned."""
        del imgui
        if io.mouse_wheel:
            self.act(controls, io.mouse_wheel)


def _find_key(imgui: Any, name: str) -> Any:
    return getattr(imgui.Key, f"_{name}" if name.isdigit() else name.lower())


FLY = (("A", "D"), ("Q", "E"), ("S", "W"))
PUSH = (("left_arrow", "right_arrow"), ("page_down", "page_up"), ("down_arrow", "up_arrow"))
KEYS: tuple[Press | Hold | Drag | Wheel, ...] = (
    Press(
        " ".join(str(i + 1) for i in range(len(SCENES))),
        f"open a built-in scene: {', '.join(SCENES)}",
        Controls.open_scene,
    ),
    Hold("W A S D, Q E", "fly; down and up", FLY, Controls.fly),
    Wheel("wheel", "fly forward and back", lambda controls, notches: controls.fly((0.0, 0.0, notches * NOTCH))),
    Drag("left mouse button", "look around", "left", Controls.look_around),
    Hold("arrows, page up/down", "move the selected light along the camera's axes", PUSH, Controls.push_light),
    Drag("right mouse button", "move the selected light; with Shift, turn it", "right", Controls.drag_light),
    Press("L", "put the selected light at the camera", lambda controls, _: controls.move_light_to_camera()),
    Press("V", "see from the selected light, and fly it", lambda controls, _: controls.swap_view()),
    Press("N", "select the next light", lambda controls, _: controls.select_next()),
    Press("O", "switch the selected light off, or on again", lambda controls, _: controls.switch_light()),
    Press(
        "F",
        "draw VPLs as axes: x red, y green, z, where they shine, blue; dim behind surfaces",
        lambda controls, _: controls.toggle("frames"),
    ),
    Press(
        "G",
        "draw lights as outlines, the selected one white; dim behind surfaces",
        lambda controls, _: controls.toggle("outlines"),
    ),
    Press("M", "show a shadow map in the lower left corner", lambda controls, _: controls.toggle("map")),
    Press("P", "play the scene's motions", lambda controls, _: controls.play()),
    Press(
        "Space",
        "progressive: average frames with new samples while nothing moves",
        lambda controls, _: controls.average(),
    ),
    Press("Tab", "hide or show the panel", lambda controls, _: controls.toggle("panel")),
    Press("Ctrl S", "save picture and scene file", lambda controls, _: controls.save()),
)
