"""Reading from glTF files what trimesh alone would lose, round or skip."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import UVS, Document, load, material, png
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from deferred_ir.base.errors import SceneError
from deferred_ir.scene.surfaces.materials import TextureRef
from deferred_ir.scene.surfaces.points import SurfacePoints


@pytest.mark.parametrize("name", ["m.gltf", "m.glb"])
def test_base_colours_are_not_rounded_and_found_by_index(tmp_path: Path, name: str) -> None:
    document = Document(
        materials=[
            material([0.1234, 0.03, 0.98765, 1], name="same"),
            material([0.5, 0.25, 0.125, 1], name="same"),
            material([0.75, 0.75, 0.75, 1]),
        ]
    )
    for place, primitive in enumerate([{"material": 1}, {"material": 0}, {"material": 2}, {}]):
        document.triangle(primitive, {"translation": [10 * place, 0, 0]})
    scene = load(document.write(tmp_path / name))
    geometry = scene.geometry
    in_places = np.argsort(geometry.positions[geometry.faces[:, 0], 0])
    found = [scene.materials[index] for index in geometry.face_materials[in_places]]
    assert [item.base_color for item in found] == [(0.5, 0.25, 0.125), (0.1234, 0.03, 0.98765), (0.75,) * 3, (1.0,) * 3]
    assert [item.name for item in found[:3]] == ["same", "same", "2"]
    assert scene.notes == ()


def test_base_colour_multiplies_the_texture_and_vertex_colours(tmp_path: Path) -> None:
    base = {"baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": {"index": 0}, "metallicFactor": 0}
    document = Document(
        materials=[{"pbrMetallicRoughness": base}],
        textures=[{"source": 1}],
        images=[{"uri": "unused and missing.png"}, {"uri": png((255, 255, 0))}],
    )
    colors = np.tile(np.array([1, 0.3, 1, 0.5], np.float32), (3, 1))
    document.triangle({"material": 0}, TEXCOORD_0=document.accessor(UVS), COLOR_0=document.accessor(colors))
    scene = load(document.write(tmp_path / "m.glb"))
    found = SurfacePoints(
        scene.geometry, scene.materials, scene.textures, np.array([0]), np.full((1, 3), 1 / 3)
    ).look_up_base_color()
    assert found == pytest.approx(np.array([[0.5, 0.3, 0.0]]), abs=1e-6)
    assert scene.geometry.uvs == pytest.approx(np.array([[0, 0], [1, 0], [0, 1]]))


@pytest.mark.parametrize(
    ("dtype", "top"), [("uint8", 255), ("uint16", 65535), ("float32", 1)], ids=["uint8", "uint16", "float"]
)
@pytest.mark.parametrize("bare", [True, False])
def test_vertex_colours_are_linear(tmp_path: Path, dtype: str, top: int, bare: bool) -> None:
    document = Document(materials=[material([1, 1, 1, 1])])
    values = np.array([[0, 0.2, 1], [1, 0.4, 0], [0.6, 0.6, 0.6]])
    colors = document.accessor((values * top).astype(dtype), normalized=dtype != "float32")
    if dtype == "uint8":  # rows are padded to 4 bytes there
        values = np.concatenate([values, np.ones((3, 1))], axis=1)
        colors = document.accessor((values * top).astype(dtype), normalized=True)
    document.triangle({} if bare else {"material": 0}, COLOR_0=colors)
    scene = load(document.write(tmp_path / "m.gltf"))
    assert scene.geometry.colors == pytest.approx(values[:, :3], abs=1e-6 if dtype == "float32" else 1 / top)


def test_specular_glossiness_keeps_its_diffuse_colour(tmp_path: Path) -> None:
    glossy = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.2, 0.3, 0.4, 1]}}
    document = Document(materials=[{"extensions": glossy}], extensionsUsed=list(glossy))
    document.triangle({"material": 0})
    scene = load(document.write(tmp_path / "m.gltf"))
    assert scene.materials[0].base_color == (0.2, 0.3, 0.4)
    assert not scene.materials[0].is_glossy
    assert "not honoured: KHR_materials_pbrSpecularGlossiness" in scene.notes[0]


def test_parents_and_children_of_a_camera_keep_their_place(tmp_path: Path) -> None:
    document = Document(cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}])
    child = document.triangle(node={"translation": [0, 0, 3], "name": "child"})
    document.json["nodes"].append({"camera": 0, "translation": [0, 5, 0], "children": [child]})
    document.json["nodes"].append({"scale": [2, 2, 2], "children": [1]})
    document.json["scenes"] = [{"nodes": [2]}]
    scene = load(document.write(tmp_path / "m.glb"))
    assert scene.geometry.bounds == pytest.approx(np.array([[0, 10, 6], [2, 12, 6]]))
    assert "m.glb: its lights and cameras are ignored" in scene.notes


def test_nodes_without_a_scene_are_drawn(tmp_path: Path) -> None:
    document = Document()
    document.triangle()
    del document.json["scenes"]
    assert len(load(document.write(tmp_path / "m.gltf")).geometry.faces) == 1


def test_strips_and_plain_vertices(tmp_path: Path) -> None:
    document = Document()
    document.triangle({"mode": 5, "indices": document.accessor(np.array([0, 1, 2, 1], np.uint16))})
    document.triangle({"mode": 1})
    scene = load(document.write(tmp_path / "m.glb"))
    assert len(scene.geometry.faces) == 2
    assert "m.glb: points, lines and triangle fans are left out" in scene.notes


def test_what_is_not_honoured_is_noted(tmp_path: Path) -> None:
    coat = {"specularTexture": {"index": 0}}
    document = Document(
        materials=[{"alphaMode": "BLEND", "extensions": {"KHR_materials_specular": coat}}],
        textures=[{"source": 0}],
        images=[{"uri": png((255, 0, 0))}],
        extensionsUsed=[
            *("KHR_materials_transmission", "KHR_materials_clearcoat", "KHR_materials_specular"),
            *("KHR_texture_transform", "KHR_materials_unlit", "KHR_lights_punctual", "EXT_texture_webp"),
        ],
        animations=[{"channels": [], "samplers": []}],
    )
    document.triangle({"material": 0}, TEXCOORD_0=document.accessor(UVS))
    assert load(document.write(tmp_path / "m.gltf")).notes == (
        "m.gltf: not honoured: KHR_materials_clearcoat, KHR_materials_transmission, textures of KHR_materials_specular",
        "m.gltf: its lights and cameras are ignored",
        "m.gltf: transparent surfaces are cut out where they cover less than 0.5",
        "m.gltf: animations and skins are ignored",
    )


def test_images_next_to_the_file(tmp_path: Path) -> None:
    document = Document(
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"uri": "a%20b.png"}],
    )
    document.triangle({"material": 0}, TEXCOORD_0=document.accessor(UVS))
    path = document.write(tmp_path / "m.gltf")
    with pytest.raises(SceneError, match=r"m\.gltf: material 0: image a%20b\.png is missing or not readable"):
        load(path)
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "a b.png")
    assert len(load(path).textures) == 1
    (tmp_path / "a b.png").write_bytes(b"no image")
    with pytest.raises(SceneError, match=r"image a%20b\.png is missing or not readable"):
        load(path)


def test_one_image_of_two_materials_is_one_texture(tmp_path: Path) -> None:
    base = {"baseColorTexture": {"index": 0}}
    document = Document(
        materials=[{"pbrMetallicRoughness": base}, {"pbrMetallicRoughness": base | {"baseColorFactor": [1, 0, 0, 1]}}],
        textures=[{"source": 0}],
        images=[{"uri": png((255, 0, 0))}],
    )
    for index in (0, 1):
        document.triangle({"material": index}, TEXCOORD_0=document.accessor(UVS))
    scene = load(document.write(tmp_path / "m.glb"))
    assert len(scene.textures) == 1
    assert [item.base_color_texture for item in scene.materials] == [TextureRef(0)] * 2


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "compressed with KHR_draco_mesh_compression; export"),
        ({"accessors": [{"count": 3, "componentType": 5126, "type": "VEC3"}]}, "sparse or compressed accessors"),
        ({"materials": [material([-1, 0, 0, 1])]}, "material 0: reflectance"),
        ({"materials": [material([1, 1])]}, "malformed glTF (ValueError: baseColorFactor has fewer"),
        ({"materials": 3}, "malformed glTF"),
        ({"nodes": [3]}, "malformed glTF"),
        ({"meshes": [{}]}, "malformed glTF (KeyError: 'primitives')"),
        ({"scenes": [{"nodes": [7]}]}, "scenes[0].nodes: 7 is none of the 1 that there are; export it again"),
        ({"asset": {"version": "1.0"}}, "only GLTF 2 is supported"),
        ({"scenes": [{"nodes": []}]}, "no triangles"),
    ],
)
def test_broken_documents(tmp_path: Path, change: dict[str, Any], expected: str) -> None:
    document = Document(materials=[material([1, 1, 1, 1])])
    document.triangle({"material": 0})
    document.json |= change
    path = document.write(tmp_path / "m.gltf")
    with pytest.raises(SceneError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("dtype", "top"), [("uint8", 255), ("uint16", 65535)])
def test_texture_coordinates_in_integers(tmp_path: Path, dtype: str, top: int) -> None:
    document = Document(
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        textures=[{"source": 0}],
        images=[{"uri": png((255, 0, 0))}],
    )
    padded = np.zeros((3, 4 // np.dtype(dtype).itemsize), dtype)  # rows begin at multiples of 4 bytes
    padded[:, :2] = np.round(UVS * top)
    index = document.accessor(padded, normalized=True)
    document.json["accessors"][index]["type"] = "VEC2"
    document.json["bufferViews"][-1]["byteStride"] = 4
    document.triangle({"material": 0}, TEXCOORD_0=index)
    scene = load(document.write(tmp_path / "m.glb"))
    assert scene.geometry.uvs == pytest.approx(np.array([[0, 0], [1, 0], [0, 1]]))


def test_quantised_positions_are_refused(tmp_path: Path) -> None:
    document = Document()
    document.triangle()
    document.json["accessors"][0]["normalized"] = True
    with pytest.raises(SceneError, match="POSITION is stored in normalised integers"):
        load(document.write(tmp_path / "m.glb"))


def test_missing_buffer(tmp_path: Path) -> None:
    document = Document()
    document.triangle()
    path = document.write(tmp_path / "m.gltf")
    text = json.loads(path.read_text())
    text["buffers"][0]["uri"] = "gone.bin"
    path.write_text(json.dumps(text))
    with pytest.raises(SceneError, match=r"m\.gltf: gone\.bin is missing; put it next to the model"):
        load(path)


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_glb_gives_a_scene_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    document = Document(materials=[material([1, 1, 1, 1])])
    document.triangle({"material": 0, "indices": document.accessor(np.array([0, 1, 2], np.uint16))})
    path = document.write(tmp_path / "m.glb")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    try:
        message = f"{len(load(path).geometry.faces)} faces"
    except SceneError as error:
        message = str(error)
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize("both", [False, True])
def test_emission_times_its_strength_and_image(tmp_path: Path, both: bool) -> None:
    glow = {"emissiveFactor": [0.5, 1, 0.25], "emissiveTexture": {"index": 0}, "doubleSided": both}
    strength = {"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}}
    document = Document(
        materials=[{**glow, **strength}, {"emissiveFactor": [0, 0, 2]}, {}],
        textures=[{"source": 0}],
        images=[{"uri": png((255, 128, 0))}],
        extensionsUsed=["KHR_materials_emissive_strength"],
    )
    for index in range(3):
        document.triangle({"material": index}, TEXCOORD_0=document.accessor(UVS))
    scene = load(document.write(tmp_path / "m.gltf"))
    assert scene.notes == ()
    first, second, third = sorted(scene.materials, key=lambda material: material.name)
    assert (first.emission, first.emits_both_sides) == ((4.0, 8.0, 2.0), both)
    assert first.base_color_texture is None
    assert first.emission_texture == TextureRef(0)
    assert (second.emission, second.emission_texture, second.emits_both_sides) == ((0.0, 0.0, 2.0), None, False)
    assert third.emission == (0.0, 0.0, 0.0)
    assert scene.surface_light is not None
    sides = 2 if both else 1
    assert len(scene.surface_light.faces) == sides + 1


def test_an_image_of_emission_that_is_missing_is_told(tmp_path: Path) -> None:
    glow = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}
    document = Document(materials=[glow], textures=[{"source": 0}], images=[{"uri": "glow.png"}])
    document.triangle({"material": 0}, TEXCOORD_0=document.accessor(UVS))
    with pytest.raises(SceneError, match=r"image glow\.png is missing or not readable"):
        load(document.write(tmp_path / "m.gltf"))
