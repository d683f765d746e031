"""Reflectance from files, and its lookup at points of a scene."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from PIL import Image

from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.base.errors import SceneError
from deferred_ir.loading import merge, models, textures
from deferred_ir.loading.model_data import GREY
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Texture, TextureRef
from deferred_ir.scene.surfaces.points import SurfacePoints
from deferred_ir.scene.surfaces.texture_lookup import sample_texture

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "usemtl m\nf 1/1 2/2 3/3 4/4\n"


def albedo_at(scene: Scene, faces: Any, weights: Any) -> Any:
    return SurfacePoints(scene.geometry, scene.materials, scene.textures, faces, weights).look_up_base_color()


def scene_of(path: Path) -> Scene:
    data = models.read(path)
    geometry, found, textures, ranges = merge.merge([(data, None)], "scene.toml")
    camera, light = Camera((0, 0, 1), (0, 0, 0)), Spotlight((0, 0, 1), (0, 0, 0))
    return Scene("test", path, geometry, found, textures, ranges, camera, light, notes=data.notes)


def scene_with(folder: Path, mtl: str, faces: str = FACES, vertices: str = SQUARE) -> Scene:
    (folder / "m.mtl").write_text(mtl)
    (folder / "model.obj").write_text(f"mtllib m.mtl\n{vertices}{faces}")
    return scene_of(folder / "model.obj")


def srgb(level: float) -> float:
    """The linear value of one sRGB level of 0 to 255."""
    value = level / 255
    return value / 12.92 if value <= 0.04045 else float(((value + 0.055) / 1.055) ** 2.4)


def test_kd_is_not_rounded(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "newmtl m\nKd 0.1234 0.03 0.98765\n")
    assert scene.materials[0].base_color == (0.1234, 0.03, 0.98765)
    assert scene.materials[0].name == "m"
    weights = np.array([[0.2, 0.3, 0.5]])
    assert albedo_at(scene, np.array([0]), weights) == pytest.approx(np.array([[0.1234, 0.03, 0.98765]]))
    assert scene.notes == ()


def test_one_number_is_grey(tmp_path: Path) -> None:
    assert scene_with(tmp_path, "newmtl m\nKd 0.3\n").materials[0].base_color == (0.3, 0.3, 0.3)


def test_kd_above_1_is_cut_with_a_note(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "newmtl m\nKd 0.5 1.5 1\n")
    assert scene.materials[0].base_color == (0.5, 1.0, 1.0)
    assert any("material m: reflectance above 1 is cut to 1" in note for note in scene.notes)


@pytest.mark.parametrize("kd", ["nan 0 0", "inf 0 0", "-0.5 0 0", "0.5 0.5"])
def test_kd_that_is_no_reflectance(tmp_path: Path, kd: str) -> None:
    with pytest.raises(SceneError, match=r"model\.obj: material m: reflectance .* must be three finite numbers"):
        scene_with(tmp_path, f"newmtl m\nKd {kd}\n")


def test_without_a_material_it_is_grey(tmp_path: Path) -> None:
    (tmp_path / "model.obj").write_text(SQUARE + "f 1 2 3 4\n")
    assert scene_of(tmp_path / "model.obj").materials[0].base_color == GREY
    (tmp_path / "model.obj").write_text(SQUARE + "f 1/1 2/2 3/3\n")
    scene = scene_of(tmp_path / "model.obj")
    assert scene.materials[0].base_color == GREY
    assert scene.textures == ()


def test_missing_kd_is_grey_with_a_note(tmp_path: Path) -> None:
    for line in ("Ks 1 1 1", "Kd spectral file.rfl", ""):
        scene = scene_with(tmp_path, f"newmtl m\n{line}\nNs 3\n")
        assert scene.materials[0].base_color == GREY
        assert any("material m has no Kd" in note for note in scene.notes)


def test_other_lines_of_a_material_file_do_no_harm(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "Kd 1 1 1\nnewmtl m\nKa 0.5\nKd 0.1 0.2 0.3 # dark\nKs\nillum x\nd -halo 1\n")
    assert scene.materials[0].base_color == (0.1, 0.2, 0.3)
    assert scene.notes == ()


def test_missing_material_file_and_material_are_noted(tmp_path: Path) -> None:
    (tmp_path / "model.obj").write_text(f"# no mtllib here\nmtllib gone.mtl\n{SQUARE}{FACES}")
    scene = scene_of(tmp_path / "model.obj")
    assert scene.materials[0].base_color == GREY
    assert scene.notes[:2] == (
        "model.obj: its material file gone.mtl is missing",
        "model.obj: no material m; its surfaces are grey",
    )


def test_several_material_files(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    Image.new("RGB", (1, 1), (255, 0, 0)).save(tmp_path / "sub" / "red.png")
    (tmp_path / "sub" / "a b.mtl").write_text("newmtl m\nmap_Kd -s 2 2 1 -clamp off red.png\n")
    (tmp_path / "c.mtl").write_text("newmtl n\nKd 0.25 0.5 0.75")
    (tmp_path / "model.obj").write_text(f"mtllib sub\\a b.mtl\nmtllib c.mtl\n{SQUARE}{FACES}usemtl n\nf 1/1 2/2 3/3\n")
    scene = scene_of(tmp_path / "model.obj")
    assert {material.name: material.base_color for material in scene.materials} == {
        "m": (1, 1, 1),
        "n": (0.25, 0.5, 0.75),
    }
    assert len(scene.textures) == 1


def test_map_kd_replaces_kd(tmp_path: Path) -> None:
    Image.new("RGB", (4, 2), (188, 0, 255)).save(tmp_path / "t.png")
    scene = scene_with(tmp_path, "newmtl m\nKd 0.5 0.5 0.5\nmap_Kd t.png\n")
    assert scene.materials[0].base_color == (1.0, 1.0, 1.0)
    assert scene.materials[0].base_color_texture == TextureRef(0)
    assert scene.textures[0].pixels.shape == (2, 4, 3)
    found = albedo_at(scene, np.array([0, 1]), np.full((2, 3), 1 / 3))
    assert found == pytest.approx(np.tile([srgb(188), 0, 1], (2, 1)), rel=1e-6)


def test_texture_stands_upright(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 1] = 255  # right, top row
    Image.fromarray(pixels).save(tmp_path / "t.png")
    scene = scene_with(tmp_path, "newmtl m\nmap_Kd t.png\n")
    geometry = scene.geometry
    assert geometry.uvs is not None
    centre_of_texel = np.array([0.75, 0.75])
    for face in range(2):
        edges = geometry.uvs[geometry.faces[face]].astype(float)
        system = np.vstack([edges.T, np.ones(3)])
        weights = np.linalg.solve(system, [*centre_of_texel, 1.0])
        if weights.min() > -1e-9:
            assert albedo_at(scene, np.array([face]), weights[None]) == pytest.approx(np.ones((1, 3)))
            position = weights @ geometry.positions[geometry.faces[face]]
            assert position[:2] == pytest.approx(centre_of_texel)  # v runs up, as y does


def test_missing_and_broken_images(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"material m: image none\.png is missing; put it next to the model"):
        scene_with(tmp_path, "newmtl m\nmap_Kd none.png\n")
    (tmp_path / "t.png").write_bytes(b"no image")
    with pytest.raises(SceneError, match=r"image t\.png is not a readable image"):
        scene_with(tmp_path, "newmtl m\nmap_Kd t.png\n")
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)).save(tmp_path / "t.png")
    (tmp_path / "t.png").write_bytes((tmp_path / "t.png").read_bytes()[:2000])
    with pytest.raises(SceneError, match=r"t\.png: not a readable image"):
        scene_with(tmp_path, "newmtl m\nmap_Kd t.png\n")


def test_an_image_that_no_face_uses_may_be_missing(tmp_path: Path) -> None:
    assert scene_with(tmp_path, "newmtl m\nKd 1 1 1\nnewmtl n\nmap_Kd none.png\n").textures == ()


def test_texture_without_coordinates(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    scene = scene_with(tmp_path, "newmtl m\nKd 0.3 0.3 0.3\nmap_Kd t.png\n", "usemtl m\nf 1 2 3\n")
    assert scene.materials[0].base_color == (0.3, 0.3, 0.3)
    assert scene.geometry.uvs is None
    assert any("no texture coordinates" in note for note in scene.notes)


def test_texture_coordinates_that_are_no_numbers(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    scene = scene_with(tmp_path, "newmtl m\nmap_Kd t.png\n", vertices=SQUARE.replace("vt 1 0", "vt nan 0"))
    assert scene.geometry.uvs is not None
    assert np.isfinite(scene.geometry.uvs).all()
    assert any("NaN or infinite" in note for note in scene.notes)


def test_ke_emits_from_both_sides(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "newmtl m\nKd 1 1 1\nKe 17 12 4\n")
    assert scene.notes == ()
    assert scene.materials[0].emission == (17.0, 12.0, 4.0)
    assert scene.materials[0].emits_both_sides
    dark = scene_with(tmp_path, "newmtl m\nKd 1 1 1\nKe 0 0 0\n")
    assert dark.surface_light is None


def test_map_ke_is_a_texture_of_emission(tmp_path: Path) -> None:
    Image.fromarray(np.array([[[255, 0, 0], [0, 0, 255]]], np.uint8)).save(tmp_path / "glow.png")
    mtl = "newmtl m\nKd 0.5 0.5 0.5\nKe 2 2 2\nmap_Ke glow.png\n"
    scene = scene_with(
        tmp_path, mtl, "usemtl m\nf 1/1 2/2 3/3\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    )
    assert (scene.materials[0].base_color_texture, scene.materials[0].emission_texture) == (None, TextureRef(0))
    found = SurfacePoints(
        scene.geometry, scene.materials, scene.textures, np.array([0, 0]), np.array([[0.75, 0.25, 0], [0.25, 0.75, 0]])
    ).look_up_emission()
    assert found == pytest.approx(np.array([[2, 0, 0], [0, 0, 2.0]]))
    with pytest.raises(SceneError, match=r"image none\.png is missing"):
        scene_with(tmp_path, mtl.replace("glow", "none"))


def test_negative_emission_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"material m: emission \[1\.0, -2\.0, 1\.0\] must be three finite numbers"):
        scene_with(tmp_path, "newmtl m\nKd 1 1 1\nKe 1 -2 1\n")


GREYS = np.array([[0, 128], [200, 255]], np.uint8)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "PA", "1", "I;16", "I", "F", "CMYK", "HSV", "YCbCr"])
def test_kinds_of_images(mode: str) -> None:
    grey = np.array([[0, 255], [255, 0]], np.uint8) if mode == "1" else GREYS
    if mode in ("I;16", "I"):
        image = Image.fromarray(grey.astype(np.uint16) * 257)
        image = image.convert("I") if mode == "I" else image
    elif mode == "F":
        image = Image.fromarray((grey / 255).astype(np.float32))
    elif mode == "PA":
        image = Image.fromarray(grey).convert("P").convert("PA")
    elif mode == "P":
        image = Image.fromarray(grey).convert("P")
    else:
        image = Image.fromarray(grey).convert("RGB").convert(mode)
    assert image.mode == mode
    deep = mode in ("I;16", "I", "F")
    texture = textures.decode_texture(image, "t.png")
    assert texture.pixels.dtype == (np.uint16 if deep else np.uint8)
    found = texture.pixels.astype(int) - grey[:, :, None].astype(int) * (257 if deep else 1)
    assert np.abs(found).max() <= (1 if mode in ("CMYK", "YCbCr") else 0)
    covered = textures.decode_texture(image, "t.png", alpha=True)
    assert covered.pixels.shape[2] == (4 if "A" in mode else 3)


@pytest.mark.parametrize(("kind", "channels"), [(0, 1), (2, 3), (4, 2), (6, 4)], ids=["L", "RGB", "LA", "RGBA"])
def test_png_of_16_bits_keep_them(kind: int, channels: int) -> None:
    pixels = np.random.default_rng(kind).integers(0, 65536, (3, 5, channels)).astype(np.uint16)
    image = textures.open_image(png_of_16_bits(pixels, kind))
    found = textures.decode_texture(image, "t.png", alpha=True).pixels
    assert found.dtype == np.uint16
    colors = np.repeat(pixels[..., :1], 3, axis=2) if channels < 3 else pixels[..., :3]
    assert np.array_equal(found[..., :3], colors)
    assert found.shape[2] == (4 if channels in (2, 4) else 3)
    if channels in (2, 4):
        assert np.array_equal(found[..., 3], pixels[..., -1])
    opaque = textures.decode_texture(textures.open_image(png_of_16_bits(pixels, kind)), "t.png")
    assert np.array_equal(opaque.pixels, colors)


def png_of_16_bits(pixels: Any, kind: int) -> bytes:
    """A PNG file of uint16 (H, W, channels); kind: its colour type, by the PNG specification."""
    height, width = pixels.shape[:2]
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def test_vertex_colours_are_srgb_and_multiply(tmp_path: Path) -> None:
    levels = np.array([[0, 128, 255, 255], [10, 20, 30, 255], [255, 255, 255, 255]], np.uint8)
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], vertex_colors=levels, process=False)
    mesh.export(tmp_path / "model.ply")
    scene = scene_of(tmp_path / "model.ply")
    assert scene.materials[0].base_color == (1.0, 1.0, 1.0)
    linear = np.vectorize(srgb)(levels[:, :3])
    assert scene.geometry.colors == pytest.approx(linear, rel=1e-6)
    weights = np.array([[0.2, 0.3, 0.5]])
    assert albedo_at(scene, np.array([0]), weights) == pytest.approx(weights @ linear, rel=1e-6)


def test_obj_vertex_colours_multiply_kd(tmp_path: Path) -> None:
    vertices = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\n"
    scene = scene_with(tmp_path, "newmtl m\nKd 0.5 0.5 0.5\n", "usemtl m\nf 1 2 3\n", vertices)
    assert scene.geometry.colors == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [0, 0, srgb(127.5)]]), rel=1e-6)
    assert albedo_at(scene, np.array([0]), np.array([[1.0, 0, 0]])) == pytest.approx(np.array([[0.5, 0, 0]]))


def test_face_colours(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    box.visual.face_colors = np.arange(12)[:, None] * [20, 10, 5, 0] + [0, 0, 0, 255]
    box.export(tmp_path / "model.ply")
    scene = scene_of(tmp_path / "model.ply")
    found = albedo_at(scene, np.arange(12), np.full((12, 3), 1 / 3))
    assert found == pytest.approx(np.vectorize(srgb)(np.arange(12)[:, None] * [20, 10, 5]), rel=1e-6)


def test_ply_with_a_missing_texture(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\ncomment TextureFile none.png\nelement vertex 3\n"
    header += "".join(f"property float {name}\n" for name in ("x", "y", "z", "s", "t"))
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "model.ply").write_text(header + "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n")
    with pytest.raises(SceneError, match=r"image none\.png is missing"):
        scene_of(tmp_path / "model.ply")
    Image.new("RGB", (2, 2), (255, 255, 255)).save(tmp_path / "none.png")
    assert len(scene_of(tmp_path / "model.ply").textures) == 1


def naive_sample(pixels: np.ndarray, u: float, v: float) -> np.ndarray:
    """One bilinear lookup, written from OpenGL 4.3, section 8.14: wrap mode repeat, row 0 at the bottom."""
    upright = pixels[::-1]
    height, width = upright.shape[:2]
    x, y = (u - math.floor(u)) * width - 0.5, (v - math.floor(v)) * height - 0.5
    i, j = math.floor(x), math.floor(y)
    a, b = x - i, y - j
    result = np.zeros(3)
    for di, dj, weight in ((0, 0, (1 - a) * (1 - b)), (1, 0, a * (1 - b)), (0, 1, (1 - a) * b), (1, 1, a * b)):
        texel = upright[(j + dj) % height, (i + di) % width]
        result += weight * np.array([srgb(level) for level in texel])
    return result


@settings(deadline=None, max_examples=60)
@given(
    pixels=npst.arrays(np.uint8, st.tuples(st.integers(1, 5), st.integers(1, 5), st.just(3))),
    uvs=st.lists(
        st.tuples(*[st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, 0.5, -1e-20])] * 2), min_size=1, max_size=8
    ),
)
def test_lookup_equals_a_naive_one(pixels: np.ndarray, uvs: list[tuple[float, float]]) -> None:
    found = sample_texture(Texture("t", pixels), np.array(uvs))
    expected = np.array([naive_sample(pixels, u, v) for u, v in uvs])
    assert found == pytest.approx(expected, abs=1e-6)


def test_texel_centres_give_texels() -> None:
    pixels = np.arange(36, dtype=np.uint8).reshape(3, 4, 3) * 7
    u, v = np.meshgrid((np.arange(4) + 0.5) / 4, 1 - (np.arange(3) + 0.5) / 3)
    found = sample_texture(Texture("t", pixels), np.stack([u, v], axis=-1).reshape(-1, 2))
    assert found.reshape(3, 4, 3) == pytest.approx(np.vectorize(srgb)(pixels), abs=1e-6)


@settings(deadline=None)
@given(npst.arrays(np.float64, st.tuples(st.integers(0, 6), st.just(3)), elements=st.floats(0, 1)))
def test_srgb_decoding_is_monotonic_and_in_range(values: np.ndarray) -> None:
    linear = linear_from_srgb(values)
    assert ((linear >= 0) & (linear <= values + 1e-12)).all()
    assert linear == pytest.approx(np.vectorize(lambda value: srgb(value * 255), otypes=[float])(values))
