"""The shadow atlas: each light's map in its own tile and nowhere else, whichever way the layer is chosen."""

from __future__ import annotations

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from small_scenes import build, plane, quad, room

from deferred_ir.base.errors import DeviceError, GraphError
from deferred_ir.frame.frame import NEAR
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.gl import raw

SIZE = (32, 32)
SETTINGS = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32}


def inward(count: int):
    """VPLs inside `room` that look in all directions, all of the same power."""
    rng = np.random.default_rng(3)
    position, normal = rng.uniform(-0.8, 0.8, (count, 3)), rng.normal(size=(count, 3))
    return vpl_records(position, normal, np.ones((count, 3)))


def atlas_of(make, folder, scene, records, **options):
    one = lit_by(make, folder, records, SIZE, "deferred", set=options.pop("settings", SETTINGS))
    for name, value in options.items():
        setattr(one.gpu, name, value)
    one.render(scene)
    with one.gpu.ctx:
        return one.executor.resource(("shadow_maps", "atlas")).read()[..., 0]


def plain_of(make, folder, scene, records, settings=SETTINGS):
    one = lit_by(make, folder, records, SIZE, "forward", set=settings)
    one.render(scene)
    with one.gpu.ctx:
        spot, vpls = (one.executor.resource(("shadow_maps", port)) for port in ("light_maps", "vpl_maps"))
        return spot[0].read()[..., 0], [texture.read()[..., 0] for texture in vpls]


def tile(atlas, number, size):
    per_row = atlas.shape[1] // size
    layer, on_layer = divmod(number, per_row**2)
    row, column = divmod(on_layer, per_row)
    return atlas[1 + layer, row * size : (row + 1) * size, column * size : (column + 1) * size]


def same_depths(a, b):
    """Equal to rounding, but for texels whose centre lies on a silhouette."""
    off = np.abs(a - b) > 1e-4 * np.maximum(a, b) + 1e-5 * NEAR
    return off.mean() < 0.01


@pytest.mark.parametrize("layer_from_vertex", [True, False])
def test_each_tile_holds_what_a_map_of_its_own_holds(renderer, tmp_path, layer_from_vertex):
    records = inward(40)
    if layer_from_vertex:
        atlas = atlas_of(renderer, tmp_path, room(), records)
    else:
        atlas = atlas_of(renderer, tmp_path, room(), records, layer_from_vertex=False)
    spot, vpls = plain_of(renderer, tmp_path, room(), records)
    assert atlas.shape == (1 + 3, 128, 128)  # 16 tiles a layer
    assert same_depths(atlas[0], spot)
    assert len(vpls) == 40
    for number, map in enumerate(vpls):
        assert map.max() > 0
        assert same_depths(tile(atlas, number, 32), map), number


@pytest.mark.parametrize("layer_from_vertex", [True, False])
def test_a_light_draws_into_its_tile_only(renderer, tmp_path, layer_from_vertex):
    """Lights in a few tiles of a large atlas; all that lies between stays clear, to the last texel."""
    lights = inward(40)
    used = [0, 5, 15, 16, 39]
    records = lights[used]
    padded = np.concatenate([records, records[-1:].repeat(40 - len(used))])  # room for 40, all in tile 39
    options = {} if layer_from_vertex else {"layer_from_vertex": False}
    atlas = atlas_of(renderer, tmp_path, room(), padded, **options)
    for number in range(48):
        part = tile(atlas, number, 32)
        assert (part > 0).mean() > 0.9 if number in used else part.max() == 0, number


def test_sizes_that_do_not_divide_one_another(renderer, tmp_path):
    settings = {"shadow_maps.spot_size": 100, "shadow_maps.vpl_size": 48}
    records = inward(6)
    atlas = atlas_of(renderer, tmp_path, room(), records, settings=settings)
    spot, vpls = plain_of(renderer, tmp_path, room(), records, settings)
    assert atlas.shape == (1 + 2, 100, 100)
    assert same_depths(atlas[0], spot)
    for number, map in enumerate(vpls):
        assert same_depths(tile(atlas, number, 48), map), number
    assert atlas[1:, 96:].max() == atlas[1:, :, 96:].max() == 0


def test_vpl_maps_may_be_larger_than_the_spotlights(renderer, tmp_path):
    settings = {"shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 96}
    records = inward(2)
    atlas = atlas_of(renderer, tmp_path, room(), records, settings=settings)
    spot, vpls = plain_of(renderer, tmp_path, room(), records, settings)
    assert atlas.shape == (1 + 2, 96, 96)
    assert same_depths(atlas[0, :64, :64], spot)
    assert atlas[0, 64:].max() == atlas[0, :, 64:].max() == 0
    assert all(same_depths(atlas[1 + number], map) for number, map in enumerate(vpls))


def test_lights_of_every_block_get_their_maps(renderer, tmp_path):
    records = inward(2 * VPLS_PER_BLOCK + 9)
    settings = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 16}
    atlas = atlas_of(renderer, tmp_path, room(), records, settings=settings)
    filled = [(tile(atlas, number, 16) > 0).mean() > 0.9 for number in range(len(records))]
    assert all(filled)


