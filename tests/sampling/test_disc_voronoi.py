"""Voronoi cells in the disc: areas, the largest empty circle, the most crowded site."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from deferred_ir.sampling.disc_voronoi import VoronoiCells, find_most_crowded

GRID = np.stack(np.meshgrid(*[np.linspace(-1, 1, 301)] * 2), axis=-1).reshape(-1, 2)
GRID = GRID[(GRID**2).sum(axis=1) <= 1]


@st.composite
def sites(draw, least=1):
    """Random sites, all on a line, all on a circle, of a lattice, or some of them twice."""
    count, rng = draw(st.integers(least, 40)), np.random.default_rng(draw(st.integers(0, 2**32)))
    kind = draw(st.sampled_from(["random", "line", "circle", "lattice", "twice"]))
    if kind == "line":
        return np.multiply.outer(rng.uniform(-1, 1, count), [np.cos(1.0), np.sin(1.0)])
    if kind == "circle":
        angle = np.arange(count) / count * 2 * np.pi
        return draw(st.sampled_from([0.3, 1.0])) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if kind == "lattice":
        return rng.integers(-3, 4, (count, 2)) / 5
    points = rng.uniform(-0.7, 0.7, (count, 2))
    return points[rng.integers(0, count, count)] if kind == "twice" else points


def add_up_coincident(sites, areas):
    """Add up the areas of sites that coincide, since they have their cell in common."""
    return np.bincount(cKDTree(sites).query(sites)[1], areas, minlength=len(sites))


@given(sites())
@pytest.mark.slow
def test_areas_are_those_of_the_nearest_points(sites):
    areas = VoronoiCells(sites).areas()
    assert areas.min() >= 0
    assert areas.sum() == pytest.approx(1, abs=1e-9)
    counted = np.bincount(cKDTree(sites).query(GRID)[1], minlength=len(sites)) / len(GRID)
    np.testing.assert_allclose(add_up_coincident(sites, areas), add_up_coincident(sites, counted), atol=6e-3)


@given(sites(), st.floats(0.1, 1.0))
@pytest.mark.slow
def test_no_point_of_the_disc_is_farther_from_all_sites(sites, radius):
    centre, distance = VoronoiCells(sites).find_emptiest_circle(radius)
    tree = cKDTree(sites)
    assert np.hypot(*centre) <= radius * (1 + 1e-9)
    assert tree.query(centre)[0] == pytest.approx(distance, abs=1e-6)
    assert tree.query(GRID * radius)[0].max() <= distance + 1e-6


@given(sites(least=0), st.integers(1, 5))
def test_adding_sites_equals_building_with_them(sites, count):
    more = np.random.default_rng(len(sites)).uniform(-0.7, 0.7, (count, 2))
    grown = VoronoiCells(sites)
    for site in more:
        grown.add(site)
    every = np.concatenate([sites, more])
    whole = VoronoiCells(every)
    np.testing.assert_allclose(
        add_up_coincident(every, grown.areas()), add_up_coincident(every, whole.areas()), atol=1e-6
    )
    np.testing.assert_allclose(grown.find_emptiest_circle()[1], whole.find_emptiest_circle()[1], atol=1e-6)


def test_one_site_has_the_whole_disc_and_the_farthest_point_is_opposite():
    cells = VoronoiCells([[0.3, 0.4]])
    assert cells.areas() == pytest.approx([1])
    centre, distance = cells.find_emptiest_circle()
    np.testing.assert_allclose(centre, [-0.6, -0.8])
    assert distance == pytest.approx(1.5)


def test_an_empty_disc_is_empty_about_its_centre():
    centre, distance = VoronoiCells(np.zeros((0, 2))).find_emptiest_circle()
    assert (centre == 0).all()
    assert distance == np.inf
    assert len(VoronoiCells(np.zeros((0, 2))).areas()) == 0


@given(sites(least=2))
def test_the_most_crowded_is_of_the_closest_pair_and_nearer_to_the_rest(sites):
    given_up, near = find_most_crowded(sites)
    distance = np.linalg.norm(sites[:, None] - sites, axis=2)
    distance[np.diag_indices(len(sites))] = np.inf
    assert near == pytest.approx(distance.min(), abs=1e-12)
    assert distance[given_up].min() == pytest.approx(near, abs=1e-12)
    if len(sites) > 2:
        partner = distance[given_up].argmin()
        second = np.sort(distance, axis=1)[:, 1]
        assert second[given_up] <= second[partner] + 1e-12
