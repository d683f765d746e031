"""Materials in the viewer: the list of what is changed, its sliders, and what is saved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from virtual_display import FEW, SIZE, act, arrange, cornell, frames, middle, picture, rendered

from deferred_ir.loading.load import load
from deferred_ir.loading.material_tables import MaterialOverride
from deferred_ir.scene.surfaces.materials import Texture, TextureRef
from deferred_ir.viewer.edits.materials import MaterialList
from deferred_ir.viewer.panels import side_panel as panels
from deferred_ir.viewer.panels.side_panel import WIDTH


@pytest.fixture
def tall(viewer):
    viewer.window.resize((64 + WIDTH, 900))
    frames(viewer, 2)
    arrange(viewer, "Materials")
    yield viewer
    arrange(viewer)


def test_the_list_has_a_row_a_name_and_changes_all_of_that_name():
    scene = cornell()
    image = Texture("t", np.full((1, 1, 3), 51, np.uint8))
    double = replace(scene.materials[0], metallic_roughness_texture=TextureRef(0), metallic=0.5)
    scene = replace(scene, materials=(*scene.materials, double), textures=(image,))
    calls = []
    materials = MaterialList(lambda: calls.append(1))
    materials.use(scene)
    assert materials.shown is scene.materials
    assert materials.names == tuple(material.name for material in cornell().materials)
    materials.edit("roughness", 0.25)
    assert materials.overrides == {scene.materials[0].name: MaterialOverride(roughness=0.25)}
    assert [m.roughness for m in materials.shown] == [0.25, 1.0, 1.0, 0.25]
    assert (materials.shown[0].metallic, materials.shown[3].metallic) == (0.0, pytest.approx(0.1))
    assert materials.material.specular == 1
    assert materials.loaded == scene.materials[0]
    materials.reset()
    assert materials.shown == scene.materials
    assert len(calls) == 3


def test_a_slider_changes_the_picture_and_is_undone(tall):
    viewer, materials = tall, tall.session.materials
    before = picture(viewer)
    x, y = middle(viewer, viewer.panel.materials, "red")
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    assert materials.names[materials.selected] == "red"
    x, y = middle(viewer, viewer.panel.materials, "metallic", inside=150)
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    assert viewer.session.error == ""
    override = materials.overrides["red"]
    assert list(override.given) == ["metallic"]
    assert 0 < materials.material.metallic < 1
    after = picture(viewer)
    assert not np.array_equal(after, before)
    assert np.array_equal(after, rendered(viewer.session.shown, viewer.session.size, set=FEW))
    x, y = middle(viewer, viewer.panel.materials, "as loaded", inside=8)
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    assert materials.overrides == {}
    assert np.array_equal(picture(viewer), before)


def test_changed_materials_are_saved(viewer, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    materials = viewer.session.materials
    materials.selected = materials.names.index("white")
    for key, value in {"base_color": (0.1, 0.2, 0.9), "roughness": 0.3, "emission": (0.0, 0.5, 0.0)}.items():
        materials.edit(key, value)
    frames(viewer, 2)
    act(viewer, "key", "ctrl+s")
    assert viewer.session.error == ""
    saved = load(tmp_path / "cornell-1.toml")
    assert saved.materials == materials.shown
    assert np.array_equal(rendered(saved, SIZE, set=FEW), picture(viewer))
    viewer.session.open(str(tmp_path / "cornell-1.toml"))
    materials.selected = materials.names.index("red")
    materials.edit("ior", 2.0)
    frames(viewer, 2)
    act(viewer, "key", "ctrl+s")
    again = load(tmp_path / "cornell-2.toml")
    assert again.materials == materials.shown
    assert {m.name: (m.roughness, m.ior) for m in again.materials if m.name != "green"} == {
        "white": (0.3, 1.5),
        "red": (1.0, 2.0),
    }
