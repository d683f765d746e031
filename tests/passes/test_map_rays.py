"""Shadow maps of any light in any scene, texel by texel, against rays from the light."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from hypothesis import given, settings
from hypothesis import strategies as st
from map_rays import tiles, wrong_texels
from small_scenes import build, triangle_soup

from deferred_ir.frame.vpl_buffer import VPL, lift_off_surface
from deferred_ir.loading.load import builtin_scenes, load
from deferred_ir.rays.tracer import Tracer

LIGHTS = 6
ONES = np.ones((LIGHTS, 3))
SIZE = 64
FOVS = {"perspective": [1.0, 60.0, 150.0], "paraboloid": [1.0, 60.0, 150.0, 179.9]}
"""Planar maps of 179.9 degrees have 5 texels for the middle half of what they show; rays cannot judge them."""
BUILT_IN = [name for name, _ in builtin_scenes()]


@lru_cache(maxsize=2)
def traced(name: str):
    scene = build(triangle_soup(int(name))) if name.isdigit() else load(name)
    return scene, Tracer(scene)


def anywhere(scene, rng, fov, on_faces):
    """VPLs on faces, either side of them, or in the air."""
    g = scene.geometry
    if not on_faces:
        return vpl_records(rng.uniform(*g.bounds, (LIGHTS, 3)), rng.normal(size=(LIGHTS, 3)), ONES, fov=fov)
    corners = g.positions[g.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    faces = rng.choice(len(g.faces), LIGHTS, p=areas / areas.sum())
    position = (corners[faces] * rng.dirichlet(np.ones(3), LIGHTS)[..., None]).sum(axis=1)
    normal = g.face_normals[faces] * rng.choice([-1, 1], LIGHTS)[:, None]
    return vpl_records(lift_off_surface(scene, position, normal), normal, ONES, fov=fov)


@pytest.fixture(params=["perspective", "paraboloid"])
def wrong(request, renderer, tmp_path):
    """Shares of wrong texels of LIGHTS lights chosen by a seed."""
    projection, records = request.param, np.zeros(LIGHTS, VPL)
    settings = {"shadow_maps.projection": projection, "shadow_maps.vpl_size": SIZE, "shadow_maps.spot_size": 256}
    one = lit_by(renderer, tmp_path, records, (16, 16), "deferred", set=settings)

    def share(name, seed, fov, on_faces):
        scene, tracer = traced(name)
        records[:] = anywhere(scene, np.random.default_rng(seed), fov, on_faces)
        one.render(scene)
        off = [
            wrong_texels(tracer, record, tile, projection)
            for record, tile in zip(records, tiles(one, LIGHTS), strict=True)
        ]
        return np.array(off).mean(axis=(1, 2))

    share.fovs = FOVS[projection]
    return share


@pytest.mark.parametrize("scene", BUILT_IN)
def test_maps_of_the_built_in_scenes_hold_what_rays_meet(wrong, scene):
    @settings(max_examples=15)
    @given(seed=st.integers(0, 10**6), fov=st.sampled_from(wrong.fovs), on_faces=st.booleans())
    def check(seed, fov, on_faces):
        found = wrong(scene, seed, fov, on_faces)
        assert found.max() < 0.01
        assert found.mean() < 0.002

    check()


def test_maps_of_any_triangles_hold_what_rays_meet(wrong):
    """Slivers and degenerate ones among them, and such as are ten times as large as where the lights are."""

    @settings(max_examples=15)
    @given(
        mesh=st.integers(0, 10**6), seed=st.integers(0, 10**6), fov=st.sampled_from(wrong.fovs), on_faces=st.booleans()
    )
    def check(mesh, seed, fov, on_faces):
        assert wrong(str(mesh), seed, fov, on_faces).mean() < 0.005

    check()
