"""How glTF materials and their textures are read: the model's numbers, where textures are read, and how."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import UVS, Document, image_uri, load, load_material, png
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from deferred_ir.base.errors import SceneError
from deferred_ir.loading.formats.gltf_materials import read_sampler, read_transform
from deferred_ir.loading.models import move_uvs_home
from deferred_ir.scene.surfaces.materials import BLACK, IDENTITY, Sampler, Texture, TextureRef
from deferred_ir.scene.surfaces.points import SurfacePoints
from deferred_ir.scene.surfaces.texture_lookup import sample_texture

ONE_IMAGE = {"textures": [{"source": 0}], "images": [{"uri": png((255, 128, 64, 100))}]}
NUMBERS = st.floats(-4, 4, allow_nan=False)


def test_what_a_material_leaves_out_has_the_specification_s_defaults(tmp_path: Path) -> None:
    found, scene = load_material(tmp_path, {})
    assert (found.base_color, found.metallic, found.roughness) == ((1, 1, 1), 1, 1)
    assert (found.specular, found.specular_color, found.ior) == (1, (1, 1, 1), 1.5)
    assert (found.alpha, found.alpha_cutoff, found.emission) == (1, None, BLACK)
    assert scene.notes == ()
    bare = Document()
    bare.triangle()
    default = load(bare.write(tmp_path / "bare.gltf")).materials[0]
    assert (default.metallic, default.roughness, default.specular) == (1, 1, 1)


def test_factors_and_textures_of_metal_and_normals(tmp_path: Path) -> None:
    base = {"metallicFactor": 0.25, "roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0}}
    table = {"pbrMetallicRoughness": base, "normalTexture": {"index": 1, "scale": -0.5, "texCoord": 1}}
    tables = {
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"uri": png((0, 51, 102))}, {"uri": png((1, 2, 3))}],
    }
    found, scene = load_material(tmp_path, table, **tables)
    assert (found.metallic, found.roughness, found.normal_scale) == (0.25, 0.5, -0.5)
    assert found.metallic_roughness_texture == TextureRef(0)
    assert found.normal_texture == TextureRef(1, uv_set=1)
    points = SurfacePoints(scene.geometry, scene.materials, scene.textures, np.array([0]), np.full((1, 3), 1 / 3))
    _, gloss = points.look_up_gloss(np.ones((1, 3)))
    assert gloss.alpha == pytest.approx([(0.5 * 51 / 255) ** 2])


def test_extensions_of_the_coat(tmp_path: Path) -> None:
    table = {
        "extensions": {
            "KHR_materials_ior": {"ior": 1.8},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 2, 0.5]},
        }
    }
    found, _ = load_material(tmp_path, table, extensionsUsed=list(table["extensions"]))
    assert (found.ior, found.specular, found.specular_color) == (1.8, 0.5, (1, 2, 0.5))


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK"])
def test_unlit_is_emission_that_lights_nothing(tmp_path: Path, mode: str) -> None:
    table = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 0.75], "baseColorTexture": {"index": 0}},
        "extensions": {"KHR_materials_unlit": {}},
        "emissiveFactor": [9, 9, 9],
        "alphaMode": mode,
    }
    found, scene = load_material(tmp_path, table, **ONE_IMAGE, extensionsUsed=["KHR_materials_unlit"])
    assert (found.base_color, found.emission, found.unlit) == (BLACK, (0.5, 0.25, 1), True)
    assert not found.is_glossy
    assert scene.surface_light is None
    assert scene.notes == ()
    assert (found.base_color_texture is not None) == (mode == "MASK")
    assert len(scene.textures) == 1
    points = SurfacePoints(scene.geometry, scene.materials, scene.textures, np.array([0]), np.full((1, 3), 1 / 3))
    assert points.look_up_emission()[0] == pytest.approx([0.5, 0.25 * 0.2158605, 0.0512695], rel=1e-4)
    assert points.look_up_coverage()[0] == pytest.approx(0.75 * 100 / 255 if mode == "MASK" else 0.75)


@pytest.mark.parametrize(
    ("keys", "cutoff"),
    [
        ({}, None),
        ({"alphaMode": "OPAQUE", "alphaCutoff": 0.3}, None),
        ({"alphaMode": "MASK"}, 0.5),
        ({"alphaMode": "MASK", "alphaCutoff": 0.3}, 0.3),
        ({"alphaMode": "BLEND", "alphaCutoff": 0.3}, 0.5),
    ],
)
def test_alpha_is_kept_where_it_is_asked_for(tmp_path: Path, keys: dict[str, Any], cutoff: float | None) -> None:
    base = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5]}
    found, scene = load_material(tmp_path, {"pbrMetallicRoughness": base, **keys}, **ONE_IMAGE)
    assert (found.alpha, found.alpha_cutoff) == (0.5, cutoff)
    assert scene.textures[0].pixels.shape == (2, 2, 3 if cutoff is None else 4)
    assert bool(scene.notes) == (keys.get("alphaMode") == "BLEND")


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"pbrMetallicRoughness": {"metallicFactor": -1}}, "metallicFactor -1 must be a finite number of 0 or more"),
        ({"pbrMetallicRoughness": {"roughnessFactor": "a"}}, "roughnessFactor 'a' must be a finite number of 0"),
        ({"alphaMode": "MASK", "alphaCutoff": True}, "alphaCutoff True must be a finite number"),
        ({"extensions": {"KHR_materials_ior": {"ior": None}}}, "ior None must be a finite number"),
        ({"extensions": {"KHR_materials_specular": {"specularColorFactor": [1, -1, 1]}}}, "specularColorFactor -1"),
        ({"normalTexture": {"index": 5}}, "malformed glTF (IndexError"),
        ({"normalTexture": {"index": 0, "texCoord": "a"}}, "malformed glTF (ValueError: texCoord 'a'"),
    ],
)
def test_numbers_that_cannot_be_used(tmp_path: Path, table: dict[str, Any], expected: str) -> None:
    with pytest.raises(SceneError) as caught:
        load_material(tmp_path, table, **ONE_IMAGE)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'm.gltf'}: ")


def test_factors_above_1_are_cut_with_a_note(tmp_path: Path) -> None:
    found, scene = load_material(tmp_path, {"pbrMetallicRoughness": {"roughnessFactor": 3}})
    assert found.roughness == 1
    assert scene.notes == (f"{tmp_path / 'm.gltf'}: material 0: roughnessFactor above 1 is cut to 1",)


def test_the_second_set_of_texture_coordinates(tmp_path: Path) -> None:
    """The set that a texture names counts, and that of its transform before that."""
    transform = {"extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    for info in ({"index": 0, "texCoord": 1}, {"index": 0, **transform}):
        found, scene = load_material(tmp_path, {"pbrMetallicRoughness": {"baseColorTexture": info}}, **ONE_IMAGE)
        assert found.base_color_texture == TextureRef(0, uv_set=1)
        assert scene.geometry.uvs is None
        assert scene.geometry.second_uvs == pytest.approx(np.array([[0, 0.5], [0.5, 0.5], [0, 1]]))
    _, scene = load_material(
        tmp_path, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 2}}}, **ONE_IMAGE
    )
    assert scene.notes == ("m.gltf: no texture coordinates for number 0; it is not used",)


@given(
    offset=st.tuples(NUMBERS, NUMBERS),
    scale=st.tuples(NUMBERS, NUMBERS),
    angle=st.floats(-7, 7),
    uv=st.tuples(NUMBERS, NUMBERS),
)
def test_transforms_are_those_of_coordinates_that_run_down(
    offset: tuple[float, float], scale: tuple[float, float], angle: float, uv: tuple[float, float]
) -> None:
    """Scaled, turned counter-clockwise as seen where v runs down, moved; then v turned upwards."""
    u, v = uv[0] * scale[0], uv[1] * scale[1]
    turned = (u * math.cos(angle) + v * math.sin(angle), v * math.cos(angle) - u * math.sin(angle))
    expected = (turned[0] + offset[0], 1 - (turned[1] + offset[1]))
    rows = np.reshape(read_transform({"offset": list(offset), "scale": list(scale), "rotation": angle}), (2, 3))
    assert rows @ (uv[0], 1 - uv[1], 1) == pytest.approx(np.array(expected), abs=1e-9)


def test_the_specification_s_example_of_a_transform() -> None:
    """It "utilizes only the lower left quadrant of the source image, rotated clockwise 90 degrees"."""
    rows = np.reshape(read_transform({"offset": [0, 1], "rotation": math.pi / 2, "scale": [0.5, 0.5]}), (2, 3))
    corners = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]]) @ rows.T
    assert sorted(np.round(corners, 9).tolist()) == [[0, 0], [0, 0.5], [0.5, 0], [0.5, 0.5]]
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[1, 0] = 255
    assert sample_texture(Texture("t", pixels), corners.mean(axis=0)[None]) == pytest.approx(np.ones((1, 3)))
    # What was the image's left edge is at the top now.
    assert rows @ (0.5, 1, 1) == pytest.approx([0, 0.25])


@given(
    st.fixed_dictionaries(
        {},
        optional={
            "wrapS": st.sampled_from([10497, 33648, 33071]),
            "wrapT": st.sampled_from([10497, 33648, 33071]),
            "magFilter": st.sampled_from([9728, 9729]),
            "minFilter": st.sampled_from([9728, 9729, 9984, 9985, 9986, 9987]),
        },
    )
)
def test_samplers(table: dict[str, int]) -> None:
    wraps = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
    names = {9728: "NEAREST", 9729: "LINEAR", 9984: "NEAREST_MIPMAP_NEAREST", 9985: "LINEAR_MIPMAP_NEAREST"}
    names |= {9986: "NEAREST_MIPMAP_LINEAR", 9987: "LINEAR_MIPMAP_LINEAR"}
    found = read_sampler(table)
    assert found.wrap == (wraps[table.get("wrapS", 10497)], wraps[table.get("wrapT", 10497)])
    assert found.magnify == names[table.get("magFilter", 9729)].lower()
    within, _, between = names[table.get("minFilter", 9729)].lower().partition("_mipmap_")
    assert (found.minify, found.mipmaps) == (within, between or None)
    if not {"magFilter", "minFilter"} & table.keys():
        assert (found.magnify, found.minify, found.mipmaps) == ("linear", "linear", None)


def test_a_file_s_sampler_and_transform_reach_its_texture(tmp_path: Path) -> None:
    pixels = np.repeat(np.array([[0, 255]], np.uint8)[..., None], 3, axis=2)
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 1]}}}
    found, scene = load_material(
        tmp_path,
        {"pbrMetallicRoughness": {"baseColorTexture": info, "metallicFactor": 0}},
        textures=[{"source": 0, "sampler": 0}],
        samplers=[{"wrapS": 33648, "magFilter": 9728}],
        images=[{"uri": image_uri(pixels)}],
        extensionsUsed=["KHR_texture_transform"],
    )
    assert found.base_color_texture == TextureRef(0, 0, (2, 0, 0, 0, 1, 0), Sampler(("mirror", "repeat"), "nearest"))
    # Read at u = 0.2, 0.8, 1.2, 1.8 of the image.
    weights = np.array([[1 - u, u, 0] for u in (0.1, 0.4, 0.6, 0.9)])
    points = SurfacePoints(scene.geometry, scene.materials, scene.textures, np.zeros(4, int), weights)
    assert points.look_up_base_color()[:, 0].tolist() == [0, 1, 1, 0]


def test_an_unknown_kind_of_wrapping_is_malformed(tmp_path: Path) -> None:
    base = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    with pytest.raises(SceneError, match="malformed glTF"):
        load_material(tmp_path, base, textures=[{"source": 0, "sampler": 0}], samplers=[{"wrapS": 1}], images=[{}])


@given(
    wraps=st.lists(
        st.tuples(*[st.sampled_from(["repeat", "mirror", "clamp"])] * 2).map(Sampler),
        min_size=1,
        max_size=2,
    ),
    transform=st.sampled_from([IDENTITY, (1, 0, 0.3, 0, 1, -0.7), (2, 0, 0, 0, 1, 0), (0, 1, 0, -1, 0, 1)]),
    far=st.tuples(st.integers(-90, 90), st.integers(-90, 90)),
)
def test_moved_texture_coordinates_read_the_same(wraps: list[Sampler], transform: Any, far: tuple[int, int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (4, 8, 3)).astype(np.uint8)
    uvs = UVS * 0.8 + np.array(far) + 0.05
    used = [TextureRef(0, 0, transform, sampler) for sampler in wraps]
    moved = move_uvs_home(uvs, used)
    rows = np.reshape(transform, (2, 3))
    for texture in used:
        before, after = (
            sample_texture(Texture("t", pixels), each @ rows[:, :2].T + rows[:, 2], texture.sampler)
            for each in (uvs, moved)
        )
        assert after == pytest.approx(before, abs=1e-9)
    if all(sampler.wrap == ("repeat", "repeat") for sampler in wraps) and transform == IDENTITY:
        assert np.abs(moved).max() <= 17


def test_the_alpha_of_vertex_colours_is_not_read_and_told(tmp_path: Path) -> None:
    document = Document(materials=[{"alphaMode": "MASK"}, {}])
    for index in (0, 1):
        colors = document.accessor(np.full((3, 4), 0.5, np.float32))
        document.triangle({"material": index}, COLOR_0=colors)
    assert load(document.write(tmp_path / "m.gltf")).notes == ("m.gltf: the alpha of vertex colours is ignored",)


def test_images_in_buffers(tmp_path: Path) -> None:
    import base64

    base = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    document = Document(materials=[base], textures=[{"source": 0}])
    data = base64.b64decode(png((255, 0, 0)).partition(",")[2])
    document.accessor(np.frombuffer(data, np.uint8))
    view = len(document.json["bufferViews"]) - 1
    document.json["images"] = [{"bufferView": view, "mimeType": "image/png"}]
    document.triangle({"material": 0}, TEXCOORD_0=document.accessor(UVS))
    assert load(document.write(tmp_path / "m.glb")).textures[0].pixels[0, 0].tolist() == [255, 0, 0]


def rich_document() -> dict[str, Any]:
    """Tables that use every key of materials, with one triangle."""
    transform = {"offset": [0, 1], "scale": [2, 2], "rotation": 1.0, "texCoord": 0}
    info = {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": transform}}
    base = {"baseColorFactor": [1, 1, 1, 1], "baseColorTexture": info, "metallicFactor": 0.5, "roughnessFactor": 0.5}
    coat = {"specularFactor": 0.5, "specularColorFactor": [1, 1, 1]}
    material = {
        "pbrMetallicRoughness": base | {"metallicRoughnessTexture": {"index": 0}},
        "normalTexture": {"index": 0, "scale": 2},
        "emissiveFactor": [1, 1, 1],
        "emissiveTexture": {"index": 0},
        "alphaMode": "MASK",
        "alphaCutoff": 0.3,
        "doubleSided": True,
        "name": "rich",
        "extensions": {
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_specular": coat,
            "KHR_materials_emissive_strength": {"emissiveStrength": 3},
        },
    }
    unlit = {"pbrMetallicRoughness": base, "alphaMode": "BLEND", "extensions": {"KHR_materials_unlit": {}}}
    return {
        "materials": [material, unlit],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33648, "magFilter": 9729, "minFilter": 9987}],
        "images": [{"uri": png((1, 2, 3))}],
    }


def list_places(value: Any, before: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the keys and indices that lead to each value within tables and arrays."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, item in inner for place in ((*before, key), *list_places(item, (*before, key)))]


@settings(deadline=None, max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    place=st.sampled_from(list_places(rich_document())),
    value=st.sampled_from([None, -1, 7, 1e308, 10**30, math.nan, "a", "data:,", True, [], [1], [[1]], {}]),
)
def test_a_wrong_value_gives_a_scene_or_one_line(tmp_path: Path, place: tuple[Any, ...], value: Any) -> None:
    tables = rich_document()
    inner: Any = tables
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    document = Document(**tables)
    for index in (0, 1):
        document.triangle(
            {"material": index},
            **{f"TEXCOORD_{number}": document.accessor(UVS) for number in (0, 1)},
            NORMAL=document.accessor(np.tile(np.array([0, 0, 1], np.float32), (3, 1))),
            TANGENT=document.accessor(np.ones((3, 4), np.float32)),
            COLOR_0=document.accessor(np.full((3, 4), 0.5, np.float32)),
        )
    try:
        message = f"{len(load(document.write(tmp_path / 'm.gltf')).geometry.faces)} faces"
    except SceneError as error:
        message = str(error)
    assert len(message.splitlines()) == 1
