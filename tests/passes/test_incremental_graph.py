"""The graph `incremental`: maps that are kept hold what a map drawn anew holds, within the budget."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from shadow_atlas import read_atlas, read_vpl_maps
from small_scenes import build, plane, room, sphere

from deferred_ir.base.errors import GraphError
from deferred_ir.cli import main
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK

SIZE = (48, 32)
ROOM = room()
MAPS = {"direct_rays.visibility": "maps"}
SETTINGS = {"vpl.count": 24, "shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32, **MAPS}


def moved(scene, step):
    """The scene with its light a little further."""
    x, y, z = scene.spotlight.position
    return replace(scene, lights=(replace(scene.spotlight, position=(x + 0.06 * step, y - 0.02 * step, z)),))


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
@pytest.mark.parametrize("layer_from_vertex", [True, False])
def test_kept_maps_hold_what_maps_drawn_anew_hold(renderer, projection, layer_from_vertex):
    one = renderer(SIZE, "incremental", set={**SETTINGS, "shadow_maps.projection": projection})
    if not layer_from_vertex:
        one.gpu.layer_from_vertex = False
    plan = one.plan(ROOM)
    for step in range(9):
        one.draw(moved(ROOM, step), plan)
        assert one.executor.counters["maps_drawn"] <= 1 + 8
    kept, spot = read_vpl_maps(one), read_atlas(one)[0]
    assert len(kept) > 16
    one.executor.state("shadow_maps").params = None  # so that all maps are drawn anew
    one.draw(moved(ROOM, 8), plan)
    assert one.executor.counters["maps_drawn"] == 1 + len(kept)
    anew = read_vpl_maps(one)
    assert kept.keys() == anew.keys()
    assert all((kept[tile] == anew[tile]).all() for tile in kept)
    assert (read_atlas(one)[0] == spot).all()


def test_tiles_of_every_block_of_lights_are_kept(renderer):
    count = VPLS_PER_BLOCK + 40
    settings = {"vpl.count": count, "vpl.most": count, "shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 16, **MAPS}
    one = renderer(SIZE, "incremental", set=settings)
    plan = one.plan(ROOM)
    one.draw(ROOM, plan)
    assert one.executor.counters["maps_drawn"] == 1 + count
    first = read_vpl_maps(one, 16)
    one.draw(moved(ROOM, 1), plan)
    assert one.executor.counters["maps_drawn"] < count
    vpls = one.executor.resource(("vpl", "vpls"))
    same = [tile for tile in read_vpl_maps(one, 16) if (first.get(tile) == read_vpl_maps(one, 16)[tile]).all()]
    assert len(same) > count // 2
    assert len(np.unique(vpls.records["tile"])) == len(vpls.records)


def test_a_still_light_draws_nothing_and_shows_the_same(renderer):
    one = renderer(SIZE, "incremental", set=SETTINGS)
    plan = one.plan(ROOM)
    for _ in range(8):
        one.draw(ROOM, plan)
    before = one.read(plan).radiance
    one.draw(ROOM, plan)
    assert one.executor.counters["maps_drawn"] == 0
    assert (one.read(plan).radiance == before).all()


def test_only_the_spotlights_map_follows_a_light_that_vpls_do_not_notice(renderer):
    one = renderer(SIZE, "incremental", set={**SETTINGS, "vpl.most": 24, "vpl.least": 0})
    plan = one.plan(ROOM)
    one.draw(ROOM, plan)
    x, y, z = ROOM.spotlight.position
    one.draw(replace(ROOM, lights=(replace(ROOM.spotlight, position=(x, y - 1e-4, z)),)), plan)
    assert one.executor.counters["maps_drawn"] == 1


def test_frames_come_again_after_a_reset(renderer):
    one = renderer(SIZE, "incremental", set=SETTINGS)
    plan = one.plan(ROOM)
    runs = []
    for _ in range(2):
        frames = []
        for step in range(4):
            one.draw(moved(ROOM, step), plan, seed=5)
            frames.append(one.read(plan).radiance)
        runs.append(frames)
        one.reset()
    np.testing.assert_array_equal(*runs)
    assert not np.array_equal(runs[0][0], runs[0][3])


@pytest.mark.parametrize("change", ["scene", "seed", "off"])
def test_state_ends_with_scene_and_seed_and_when_the_light_is_off(renderer, change):
    one = renderer(SIZE, "incremental", set=SETTINGS)
    fresh = one.render(ROOM).radiance
    first = one.executor.counters["vpls_alive"]
    one.render(ROOM)
    assert one.executor.counters["vpls_alive"] > first
    if change == "scene":
        one.render(build(plane(9.0, -1.0)))
    elif change == "seed":
        one.render(ROOM, seed=1)
    else:
        dark = replace(ROOM, lights=(replace(ROOM.spotlight, emission=(0.0, 0.0, 0.0)),))
        assert one.render(dark).radiance.max() == 0
    assert (one.render(ROOM).radiance == fresh).all()
    assert one.executor.counters["maps_drawn"] <= 9


def test_without_a_budget_there_is_direct_light_alone(renderer):
    none = renderer(SIZE, "incremental", set={**SETTINGS, "vpl.least": 0, "vpl.most": 0}).render(ROOM)
    direct = renderer(SIZE, "deferred", set={"shadow_maps.spot_size": 128}).render(ROOM, vpls=0)
    np.testing.assert_array_equal(none.radiance, direct.radiance)


def test_with_the_whole_budget_one_frame_is_as_bright_as_fresh_vpls(renderer):
    settings = {"vpl.count": 256, "shadow_maps.vpl_size": 64}
    one = renderer(SIZE, "incremental", set={**settings, "vpl.most": 256}).render(ROOM).radiance
    other = renderer(SIZE, "interleaved", set=settings).render(ROOM).radiance
    assert one.mean() == pytest.approx(other.mean(), rel=0.03)


def test_a_least_above_the_most_is_one_line(renderer):
    with pytest.raises(GraphError, match=r"vpl: least 9: is more than most, 8; give both"):
        renderer(SIZE, "incremental", set={"vpl.least": 9}).plan(ROOM)


def test_a_run_tells_which_maps_it_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = "render cornell --graph incremental --size 32x32 --vpls 16 --frames 3 --device software"
    given = ("shadow_maps.spot_size=64", "shadow_maps.vpl_size=16", "direct_rays.visibility=maps")
    settings = [word for each in given for word in ("--set", each)]
    assert main.main([*command.split(), *settings, "--json", "run.json", "-o", "a_%04d.npy"]) == 0
    assert main.main([*command.split(), *settings, "-o", "b_%04d.npy"]) == 0
    run = json.loads((tmp_path / "run.json").read_text())
    assert run["maps_drawn"][0] > 1
    assert all(drawn <= 9 for drawn in run["maps_drawn"])
    (parts,) = [entry["subpasses"] for entry in run["passes"] if entry["name"] == "shadow_maps"]
    assert len(parts) == 1 + run["vpls_alive"]
    assert (parts[0]["state"], parts[0]["why"]) == ("kept", "its light stays")
    assert sum(part["state"] == "dirty" for part in parts) == run["maps_drawn"][-1]
    assert len({(part["layer"], part["tile"]) for part in parts}) == len(parts)
    for frame in range(3):
        np.testing.assert_array_equal(*(np.load(f"{name}_{frame:04d}.npy") for name in "ab"))


def test_direct_light_comes_from_a_map_or_from_rays(renderer):
    """The same but for the edges of shadows; with rays the spotlight has no map."""
    images = []
    for visibility in ("maps", "rays"):
        one = renderer((96, 64), "incremental", set={**SETTINGS, "direct_rays.visibility": visibility})
        images.append(one.render(ROOM).radiance)
        step = next(step for step in one.plan(ROOM).steps if step.name == "shadow_maps")
        parts = step.work.subpasses(step.descriptions, one.executor.state("shadow_maps"))
        assert (parts[0]["light"] == "spotlight") == (visibility == "maps")
        assert one.executor.counters["maps_drawn"] == len(parts) == 8 + (visibility == "maps")
    differ = np.abs(images[0] - images[1]).max(axis=-1) > 0.01 * images[0].mean()
    assert 0 < differ.mean() < 0.04


@pytest.mark.parametrize(
    ("scene", "size", "rays"),
    [
        (ROOM, (64, 64), True),
        (ROOM, (512, 512), False),
        (replace(ROOM, lights=(replace(ROOM.spotlight, radius=0.1),)), (96, 64), False),
        (build(sphere(1.0, 6), plane(9.0, -1.0)), (512, 512), True),
    ],
    ids=["few pixels", "many pixels", "a disc", "many triangles"],
)
def test_direct_light_comes_from_what_should_take_less_time(renderer, scene, size, rays):
    one = renderer(size, "incremental")
    assert ("direct_rays" in {step.name for step in one.plan(scene).steps}) == rays
    assert "direct_rays" in {step.name for step in renderer(size, "resampled").plan(scene).steps}
