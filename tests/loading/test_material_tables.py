"""Tables [material.NAME] of scene files: what they replace, and what is wrong with them."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from deferred_ir.base.errors import SceneError
from deferred_ir.loading import scene_file
from deferred_ir.loading.load import load
from deferred_ir.loading.material_tables import RANGES, MaterialOverride, merge_overrides
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import BLACK, Material, Texture, TextureRef

MATT = Material("m", (0.5, 0.5, 0.5))
GLOSSY = replace(MATT, specular=1.0, metallic=0.5, roughness=0.5, metallic_roughness_texture=TextureRef(0))
SHADES = Texture("t", np.array([[[0, 51, 255], [0, 153, 0]]], np.uint8))
"""Roughness 0.2 and 0.6, metallic 1 and 0."""


def scene_with(folder: Path, tables: str, mtl: str = "newmtl red wall\nKd 1 0 0\nmap_Kd t.png\nKe 1 1 1\n") -> Scene:
    Image.new("RGBA", (2, 2), (200, 100, 50, 60)).save(folder / "t.png")
    (folder / "m.mtl").write_text(mtl + "newmtl plain\nKd 0.5 0.5 0.5\n")
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    faces = "usemtl red wall\nf 1/1 2/2 3/3\nusemtl plain\nf 1/1 3/3 4/4\n"
    (folder / "model.obj").write_text(f"mtllib m.mtl\n{square}{faces}")
    (folder / "scene.toml").write_text(f'[[model]]\npath = "model.obj"\n{tables}')
    return load(folder / "scene.toml")


def test_a_table_replaces_colour_texture_and_emission(tmp_path: Path) -> None:
    scene = scene_with(
        tmp_path, '[material."red wall"]\nbase_color = [0, 0.5, 1]\nemission = [0, 0, 0]\nior = 2\n[material.plain]\n'
    )
    found = {material.name: material for material in scene.materials}
    wall = found["red wall"]
    assert (wall.base_color, wall.base_color_texture, wall.emission, wall.ior) == ((0, 0.5, 1), None, BLACK, 2)
    assert not wall.is_glossy
    assert found["plain"] == Material("plain", (0.5, 0.5, 0.5))
    assert scene.textures == ()
    assert scene.surface_light is None


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"roughness": 0.25}, {"roughness": 0.25, "metallic": 0.0, "specular": 1.0}),
        ({"metallic": 1.0}, {"roughness": 1.0, "metallic": 1.0, "specular": 1.0}),
        ({"metallic": 1.0, "specular": 0.5}, {"roughness": 1.0, "metallic": 1.0, "specular": 0.5}),
        ({"specular": 0.5}, {"roughness": 1.0, "metallic": 0.0, "specular": 0.5}),
    ],
)
def test_a_matt_material_becomes_glossy(values: dict[str, Any], expected: dict[str, float]) -> None:
    found = MaterialOverride(**values).apply(MATT, ())
    assert {key: getattr(found, key) for key in expected} == expected


@pytest.mark.parametrize(
    ("values", "metallic", "roughness"),
    [
        ({"roughness": 0.25}, 0.25, 0.25),
        ({"metallic": 0.75}, 0.75, 0.2),
        ({"metallic": 0.0, "roughness": 0.0}, 0.0, 0.0),
    ],
)
def test_what_is_not_given_is_the_image_s_mean(values: dict[str, Any], metallic: float, roughness: float) -> None:
    found = MaterialOverride(**values).apply(GLOSSY, [SHADES])
    assert found.metallic_roughness_texture is None
    assert (found.metallic, found.roughness) == (pytest.approx(metallic), pytest.approx(roughness))
    assert MaterialOverride(specular=0.5).apply(GLOSSY, [SHADES]).metallic_roughness_texture == TextureRef(0)


def test_alpha_is_kept_where_a_table_cuts_by_it(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, '[material."red wall"]\nalpha_cutoff = 0.5\n')
    assert [texture.pixels.shape for texture in scene.textures] == [(2, 2, 4)]
    assert {material.alpha_cutoff for material in scene.materials} == {0.5, None}


def test_a_table_lights_a_dark_model(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "lights = false\n[material.plain]\nemission = [1, 2, 3]\n")
    assert {m.name: m.emission for m in scene.materials} == {"red wall": BLACK, "plain": (1, 2, 3)}


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        ("[material]\nmetallic = 1", 'material: must be a table for each material; write [material."NAME"]'),
        ("[[material]]\nmetallic = 1", "material: must be a table for each material"),
        ('[material."red wall"]\ncolour = 1', '."red wall".colour: unknown key; did you mean '),
        ("[material.plain]\nroughnes = 1", "material.plain.roughnes: unknown key; did you mean 'roughness'?"),
        ("[material.plain]\nroughness = 1.5", "material.plain.roughness: must be from 0 to 1, not 1.5"),
        ("[material.plain]\nroughness = nan", "material.plain.roughness: must be finite, not nan"),
        ("[material.plain]\nbase_color = [0, 0, 2]", "material.plain.base_color: must be from 0 to 1, not [0, 0, 2]"),
        ("[material.plain]\nemission = [-1, 0, 0]", "material.plain.emission: must be 0 or more, not [-1, 0, 0]"),
        ("[material.plain]\nemission = 3", "material.plain.emission: must be 3 numbers such as [0.0, 0.0, 0.0]"),
        ("[material.plain]\nior = 0.5", "material.plain.ior: must be 1 or more, not 0.5"),
        ('[material."red wal"]', 'material."red wal": no surface of the models has this material; did you mean \'red'),
        ("[material.x]\n[material.plane]", "material.x: no surface of the models has this material; known: plain, red"),
    ],
)
def test_faults(tmp_path: Path, tables: str, expected: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene_with(tmp_path, tables)
    assert str(caught.value).startswith(f"{tmp_path / 'scene.toml'}: ")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_keys_are_fields_of_materials() -> None:
    names = {field.name for field in fields(Material)}
    assert set(RANGES) == {field.name for field in fields(MaterialOverride)} <= names


OVERRIDES = st.builds(
    MaterialOverride,
    **{name: st.none() | st.floats(0, 1) for name in ("metallic", "roughness", "specular", "alpha_cutoff")},
    **{name: st.none() | st.tuples(*[st.floats(0, 1)] * 3) for name in ("base_color", "emission")},
)


@given(OVERRIDES, OVERRIDES, st.sampled_from([MATT, GLOSSY]))
def test_one_after_the_other_is_both_merged(first: MaterialOverride, second: MaterialOverride, on: Material) -> None:
    merged = merge_overrides({"m": first}, {"m": second})["m"]
    stepwise, at_once = second.apply(first.apply(on, [SHADES]), [SHADES]), merged.apply(on, [SHADES])
    for name in ("base_color", "metallic", "roughness", "emission", "alpha_cutoff", "metallic_roughness_texture"):
        assert getattr(stepwise, name) == getattr(at_once, name)


def test_tables_are_read_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('[[model]]\npath = "x.obj"\n[material.a]\nior = 0\nbase_color = [1, 0.5, 0]\n')
    found = scene_file.read(tmp_path / "s.toml").materials
    assert found == {"a": MaterialOverride(ior=0.0, base_color=(1.0, 0.5, 0.0))}
