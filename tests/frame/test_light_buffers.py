"""Records of direct lights, VPLs and views: what shaders read."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_scenes import box, build, room

from deferred_ir.frame.direct_lights import LIGHT, LightVersions, describe_views, list_kinds, pack_lights
from deferred_ir.frame.vpl_buffer import VPL, MapVersions, VplParams, fill_view, pack_vpls
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.lights.base import LightView
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.shadows.views import VIEW
from deferred_ir.vpls.cast import NONE, Vpls


def pack(scene):
    return pack_lights(scene, describe_views(scene), list_kinds(scene))


def unit(*vector: float) -> np.ndarray:
    return np.array(vector) / np.linalg.norm(vector)


def two_vpls() -> Vpls:
    position, normal = np.array([[1.0, 2, 3], [4, 5, 6]]), np.array([unit(1, 2, -2), unit(0, 0, -1)])
    return Vpls(position, normal, np.array([[7.0, 8, 9], [0.5, 0, 0]]), np.arange(2))


def offsets(record: np.dtype) -> dict[str, int]:
    assert record.fields
    return {name: field[1] for name, field in record.fields.items()}


def test_records_are_vec4_of_std140():
    assert (LIGHT.itemsize, VPL.itemsize, VIEW.itemsize) == (4 * 16, 5 * 16, 5 * 16)
    assert [offsets(LIGHT)[name] for name in ("position", "axis", "emission")] == [0, 16, 32]
    axes = ("x_axis", "y_axis", "z_axis")
    assert [offsets(VPL)[name] for name in ("position", *axes, "emission")] == [16 * i for i in range(5)]
    assert [offsets(VIEW)[name] for name in ("position", *axes, "rectangle")] == [16 * i for i in range(5)]


def test_the_record_of_the_spotlight_holds_what_shaders_read():
    scene = room()
    light = replace(scene.spotlight, radius=0.25)
    records = pack(replace(scene, lights=(light,)))
    assert records.shape == (1,)
    np.testing.assert_array_equal(records["position"][0], np.float32(light.position))
    np.testing.assert_allclose(records["axis"][0], light.axis, atol=1e-7)
    assert records["radius"] == 0.25
    assert records["view"] == 0
    np.testing.assert_allclose(records["one_minus_cos"], 1 - math.cos(math.radians(light.fov / 2)), rtol=1e-6)


@dataclass(frozen=True)
class Lamp(Spotlight):
    """A spotlight with any number of views."""

    views: int = 1

    def list_views(self, bounds) -> tuple[LightView, ...]:
        return super().list_views(bounds) * self.views


def test_lights_have_any_number_of_views():
    lights = [Lamp((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), views=views) for views in (2, 0, 1)]
    scene = SimpleNamespace(direct_lights=lights, bounds=None)
    np.testing.assert_array_equal(describe_views(scene).owners, [0, 0, 2])
    assert [pack(scene)["view"][i] for i in (0, 2)] == [0, 2]


def test_records_of_vpls_hold_what_shaders_read():
    vpls, scene = two_vpls(), room()
    records = pack_vpls(scene, vpls, VplParams(fov=150.0, clamp=0.5), np.array([3, 4]))
    np.testing.assert_allclose(records["position"], vpls.position, rtol=1e-5)
    np.testing.assert_array_equal(records["emission"], vpls.emission.astype("f4"))
    np.testing.assert_allclose(records["z_axis"], vpls.normal, atol=1e-7)
    np.testing.assert_array_equal(records["tile"], [3, 4])
    np.testing.assert_allclose(records["tan_half"], math.tan(math.radians(75)), rtol=1e-6)
    np.testing.assert_allclose(records["one_minus_cos"], 1 - math.cos(math.radians(75)), rtol=1e-6)
    np.testing.assert_allclose(records["clamp_squared"], (0.5 * scene.geometry.diagonal) ** 2, rtol=1e-6)


def test_no_vpls_make_no_records():
    assert pack_vpls(room(), NONE, VplParams(), NONE.ray).shape == (0,)


@pytest.mark.parametrize("fov", [0.1, 60.0, 150.0, 179.9])
def test_the_axes_of_a_view_take_the_cone_to_the_unit_square(fov):
    """A direction at the edge of the cone along the map's right lands at NDC (1, 0)."""
    axis, records = unit(0.3, -0.9, -0.2), np.zeros(1, VPL)
    fill_view(records, axis[None], fov)
    right, up = build_basis(axis)
    half = math.radians(fov) / 2
    for direction, ndc in ((right, (1, 0)), (-right, (-1, 0)), (up, (0, 1)), (-up, (0, -1))):
        d = math.cos(half) * axis + math.sin(half) * direction
        w = d @ records["z_axis"][0].astype(float)
        seen = (d @ records["x_axis"][0].astype(float) / w, d @ records["y_axis"][0].astype(float) / w)
        np.testing.assert_allclose(seen, ndc, atol=2e-6 * max(1, 1 / math.tan(half), math.tan(half)))


def test_a_map_stays_while_its_light_looks_the_same():
    scene, versions = room(), LightVersions()
    first = versions.update(pack(scene), scene)
    for change in ({"emission": (9.0, 9.0, 9.0)}, {"radius": 0.1}, {}):
        same = replace(scene, lights=(replace(scene.spotlight, **change),))
        assert versions.update(pack(same), same) == first
    for change in ({"fov": 40.0}, {"position": (0.1, 0.9, 0.1)}, {"look_at": (0.2, -1.0, 0.0)}):
        other = replace(scene, lights=(replace(scene.spotlight, **change),))
        assert versions.update(pack(other), other) != first
        first = versions.update(pack(scene), scene)


def test_maps_of_vpls_stay_while_they_look_the_same():
    scene, versions, params = room(), MapVersions(), VplParams()
    vpls = two_vpls()
    first = versions.update(pack_vpls(scene, vpls, params, vpls.ray), scene)
    brighter = replace(vpls, emission=2 * vpls.emission)
    np.testing.assert_array_equal(versions.update(pack_vpls(scene, brighter, params, vpls.ray), scene), first)
    moved = replace(vpls, position=vpls.position + np.array([[0.0, 0, 0], [0.1, 0, 0]]))
    second = versions.update(pack_vpls(scene, moved, params, vpls.ray), scene)
    np.testing.assert_array_equal(second == first, [True, False])
    other = build(box((-1, -1, -1), (1, 1, 1)))
    assert (versions.update(pack_vpls(other, moved, params, vpls.ray), other) != second).all()
