"""Frames that are reused: a pass runs only if what its outputs are made of has changed, and no pixel tells."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any, ClassVar

import moderngl
import numpy as np
import pytest
from small_scenes import build, plane, room

from deferred_ir.cli import main
from deferred_ir.frame.frame import PARTS, Frame
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.textures import GpuTexture

SIZE = (32, 24)
ROOM = room()
GRAPHS = ["forward", "deferred", "hemisphere", "interleaved", "mapped", "incremental"]
SETTINGS = {"vpl.count": 16, "shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 16}
RAYS = {"shadow_rays.visibility": "rays"}


class Broken:
    """Stands for an OpenGL buffer that the driver takes nothing into."""

    def write(self, *_: Any, **__: Any) -> None:
        raise ZeroDivisionError


def light(**changes):
    return replace(ROOM, lights=(replace(ROOM.spotlight, **changes),))


X, Y, Z = ROOM.spotlight.position
CAMERA = replace(ROOM, camera=replace(ROOM.camera, fov=ROOM.camera.fov - 5))
LIGHT = light(position=(X + 0.1, Y, Z))
BRIGHTER = light(emission=(3.0, 2.0, 1.0))


def drawn(one, scene, **options):
    """Which passes ran."""
    plan = one.plan(scene)
    one.draw(scene, plan, **options)
    return {step.name for step in plan.steps} - set(one.executor.skipped)


def settled(one, scene=ROOM):
    """The renderer after frames of `scene` until nothing runs any more."""
    for _ in range(20):
        if not drawn(one, scene):
            return one
    raise AssertionError("never comes to rest")


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_still_frame_runs_nothing(renderer, graph):
    one = settled(renderer(SIZE, graph, set=SETTINGS, reuse=True))
    record = one.executor.counters.copy()
    assert not drawn(one, ROOM)
    assert one.executor.counters["maps_drawn"] == 0
    assert one.executor.counters["vpls_alive"] == record["vpls_alive"] > 0


@pytest.mark.parametrize(
    ("graph", "scene", "options", "ran"),
    [
        ("deferred", CAMERA, {}, {"gbuffer", "cull_lights", "lighting", "tonemap"}),
        ("deferred", LIGHT, {}, {"lights", "vpl", "shadow_maps", "cull_lights", "lighting", "tonemap"}),
        ("deferred", ROOM, {"seed": 1}, {"vpl", "shadow_maps", "cull_lights", "lighting", "tonemap"}),
        ("deferred", ROOM, {"time": 1.0}, set()),
        ("forward", CAMERA, {}, {"visible_faces", "forward", "tonemap"}),
        ("interleaved", CAMERA, {}, {"gbuffer", "light_shares", "neighbours", "gather", "lighting", "tonemap"}),
    ],
)
def test_only_what_depends_on_a_change_runs(renderer, graph, scene, options, ran):
    one = settled(renderer(SIZE, graph, set=SETTINGS, reuse=True))
    assert drawn(one, scene, **options) == ran


def test_a_brighter_light_draws_no_map(renderer):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    assert "vpl" in drawn(one, BRIGHTER)
    assert one.executor.counters["maps_drawn"] == 0
    drawn(one, LIGHT)
    assert one.executor.counters["maps_drawn"] > 10


def test_a_changed_setting_runs_its_pass_and_its_readers(renderer):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    one.configure(set={**SETTINGS, "tonemap.exposure": 1.0})
    assert drawn(one, ROOM) == {"tonemap"}
    one.configure(set={**SETTINGS, "tonemap.exposure": 1.0, "shadow_maps.vpl_size": 32})
    assert drawn(one, ROOM) == {"shadow_maps", "lighting", "tonemap"}
    one.configure(set={**SETTINGS, "tonemap.exposure": 1.0})
    assert "tonemap" in drawn(one, ROOM)
    assert not drawn(one, ROOM)


@pytest.mark.parametrize("key", ["spot_kernel", "vpl_kernel", "spot_taps", "vpl_offset", "soft_taps"])
def test_another_filter_lights_again_and_draws_no_map(renderer, key):
    """Nor does it compile a program that does not name it."""
    settings = {**SETTINGS, "lighting.spot_kernel": 3.0, "lighting.vpl_kernel": 3.0}
    one = settled(renderer(SIZE, set=settings, reuse=True))
    library = one.executor.library
    before = set(library._programs.values())
    one.configure(set={**settings, f"lighting.{key}": 5})
    assert drawn(one, ROOM) == {"lighting", "tonemap"}
    assert one.executor.counters["maps_drawn"] == 0
    new = set(library._programs.values()) - before
    assert len(new) == 1
    assert all(re.search(rf"#define {key.upper()} 5", program.text) for program in new)


def test_a_light_that_moves_uploads_no_vertices(renderer, monkeypatch):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    kept = one._buffers
    monkeypatch.setattr(kept, "_attributes", dict.fromkeys(kept._attributes, (Broken(), "")))
    assert "shadow_maps" in drawn(one, LIGHT)
    assert one._buffers is kept


class Work:
    """Counts what OpenGL is asked for while it is on: draws, uploads, objects and programs that are new."""

    def __init__(self, one, monkeypatch):
        self.one, self.settings, self.draws, self.uploads = one, SETTINGS, 0, 0
        self._patch(monkeypatch, moderngl.VertexArray, "render", "draws")
        self._patch(monkeypatch, moderngl.VertexArray, "render_indirect", "draws")
        self._patch(monkeypatch, moderngl.Buffer, "write", "uploads")
        self._patch(monkeypatch, GpuTexture, "upload", "uploads")

    def _patch(self, monkeypatch, kind, name, counter):
        original = getattr(kind, name)

        def counted(*arguments, **options):
            setattr(self, counter, getattr(self, counter) + 1)
            return original(*arguments, **options)

        monkeypatch.setattr(kind, name, counted)

    def of(self, scene, settings):
        """(draws, uploads, new objects) of a frame; programs are objects, too."""
        with self.one.gpu.ctx:
            before = self.one.gpu.gl.count_objects()
        if settings != self.settings:
            self.one.configure(set=settings)
            self.settings = settings
        self.draws = self.uploads = 0
        drawn(self.one, scene)
        with self.one.gpu.ctx:
            after = self.one.gpu.gl.count_objects()
        return (
            self.draws,
            self.uploads,
            {kind: after[kind] - before[kind] for kind in after if after[kind] > before[kind]},
        )


def test_each_change_costs_what_it_must(renderer, monkeypatch):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    work, exposed = Work(one, monkeypatch), {**SETTINGS, "tonemap.exposure": 1.0}
    work.of(ROOM, exposed)  # the curve of this exposure is another program, once
    work.of(CAMERA, exposed)
    # Uploads: the frame's uniforms always; lights, VPLs and views if they changed, and what the draws of the maps of
    # VPLs and of views read.
    for scene, expected in ((CAMERA, (4, 1)), (LIGHT, (5, 8)), (BRIGHTER, (3, 3))):
        work.of(ROOM, exposed)
        assert work.of(ROOM, exposed) == (0, 1, {})
        assert work.of(scene, exposed) == (*expected, {})
    work.of(BRIGHTER, SETTINGS)
    assert work.of(BRIGHTER, exposed) == (1, 1, {})


def warmed_up(one):
    """The renderer at rest, with the variants of programs that it has where parts of a frame stay."""
    drawn(settled(one), LIGHT)
    return settled(one)


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_define_compiles_the_programs_that_name_it(renderer, graph):
    """The size of VPLs' maps stands in their readers' programs, and in none of the others."""
    one = warmed_up(renderer(SIZE, graph, set=SETTINGS, reuse=True))
    library = one.executor.library
    before = set(library._programs.values())
    one.configure(set={**SETTINGS, "shadow_maps.vpl_size": 32})
    drawn(one, ROOM)
    naming = {program for program in library._programs.values() if "#define VPL_SIZE 32\n" in program.text}
    assert set(library._programs.values()) - before == naming
    one.configure(set=SETTINGS)
    settled(one)
    assert library.compiled == len(library._programs)


def test_a_parameter_that_no_program_names_compiles_nothing(renderer):
    settings = {**SETTINGS, **RAYS}
    one = warmed_up(renderer(SIZE, "mapped", set=settings, reuse=True))
    compiled = one.executor.library.compiled
    for change in ({"vpl.bounces": 2}, {"vpl.clamp": 0.1}, {"shadow_maps.bend": 1.0}, {"near_field.samples": 2.0}):
        one.configure(set={**settings, **change})
        assert drawn(one, ROOM)
        assert one.executor.library.compiled == compiled


def changes():
    """(scene, options, settings) of frames one after the other."""
    more = {**SETTINGS, "tonemap.exposure": 2.0}
    yield ROOM, {}, SETTINGS
    yield CAMERA, {}, SETTINGS
    yield CAMERA, {}, more
    yield LIGHT, {}, more
    yield BRIGHTER, {}, SETTINGS
    yield BRIGHTER, {"seed": 2}, SETTINGS
    yield ROOM, {"seed": 2}, {**SETTINGS, "vpl.count": 12}
    yield build(plane()), {}, {**SETTINGS, "vpl.count": 12}
    yield light(emission=(0.0, 0.0, 0.0)), {}, SETTINGS
    yield ROOM, {}, SETTINGS


@pytest.mark.parametrize(("visibility", "rays"), [("maps", set()), ("rays", {"direct_rays", "shadow_maps"})])
def test_a_camera_that_moves_keeps_vpls(renderer, visibility, rays):
    one = settled(renderer(SIZE, "incremental", set=SETTINGS | {"direct_rays.visibility": visibility}, reuse=True))
    seen = {"gbuffer", "sample_pixels", "light_shares", "neighbours", "gather", "lighting", "tonemap"}
    assert drawn(one, CAMERA) == seen | rays
    assert one.executor.counters["maps_drawn"] == 0


@pytest.mark.parametrize("graph", [*GRAPHS[:-1], "mapped by rays"])
def test_no_pixel_tells(renderer, graph):
    name, *rays = graph.split(" by ")
    own = RAYS if rays else {}
    one = renderer(SIZE, name, reuse=True)
    other = renderer(SIZE, name)
    for scene, options, settings in changes():
        for made in (one, other):
            made.configure(set={**settings, **own})
        for _ in range(2):
            kept, anew = (made.render(scene, **options) for made in (one, other))
            np.testing.assert_array_equal(kept.radiance, anew.radiance)
            np.testing.assert_array_equal(kept.display, anew.display)


def test_no_pixel_of_incremental_tells(renderer):
    """Its frames go on from one another, so both draw the same ones."""
    one, other = (renderer(SIZE, "incremental", set=SETTINGS, reuse=reuse) for reuse in (True, False))
    for scene in [ROOM] * 12 + [LIGHT] * 3 + [CAMERA] * 6:
        np.testing.assert_array_equal(*(made.render(scene).radiance for made in (one, other)))


def test_a_mean_of_frames_is_the_same(renderer):
    one, other = (renderer(SIZE, "interleaved", set=SETTINGS, reuse=reuse) for reuse in (True, False))
    for accumulate in (3, 1, 2):
        kept, anew = (made.render(ROOM, accumulate=accumulate) for made in (one, other))
        np.testing.assert_array_equal(kept.radiance, anew.radiance)
        np.testing.assert_array_equal(kept.display, anew.display)


def test_a_frame_that_is_broken_off_runs_again(renderer, monkeypatch):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    with monkeypatch.context() as broken:
        broken.setattr(GpuBuffer, "write", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            drawn(one, LIGHT)
    assert "lights" in drawn(one, ROOM)


def test_lights_that_were_not_uploaded_light_the_next_frame(renderer, monkeypatch):
    one = settled(renderer(SIZE, set=SETTINGS, reuse=True))
    with monkeypatch.context() as broken:
        broken.setattr(one.executor.resource(("vpl", "vpls")), "buffer", Broken())
        with pytest.raises(ZeroDivisionError):
            one.render(BRIGHTER)
    expected = renderer(SIZE, set=SETTINGS).render(BRIGHTER)
    np.testing.assert_array_equal(one.render(BRIGHTER).radiance, expected.radiance)


class Watched:
    """Stands for a frame and notes which of its parts a pass reads."""

    PARTS: ClassVar = {"buffers": "models", "tracer": "models", "near": "models", "seed": "seed", "time": "time"}

    def __init__(self, frame: Frame) -> None:
        self.frame, self.read = frame, set[str]()

    def __getattr__(self, name: str) -> Any:
        if name in self.PARTS:
            self.read.add(self.PARTS[name])
        return WatchedScene(self) if name == "scene" else getattr(self.frame, name)

    def read_surfaces(self, *gbuffer):
        self.read.add("camera")
        return self.frame.read_surfaces(*gbuffer)


class WatchedScene:
    """The same for its scene."""

    PARTS: ClassVar = {"camera": "camera", "spotlight": "light"}

    def __init__(self, watched: Watched) -> None:
        self.watched = watched

    def __getattr__(self, name: str) -> Any:
        self.watched.read.add(self.PARTS.get(name, "models"))
        return getattr(self.watched.frame.scene, name)


@pytest.mark.parametrize("graph", [*GRAPHS, "mapped by rays"])
def test_passes_name_all_that_they_read(renderer, graph):
    name, *rays = graph.split(" by ")
    one = renderer(SIZE, name, set={**SETTINGS, **(RAYS if rays else {})}, reuse=True)
    plan = one.plan(ROOM)
    for step in plan.steps:
        execute = step.work.execute

        def watch(frame, io, step=step, execute=execute):
            watched = Watched(frame)
            execute(watched, io)
            assert watched.read <= step.work.depends() <= PARTS.keys(), step.name

        step.work.execute = watch
    one.draw(ROOM, plan)


def test_the_record_tells_what_was_kept_and_what_that_saved(tmp_path):
    run = tmp_path / "run.json"
    options = ["--size", "32x24", "--vpls", "8", "--device", "software", "--json", str(run), "--frames", "5"]
    assert main.main(["render", "cornell", *options, "--reuse"]) == 0
    made = json.loads(run.read_text())
    first, *rest = made["maps_drawn"]
    assert first == 1 + made["vpls_alive"] > 4
    assert rest == [0] * 4
    entry = next(entry for entry in made["left_out"] if entry["what"] == "lighting")
    assert entry["why"] == "in 4 of 5 frames nothing that it is made of changed"
    assert entry["ms"] > 0
    assert {entry["gpu_ms"] for entry in made["passes"]} == {0}
    assert main.main(["render", "cornell", *options]) == 0
    made = json.loads(run.read_text())
    assert made["maps_drawn"] == [first] * 5
    assert "lighting" not in {entry["what"] for entry in made["left_out"]}


@pytest.mark.parametrize("n", [2, 4, 8])
def test_neighbours_are_found_anew_only_with_the_g_buffer_and_pixels_stay_the_same(renderer, n):
    settings = {**SETTINGS, "interleave.n": n}
    one, other = (renderer((37, 29), "interleaved", set=settings, reuse=reuse) for reuse in (True, False))
    for step, scene in enumerate([ROOM, LIGHT, ROOM, CAMERA, replace(LIGHT, camera=CAMERA.camera)]):
        np.testing.assert_array_equal(*(made.render(scene, seed=3).radiance for made in (one, other)))
        assert ("neighbours" in one.executor.skipped) == (step in (1, 2, 4))
        assert "gather" not in one.executor.skipped
    for change in ({"neighbours.fewest": 0.0}, {"neighbours.fewest": 0.9}, {"neighbours.angle": 5.0}):
        for made in (one, other):
            made.configure(set=settings | change)
        for scene in (CAMERA, replace(LIGHT, camera=CAMERA.camera)):
            np.testing.assert_array_equal(*(made.render(scene, seed=3).radiance for made in (one, other)))


def test_a_pass_of_another_type_starts_afresh(renderer):
    """`incremental` and `deferred` both have a pass `vpl`, and each keeps its own kind of thing from frame to frame."""
    one = renderer(SIZE, set=SETTINGS, reuse=True)
    expected = one.render(ROOM).radiance
    for graph in ("incremental", "deferred"):
        one.configure(graph=graph)
        found = one.render(ROOM).radiance
    np.testing.assert_array_equal(found, expected)
