"""VPLs that outlive their frame while models move: which are removed, which maps are redrawn, and when all rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moving_scenes import AROUND, UP, VECTORS, WALLS, bake, pose_matrix, room_with_moving_block, room_with_moving_models
from shadow_atlas import read_atlas, read_vpl_maps
from small_scenes import box, build

from deferred_ir.frame.direct_lights import LightVersions, describe_views, list_kinds, pack_lights
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.vertices import transform_points
from deferred_ir.vpls.incremental import FARTHEST, IncrementalVpls
from deferred_ir.vpls.stale_maps import StaleMaps

SIZE = (48, 32)
SETTINGS = {"vpl.count": 24, "shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32, "direct_rays.visibility": "maps"}
LIGHT = Spotlight((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 110.0, (3.0, 2.5, 2.0))
STILL = (0.0, 0.0, 0.0, 1.0)
SCENE = room_with_moving_models()
TRACER = Tracer(SCENE.at(0.0))


def pack(scene):
    return pack_lights(scene, describe_views(scene), list_kinds(scene))


def corners(box_of: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*box_of.T), axis=-1).reshape(-1, 3)


@settings(max_examples=15)
@given(
    steps=st.lists(st.one_of(st.none(), st.tuples(st.integers(0, 1), VECTORS, VECTORS)), min_size=2, max_size=10),
    budget=st.sampled_from([(0, 0), (0, 1), (4, 8), (2, 3), (48, 48)]),
    seed=st.integers(0, 99),
)
@pytest.mark.slow
def test_what_holds_in_every_frame(steps, budget, seed):
    """Each step moves one model, or none."""
    least, most = budget
    one, same = IncrementalVpls(48, seed), IncrementalVpls(48, seed)
    poses = np.stack([AROUND.matrix(0.2), UP.matrix(0.2)])
    seen_since = np.zeros(48, bool)  # a model has moved before a slot's VPL since its map was drawn
    geometry = SCENE.geometry.pose(poses)
    for step in steps:
        before, poses = geometry, poses.copy()
        if step:
            poses[step[0]] = pose_matrix(3 * np.array(step[1]), 0.6 * np.array(step[2]))
        geometry = SCENE.geometry.pose(poses)
        TRACER.follow(replace(SCENE, geometry=geometry))
        version, used, group, position = (a.copy() for a in (one.version, one.used, one._group, one.position))
        vpls = one.update(LIGHT, TRACER, least=least, most=most)
        again = same.update(LIGHT, TRACER, least=least, most=most)
        assert (vpls.ray == again.ray).all()
        assert (vpls.emission == again.emission).all()
        # New sites and maps drawn again, together.
        drawn = one.used & ((one.version != version) | ~used)
        assert drawn.sum() <= most
        # What lies on the moved model has gone with it, and every VPL is seen where things are now.
        stays = used & one.used & ~drawn
        for number, (now, then) in enumerate(zip(geometry.poses, before.poses, strict=True)):
            own = stays & (group == 1 + number)
            expected = transform_points(position[own], now @ np.linalg.inv(then))
            np.testing.assert_allclose(one.position[own], expected, atol=1e-12)
        assert (one._measure_lag()[one.used] <= FARTHEST * geometry.diagonal).all()
        where, normal = one.position[vpls.ray], one.normal[vpls.ray]
        origins = np.broadcast_to(np.array(LIGHT.position), where.shape)
        way = where - origins
        distance = np.linalg.norm(way, axis=1)
        assert (((way / distance[:, None] - LIGHT.axis) ** 2).sum(axis=1) / 2 <= one_minus_cos(110) * 1.001).all()
        assert ((way * normal).sum(axis=1) < 0).all()
        assert not TRACER.occluded(origins, TRACER.lift(where, normal)).any()
        if one.used.any():
            assert one.weights.sum() == pytest.approx(1, abs=1e-6)
        # Every map that misses something is known to.
        if step:
            for where in (before.boxes[step[0]], geometry.boxes[step[0]]):
                off = (corners(where)[None] - one.shaded_position[:, None]) @ one.shaded_normal[:, :, None]
                seen_since |= (off[..., 0] > 1e-9).any(axis=1) & (not np.array_equal(before.poses, geometry.poses))
        seen_since &= ~drawn
        missing = np.isin(np.arange(48), vpls.ray) & seen_since
        assert one._maps.stale[missing].all()
        assert one._maps.stale.sum() <= len(vpls)


@pytest.mark.parametrize("most", [1, 2, 8, 24])
@pytest.mark.slow
def test_stale_maps_are_drawn_again_and_then_it_rests(most):
    # A block in a corner that the light does not see, but the walls do.
    light = replace(LIGHT, look_at=(-0.4, 0.5, 0.2), fov=30.0)
    scene = build(WALLS, box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), motions=(None, UP), spotlight=light)
    tracer = Tracer(scene.at(0.0))
    state = IncrementalVpls(24)
    for _ in range(40):
        state.update(light, tracer, least=0, most=most)
    assert state.at_rest
    tracer.follow(scene.at(0.1))
    seen, before = state.used.sum(), state.version.copy()
    assert seen == 24
    frames, changed = 0, []
    while True:
        state.update(light, tracer, least=0, most=most)
        if (state.version == before).all():
            break
        changed.append(np.flatnonzero(state.version != before))
        assert len(changed[-1]) <= most
        before, frames = state.version.copy(), frames + 1
    once = np.concatenate(changed)
    assert len(once) == len(set(once.tolist())) == 24
    assert frames == -(-24 // most)
    assert state.at_rest


def test_maps_that_do_most_harm_come_first():
    maps = StaleMaps(4)
    scene = build(WALLS, box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), motions=(None, UP))
    where = np.array([(0.4, -1.0, 0.3), (-0.9, -1.0, 0.9), (0.4, -1.0, 0.3), (0.4, -1.0, 0.3)])
    maps.follow(scene.at(0.0).geometry)
    maps.follow(scene.at(0.1).geometry)
    maps.age(np.array([True, True, True, False]), np.array([False, False, True, False]), where)
    assert maps.stale.tolist() == [True, True, True, False]
    # The light that went along before the one nearby, that before one far off, and a strong one before all.
    assert maps.find_worst(np.ones(4), 8).tolist() == [2, 0, 1]
    assert maps.find_worst(np.ones(4), 1).tolist() == [2]
    assert maps.find_worst(np.array([1.0, 1e3, 1.0, 1.0]), 2).tolist() == [1, 2]
    # What is drawn is right again, and what stays wrong adds up: none is passed over for ever.
    maps.mark_drawn(np.array([2, 0]))
    assert maps.find_worst(np.ones(4), 8).tolist() == [1]
    maps.follow(scene.at(0.2).geometry)
    for _ in range(40):
        maps.age(np.array([True, True, False, False]), np.zeros(4, bool), where)
        first = maps.find_worst(np.ones(4), 1)
        maps.mark_drawn(first)
        if first[0] == 1:
            break
    assert first.tolist() == [1]


def test_lights_that_a_model_moves_behind_do_not_notice():
    # The model moves above the light, which looks down: it is behind the light and before its VPLs on the floor.
    light = Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 60.0)
    shade = ModelMotion((0.0, 1.0), ((0.0, 0.5, 0.0), (0.2, 0.5, 0.0)), (STILL, STILL))
    scene = build(WALLS, box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), motions=(None, shade), spotlight=light)
    tracer, state = Tracer(scene.at(0.0)), IncrementalVpls(16)
    state.update(light, tracer, least=0, most=16)
    spotlight, before = LightVersions(), state.version.copy()
    spot = spotlight.update(pack(scene), scene.at(0.0))
    tracer.follow(scene.at(0.5))
    state.update(light, tracer, least=0, most=16)
    assert spotlight.update(pack(scene), scene.at(0.5)) == spot
    assert (state.version != before).all()
    # Below the floor, behind the VPLs and before the light: the other way round.
    deep = replace(shade, translations=((0.0, -3.0, 0.0), (0.2, -3.0, 0.0)))
    scene = build(WALLS, box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)), motions=(None, deep), spotlight=light)
    tracer, state = Tracer(scene.at(0.0)), IncrementalVpls(16)
    state.update(light, tracer, least=0, most=16)
    spotlight, before = LightVersions(), state.version.copy()
    spot = spotlight.update(pack(scene), scene.at(0.0))
    tracer.follow(scene.at(0.5))
    state.update(light, tracer, least=0, most=16)
    assert spotlight.update(pack(scene), scene.at(0.5)) != spot
    assert (state.version == before).all()


def test_a_ray_that_missed_finds_a_model_that_comes():
    light = Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 60.0)
    comes = ModelMotion((0.0, 1.0), ((9.0, -1.0, 0.0), (0.0, -1.0, 0.0)), (STILL, STILL))
    scene = build(box((8, 8, 8), (9, 9, 9)), box((-2, -0.1, -2), (2, 0.1, 2)), motions=(None, comes), spotlight=light)
    tracer, state = Tracer(scene.at(0.0)), IncrementalVpls(16)
    assert len(state.update(light, tracer, least=0, most=16)) == 0
    tracer.follow(scene.at(1.0))
    assert len(state.update(light, tracer, least=0, most=16)) == 16


@pytest.mark.slow
def test_vpls_go_with_their_model_and_shine_from_where_their_maps_are():
    """With more VPLs than the budget, each is redrawn in its turn, none lags far, and in the end none lags."""
    light = replace(LIGHT, position=(0.0, 0.9, 0.0), look_at=(0.0, -1.0, 0.0))
    slides = ModelMotion((0.0, 1.0), ((0.0, -0.5, 0.0), (0.0, -0.5, 0.6)), (STILL, STILL))
    scene = build(WALLS, box((-0.7, -0.1, -0.7), (0.7, 0.1, 0.7)), motions=(None, slides), spotlight=light)
    tracer, state = Tracer(scene.at(0.0)), IncrementalVpls(64)
    for _ in range(12):
        state.update(light, tracer, least=4, most=8)
    own = state._group == 1
    assert own.sum() > 16
    for frame in range(1, 13):
        tracer.follow(scene.at(frame / 30))
        before, used = state.version.copy(), state.used.copy()
        vpls = state.update(light, tracer, least=4, most=8)
        drawn = (state.version != before) & state.used
        assert drawn.sum() <= 8
        assert (drawn & used & (state._group == 1)).sum() >= 1  # new ones do not take the whole budget
        np.testing.assert_array_equal(vpls.position, state.shaded_position[vpls.ray])
        assert state._measure_lag().max() <= 0.02 * own.sum() / 2 + 1e-9
    assert state._measure_lag().max() > 0.05
    assert state.used.sum() > 56
    for _ in range(40):
        vpls = state.update(light, tracer, least=4, most=8)
    assert state.at_rest
    np.testing.assert_array_equal(vpls.position, state.position[vpls.ray])


def test_a_vpl_on_a_model_that_jumps_is_removed():
    light = replace(LIGHT, position=(0.0, 0.9, 0.0), look_at=(0.0, -1.0, 0.0), fov=60.0)
    jumps = ModelMotion((0.0, 1.0), ((0.0, -0.5, 0.0), (0.0, 0.1, 0.0)), (STILL, STILL))
    scene = build(WALLS, box((-0.7, -0.1, -0.7), (0.7, 0.1, 0.7)), motions=(None, jumps), spotlight=light)
    tracer, state = Tracer(scene.at(0.0)), IncrementalVpls(32)
    for _ in range(4):
        state.update(light, tracer, least=0, most=8)
    tracer.follow(scene.at(1.0))
    vpls = state.update(light, tracer, least=0, most=8)
    assert 0 < len(vpls) <= 8
    assert (vpls.position[:, 1] > 0).all()


# In the graph


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_maps_at_rest_hold_what_maps_drawn_anew_hold(renderer, projection):
    """And no frame draws more maps than the budget allows, besides the spotlight's."""
    scene = room_with_moving_models()
    one = renderer(SIZE, "incremental", set={**SETTINGS, "shadow_maps.projection": projection})
    plan = one.plan(scene)
    for step in range(12):
        one.draw(scene, plan, time=step / 30)
        assert one.executor.counters["maps_drawn"] <= 1 + 8
    for _ in range(16):
        one.draw(scene, plan, time=12 / 30)
        if one.executor.counters["maps_drawn"] == 0:
            break
    assert one.executor.counters["maps_drawn"] == 0
    kept, spot = read_vpl_maps(one), read_atlas(one)[0]
    assert len(kept) > 16
    one.executor.state("shadow_maps").params = None  # so that all maps are drawn anew
    one.draw(scene, plan, time=12 / 30)
    assert one.executor.counters["maps_drawn"] == 1 + len(kept)
    anew = read_vpl_maps(one)
    assert all((kept[tile] == anew[tile]).all() for tile in kept)
    assert (read_atlas(one)[0] == spot).all()


