"""The list of lights: add, duplicate, remove, switch off, select, and edit the fields of the selected one."""

from __future__ import annotations

from typing import Any

from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.viewer.controls import Controls
from deferred_ir.viewer.edits.lights import set_field
from deferred_ir.viewer.navigation import looks
from deferred_ir.viewer.panels.light_fields import LightFields
from deferred_ir.viewer.session import Session

ROWS = 6
"""Lights that the list shows before it scrolls."""


class LightsPanel:
    """Draws the list and the widgets of the selected light."""

    def __init__(self, imgui: Any, session: Session, controls: Controls) -> None:
        self._imgui, self._session, self._controls = imgui, session, controls
        self.fields = LightFields(imgui)

    def draw(self) -> None:
        """Draw the whole part."""
        imgui, session, lights = self._imgui, self._session, self._session.lights
        self._draw_list()
        if imgui.begin_combo("##add", "add a light"):
            for name, kind in find_kinds().items():
                if imgui.selectable(name, False)[0]:
                    self._controls.add_light(kind)
            imgui.end_combo()
        imgui.begin_disabled(not lights.entries)
        if imgui.button("duplicate"):
            self._controls.duplicate_light()
        imgui.same_line()
        if imgui.button("remove"):
            lights.remove()
        imgui.end_disabled()
        if lights.entries:
            entry = lights.entries[lights.selected]
            imgui.push_id(entry.key)
            edit = self.fields.draw(entry.light, entry.origin, session.scene.geometry.diagonal)
            imgui.pop_id()
            if edit:
                lights.edit(lambda light: set_field(light, *edit))
        if imgui.button("light to camera (L)"):
            self._controls.move_light_to_camera()
        imgui.same_line()
        imgui.begin_disabled(not looks(session.light))
        touched, session.from_light = imgui.checkbox("see from the light (V)", session.from_light)
        imgui.end_disabled()
        if touched:
            session.invalidate()
        switches = self._controls.switches
        _, switches["outlines"] = imgui.checkbox("lights as outlines (G)", switches["outlines"])
        imgui.same_line()
        _, switches["frames"] = imgui.checkbox("VPLs as axes (F)", switches["frames"])

    def _draw_list(self) -> None:
        """Draw a row a light: whether it is on, and its kind."""
        imgui, lights = self._imgui, self._session.lights
        rows = min(max(len(lights.entries), 1), ROWS)
        imgui.begin_child("list", imgui.ImVec2(0, rows * imgui.get_frame_height_with_spacing()))
        clipper = imgui.ListClipper()
        clipper.begin(len(lights.entries))
        while clipper.step():
            for number in range(clipper.display_start, clipper.display_end):
                entry = lights.entries[number]
                imgui.push_id(entry.key)
                if imgui.checkbox("##on", entry.on)[0]:
                    lights.switch(number)
                imgui.set_item_tooltip("On or off (O)")
                imgui.same_line()
                if imgui.selectable(f"{number + 1} {entry.light.kind}", number == lights.selected)[0]:
                    lights.select(number)
                imgui.pop_id()
        imgui.end_child()
