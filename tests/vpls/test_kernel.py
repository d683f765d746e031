"""The light of a VPL without shadows: what its limits let through, and what they leave to short rays."""

from __future__ import annotations

import numpy as np
import pytest

from deferred_ir.vpls.kernel import VplLimits, cosine_ratio, find_lit, weigh


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=0)


@pytest.fixture(name="pairs")
def random_pairs():
    """`way`, normals of VPLs, and normals of surfaces, geometric and smooth, (3, 2000) each."""
    rng = np.random.default_rng(5)
    way, vpl_normal, normal, off = rng.normal(size=(4, 3, 2000))
    return way, unit(vpl_normal), unit(normal), unit(unit(normal) + 0.4 * off)


def test_a_cone_is_stated_by_its_full_angle():
    assert VplLimits.from_angle(120.0, 0.5).cosine == pytest.approx(0.5, rel=1e-12)
    assert VplLimits.from_angle(120.0, 0.5).edge == pytest.approx(0.25, rel=1e-6)
    assert VplLimits.from_angle(180.0, 0.5) == VplLimits(0.5)
    assert VplLimits(0.5).edge == 0


@pytest.mark.parametrize("fov", [60.0, 150.0, 180.0])
def test_what_is_lit_has_weight_and_nothing_else(pairs, fov):
    edge = VplLimits.from_angle(fov, 0.0).edge
    lit = find_lit(*pairs, edge)
    np.testing.assert_array_equal(lit, weigh(*pairs, edge=edge, clamp=np.float32(0)) > 0)
    way, vpl_normal, normal, shading_normal = pairs
    leaving = (unit(way) * vpl_normal).sum(axis=0)
    expected = leaving > np.cos(np.radians(fov / 2))
    expected &= ((way * normal).sum(axis=0) < 0) & ((way * shading_normal).sum(axis=0) < 0)
    np.testing.assert_array_equal(lit, expected)
    assert 0 < lit.mean() < 0.3


def test_a_weight_is_cosines_over_the_clamped_squared_distance(pairs):
    way, vpl_normal, _, shading_normal = pairs
    weights = weigh(*pairs, edge=np.float32(0), clamp=np.float32(2.25))
    distance = np.linalg.norm(way, axis=0)
    cosines = (unit(way) * vpl_normal).sum(axis=0) * -(unit(way) * shading_normal).sum(axis=0)
    lit = find_lit(*pairs, np.float32(0))
    np.testing.assert_allclose(weights[lit], (cosines / np.maximum(distance**2, 2.25))[lit], rtol=1e-6)


def test_the_clamp_and_what_it_misses_are_one(pairs):
    way, vpl_normal = pairs[:2]
    limits = VplLimits.from_angle(150.0, 1.5)
    whole, clamped = (weigh(*pairs, edge=np.float32(0), clamp=np.float32(c**2)) for c in (0.0, limits.clamp))
    distance = np.linalg.norm(way, axis=0)
    leaving = (unit(way) * vpl_normal).sum(axis=0)
    missing = limits.missing(distance**2, leaving)
    inside = (whole > 0) & (leaving >= limits.cosine)
    np.testing.assert_allclose((clamped / np.where(whole > 0, whole, 1) + missing)[inside], 1, rtol=1e-5)
    near = distance < limits.clamp
    assert (missing[near & (leaving < limits.cosine)] == 1).all()
    assert (missing[~near] == 0).all()


def test_light_lands_as_the_cosines_of_shading_and_face_are_to_each_other():
    down, tilted = np.array([[0.0, -1.0, 0.0]]), np.array([[0.6, 0.8, 0.0]])
    assert cosine_ratio(-down, tilted, down) == pytest.approx(0.8)
    assert cosine_ratio(-down, -down, down) == 1
    assert cosine_ratio(down, tilted, down) == 0  # from behind the face
    assert cosine_ratio(-down, down, down) == 0  # from behind the shading normal