def test_direct_light_never_lags(renderer):
    scene = room_with_moving_block()
    one, other = renderer(SIZE, "incremental", set={**SETTINGS, "vpl.most": 0, "vpl.least": 0}), renderer(SIZE)
    other.configure(set={"shadow_maps.spot_size": 128})
    for step in range(4):
        found = one.render(scene, time=step / 10).radiance
        np.testing.assert_array_equal(found, other.render(bake(scene, step / 10), vpls=0).radiance)


def test_a_seed_gives_the_same_frames_again(renderer):
    scene, runs = room_with_moving_models(), []
    one = renderer(SIZE, "incremental", set=SETTINGS)
    plan = one.plan(scene)
    for _ in range(2):
        frames = []
        for step in range(5):
            one.draw(scene, plan, seed=3, time=step / 30)
            frames.append(one.read(plan).radiance)
        runs.append(frames)
        one.reset()
    np.testing.assert_array_equal(*runs)


def test_with_the_whole_budget_it_is_as_good_as_afresh(renderer):
    """All stale maps are redrawn at once, so the remaining difference is that of two sets of VPLs."""
    scene = room_with_moving_block()
    one = renderer(SIZE, "incremental", set={**SETTINGS, "vpl.most": 64, "vpl.count": 64, "vpl.least": 0})
    plan = one.plan(scene)
    for step in range(6):
        one.draw(scene, plan, time=step / 10)
    kept = one.read(plan).radiance
    one.reset()
    one.draw(scene, plan, time=0.5)
    afresh = one.read(plan).radiance
    assert kept.mean() == pytest.approx(afresh.mean(), rel=0.05)


def test_an_update_that_is_broken_off_starts_afresh(renderer, monkeypatch):
    """Otherwise some VPLs would have moved with their models, and others not."""
    one, fresh = (renderer(SIZE, "incremental", set=SETTINGS) for _ in range(2))
    for time in (0.0, 0.1, 0.2):
        one.render(SCENE, time=time)
    with monkeypatch.context() as broken:
        broken.setattr(StaleMaps, "age", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            one.render(SCENE, time=0.5)
    for time in (0.5, 0.6):
        np.testing.assert_array_equal(*(made.render(SCENE, time=time).radiance for made in (one, fresh)))
