"""Chances of the groups of a pool in tiles, and the power of VPLs within their groups."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.pool import proposals
from deferred_ir.pool.proposals import (
    EVEN,
    add_up_chances,
    count_groups,
    draw_members,
    order_along_curve,
    share_power,
)


def make_power(rng, count):
    power = rng.random(count) ** 4
    power[::7] = 0
    power[-1] = 1
    return power


@given(st.integers(1, 300), st.integers(1, 40), st.integers(0, 1000))
def test_shares_and_parts_give_each_vpl_its_power(vpls, groups, seed):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proposals, "GROUPS", groups)
        power = make_power(np.random.default_rng(seed), vpls)
        shares, within = share_power(power)
        groups = count_groups(vpls)
    starts = np.arange(groups + 1) * vpls // groups
    assert shares.sum() == pytest.approx(1)
    for share, first, last in zip(shares, starts, starts[1:], strict=False):
        parts = np.diff(within[first:last], prepend=0)
        np.testing.assert_allclose(share * parts, power[first:last] / power.sum(), atol=1e-12)
        assert within[last - 1] == (1 if share > 0 else 0)  # exactly: the shader looks for it


@given(st.integers(1, 60), st.integers(1, 20), st.integers(0, 1000))
def test_a_member_is_of_its_group_and_shines(vpls, groups, seed):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proposals, "GROUPS", groups)
        rng = np.random.default_rng(seed)
        power = make_power(rng, vpls)
        shares, within = share_power(power)
        drawn = draw_members(within, rng.choice([0.0, 0.5, 1 - 1e-16], len(shares)))
    starts = np.arange(len(shares) + 1) * vpls // len(shares)
    assert ((drawn >= starts[:-1]) & (drawn < starts[1:])).all()
    assert (power[drawn] > 0)[shares > 0].all()


def test_members_are_drawn_by_power(monkeypatch):
    monkeypatch.setattr(proposals, "GROUPS", 2)
    power = np.array([1.0, 0.0, 3.0, 2.0, 2.0, 0.0])
    _, within = share_power(power)
    rng = np.random.default_rng(3)
    drawn = np.concatenate([draw_members(within, rng.random(2)) for _ in range(4000)])
    np.testing.assert_allclose(np.bincount(drawn, minlength=6) / 4000, [0.25, 0, 0.75, 0.5, 0.5, 0], atol=0.03)


@pytest.mark.parametrize("scores", ["none", "even", "one", "wild"])
def test_chances_are_those_of_power_and_scores(scores):
    rng = np.random.default_rng(1)
    shares, _ = share_power(make_power(rng, 40))
    scored = {
        "none": np.zeros((3, 40)),
        "even": np.ones((3, 40)),
        "one": np.eye(3, 40),
        "wild": rng.random((3, 40)) ** 8 * 1e20,
    }[scores].astype(np.float32)
    chances = np.diff(add_up_chances(scored, shares).astype(float), axis=1, prepend=0)
    expected = np.tile(shares, (3, 1))
    if scores != "none":
        expected = EVEN * shares + (1 - EVEN) * scored / scored.sum(axis=1, keepdims=True, dtype=float)
    np.testing.assert_allclose(chances, expected, atol=3e-7)
    assert (add_up_chances(scored, shares)[:, -1] == 1).all()  # exactly: the shader looks for it


@pytest.mark.parametrize("count", [0, 9])
def test_without_power_there_are_no_chances(count):
    shares, within = share_power(np.zeros(count))
    chances = add_up_chances(np.zeros((2, count), np.float32), shares) if count else np.zeros(0)
    assert not shares.any()
    assert not within.any()
    assert not chances.any()


@given(st.integers(0, 200), st.floats(1e-20, 1e20))
def test_the_curve_visits_every_vpl_once_at_any_scale(count, scale):
    rng = np.random.default_rng(count)
    position, normal = rng.random((count, 3)), rng.normal(size=(count, 3))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    order = order_along_curve(position * scale, normal)
    assert sorted(order) == list(range(count))
    assert (order == order_along_curve(position, normal)).mean() >= 0.9 if count else True
