"""The list of materials, and sliders for the values of the selected one."""

from __future__ import annotations

from typing import Any

from deferred_ir.base.arrays import Vec3
from deferred_ir.scene.surfaces.materials import Material
from deferred_ir.viewer.panels.light_fields import draw_strong_colour, name_field
from deferred_ir.viewer.session import Session

ROWS = 6
"""Materials that the list shows before it scrolls."""
SLIDERS = {"metallic": 1.0, "roughness": 1.0, "specular": 1.0, "ior": 3.0, "alpha_cutoff": 1.0, "normal_scale": 4.0}
"""Upper ends of sliders; the lower end is 0, and 1 for ior."""


class MaterialsPanel:
    """Draws the list and the widgets of the selected material."""

    def __init__(self, imgui: Any, session: Session) -> None:
        self._imgui, self._session = imgui, session

    def draw(self) -> None:
        """Draw the whole part."""
        imgui, materials = self._imgui, self._session.materials
        self._draw_list()
        imgui.push_id(materials.names[materials.selected])
        edit = self._draw_fields(materials.material, materials.loaded)
        imgui.pop_id()
        if edit:
            materials.edit(*edit)
        imgui.begin_disabled(materials.names[materials.selected] not in materials.overrides)
        if imgui.button("as loaded"):
            materials.reset()
        imgui.end_disabled()

    def _draw_list(self) -> None:
        """Draw a row a name; those that are changed have a star."""
        imgui, materials = self._imgui, self._session.materials
        rows = min(len(materials.names), ROWS)
        imgui.begin_child("list", imgui.ImVec2(0, rows * imgui.get_frame_height_with_spacing()))
        clipper = imgui.ListClipper()
        clipper.begin(len(materials.names))
        while clipper.step():
            for number in range(clipper.display_start, clipper.display_end):
                name = materials.names[number]
                star = " *" if name in materials.overrides else ""
                if imgui.selectable(f"{name}{star}##{number}", number == materials.selected)[0]:
                    materials.selected = number
        imgui.end_child()

    def _draw_fields(self, material: Material, loaded: Material) -> tuple[str, Any] | None:
        """Draw all widgets. Returns the field that was touched and its new value, None if none was."""
        edit: tuple[str, Any] | None = None
        if (colour := self._draw_base_color(material)) is not None:
            edit = "base_color", colour
        for name, most in SLIDERS.items():
            if name == "alpha_cutoff" and not material.is_cut:
                continue
            if name == "normal_scale" and material.normal_texture is None:
                continue
            least = 1.0 if name == "ior" else 0.0
            flags = self._imgui.SliderFlags_.always_clamp
            touched, new = self._imgui.slider_float(
                name_field(name), getattr(material, name) or 0.0, least, most, "%.3g", flags
            )
            if name in ("metallic", "roughness") and material.metallic_roughness_texture is not None:
                self._imgui.set_item_tooltip("times an image, which a new value takes the place of")
            edit = (name, new) if touched else edit
        glow = draw_strong_colour(self._imgui, "emission", material.emission, loaded.emission)
        return edit if glow is None else ("emission", glow)

    def _draw_base_color(self, material: Material) -> Vec3 | None:
        imgui = self._imgui
        flags = imgui.ColorEditFlags_.float | imgui.ColorEditFlags_.no_alpha
        picked, new = imgui.color_edit3("base colour", list(material.base_color), flags)
        image = ", times an image, which a new colour takes the place of" if material.base_color_texture else ""
        imgui.set_item_tooltip(f"linear RGB{image}")
        red, green, blue = (min(max(float(channel), 0.0), 1.0) for channel in new)
        return (red, green, blue) if picked else None
