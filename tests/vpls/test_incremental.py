"""VPLs that outlive their frame: invariants of every frame, whatever the light does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import mean_cone_factor
from hypothesis import given, settings
from hypothesis import strategies as st
from small_scenes import box, build, plane, room

from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos
from deferred_ir.vpls.incremental import IncrementalVpls
from deferred_ir.vpls.kept_lights import KeptVpls

ALBEDO = (0.5, 0.25, 0.125)
LIGHT = Spotlight((0.1, 0.2, -0.1), (0.3, -1.0, 0.4), 100.0, (3.0, 2.0, 1.0))
EMPTY = Tracer(build(box((-1, -1, -1), (1, 1, 1), ALBEDO)))
ROOM = Tracer(room())
SCENES = {"room": ROOM, "half": Tracer(build(plane(0.8, -0.5), plane(0.8, 0.4)))}


def run_frames(state, lights, tracer=EMPTY, least=4, most=8):
    return [state.update(light, tracer, least=least, most=most) for light in lights]


@st.composite
def paths(draw):
    """Draw frames of a light that drifts, jumps, turns and changes its cone, inside and outside the boxes' walls."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    position, aim, fov = rng.uniform(-0.8, 0.8, 3), rng.uniform(-1, 1, 3), rng.uniform(1, 179)
    radius = draw(st.sampled_from([0.0, 0.1]))
    lights = []
    for _ in range(draw(st.integers(1, 12))):
        event = draw(st.sampled_from(["drift", "drift", "drift", "still", "jump", "cone", "wall"]))
        if event == "drift":
            position, aim = position + rng.normal(0, 0.03, 3), aim + rng.normal(0, 0.03, 3)
        elif event == "jump":
            position, aim = rng.uniform(-1.2, 1.2, 3), rng.uniform(-1, 1, 3)
        elif event == "cone":
            fov = rng.uniform(1, 179)
        elif event == "wall":
            position = np.array([0.05, -0.6, -0.2])  # in the block that stands in `room`
        look_at = aim + np.array([0, 0, 3]) if np.linalg.norm(aim - position) < 0.1 else aim
        lights.append(Spotlight(tuple(position), tuple(look_at), fov, (3.0, 2.0, 1.0), radius))
    return lights


@settings(max_examples=60)
@given(
    lights=paths(),
    scene=st.sampled_from(sorted(SCENES)),
    count=st.sampled_from([1, 2, 3, 20, 64]),
    budget=st.sampled_from([(0, 0), (0, 3), (4, 8), (64, 64)]),
    seed=st.integers(0, 99),
)
@pytest.mark.slow
def test_what_holds_in_every_frame(lights, scene, count, budget, seed):
    tracer, (least, most) = SCENES[scene], budget
    one, same = IncrementalVpls(count, seed), IncrementalVpls(count, seed)
    for light in lights:
        before, was = one.version.copy(), one.used.copy()
        vpls = one.update(light, tracer, least=least, most=most)
        again = same.update(light, tracer, least=least, most=most)
        # A seed gives the same frames again.
        assert (vpls.ray == again.ray).all()
        assert (vpls.emission == again.emission).all()
        assert (vpls.position == again.position).all()
        # The budget is respected, and used where there is room.
        fresh = one.used & ((one.version != before) | ~was)
        assert fresh.sum() <= most
        assert most == 0 or one.used.any()
        # Slots are shared by none, and stay a VPL's own.
        assert len(set(vpls.ray)) == len(vpls) <= count
        # All of the light is accounted for.
        if one.used.any():
            assert one.weights.sum() == pytest.approx(1, abs=1e-6)
        assert (one.weights[~one.used] == 0).all()
        # Every VPL is seen by the light, in its cone and from the front.
        origins = one._origins(light)[vpls.ray]
        way = vpls.position - origins
        distance = np.linalg.norm(way, axis=1)
        off_axis = ((way / distance[:, None] - light.axis) ** 2).sum(axis=1) / 2
        assert (off_axis <= one_minus_cos(light.fov) * (1 + 1e-3)).all()
        assert ((way * vpls.normal).sum(axis=1) < 0).all()
        assert not tracer.occluded(origins, tracer.lift(vpls.position, vpls.normal)).any()
        assert np.isfinite(vpls.emission).all()
        assert (vpls.emission >= 0).all()


