"""glTF's model: reciprocal, no energy won by a lobe, and directions as densely drawn as is stated."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.brdf import MIN_ALPHA, Gloss

UP = np.array([0.0, 0.0, 1.0])
SIDE = 96
roughness = st.floats(0.0, 1.0)
cosine = st.floats(0.01, 1.0)
angle = st.floats(0.0, 2 * np.pi)
share = st.floats(0.0, 1.0)


def make(count, rough, f0=1.0, f90=1.0, taken=(0.0, 0.0)):
    ones = np.ones(count)
    return Gloss(
        np.full((count, 3), f0), f90 * ones, np.tile(taken, (count, 1)), np.maximum(rough**2, MIN_ALPHA) * ones
    )


def point(cosine, angle=0.0):
    sine = np.sqrt(1 - cosine**2)
    return np.array([[sine * np.cos(angle), sine * np.sin(angle), cosine]])


def lattice(side=SIDE):
    """Points in the middles of the cells of the unit square, (side^2, 2)."""
    across = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)


def spread_over_hemisphere(side):
    """Directions in the middles of cells of equal solid angle, (side^2, 3)."""
    height, turn = lattice(side).T
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(2 * np.pi * turn), flat * np.sin(2 * np.pi * turn), height], axis=1)


def draw(gloss, viewer, points):
    count = len(points)
    return brdf.sample(gloss, np.tile(UP, (count, 1)), np.tile(viewer, (count, 1)), points)


@settings(max_examples=300, deadline=None)
@given(roughness, st.tuples(cosine, cosine), angle, st.tuples(share, share, share, share))
def test_light_may_go_either_way(rough, heights, turn, shares):
    gloss, a, b = make(1, rough, *shares[:2], shares[2:]), point(heights[0]), point(heights[1], turn)
    kept, glossy = brdf.eval(gloss, UP[None], a, b)
    back, again = brdf.eval(gloss, UP[None], b, a)
    # The sine between normal and half vector is what is left of larger numbers where the lobe is narrow.
    np.testing.assert_allclose(glossy, again, rtol=1e-9)
    np.testing.assert_allclose(kept, back, rtol=1e-12)
    assert (glossy >= 0).all()
    assert (kept >= 0).all()


@settings(max_examples=60, deadline=None)
@given(roughness, cosine)
def test_a_white_metal_loses_only_what_facets_hide(rough, up):
    """In a furnace: nothing is won; what is lost is light that facets reflect into others, and nothing where smooth."""
    _, weight = draw(make(SIDE**2, rough), point(up), lattice())
    reflected = weight.mean()
    assert reflected <= 1 + 1e-9
    # At roughness 1, seen along the normal, the integral is 1 - ln 2.
    assert reflected >= 1 - np.log(2) - 1e-4
    if rough < 0.1 and up > 0.2:
        assert reflected == pytest.approx(1, abs=5e-3)


def reflect_plastic(rough, up, weight=1.0, f0=0.04, side=SIDE):
    """Return what white plastic reflects in a furnace: by its diffuse part, and by its coat."""
    gloss, points = make(side**2, rough, weight * f0, weight, (weight * f0, weight)), lattice(side)
    radius, turn = np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
    ways = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - points[:, 0])], axis=1)
    normal, viewer = np.tile(UP, (side**2, 1)), np.tile(point(up), (side**2, 1))
    return brdf.eval(gloss, normal, viewer, ways)[0].mean(), draw(gloss, point(up), points)[1].mean()


@settings(max_examples=60, deadline=None)
@given(roughness, cosine, share)
def test_white_plastic_wins_no_more_than_its_coat_reflects(rough, up, weight):
    """Schlick's term at the half vector takes less from diffuse light seen at grazing angles than the coat reflects.

    So glTF's sum, which is reciprocal, is above 1 there; each part alone never is.
    """
    diffuse, coat = reflect_plastic(rough, up, weight)
    assert diffuse <= 1 + 1e-9
    assert coat <= weight * (0.04 + 0.96 * (1 - up) ** 5 + 0.2)
    assert diffuse + coat <= 1 + coat
    if up > 0.6:
        assert diffuse + coat <= 1.005


@settings(max_examples=100, deadline=None)
@given(cosine, share, share)
def test_the_mean_kept_is_that_over_all_directions(up, first, last):
    gloss, points = make(SIDE**2, 0.5, taken=(first, last)), lattice()
    radius, turn = np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
    ways = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - points[:, 0])], axis=1)
    kept = brdf.eval(gloss, np.tile(UP, (SIDE**2, 1)), np.tile(point(up), (SIDE**2, 1)), ways)[0].mean()
    assert brdf.find_mean_kept(gloss, np.array([up]))[0] == pytest.approx(kept, abs=3e-4)


@settings(max_examples=100, deadline=None)
@given(roughness, cosine, st.floats(0.0, 0.3), st.integers(0, 1000))
def test_what_is_drawn_weighs_brdf_times_cosine_over_density(rough, up, f0, seed):
    gloss, viewer = make(512, rough, f0), point(up)
    ways, weight = draw(gloss, viewer, np.random.default_rng(seed).random((512, 2)))
    normal, viewers = np.tile(UP, (512, 1)), np.tile(viewer, (512, 1))
    density, glossy = brdf.pdf(gloss, normal, viewers, ways), brdf.eval(gloss, normal, viewers, ways)[1]
    # Facets edge-on to the viewer are drawn, but their directions are at the edge of the precision of a half vector.
    sure = (ways[:, 2] > 1e-3) & (density > 1e-6)
    np.testing.assert_allclose(
        weight[sure], glossy[sure] * (ways[sure, 2:] / density[sure, None]), rtol=2e-6 / gloss.alpha[0]
    )
    assert not weight[ways[:, 2] <= 0].any()
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1, atol=1e-3)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.4, 1.0), st.floats(0.1, 1.0))
def test_densities_and_what_falls_below_the_horizon_add_up_to_one(rough, up):
    count = 500
    many, viewer = make(count**2, rough), point(up)
    # A lattice without rows: the edge of what falls below follows those of a grid.
    number = np.arange(count**2)
    points = np.stack([(number + 0.5) / count**2, number * (np.sqrt(5) - 1) / 2 % 1], axis=1)
    below = (draw(many, viewer, points)[0][:, 2] <= 0).mean()
    density = brdf.pdf(many, np.tile(UP, (count**2, 1)), np.tile(viewer, (count**2, 1)), spread_over_hemisphere(count))
    assert 2 * np.pi * density.mean() + below == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("rough", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("up", [1.0, 0.6, 0.15])
def test_directions_are_drawn_with_the_stated_density(rough, up):
    """The numbers in the cells of a grid are the integrals of the density over them (chi-square)."""
    rng, count, bins = np.random.default_rng(3), 200_000, (8, 12)
    gloss, viewer = make(count, rough), point(up)
    ways, _ = draw(gloss, viewer, rng.random((count, 2)))
    ways = ways[ways[:, 2] > 0]
    edges = [np.linspace(0, 1, bins[0] + 1), np.linspace(-np.pi, np.pi, bins[1] + 1)]
    found, *_ = np.histogram2d(ways[:, 2], np.arctan2(ways[:, 1], ways[:, 0]), bins=edges)
    everywhere = spread_over_hemisphere(1200)
    many = len(everywhere)
    density = brdf.pdf(make(many, rough), np.tile(UP, (many, 1)), np.tile(viewer, (many, 1)), everywhere)
    height, turn = everywhere[:, 2], np.arctan2(everywhere[:, 1], everywhere[:, 0])
    expected, *_ = np.histogram2d(height, turn, bins=edges, weights=density * (2 * np.pi * count / many))
    enough = expected > 20
    chi = ((found - expected)[enough] ** 2 / expected[enough]).sum()
    freedom = enough.sum()
    assert chi < freedom + 6 * np.sqrt(2 * freedom)
    assert enough.sum() > 20


def test_samples_are_right_where_the_viewer_is_below_the_shading_normal():
    """So a normal map may turn a surface; draws and their density agree with the BRDF there, too."""
    rng, count = np.random.default_rng(1), 200_000
    gloss = brdf.Gloss(np.full((count, 3), 0.5), np.ones(count), np.zeros((count, 2)), np.full(count, 0.3))
    normal = np.tile([0.0, 0.0, 1.0], (count, 1))
    viewer = np.tile([np.sqrt(1 - 0.04), 0.0, -0.2], (count, 1))
    ways, weights = brdf.sample(gloss, normal, viewer, rng.random((count, 2)))
    height, angle = rng.random(count), 2 * np.pi * rng.random(count)
    ring = np.sqrt(1 - height**2)
    even = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    _, glossy = brdf.eval(gloss, normal, viewer, even)
    assert weights[:, 0].mean() == pytest.approx((glossy[:, 0] * height).mean() * 2 * np.pi, rel=0.02)
    above = brdf.pdf(gloss, normal, viewer, even).mean() * 2 * np.pi
    assert above + (ways[:, 2] <= 0).mean() == pytest.approx(1, abs=0.01)