def test_depth_is_near_over_distance(renderer, tmp_path):
    """A floor seen from straight above fills the map with one value."""
    scene = build(plane(20.0))
    records = vpl_records([(0, 2.0, 0)], [(0, -1, 0)], [(1, 1, 1)])
    depths = tile(atlas_of(renderer, tmp_path, scene, records), 0, 32)
    np.testing.assert_allclose(depths, NEAR * scene.geometry.diagonal / 2, rtol=1e-5)


def test_culling_front_faces_draws_what_looks_away(renderer, tmp_path):
    up = quad((-1, 0, 1), (1, 0, 1), (1, 0, -1))
    down = quad((-1, 0, -1), (1, 0, -1), (1, 0, 1))
    light = vpl_records([(0, 2.0, 0)], [(0, -1, 0)], [(1, 1, 1)])
    for mesh, drawn in ((up, False), (down, True)):
        scene = build(mesh)
        atlas = atlas_of(renderer, tmp_path, scene, light, settings={**SETTINGS, "shadow_maps.cull": "front"})
        plain = plain_of(renderer, tmp_path, scene, light, {**SETTINGS, "shadow_maps.cull": "front"})
        assert (tile(atlas, 0, 32).max() > 0) == (plain[1][0].max() > 0) == drawn


def test_clip_distances_are_off_for_whoever_draws_next(renderer):
    one = renderer(SIZE)
    one.render(room(), vpls=4)
    with one.gpu.ctx:
        assert [one.gpu.gl.integers(raw.CLIP_DISTANCE0 + side) for side in range(4)] == [[0]] * 4


# The plan


@pytest.mark.parametrize(("count", "layers"), [(0, 1), (1, 2), (64, 2), (65, 3), (640, 11)])
def test_the_atlas_grows_by_layers_of_sixty_four(renderer, count, layers):
    plan = renderer(SIZE).plan(room(), count)
    step = next(step for step in plan.steps if step.name == "shadow_maps")
    atlas = step.outputs["atlas"].description
    assert (atlas.format, atlas.size, atlas.layers) == ("depth32f", (2048, 2048), layers)


def test_each_light_has_a_sub_pass_with_its_place(renderer):
    plan = renderer(SIZE).plan(room(), 70)
    step = next(step for step in plan.steps if step.name == "shadow_maps")
    parts = step.work.subpasses(step.descriptions)
    assert len(parts) == 71
    assert parts[0] == {
        "light": "spotlight",
        "projection": "perspective",
        "layer": 0,
        "tile": 0,
        "corner": (0, 0),
        "size": 2048,
        "state": "dirty",
        "why": "no frame has drawn it yet",
    }
    assert (parts[65]["light"], parts[65]["layer"], parts[65]["tile"]) == ("vpl 64", 2, 0)
    assert len({(part["layer"], part["tile"]) for part in parts}) == 71


def test_more_maps_than_the_budget_is_one_line_with_what_fits(renderer):
    with pytest.raises(GraphError) as raised:
        renderer(SIZE, set={"shadow_maps.budget": 40}).plan(room(), 1000)
    message = str(raised.value)
    assert "\n" not in message
    assert message.startswith("deferred.toml: shadow_maps: maps for 1000 VPLs of 256x256 need 272 MiB")
    assert "64 VPLs fit" in message


def test_what_is_said_to_fit_fits_and_not_one_more(renderer):
    one = renderer(SIZE, set={"shadow_maps.budget": 40})
    assert one.plan(room(), 64)
    with pytest.raises(GraphError, match="64 VPLs fit"):
        one.plan(room(), 65)


def test_a_budget_for_less_than_the_spotlight_fits_none(renderer):
    with pytest.raises(GraphError, match="the spotlight's map of 2048x2048 alone needs 16 MiB"):
        renderer(SIZE, set={"shadow_maps.budget": 1}).plan(room(), 1)


def test_the_baseline_has_the_same_budget(renderer):
    """Its maps are as large, one by one."""
    with pytest.raises(GraphError, match="VPLs fit"):
        renderer(SIZE, "forward").plan(room(), 65536)


def test_more_layers_than_the_driver_has_is_one_line(renderer, monkeypatch):
    one = renderer(SIZE)
    monkeypatch.setitem(one.gpu.__dict__, "max_layers", 1)
    with pytest.raises(DeviceError, match=r"^shadow_maps\.atlas: 2 layers, and this driver takes 1; use fewer VPLs"):
        one.render(room(), vpls=64)
    assert one.render(room(), vpls=0).radiance.max() > 0  # and it goes on
