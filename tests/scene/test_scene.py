"""What a scene derives from its arrays: normals, bounds, hash."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import GREY, Mesh, box, build, plane, room, textured

from deferred_ir.base.errors import SettingError
from deferred_ir.frame.facts import (
    DIRECT_LIGHTS,
    EMISSION,
    EMITS,
    ENVIRONMENT,
    SAMPLED,
    SOFT,
    TRIANGLES,
    VIEWS,
    collect_facts,
)
from deferred_ir.loading.load import load
from deferred_ir.profiling.light_scenes import SCENES
from deferred_ir.scene.motion import LissajousMotion, ModelMotion
from deferred_ir.scene.scene import Geometry

STILL = ModelMotion((0.0,), ((0, 0, 0),), ((0, 0, 0, 1),))


def test_face_normals_follow_the_winding():
    np.testing.assert_allclose(build(plane()).geometry.face_normals, [[0, 1, 0], [0, 1, 0]], atol=1e-15)
    cube = build(box((-1, -1, -1), (1, 1, 1))).geometry
    centres = cube.positions[cube.faces].mean(axis=1)
    assert ((cube.face_normals * centres).sum(axis=1) > 0.99).all()


@given(st.floats(-150, 150))
def test_face_normals_are_unit_at_any_size(exponent):
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1]]) * 10.0**exponent
    geometry = Geometry(triangle, np.array([[0, 1, 2]], "i4"), np.zeros(1, "i4"))
    np.testing.assert_allclose(geometry.face_normals, [[0, -np.sqrt(0.5), np.sqrt(0.5)]])


@pytest.mark.parametrize(
    "corners", [[[0, 0, 0]] * 3, [[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[5, 5, 5], [5, 5, 5], [6, 5, 5]]]
)
def test_a_degenerate_face_has_a_unit_normal_all_the_same(corners):
    geometry = Geometry(np.array(corners, float), np.array([[0, 1, 2]], "i4"), np.zeros(1, "i4"))
    np.testing.assert_array_equal(geometry.face_normals, [[0, 1, 0]])


def test_bounds_and_diagonal_are_those_of_what_faces_use():
    stray = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [99.0, 99, 99]]), np.array([[0, 1, 2]]), GREY)
    geometry = build(stray).geometry
    np.testing.assert_array_equal(geometry.bounds, [[0, 0, 0], [1, 2, 0]])
    assert geometry.diagonal == pytest.approx(np.sqrt(5))


def test_facts_say_whether_the_light_shines_and_how_many_triangles_there_are():
    scene = room()
    facts = collect_facts(scene)
    assert [facts[fact] for fact in (EMITS, SOFT, TRIANGLES, DIRECT_LIGHTS)] == [True, False, 24, 1]
    assert [facts[fact] for fact in (VIEWS, SAMPLED, ENVIRONMENT, EMISSION)] == [(0,), False, None, False]
    everything = collect_facts(SCENES["mixture"]())
    assert everything[DIRECT_LIGHTS] == 4
    assert len(everything[VIEWS]) == 1 + 6 + 1 + 1
    assert everything[ENVIRONMENT] == (128, 64)
    assert (everything[SAMPLED], everything[EMISSION]) == (True, True)
    dim, dark = (replace(scene, lights=(replace(scene.spotlight, emission=(0, 0, e)),)) for e in (1e-9, 0))
    assert dim.emits
    assert not dark.emits


def changed():
    """Return scenes that differ from `textured(room())` in one thing each, by name."""
    base = base_scene()
    g, light, camera = base.geometry, base.spotlight, base.camera
    moved = g.positions.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], 9)
    pixels = base.textures[0].pixels.copy()
    pixels[0, 0, 0] += 1
    colored = replace(g, colors=np.ones_like(g.positions, "f4"))
    return {
        "a vertex": replace(base, geometry=replace(g, positions=moved)),
        "a face": replace(base, geometry=replace(g, faces=g.faces[:, [1, 2, 0]])),
        "a face's material": replace(base, geometry=replace(g, face_materials=g.face_materials[::-1])),
        "normals": replace(base, geometry=replace(g, normals=np.zeros_like(g.positions, "f4"))),
        "uvs": replace(base, geometry=replace(g, uvs=g.uvs + 1)),
        "colours": replace(base, geometry=colored),
        "an albedo": replace(
            base, materials=(replace(base.materials[0], base_color=(0.1, 0.2, 0.3)), *base.materials[1:])
        ),
        "a texel": replace(base, textures=(replace(base.textures[0], pixels=pixels),)),
        "a texture's shape": replace(
            base, textures=(replace(base.textures[0], pixels=base.textures[0].pixels.reshape(1, 4, 3)),)
        ),
        "the camera": replace(base, camera=replace(camera, fov=camera.fov + 1e-9)),
        "the light": replace(base, lights=(replace(light, emission=(3.0, 2.5, 2.1)),)),
        "the light's radius": replace(base, lights=(replace(light, radius=0.1),)),
        "the light's motion": replace(base, lights=(replace(light, motion=LissajousMotion((1, 1, 1), (1, 1))),)),
        "a model's motion": replace(base, models=(replace(base.models[0], motion=STILL),)),
    }


def base_scene():
    return textured(room(), np.arange(12).reshape(2, 2, 3), np.zeros((len(room().geometry.positions), 2)))


def test_the_hash_is_the_same_for_the_same_scene_whatever_it_is_called():
    assert base_scene().hash == base_scene().hash
    assert replace(base_scene(), name="other", notes=("a note",)).hash == base_scene().hash
    assert len(base_scene().hash) == 16
    int(base_scene().hash, 16)


def test_the_hash_changes_with_everything_that_a_picture_depends_on():
    hashes = {name: scene.hash for name, scene in changed().items()}
    hashes["nothing"] = base_scene().hash
    assert len(set(hashes.values())) == len(hashes)


@pytest.mark.parametrize("time", [float("nan"), float("inf")])
def test_a_time_is_finite(time: float) -> None:
    with pytest.raises(SettingError, match="must be finite"):
        load("cornell").at(time)
