"""Tangents for normal maps: analytic cases, what holds for every mesh, and what placing a model does to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_documents import POSITIONS, UVS, Document, image_uri, load
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from deferred_ir.loading.model_data import Part
from deferred_ir.loading.tangents import add_tangents, place_tangents
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, TextureRef
from deferred_ir.scene.surfaces.points import SurfacePoints

MAPPED = Material("mapped", (1.0, 1.0, 1.0), normal_texture=TextureRef(0))
UP = np.array([[[128, 238, 238]]], np.uint8)
"""A normal map whose green says: the surface tilts to the image's upper edge."""


def square(uvs: Any, *, smooth: bool = True, texture: TextureRef | None = None) -> Part:
    """A unit square that faces +z, with texture coordinates at (0, 0), (1, 0), (1, 1), (0, 1)."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    normals = np.tile((0.0, 0.0, 1.0), (4, 1)) if smooth else None
    material = replace(MAPPED, normal_texture=texture or TextureRef(0))
    return Part(positions, np.array([[0, 1, 2], [0, 2, 3]]), material, normals, np.array(uvs, float))


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize(
    ("uvs", "expected"),
    [
        ([[0, 0], [1, 0], [1, 1], [0, 1]], [1, 0, 0, 1]),
        ([[0, 0], [0, 1], [-1, 1], [-1, 0]], [0, -1, 0, 1]),
        ([[1, 0], [0, 0], [0, 1], [1, 1]], [-1, 0, 0, -1]),
        ([[0, 1], [1, 1], [1, 0], [0, 0]], [1, 0, 0, -1]),
        ([[0, 0], [3, 0], [3, 0.01], [0, 0.01]], [1, 0, 0, 1]),
        ([[0, 0], [1, 0], [2, 0], [3, 0]], [0, 0, 0, 0]),
    ],
)
def test_a_square_s_tangents(uvs: Any, expected: list[float], smooth: bool) -> None:
    part = add_tangents(square(uvs, smooth=smooth))
    assert part.tangents is not None
    assert part.tangents == pytest.approx(np.tile(expected, (len(part.positions), 1)), abs=1e-12)
    assert len(part.positions) == (4 if smooth else 6)


def test_tangents_follow_the_transform_of_the_normal_map() -> None:
    turned = TextureRef(0, 0, (0.0, 1.0, 0.0, -1.0, 0.0, 0.0))  # u' = v, v' = -u
    part = add_tangents(square([[0, 0], [1, 0], [1, 1], [0, 1]], texture=turned))
    assert part.tangents == pytest.approx(np.tile((0, 1, 0, 1), (4, 1)))


def test_vertices_are_split_where_the_texture_is_mirrored() -> None:
    """Two squares side by side show one image, the second one mirrored: the vertices between them become two each."""
    positions = np.array([[x, y, 0] for y in (0, 1) for x in (0, 1, 2)], float)
    uvs = np.array([[u, v] for v in (0, 1) for u in (0, 1, 0)], float)
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    part = add_tangents(Part(positions, faces, MAPPED, np.tile((0.0, 0.0, 1.0), (6, 1)), uvs))
    assert len(part.positions) == 8
    assert np.array_equal(part.positions[part.faces], positions[faces])
    assert part.tangents is not None
    assert part.tangents[part.faces[:2]] == pytest.approx(np.broadcast_to((1, 0, 0, 1), (2, 3, 4)))
    assert part.tangents[part.faces[2:]] == pytest.approx(np.broadcast_to((-1, 0, 0, -1), (2, 3, 4)))


def test_vertices_that_are_alike_share_a_tangent() -> None:
    """A bent strip whose faces have vertices of their own gets the tangents of one whose faces share them."""
    positions = np.array([[0, 0, 0], [1, 0, 0.5], [2, 0, 0], [0, 1, 0], [1, 1, 0.5], [2, 1, 0]], float)
    normals = np.array([[-0.6, 0, 0.8], [0, 0, 1], [0.6, 0, 0.8]] * 2, float)
    uvs = positions[:, :2].copy()
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    shared = Part(positions, faces, MAPPED, normals, uvs)
    own = shared.pick(faces.ravel(), np.arange(12).reshape(-1, 3))
    one, other = add_tangents(shared), add_tangents(own)
    assert one.tangents is not None
    assert other.tangents is not None
    assert one.tangents[one.faces] == pytest.approx(other.tangents[other.faces])
    assert one.tangents[np.isclose(one.positions[:, 0], 1)][:, :3] == pytest.approx(np.tile((1, 0, 0), (2, 1)))


FLOATS = st.floats(-3, 3, allow_nan=False, width=32)


@settings(deadline=None)
@given(
    positions=npst.arrays(np.float64, (5, 3), elements=FLOATS),
    normals=npst.arrays(np.float64, (5, 3), elements=FLOATS),
    uvs=npst.arrays(np.float64, (5, 2), elements=FLOATS),
    smooth=st.booleans(),
)
def test_tangents_are_unit_and_at_right_angles(positions: Any, normals: Any, uvs: Any, smooth: bool) -> None:
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = np.divide(normals, length, out=np.zeros_like(normals), where=length > 1e-3)
    faces = np.array([[0, 1, 2], [0, 2, 3], [3, 4, 1], [0, 0, 1]])
    part = add_tangents(Part(positions, faces, MAPPED, unit if smooth else None, uvs))
    assert part.tangents is not None
    assert np.array_equal(part.positions[part.faces], positions[faces])
    known = part.tangents.any(axis=1)
    assert np.linalg.norm(part.tangents[known, :3], axis=1) == pytest.approx(np.ones(known.sum()))
    assert set(part.tangents[known, 3]) <= {-1.0, 1.0}
    if smooth:
        assert part.normals is not None
        assert np.abs((part.tangents[:, :3] * part.normals).sum(axis=1)).max() < 1e-6


def mapped_triangle(folder: Path, node: dict[str, Any], tangent: list[float] | None, normals: bool = True) -> Scene:
    """A triangle that faces +z, u along x and v along y, placed by a node, with a normal map that says UP."""
    material = {"normalTexture": {"index": 0}}
    document = Document(materials=[material], textures=[{"source": 0}], images=[{"uri": image_uri(UP)}])
    attributes = {"TEXCOORD_0": document.accessor(UVS)}
    if normals:
        attributes["NORMAL"] = document.accessor(np.tile(np.array([0, 0, 1], np.float32), (3, 1)))
    if tangent:
        attributes["TANGENT"] = document.accessor(np.tile(np.array(tangent, np.float32), (3, 1)))
    document.triangle({"material": 0}, node, **attributes)
    return load(document.write(folder / "m.gltf"))


@pytest.mark.parametrize("tangent", [None, [1, 0, 0, 1]], ids=["computed", "stored"])
@pytest.mark.parametrize("scale", [[1, 1, 1], [-1, 1, 1], [1, -1, 1], [2, 3, -1], [-1, -2, -3]], ids=str)
@pytest.mark.parametrize("normals", [True, False], ids=["smooth", "flat"])
def test_green_tilts_normals_to_where_the_image_s_top_is(
    tmp_path: Path, tangent: list[float] | None, scale: list[float], normals: bool
) -> None:
    """However a node mirrors the triangle: its image's top lies where +y of the model goes."""
    scene = mapped_triangle(tmp_path, {"scale": scale}, tangent, normals)
    geometry = scene.geometry
    towards = geometry.face_normals if not normals else np.array(geometry.normals[:1], float)  # type: ignore[index]
    points = SurfacePoints(geometry, scene.materials, scene.textures, np.array([0]), np.full((1, 3), 1 / 3))
    bent = points.bend_normals(towards)
    assert bent[0, 1] * np.sign(scale[1]) == pytest.approx(0.707, abs=0.01)
    assert bent[0, 2] == pytest.approx(0.707 * towards[0, 2], abs=0.01)
    assert abs(bent[0, 0]) < 0.01


