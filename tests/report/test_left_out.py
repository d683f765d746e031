"""What is said about what was left out: in RUN.json and in the report."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
from small_scenes import gable, room, smooth_scene

from deferred_ir.base.errors import DeviceError
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.measurement import Measurement
from deferred_ir.gl.formats import FORMATS
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture
from deferred_ir.profiling.studies import left_out
from deferred_ir.report import left_out as savings

SIZE = (48, 48)


def told(renderer, scene, graph, outputs=None, **settings):
    """Entries by what was left out, of two frames."""
    one = renderer(SIZE, graph, set=settings)
    plan, measurement = one.plan(scene, outputs=outputs), Measurement()
    for _ in range(2):
        one.draw(scene, plan, measurement=measurement)
    one.finish(measurement)
    before = one.memory()
    entries = savings.list_for_frames(one, plan, measurement) + savings.measure_passes(one, scene, plan)
    return {entry.what: entry for entry in entries}, one.memory()["textures"] - before["textures"]


def test_passes_that_another_output_needs_are_measured(renderer):
    found, more = told(renderer, room(), "deferred", ["radiance"], **{"vpl.count": 4})
    assert found["tonemap"].why == "no requested output needs it"
    assert found["tonemap"].ms > 0
    assert found["tonemap"].bytes == more == 4 * SIZE[0] * SIZE[1]


def test_filters_without_vpls_are_measured_with_the_bytes_that_they_would_take(renderer):
    found, more = told(renderer, room(), "interleaved", **{"vpl.count": 0})
    assert {"interleave", "light_shares", "gather"} <= found.keys()
    assert found["light_shares"].why.startswith("there are no VPLs")
    assert all(found[name].ms >= 0 for name in ("light_shares", "gather"))
    assert found["Embree's scene"].why == "no ray was traced"
    assert found["light_shares"].bytes == 16 * SIZE[0] * SIZE[1]
    assert more >= found["light_shares"].bytes


def test_what_could_not_run_is_told_without_figures(renderer):
    """A dark spotlight needs no maps, and maps of so many VPLs would not fit."""
    dark = replace(room(), lights=(replace(room().spotlight, emission=(0.0, 0.0, 0.0)),))
    found, _ = told(renderer, dark, "deferred", **{"vpl.count": 65536})
    assert found["shadow_maps"].why == "no light needs one: nothing shines"
    assert found["shadow_maps"].ms is found["shadow_maps"].bytes is None


def test_measuring_that_fails_leaves_the_renderer_as_it_was(renderer, monkeypatch):
    one = renderer(SIZE, set={"vpl.count": 4}, reuse=True)
    plan = one.plan(room(), outputs=["radiance"])
    one.draw(room(), plan)
    with monkeypatch.context() as full:
        full.setattr(one.executor, "run", partial(_refuse, DeviceError("no room")))
        entries = savings.measure_passes(one, room(), plan)
    assert {entry.what: entry.ms for entry in entries}["tonemap"] is None
    assert one.reuse


def _refuse(error, *_, **__):
    raise error


def test_frames_of_a_mean_are_counted_without_what_shows_it(renderer):
    one, measurement = renderer(SIZE, set={"vpl.count": 4}, reuse=True), Measurement()
    mean = Accumulation(one, room(), one.plan(room()), measurement=measurement)
    for _ in range(3):
        mean.draw()
    mean.show()
    assert measurement.skipped == [(), ("lights", "gbuffer"), ("lights", "gbuffer")]
    assert [entry[:2] for entry in measurement.skipped_passes()] == [("lights", 2), ("gbuffer", 2)]


def test_what_is_a_choice_is_not_measured(renderer):
    found, _ = told(renderer, room(), "mapped", **{"vpl.count": 4, "shadow_rays.visibility": "maps"})
    assert found["shadow_rays"].ms is None
    assert found["shadow_rays"].bytes is None


def test_lights_layers_and_shared_textures_are_told(renderer):
    sizes = {"shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 32, "vpl.count": 256}
    found, _ = told(renderer, gable(), "interleaved", **sizes)
    lights = next(entry for what, entry in found.items() if what.startswith("maps of "))
    assert lights.why == "they light nothing that is seen"
    assert found["lighting.radiance"].why.startswith("it has the texture of light_shares.shares")
    assert found["lighting.radiance"].bytes == 16 * SIZE[0] * SIZE[1]
    assert "Embree's scene" not in found
    layers = found["shadow_maps.atlas"]
    assert layers.why.endswith("of 65 layers are enough for the lights that live")
    assert layers.bytes % (4 * 64 * 64) == 0


def test_the_scene_tells_what_shaders_do_without():
    def words(scene):
        return {entry.what for entry in savings.list_for_scene(scene)}

    assert words(room()) == {"vertex normals", "vertex colours", "textures", "soft shadows"}
    assert words(smooth_scene()) == {"vertex colours", "textures", "soft shadows"}
    disc = replace(room(), lights=(replace(room().spotlight, radius=0.1),))
    assert "soft shadows" not in words(disc)


@pytest.mark.parametrize("format", ["rgba32f", "rgba16f", "rgba16", "rgba8", "r32f", "rg32ui", "r32ui", "depth32f"])
def test_memory_is_what_the_driver_says_of_each_format(gpu, format):
    for layers in (0, 3):
        texture = GpuTexture(gpu, Texture(format, layers=layers), (8, 4))
        assert texture.nbytes == max(layers, 1) * 8 * 4 * FORMATS[format].bytes
        texture.release()


def test_the_table_holds_both_ways_together(monkeypatch, capsys):
    started = []
    monkeypatch.setattr(left_out, "seconds", lambda command: started.append("--keep-all" in command) or 1.0)
    monkeypatch.setattr(left_out, "row", partial(left_out.row, size=(32, 24)))
    monkeypatch.setattr("sys.argv", ["left_out", "cornell", "--vpls", "4", "--turns", "1", "--device", "software"])
    left_out.main()
    head, _, *rows = capsys.readouterr().out.splitlines()
    assert head.startswith("| scene | graph | frame [ms] | with all |")
    for graph, line in zip(("deferred", "interleaved"), rows, strict=True):
        assert line.startswith(f"| cornell | {graph} |")
        few, more = (float(cell) for cell in line.strip(" |").split(" | ")[-2:])
        assert 16 < few <= more
    assert started == [False, True] * 2
