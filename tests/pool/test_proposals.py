"""Lists of VPLs for tiles: every VPL stands in them as often as its weight says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.pool import proposals
from deferred_ir.pool.proposals import EVEN, Groups, draw_lists, order_along_curve


def sums(found, weight, count):
    """How often each VPL is in each list, by its weight, (t, count)."""
    total = np.zeros((len(found), count))
    for tile, (members, weights) in enumerate(zip(found, weight, strict=True)):
        np.add.at(total[tile], members, weights)
    return total


@pytest.mark.parametrize("scores", ["none", "even", "one", "wild"])
@pytest.mark.parametrize(("vpls", "groups"), [(40, 8), (5, 8), (1, 1)])
def test_in_the_mean_each_vpl_counts_once(monkeypatch, scores, vpls, groups):
    monkeypatch.setattr(proposals, "GROUPS", groups)
    rng = np.random.default_rng(1)
    power = rng.random(vpls) + 0.1
    power[::7] = 0
    power[-1] = 1
    parted = Groups.of_power(power)
    shape = (3, len(parted.power))
    scored = {
        "none": np.zeros(shape),
        "even": np.ones(shape),
        "one": np.eye(*shape),
        "wild": rng.random(shape) ** 8 * 1e20,
    }[scores].astype(np.float32)
    runs = np.array([sums(*draw_lists(scored, parted, 16, rng), vpls) for _ in range(3000)])
    error = runs.std(axis=0) / np.sqrt(len(runs))
    alive = power > 0
    assert (np.abs(runs.mean(axis=0) - 1) <= 4.5 * error + 1e-6)[:, alive].all()
    assert (runs[..., ~alive] == 0).all()


@given(st.integers(1, 300), st.integers(1, 64), st.integers(0, 1000))
def test_no_group_is_in_a_list_more_than_once_beyond_its_part(vpls, entries, seed):
    rng = np.random.default_rng(seed)
    parted = Groups.of_power(rng.random(vpls) + 0.01)
    scores = rng.random((2, vpls)).astype(np.float32)
    found, _ = draw_lists(scores, parted, entries, rng)
    chance = (1 - EVEN) * scores / scores.sum(axis=1, keepdims=True) + EVEN * parted.power / parted.power.sum()
    for tile in range(2):
        drawn = np.bincount(found[tile], minlength=vpls)
        assert np.abs(drawn - entries * chance[tile]).max() < 1 + 1e-3
        assert (np.diff(found[tile]) >= 0).all()  # along the curve


def test_no_weight_exceeds_what_power_alone_allows():
    """A VPL that the probes of a tile do not see can light the tile: its weight must stay finite, and small."""
    parted = Groups.of_power(np.ones(64))
    scores = np.zeros((1, 64), np.float32)
    scores[0, 0] = 1
    _, weight = draw_lists(scores, parted, 32, np.random.default_rng(0))
    assert weight.max() <= 64 / (32 * EVEN) * (1 + 1e-5)


@pytest.mark.parametrize("power", [np.zeros(0), np.zeros(9)])
def test_without_power_lists_hold_nobody(power):
    parted = Groups.of_power(power)
    found, weight = draw_lists(np.zeros((2, len(parted.power)), np.float32), parted, 4, np.random.default_rng(0))
    assert found.shape == weight.shape == (2, 4)
    assert not weight.any()


@given(st.integers(0, 200), st.floats(1e-20, 1e20))
def test_the_curve_visits_every_vpl_once_at_any_scale(count, scale):
    rng = np.random.default_rng(count)
    position, normal = rng.random((count, 3)), rng.normal(size=(count, 3))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    order = order_along_curve(position * scale, normal)
    assert sorted(order) == list(range(count))
    assert (order == order_along_curve(position, normal)).mean() >= 0.9 if count else True
