"""Rays go through what is cut out of surfaces, and the G-buffer shows the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, plane
from surface_scenes import LATTICE, lattice

from deferred_ir.rays.cutouts import MOST_HOLES
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.surfaces.materials import Sampler, Texture, TextureRef


def stack(layers, alpha=LATTICE):
    """Squares one above the other, each with the same image."""
    scene = build(*(plane(1.0, -0.01 * layer) for layer in range(layers)), plane(1.0, -0.01 * layers))
    pixels = np.concatenate([np.full((8, 8, 3), 200), alpha[..., None]], axis=2).astype(np.uint8)
    uvs = np.tile(np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]), (layers + 1, 1))
    texture = TextureRef(0, sampler=Sampler(magnify="nearest"))
    holes = [replace(material, base_color_texture=texture, alpha_cutoff=0.5) for material in scene.materials[:-1]]
    return replace(
        scene,
        geometry=replace(scene.geometry, uvs=uvs),
        materials=(*holes, scene.materials[-1]),
        textures=(Texture("holes", pixels),),
    )


def down(points):
    origins = np.column_stack([points[:, 0], np.full(len(points), 1.0), points[:, 1]])
    return origins, np.tile([0.0, -2.5, 0.0], (len(points), 1))


@pytest.mark.parametrize("layers", [1, 3, 40])
def test_rays_pass_holes_and_meet_what_is_left(layers):
    points = np.random.default_rng(layers).uniform(-1, 1, (500, 2))
    tracer = Tracer(stack(layers))
    hits = tracer.closest(*down(points))
    column, row = np.floor((points[:, 0] + 1) * 4).astype(int), np.floor((points[:, 1] + 1) * 4).astype(int)
    solid = LATTICE[row, column] > 0
    np.testing.assert_allclose(hits.position[:, 1], np.where(solid, 0.0, -0.01 * layers), atol=1e-5)
    origins, ways = down(points)
    above_last = (1 + 0.01 * layers - 0.005) / 2.5
    np.testing.assert_array_equal(tracer.occluded(origins, origins + ways * above_last), solid)
    rows, found = tracer.within(origins, ways, above_last)
    np.testing.assert_array_equal(rows, np.flatnonzero(solid))
    assert (found.face >= 0).all()


def test_rays_that_only_meet_holes_miss_and_end():
    tracer = Tracer(stack(MOST_HOLES + 20, np.zeros((8, 8))))
    hits = tracer.closest(*down(np.zeros((1, 2))))
    assert hits.face[0] >= 0  # the last of the holes that a ray goes through is taken to be there
    few = Tracer(stack(3, np.zeros((8, 8))))
    origins, ways = down(np.array([[0.1, 0.2]]))
    assert not few.occluded(origins, origins + ways * 0.4)[0]


def test_nothing_is_cut_without_a_threshold():
    scene = lattice(cutoff=None)
    assert not scene.has_cutouts
    seen = Tracer(scene).closest(*down(np.random.default_rng(1).uniform(-0.3, 0.3, (50, 2)) * [1, 1] + [0.05, 0.0]))
    assert (scene.geometry.face_materials[seen.face] <= 1).all()
