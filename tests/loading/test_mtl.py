"""What MTL files say besides Kd and Ke: gloss, normal maps, options of maps, and notes on what is not honoured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gltf_documents import load
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from deferred_ir.base.errors import SceneError
from deferred_ir.loading.formats.mtl import MtlMaterial, read_materials
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import IDENTITY, Sampler, TextureRef

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n"


def scene_with(folder: Path, mtl: str) -> Scene:
    (folder / "m.mtl").write_text("newmtl m\nKd 0.5 0.5 0.5\n" + mtl)
    (folder / "model.obj").write_text(f"mtllib m.mtl\n{SQUARE}")
    return load(folder / "model.obj")


@pytest.mark.parametrize(
    ("lines", "metallic", "roughness"),
    [("Pr 0.25\nPm 0.75\n", 0.75, 0.25), ("Pm 1\n", 1, 1), ("pr 0\n", 0, 0), ("Pr x\n", 0, 1)],
)
def test_numbers_of_gloss(tmp_path: Path, lines: str, metallic: float, roughness: float) -> None:
    scene = scene_with(tmp_path, lines)
    found = scene.materials[0]
    assert (found.metallic, found.roughness, found.specular, found.ior) == (metallic, roughness, 1, 1.5)
    assert scene.notes == ()


def test_without_the_keys_of_gloss_it_is_matt(tmp_path: Path) -> None:
    assert not scene_with(tmp_path, "Ns 100\n").materials[0].is_glossy


def test_numbers_of_gloss_out_of_range(tmp_path: Path) -> None:
    assert scene_with(tmp_path, "Pr 2\n").notes[0].endswith("material m: Pr above 1 is cut to 1")
    with pytest.raises(SceneError, match=r"material m: Pm -1\.0 must be a finite number of 0 or more; mend the file"):
        scene_with(tmp_path, "Pm -1\n")


@pytest.mark.parametrize("deep", [False, True])
def test_two_grey_images_become_one(tmp_path: Path, deep: bool) -> None:
    """Roughness in green, metallic in blue, at the larger size; the images replace the numbers."""
    rough = np.arange(8, dtype=np.uint8).reshape(2, 4) * 30
    Image.fromarray(rough.astype(np.uint16) * 257 if deep else rough).save(tmp_path / "r.png")
    Image.new("L", (2, 4), 51).save(tmp_path / "m.png")
    scene = scene_with(tmp_path, "Pr 0.1\nPm 0.1\nmap_Pr r.png\nmap_Pm m.png\n")
    found = scene.materials[0]
    assert (found.metallic, found.roughness) == (1, 1)
    assert found.metallic_roughness_texture == TextureRef(0)
    pixels = scene.textures[0].pixels
    assert pixels.shape == (4, 4, 3)
    assert (pixels[..., 2] == 51).all()
    assert pixels[0, :, 1].tolist() == rough[0].tolist()
    assert pixels[3, :, 1].tolist() == rough[1].tolist()


def test_one_grey_image_and_a_number(tmp_path: Path) -> None:
    Image.new("RGB", (3, 1), (102, 0, 0)).save(tmp_path / "r.png")
    scene = scene_with(tmp_path, "Pm 0.5\nmap_Pr r.png\n")
    assert (scene.materials[0].metallic, scene.materials[0].roughness) == (0.5, 1)
    assert scene.textures[0].pixels[0, 0].tolist() == [255, 102, 255]
    with pytest.raises(SceneError, match=r"material m: image none\.png is missing"):
        scene_with(tmp_path, "map_Pr none.png\n")


def test_norm_is_a_normal_map(tmp_path: Path) -> None:
    Image.new("RGB", (1, 1), (128, 128, 255)).save(tmp_path / "n.png")
    scene = scene_with(tmp_path, "norm n.png\n")
    assert scene.materials[0].normal_texture == TextureRef(0)
    assert not scene.materials[0].is_glossy
    assert scene.geometry.tangents is not None
    assert scene.geometry.tangents == pytest.approx(np.tile((1, 0, 0, 1), (6, 1)))


@pytest.mark.parametrize(
    ("options", "use"),
    [
        ("", TextureRef(0)),
        ("-s 3 2 1 -o 0.5 -0.25 0", TextureRef(0, 0, (3, 0, 0.5, 0, 2, -0.25))),
        ("-s 4", TextureRef(0, 0, (4, 0, 0, 0, 1, 0))),
        ("-blendu off -clamp on -mm 0 1", TextureRef(0, 0, IDENTITY, Sampler(("clamp", "clamp")))),
        ("-clamp off -s 1 1 1", TextureRef(0)),
    ],
)
def test_options_of_maps(tmp_path: Path, options: str, use: TextureRef) -> None:
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "t 1.png")
    assert scene_with(tmp_path, f"map_Kd {options} t 1.png\n").materials[0].base_color_texture == use


@given(st.text("-somap clf0123.e \t", max_size=30))
def test_no_options_are_malformed(text: str) -> None:
    material = MtlMaterial({"map_kd": text})
    assert np.isfinite(material.read_use("map_kd").transform).all()
    assert (material.find_file("map_kd") or "x").strip()


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        ("Ka 1 1 1\nKs 0 0 0\nNs 100\nillum 2\nNi 1.5\nd 1\nTr 0\nTf 1 1 1\n", None),
        ("d 0.3\n", "transparency is ignored (d)"),
        ("Tr 0.3\nmap_d a.png\n", "transparency is ignored (Tr, map_d)"),
        ("d 1\nTr 1\n", None),
        ("Ks 1 1 1\nNs 10\nmap_Bump -bm 1 b.png\n", "not honoured: Ks, Ns, map_Bump"),
    ],
)
def test_what_is_not_honoured_is_told(tmp_path: Path, lines: str, note: str | None) -> None:
    assert scene_with(tmp_path, lines).notes == (() if note is None else (f"model.obj: {note}",))


def test_materials_that_no_face_uses_are_not_told_of(tmp_path: Path) -> None:
    assert scene_with(tmp_path, "newmtl other\nd 0.5\nKs 1 1 1\n").notes == ()


def test_later_lines_count() -> None:
    found = read_materials("Kd 1\nnewmtl a  b\nKd 1 1 1\n\tKD 0.5 # half\n#Ke 1\nnewmtl a b\nPr 0.5\n")
    assert found == {"a b": MtlMaterial({"pr": "0.5"})}
