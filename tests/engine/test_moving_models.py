"""Models that move: what is drawn and traced is the scene that has them there from the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_scenes import (
    AROUND,
    BALL,
    BLOCK,
    TURN,
    UP,
    VECTORS,
    VIEW,
    WALLS,
    bake,
    pose_matrix,
    room_with_moving_models,
)
from small_scenes import box, build, move_away, plane, room, sphere, textured

from deferred_ir import load
from deferred_ir.engine.renderer import Renderer
from deferred_ir.meshes.posed import PosedMesh
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.reference import trace_reference

SIZE = (48, 32)
# Geometry


def test_only_what_moves_is_new():
    scene = room_with_moving_models()
    rest, there = scene.geometry, scene.at(0.3).geometry
    block = slice(8, 16)
    assert (there.positions[:8] == rest.positions[:8]).all()
    matrix = AROUND.matrix(0.3)
    np.testing.assert_allclose(there.positions[block], rest.positions[block] @ matrix[:3, :3].T + matrix[:3, 3])
    np.testing.assert_allclose(there.normals[16:], rest.normals[16:], atol=1e-7)  # the ball does not turn
    for name in ("faces", "face_materials", "uvs", "colors"):
        assert getattr(there, name) is getattr(rest, name)
    np.testing.assert_array_equal(there.face_normals, bake(scene, 0.3).geometry.face_normals)
    assert there.rest is rest


def test_distances_that_depend_on_the_scenes_size_stay():
    """Near plane, clamp and offsets would flicker."""
    scene = build(BLOCK, BALL, motions=(AROUND, ModelMotion((0.0, 1.0), ((5.0, 0, 0), (9.0, 0, 0)), (TURN, TURN))))
    moments = [scene.at(time).geometry for time in (0.0, 0.4, 1.0, 7.0)]
    assert len({moment.diagonal for moment in moments}) == 1
    assert len({Tracer(scene.at(time)).offset for time in (0.0, 0.5)}) == 1
    assert moments[0].diagonal == scene.geometry.diagonal > 8
    assert moments[0].bounds[1, 0] == pytest.approx(5.25, abs=0.02)
    assert moments[2].bounds[1, 0] == pytest.approx(9.25, abs=0.02)


def test_the_same_pose_is_the_same_object():
    scene = room_with_moving_models()
    assert scene.at(0.5).geometry is scene.at(0.5).geometry
    assert scene.at(7.0).geometry is scene.at(8.0).geometry  # at rest
    assert scene.at(0.5).geometry is not scene.at(0.6).geometry
    assert scene.at(0.5).at(1.0).geometry is scene.at(0.5).geometry  # a moment stays
    still = room()
    assert still.at(3.0).geometry is still.geometry
    far = move_away(scene)
    assert recentre(far.at(7.0)).geometry is recentre(far.at(8.0)).geometry


def test_a_pose_is_not_that_of_another_thread(monkeypatch):
    """The viewer poses the scene that plays while a reference of it is traced."""
    geometry, equal = room_with_moving_models().geometry, np.array_equal
    here, there = (np.stack([AROUND.matrix(time), UP.matrix(time)]) for time in (0.2, 0.9))
    expected = geometry.pose(here)

    def meanwhile(*arrays):
        monkeypatch.undo()
        geometry.pose(there)
        return equal(*arrays)

    monkeypatch.setattr(np, "array_equal", meanwhile)
    assert geometry.pose(here) is expected


def away_moving(scene: Scene, by: tuple[float, float, float]) -> Scene:
    """`scene` somewhere else, moving as it did."""
    models = tuple(
        replace(model, motion=model.motion.shift_origin((-by[0], -by[1], -by[2]))) if model.motion else model
        for model in scene.models
    )
    moving = tuple(model for model in models if model.motion)
    moved = move_away(scene, by)
    return replace(moved, models=models, geometry=replace(moved.geometry, moving=moving))


# Rays


@settings(max_examples=40)
@given(st.lists(st.tuples(VECTORS, VECTORS), min_size=2, max_size=2), st.integers(0, 2**31), st.booleans())
@pytest.mark.slow
def test_rays_meet_what_they_would_in_the_moved_scene(poses, seed, walls):
    meshes = (WALLS, BLOCK, BALL) if walls else (BLOCK, BALL)
    scene = build(*meshes, motions=(None, AROUND, UP)[3 - len(meshes) :])
    tracer = Tracer(scene.at(0.0))
    geometry = scene.geometry.pose(np.stack([pose_matrix(3 * np.array(turn), shift) for turn, shift in poses]))
    moved = replace(scene, geometry=geometry)
    tracer.follow(moved)
    fresh = Tracer(replace(scene, geometry=replace(scene.geometry, positions=geometry.positions, moving=())))
    rng = np.random.default_rng(seed)
    origins, directions = rng.uniform(-1.2, 1.2, (300, 3)), rng.normal(size=(300, 3))
    found, expected = (each.closest(origins, directions) for each in (tracer, fresh))
    same = found.face == expected.face
    assert same.mean() > 0.99  # but for rays that pass between two triangles
    np.testing.assert_allclose(found.position[same], expected.position[same], atol=1e-5)
    np.testing.assert_allclose(found.normal[same], expected.normal[same], atol=1e-6)
    np.testing.assert_array_equal(found.albedo[same], expected.albedo[same])
    targets = rng.uniform(-1, 1, (300, 3))
    assert (tracer.occluded(origins, targets) == fresh.occluded(origins, targets)).mean() > 0.99
    rows, near = tracer.within(origins, directions, 0.3)
    others, others_near = fresh.within(origins, directions, 0.3)
    assert len(np.setxor1d(rows, others)) < 3
    both = np.isin(rows, others), np.isin(others, rows)
    np.testing.assert_allclose(near.position[both[0]], others_near.position[both[1]], atol=1e-5)


def test_rays_in_the_planes_of_a_box_are_not_lost():
    scene = build(box((0, 0, 0), (1, 1, 1)), motions=(AROUND,))
    scene = replace(scene, geometry=scene.geometry.pose(np.eye(4)[None]))
    tracer = Tracer(scene)
    origins = np.array([[-1, 0.5, 0.5], [0.5, 2, 0.5], [0.5, 0.5, 0.5], [2, 3, 0.5]])
    directions = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, 1], [0, -1, 0]])
    assert tracer.closest(origins, directions).hit.tolist() == [True, True, True, False]


# Pictures


def assert_same(found: np.ndarray, expected: np.ndarray) -> None:
    """But for the last bits of VPLs, whose rays were turned."""
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * expected.max())


GRAPHS = ["deferred", "forward", "interleaved", "mapped"]


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_moved_scene_looks_as_if_made_so(renderer: Callable[..., Renderer], graph: str):
    one, other = renderer(SIZE, graph), renderer(SIZE, graph)
    scene = room_with_moving_models()
    for time in (0.0, 0.7, 0.2):
        direct = one.render(scene, vpls=0, time=time).radiance
        np.testing.assert_array_equal(direct, other.render(bake(scene, time), vpls=0).radiance)
        found = one.render(scene, vpls=8, time=time).radiance
        assert_same(found, other.render(bake(scene, time), vpls=8).radiance)
    assert not np.array_equal(found, one.render(scene, vpls=8, time=0.7).radiance)


@pytest.mark.parametrize("graph", ["resampled", "accurate"])
def test_pixels_that_choose_vpls_choose_the_same_but_for_roundings(renderer: Callable[..., Renderer], graph: str):
    one, other = renderer(SIZE, graph), renderer(SIZE, graph)
    scene = room_with_moving_models()
    for time in (0.0, 0.7, 0.2):
        direct = one.render(scene, vpls=0, time=time).radiance
        np.testing.assert_array_equal(direct, other.render(bake(scene, time), vpls=0).radiance)
        found = one.render(scene, vpls=8, time=time).radiance
        expected = other.render(bake(scene, time), vpls=8).radiance
        off = np.abs(found - expected).max(axis=-1) > 1e-5 * expected.max()
        assert off.mean() < 0.05  # the filter spreads a choice that flips
        assert found.mean() == pytest.approx(expected.mean(), rel=1e-3)
    assert not np.array_equal(found, one.render(scene, vpls=8, time=0.7).radiance)


@pytest.mark.parametrize("graph", ["deferred", "forward"])
@pytest.mark.parametrize(
    ("options", "tolerance"),
    [
        ({"projection": "paraboloid"}, 0.0),
        ({"projection": "paraboloid", "tessellation": "pre", "edge": 0.02}, 0.02),
        ({"vpl_deviation": 4.0}, 0.03),
        ({"vpl_deviation": 4.0, "projection": "paraboloid"}, 0.03),
    ],
)
def test_maps_show_what_moves_where_it_is(renderer, graph, options, tolerance):
    """Also in meshes that stand in for the scene: made at rest and of each model alone, they differ in little."""
    chosen = {f"shadow_maps.{name}": value for name, value in options.items()}
    one, other = renderer(SIZE, graph, set=chosen), renderer(SIZE, graph, set=chosen)
    scene = build(WALLS, BLOCK, sphere(0.3, 4), motions=(None, AROUND, UP), **VIEW)
    for time in (0.0, 0.9):
        found = one.render(scene, vpls=16, time=time).radiance
        expected = other.render(bake(scene, time), vpls=16).radiance
        off = np.abs(found - expected).max(axis=-1) > 1e-3 * expected.max()
        assert off.mean() <= tolerance
    still = other.render(bake(scene, 0.0), vpls=16).radiance
    assert (np.abs(still - expected).max(axis=-1) > 0.01 * expected.max()).mean() > 0.1


def test_a_reference_is_of_the_moved_scene():
    scene = room_with_moving_models()
    now, made = trace_reference(scene.at(0.7), SIZE, spp=4), trace_reference(bake(scene, 0.7), SIZE, spp=4)
    np.testing.assert_allclose(now.radiance, made.radiance, atol=1e-4 * made.radiance.max())


def test_a_textured_model_carries_its_texture(renderer):
    pixels = np.random.default_rng(0).integers(0, 255, (8, 8, 3))
    scene = room_with_moving_models()
    uvs = np.random.default_rng(1).random((len(scene.geometry.positions), 2))
    scene = textured(scene, pixels, uvs)
    one, other = renderer(SIZE), renderer(SIZE)
    for time in (0.2, 0.6):
        found = one.render(scene, vpls=4, time=time).radiance
        assert_same(found, other.render(bake(scene, time), vpls=4).radiance)


def test_far_from_the_origin(renderer):
    scene, far = room_with_moving_models(), away_moving(room_with_moving_models(), (1e5, -2e5, 3e5))
    one, other = renderer(SIZE), renderer(SIZE)
    for time in (0.0, 0.8):
        near, away_ = one.render(scene, vpls=8, time=time).radiance, other.render(far, vpls=8, time=time).radiance
        assert np.median(np.abs(near - away_)) < 1e-5
        assert (np.abs(near - away_).max(axis=-1) > 1e-2).mean() < 0.01


def test_a_model_whose_file_lies_far_out_is_as_sharp_as_others(renderer):
    """Rest positions do not go through 32 bits before they are moved."""
    far = replace(BALL, positions=BALL.positions + 1e6)
    back = ModelMotion((0.0,), ((-1e6 + 0.3, -1e6 - 0.5, -1e6),), ((0.0, 0.0, 0.0, 1.0),))
    here = ModelMotion((0.0,), ((0.3, -0.5, 0.0),), ((0.0, 0.0, 0.0, 1.0),))
    for options in ({}, {"shadow_maps.projection": "paraboloid", "shadow_maps.tessellation": "pre"}):
        one = renderer(SIZE, set=options)
        pictures = [
            one.render(build(WALLS, ball, motions=(None, motion), **VIEW), vpls=8).radiance
            for ball, motion in ((far, back), (BALL, here))
        ]
        assert np.median(np.abs(pictures[0] - pictures[1])) < 1e-6
        assert (np.abs(pictures[0] - pictures[1]).max(axis=-1) > 1e-2).mean() < 0.02


class Counted:
    """A buffer that notes what is written to it."""

    def __init__(self, buffer: Any) -> None:
        self.buffer, self.writes = buffer, []

    def write(self, data: bytes, offset: int = 0) -> None:
        self.writes.append((offset, len(data)))
        self.buffer.write(data, offset=offset)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.buffer, name)


def test_only_what_moved_is_written(renderer):
    one, scene = renderer(SIZE), room_with_moving_models()
    one.render(scene, vpls=4)
    buffers = one._buffers
    counted = {name: Counted(buffer) for name, (buffer, _) in buffers._attributes.items()}
    buffers._attributes = {name: (counted[name], kind) for name, (_, kind) in buffers._attributes.items()}
    buffers._faces = faces = Counted(buffers._faces)
    programs = dict(one.executor.library._programs)
    arrays = [array for program in programs.values() for array in program.arrays.values()]
    one.render(scene, vpls=4, time=0.5)
    ball = len(BALL.positions)
    assert counted["position"].writes == counted["normal"].writes == [(12 * 8, 12 * 8), (12 * 16, 12 * ball)]
    assert faces.writes == [(16 * 12, 16 * 12), (16 * 24, 16 * len(BALL.faces))]
    one.render(scene, vpls=4, time=0.5)
    one.render(scene, vpls=4, time=1.0)  # both
    one.render(scene, vpls=4, time=1.5)  # the ball alone
    assert [len(each.writes) for each in (counted["position"], faces)] == [5, 5]
    assert counted["position"].writes[-1] == (12 * 16, 12 * ball)
    assert one._buffers is buffers
    assert one.executor.library._programs == programs
    assert [array for program in programs.values() for array in program.arrays.values()] == arrays


def test_a_model_that_leaves_where_it_was(renderer):
    """Out of the bounds of all that rests: clusters' boxes and the tracer's follow."""
    motion = ModelMotion((0.0, 1.0), ((0.0, 0.0, 0.0), (0.0, 6.0, -6.0)), (TURN, TURN))
    scene = build(box((-1, -1, -1), (1, -0.9, 1)), BLOCK, motions=(None, motion))
    light = Spotlight((0.0, 7.5, -5.0), (0.0, 5.0, -6.0), 60.0, (5.0, 5.0, 5.0))
    scene = replace(
        scene, camera=replace(scene.camera, position=(0.0, 6.5, -3.0), look_at=(0.0, 6.0, -6.0)), lights=(light,)
    )
    one, other = renderer(SIZE), renderer(SIZE)
    one.render(scene, vpls=8)
    found = one.render(scene, vpls=8, time=1.0).radiance
    assert found.max() > 0.01
    assert_same(found, other.render(bake(scene, 1.0), vpls=8).radiance)


def test_beside_a_ground_that_is_cut_up(renderer):
    """Giant triangles are split before 32 bits hold them; the faces of moving models are then others by number."""
    ground = plane(1e5, -1.0)
    scene = build(box((-1, -1, -1), (1, 1, 1)), ground, BLOCK, BALL, motions=(None, None, AROUND, UP), **VIEW)
    assert len(recentre(scene.at(0.3)).geometry.faces) > len(scene.geometry.faces)
    one, other = renderer(SIZE), renderer(SIZE)
    for time in (0.2, 0.6):
        found = one.render(scene, vpls=8, time=time).radiance
        expected = other.render(bake(scene, time), vpls=8).radiance
        assert np.median(np.abs(found - expected)) < 1e-5 * expected.max()
        assert (np.abs(found - expected).max(axis=-1) > 1e-2 * expected.max()).mean() < 0.01


@pytest.mark.parametrize("graph", ["deferred", "interleaved"])
def test_what_is_kept_between_frames_sees_that_models_move(renderer, graph):
    one, other, scene = renderer(SIZE, graph, reuse=True), renderer(SIZE, graph), room_with_moving_models()
    for time in (0.0, 0.3, 0.3, 0.6, 5.0, 6.0):
        found = one.render(scene, vpls=8, time=time).radiance
        np.testing.assert_array_equal(found, other.render(scene, vpls=8, time=time).radiance)
        if time == 6.0:  # at rest since 2 s
            assert one.executor.counters["maps_drawn"] == 0


def test_a_move_that_is_broken_off_is_done_again(renderer, monkeypatch):
    one, other, scene = renderer(SIZE, reuse=True), renderer(SIZE), room_with_moving_models()
    one.render(scene, vpls=8)
    with monkeypatch.context() as broken:
        broken.setattr(PosedMesh, "move", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            one.render(scene, vpls=8, time=0.3)
    for time in (0.0, 0.3):
        found = one.render(scene, vpls=8, time=time).radiance
        np.testing.assert_array_equal(found, other.render(scene, vpls=8, time=time).radiance)


def test_a_motion_of_a_scene_file(tmp_path, renderer):
    """From the file to the picture; a motion that begins elsewhere than its file counts at time 0."""
    source = load("cornell").path.parent / "cornell.obj"
    text = f"""
    [[model]]
    path = "{source}"
    scale = 0.001
    [[model]]
    path = "{source}"
    scale = 0.0002
    [model.motion]
    times = [0, 1]
    translations = [[0.2, 0.1, 0.1], [0.4, 0.3, 0.1]]
    rotations = [[0, 0, 0, 1], [0, 0, 0, 1]]
    """
    path = tmp_path / "moving.toml"
    path.write_text(text)
    scene = load(path)
    first = scene.at(0.0).geometry.positions - scene.geometry.positions
    rest = scene.models[1].vertices
    np.testing.assert_allclose(first[rest], np.broadcast_to((0.2, 0.1, 0.1), first[rest].shape))
    assert (first[: rest.start] == 0).all()
    one = renderer(SIZE)
    pictures = [one.render(scene, vpls=4, time=time).radiance for time in (0.0, 0.5)]
    assert not np.array_equal(*pictures)
