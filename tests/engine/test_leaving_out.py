"""What a scene or a view does not need is left out, and no pixel is another for it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from distance import same_pixels
from moving_scenes import room_with_moving_models
from small_scenes import build, crooked_room, gable, plane, room

from deferred_ir.cli import main
from deferred_ir.frame.fullscreen import FullscreenPass
from deferred_ir.frame.screen_tiles import TILES, count_pairs
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.aliasing import alias_textures
from deferred_ir.graph.ports import Input, Output, Texture
from deferred_ir.scene.camera import Camera

SIZE = (48, 48)
DARK = (0.0, 0.0, 0.0)


def both(renderer, scene, graph, *, vpls=None, size=SIZE, **settings):
    """The frame as it is and with all that another scene would need, each with its counters and its plan."""
    result = []
    for keep_all in (False, True):
        one = renderer(size, graph, set=settings, keep_all=keep_all)
        image = one.render(scene, vpls=vpls)
        result.append((image, dict(one.executor.counters), one.plan(scene, vpls)))
    return result


GRAPHS = [
    ("deferred", {}),
    ("hemisphere", {}),
    ("interleaved", {}),
    ("mapped", {"shadow_rays.visibility": "rays"}),
    ("mapped", {"shadow_rays.visibility": "maps"}),
    ("forward", {"forward.lights_per_draw": 3}),
    ("forward", {"forward.lights_per_draw": 1}),
]


@pytest.mark.parametrize(("graph", "settings"), GRAPHS)
def test_lights_that_light_nothing_in_view_get_no_map(renderer, graph, settings):
    (image, counters, _), (full, kept, _) = both(renderer, gable(), graph, vpls=64, **settings)
    assert image.radiance.any()
    assert same_pixels(image, full)
    assert 5 < counters["lights_dropped"] < 40
    assert "lights_dropped" not in kept
    assert counters["vpls_alive"] == kept["vpls_alive"]
    if "maps_drawn" in kept:
        assert counters["maps_drawn"] == kept["maps_drawn"] - counters["lights_dropped"]


@pytest.mark.parametrize("graph", ["deferred", "interleaved"])
def test_many_lights_are_added_up_in_the_same_blocks_without_those_that_are_dropped(renderer, graph):
    (image, counters, _), (full, _, _) = both(
        renderer, gable(), graph, vpls=500, **{"shadow_maps.vpl_size": 16, "vpl.pattern": "random"}
    )
    assert counters["lights_dropped"] > 50
    assert same_pixels(image, full)


def test_a_spotlight_that_shines_where_nobody_looks_gets_no_map(renderer):
    scene = gable()
    away = replace(
        scene, lights=(replace(scene.spotlight, position=(-0.7, 3.0, 0.0), look_at=(-0.7, 0.0, 0.0), fov=10),)
    )
    (image, counters, _), (full, kept, _) = both(renderer, away, "deferred", vpls=16)
    assert counters["maps_drawn"] == 0
    assert kept["maps_drawn"] == 1 + kept["vpls_alive"] > 1
    assert same_pixels(image, full)


def test_the_plan_of_a_frame_says_which_lights_have_no_map(renderer):
    one = renderer(SIZE)
    one.render(gable(), vpls=16)
    step = next(step for step in one.plan(gable(), 16).steps if step.name == "shadow_maps")
    parts = step.work.subpasses(step.descriptions, one.executor.state("shadow_maps"))
    out = [part for part in parts if part["state"] == "left out"]
    assert len(out) == one.executor.counters["lights_dropped"]
    assert out[0]["why"] == "it lights nothing that is seen"


@pytest.mark.parametrize("graph", ["deferred", "interleaved", "mapped", "forward", "incremental"])
def test_without_vpls_nothing_is_cast_shared_or_filtered(renderer, graph):
    one = renderer(SIZE, graph)
    image = one.render(room(), vpls=0)
    assert one._tracer is None or graph in ("mapped", "incremental")  # which trace direct light
    plan = one.plan(room(), 0)
    assert not {"light_shares", "gather", "near_field", "neighbours", "light_lonely_pixels"} & {
        step.name for step in plan.steps
    }
    full = renderer(SIZE, graph, keep_all=True)
    assert same_pixels(image, full.render(room(), vpls=0))
    if graph != "forward":
        assert one.executor.counters["maps_drawn"] in (0, 1)
    kept = full.plan(room(), 0)
    assert set(kept.left_out) <= {"shadow_rays", "light_lonely_pixels", "shadow_maps", "interleave", "light_points"} | {
        "environment",
        "gbuffer.emission",
        "gbuffer.material",
        "reflection_rays",
        "filter_reflections",
    }


@pytest.mark.parametrize("graph", ["deferred", "interleaved", "mapped", "forward"])
def test_without_light_there_are_no_maps_and_no_rays(renderer, graph):
    scene = replace(room(), lights=(replace(room().spotlight, emission=DARK),))
    (image, counters, plan), (full, _, kept) = both(renderer, scene, graph, vpls=8)
    assert same_pixels(image, full)
    assert not image.radiance.any()
    assert "shadow_maps" in plan.left_out
    assert plan.left_out.keys() > kept.left_out.keys()
    assert counters.get("maps_drawn", 0) == 0


def test_a_target_that_nothing_reads_is_not_written(renderer, tmp_path):
    path = tmp_path / "flat.toml"
    path.write_text(
        'extends = "deferred"\n[outputs]\ndisplay = "flat.color"\n[passes.flat]\ninputs = { depth = "gbuffer.depth" }\n'
    )
    (tmp_path / "flat.frag").write_text(
        "layout(binding = UNIT_DEPTH) uniform sampler2D depth;\nlayout(location = 0) out vec4 color;\n"
        "void main() { color = vec4(sign(texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r)); }\n"
    )

    class Flat(FullscreenPass):
        inputs: ClassVar = {"depth": Input("depth", "depth32f")}
        fragment = "flat.frag"
        shader_folder = tmp_path

        def outputs(self, inputs):
            del inputs
            return {"color": Output("grey", Texture("rgba8"))}

    pictures = {}
    for keep_all in (False, True):
        one = renderer(SIZE, path, passes={"flat": Flat}, keep_all=keep_all)
        plan = one.plan(room(), outputs=["display"])
        one.draw(room(), plan)
        pictures[keep_all] = one.read(plan).display, one.memory()["textures"], plan
    (slim, few, plan), (full, more, kept) = pictures[False], pictures[True]
    assert np.array_equal(slim, full)
    assert slim.any()
    assert {"gbuffer.albedo", "gbuffer.normals"} <= plan.left_out.keys()
    assert plan.left_out["gbuffer.albedo"] == "nothing reads it"
    assert few == more - 2 * 8 * SIZE[0] * SIZE[1]
    assert "gbuffer.albedo" not in kept.left_out


def atlas(one):
    return one.executor.resource(("shadow_maps", "atlas"))


def test_the_atlas_has_room_for_the_lights_that_live(renderer, monkeypatch):
    made = []
    allocate = GpuTexture._allocate
    monkeypatch.setattr(GpuTexture, "_allocate", lambda self, layers: (made.append(layers), allocate(self, layers)))
    settings = {"shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 16}
    half = replace(gable(), lights=(replace(gable().spotlight, position=(0.1, 1.6, 1.0), look_at=(0.1, -1.0, 1.0)),))
    one = renderer(SIZE, set=settings)
    image = one.render(half, vpls=256)
    lights = one.executor.resource(("vpl", "vpls")).records
    tiles = lights["tile"][lights["emission"].any(axis=1)].max() + 1
    assert 16 < tiles < 200
    assert atlas(one).layers == 1 + -(-tiles // 16) < 17
    full = renderer(SIZE, set=settings, keep_all=True)
    assert same_pixels(image, full.render(half, vpls=256))
    assert atlas(full).layers == 17
    made.clear()
    for seed in range(1, 7):
        one.render(half, vpls=256, seed=seed)
    assert len(made) <= 2
    one.render(room(), vpls=256)
    assert atlas(one).layers == 17


def test_transient_targets_share_textures_and_the_pixels_are_the_same(renderer):
    for graph in ("interleaved", "mapped"):
        settings = {"shadow_rays.visibility": "rays"} if graph == "mapped" else {}
        one, full = (renderer(SIZE, graph, set=settings, keep_all=keep_all) for keep_all in (False, True))
        images = [r.render(room(), vpls=16, seed=seed) for r in (one, full) for seed in (0, 1)]
        assert same_pixels(images[0], images[2])
        assert same_pixels(images[1], images[3])
        plan = one.plan(room(), 16)
        assert len(alias_textures(plan)) == 1
        spared = full.executor.memory()["textures"] - one.executor.memory()["textures"]
        assert spared == 16 * SIZE[0] * SIZE[1]
        source = next(iter(alias_textures(plan).values()))
        with pytest.raises(KeyError, match="another pass has its texture by now; make it an output"):
            one.executor.resource(source)
        assert one.render(room(), vpls=16, accumulate=2).radiance.tobytes() == (
            full.render(room(), vpls=16, accumulate=2).radiance.tobytes()
        )


def test_no_texture_is_shared_where_frames_are_reused(renderer):
    one = renderer(SIZE, "interleaved", reuse=True)
    one.render(room(), vpls=16)
    assert one.executor.resource(("light_shares", "shares")) is not one.executor.resource(("lighting", "radiance"))


def test_the_command_line_can_keep_all(tmp_path):
    images = []
    for options in ([], ["--keep-all"]):
        path, run = tmp_path / f"{len(options)}.npy", tmp_path / f"{len(options)}.json"
        command = ["render", "cornell", "--size", "24x16", "--vpls", "4", "--device", "software"]
        assert main.main([*command, "-o", str(path), "--json", str(run), *options]) == 0
        made = json.loads(run.read_text())
        images.append((np.load(path), [entry["name"] for entry in made["passes"]], made["memory_bytes"]["textures"]))
    (slim, few, _), (full, more, _) = images
    assert np.array_equal(slim, full)
    assert [*few, "tonemap"] == more


@pytest.mark.parametrize(("graph", "size", "vpls"), [("deferred", (150, 90), 40), ("hemisphere", (70, 130), 260)])
def test_tiles_of_the_screen_skip_lights_that_they_lie_behind(renderer, graph, size, vpls):
    scene = crooked_room()
    settings = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32}
    (image, counters, _), (full, kept, _) = both(renderer, scene, graph, vpls=vpls, size=size, **settings)
    assert counters["lights_skipped"] > 5
    assert "lights_skipped" not in kept
    assert same_pixels(image, full)


@pytest.mark.parametrize("size", [(192, 192), (45, 20)])
def test_tiles_list_no_lights_where_they_show_nothing(renderer, size):
    scene = build(plane(), camera=Camera((0.0, 3.0, 0.1), (2.0, 0.0, 0.0), fov=70.0))
    (image, counters, _), (full, _, _) = both(renderer, scene, "deferred", vpls=16, size=size)
    assert same_pixels(image, full)
    one = renderer(size)
    one.render(scene, vpls=16)
    depth, texels = (one.read_texture(source) for source in (("gbuffer", "depth"), ("cull_lights", "tiles")))
    columns, rows = (np.arange(length) * TILES // length for length in size)
    shows = np.zeros((TILES, TILES), bool)
    np.logical_or.at(shows, (rows[:, None], columns), depth[..., 0] > 0)
    lit = texels[:TILES, :TILES].any(axis=-1)
    assert lit.any()
    assert not (lit & ~shows).any()
    assert counters["lights_skipped"] == TILES**2 * counters["vpls_alive"] - count_pairs(texels)


@pytest.mark.parametrize("graph", ["deferred", "interleaved"])
def test_nothing_is_missing_when_models_move(renderer, graph):
    scene = room_with_moving_models()
    ways = [renderer((96, 70), graph, keep_all=keep_all) for keep_all in (False, True)]
    for time in (0.0, 0.7, 0.2):
        images = [one.render(scene, vpls=24, time=time) for one in ways]
        assert same_pixels(*images)