def test_vpls_that_stay_keep_slot_position_and_version():
    state = IncrementalVpls(64)
    for step in range(30):
        light = replace(LIGHT, position=(0.1 + 0.01 * step, 0.2, -0.1))
        before = state.version.copy(), state.position.copy()
        state.update(light, EMPTY, least=4, most=8)
        stays = (state.version == before[0]) & state.used
        np.testing.assert_array_equal(state.position[stays], before[1][stays])
        assert stays.sum() >= min(8 * step, 64) - 16


@pytest.mark.parametrize("count", [64, 256])
def test_the_power_is_that_of_the_light(count):
    state = IncrementalVpls(count, seed=3)
    vpls = run_frames(state, [LIGHT] * (count // 8))[-1]
    assert len(vpls) == count
    expected = np.array(LIGHT.emission) * math.sin(math.radians(50)) ** 2 * ALBEDO * mean_cone_factor(100)
    np.testing.assert_allclose(vpls.emission.sum(axis=0), expected, rtol=1e-6)


@pytest.mark.parametrize("radius", [0.0, 0.2])
@pytest.mark.slow
def test_a_light_that_moves_there_gives_as_much_as_one_that_stands_there(radius):
    """Weights follow the light: after a long path the sum is that of a light that never moved."""
    way = [replace(LIGHT, position=(0.1 + 0.005 * i, 0.2, -0.1), radius=radius) for i in range(60)]
    moved = run_frames(IncrementalVpls(128), way)[-1]
    still = run_frames(IncrementalVpls(128), [way[-1]] * 16)[-1]
    np.testing.assert_allclose(moved.emission.sum(axis=0), still.emission.sum(axis=0), rtol=1e-6)


def test_a_still_light_comes_to_rest():
    state = IncrementalVpls(64)
    run_frames(state, [LIGHT] * 24)
    before = state.version.copy()
    run_frames(state, [LIGHT] * 8)
    assert (state.version == before).all()


def test_sites_spread_out_again_after_the_light_has_moved():
    state = IncrementalVpls(64)
    run_frames(state, [LIGHT] * 8)
    far = replace(LIGHT, position=(0.6, 0.6, -0.1))
    run_frames(state, [far])
    uneven = state.weights.max()
    run_frames(state, [far] * 40)
    assert state.weights.max() < 0.7 * uneven


def test_a_ray_that_misses_loses_its_cells_light_and_is_not_tried_again():
    tracer = Tracer(build(plane(0.3, -1.0)))
    light = replace(LIGHT, position=(0.0, 0.0, 0.0), look_at=(0.0, -1.0, 0.0), fov=120.0)
    state = IncrementalVpls(64)
    vpls = run_frames(state, [light] * 16, tracer)[-1]
    assert state.used.all()
    assert 3 < len(vpls) < 32
    before = state.version.copy()
    again = run_frames(state, [light] * 4, tracer)[-1]
    assert (state.version == before).all()
    assert len(again) == len(vpls)
    whole = run_frames(IncrementalVpls(64), [light] * 16, Tracer(build(plane(99.0, -1.0))))[-1]
    assert vpls.emission.sum() < 0.5 * whole.emission.sum()
    # Where there is something to meet later on, the site is free for it.
    assert len(run_frames(state, [light] * 16, Tracer(build(plane(99.0, -1.0))))[-1]) == 64


def test_black_surfaces_hold_their_sites_and_make_no_vpl():
    state = IncrementalVpls(16)
    assert len(run_frames(state, [LIGHT] * 4, Tracer(build(box((-1, -1, -1), (1, 1, 1), (0, 0, 0)))))[-1]) == 0
    assert state.used.all()


def test_a_light_that_jumps_is_refilled_within_the_budget():
    state = IncrementalVpls(64)
    run_frames(state, [LIGHT] * 8)
    away = replace(LIGHT, look_at=(0.1, 1.0, -0.1))
    alive = [len(vpls) for vpls in run_frames(state, [away] * 8)]
    assert alive[0] < 24
    assert (np.diff(alive) <= 8).all()
    assert alive[-1] == 64


def test_a_light_of_another_kind_that_is_switched_on_gets_vpls():
    spot = Spot((0.1, 0.2, -0.1), (0.3, -1.0, 0.4), 60.0, intensity=(3.0, 2.0, 1.0))
    switched, fresh = KeptVpls(64), KeptVpls(64)
    for _ in range(8):
        switched.update((LIGHT,), EMPTY, least=2, most=8)
    for _ in range(8):
        after, wanted = (vpls.update((LIGHT, spot), EMPTY, least=2, most=8) for vpls in (switched, fresh))
    assert 0 < (~wanted.kept).sum() < 64
    np.testing.assert_array_equal(after.vpls.emission, wanted.vpls.emission)