def test_stored_tangents_are_kept_unless_normals_are_missing(tmp_path: Path) -> None:
    diagonal = [0.6, 0.8, 0, -1]
    stored = mapped_triangle(tmp_path, {}, diagonal).geometry.tangents
    assert stored == pytest.approx(np.tile(diagonal, (3, 1)))
    flat = mapped_triangle(tmp_path, {}, diagonal, normals=False).geometry
    assert flat.normals is None
    assert flat.tangents == pytest.approx(np.tile((1, 0, 0, 1), (3, 1)))


def test_stored_tangents_turn_and_lean_with_their_surface() -> None:
    shear = np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    rows = np.array([[0, 1, 0, 1], [1, 0, 0.3, -1], [0, 0, 0, 1], [np.nan, 0, 0, 1]])
    placed = place_tangents(rows, normals, shear)
    assert placed == pytest.approx(
        np.array([[0.5 / 1.25**0.5, 1 / 1.25**0.5, 0, 1], [1, 0, 0, -1], [0, 0, 0, 0], [0, 0, 0, 0]])
    )


def test_without_a_normal_map_there_are_no_tangents(tmp_path: Path) -> None:
    document = Document()
    document.triangle(
        NORMAL=document.accessor(np.tile(np.array([0, 0, 1], np.float32), (3, 1))),
        TEXCOORD_0=document.accessor(UVS),
        TANGENT=document.accessor(np.tile(np.array([1, 0, 0, 1], np.float32), (3, 1))),
    )
    geometry = load(document.write(tmp_path / "m.glb")).geometry
    assert geometry.tangents is None
    assert geometry.positions == pytest.approx(POSITIONS.astype(float))
