"""Averages of frames with fresh samples: what they are, where they end, and what of them is told."""

import json
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from distance import rel_mse
from fake_passes import Fake, graph, reads, source
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import room

from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.cli.main import main
from deferred_ir.engine.accumulation import Accumulation, find_readers
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.compile import compile
from deferred_ir.graph.file import find_obstacles, graph_names
from deferred_ir.sampling.streams import frame_seed

SIZE = (32, 24)
SMALL = ("--size", "32x32", "--vpls", "4", "--device", "software")


def frames(one, count, seed=0, **options):
    """The radiance of each frame that is averaged under `seed`."""
    return np.array([one.render(room(), seed=frame_seed(seed, k), **options).radiance for k in range(count)])


def mean(images):
    return np.asarray(images, np.float64).mean(axis=0).astype(np.float32)


# Seeds


@given(st.integers(0, 2**70), st.integers(1, 2**40))
def test_frames_have_seeds_that_any_device_can_hold(seed, frame):
    assert frame_seed(seed, 0) == seed
    assert 0 <= frame_seed(seed, frame) < 2**31
    assert frame_seed(seed, frame) == frame_seed(seed, frame)


def test_frames_of_one_seed_are_none_of_anothers():
    seeds = [frame_seed(seed, frame) for seed in range(20) for frame in range(200)]
    assert len(set(seeds)) == len(seeds)


# The mean


@pytest.mark.parametrize("name", [name for name in graph_names() if name not in find_obstacles()])
def test_it_is_the_mean_of_its_frames_in_every_graph(renderer, name):
    one = renderer(SIZE, name)
    expected = mean(frames(one, 3, seed=5, vpls=8))
    np.testing.assert_array_equal(one.render(room(), seed=5, vpls=8, accumulate=3).radiance, expected)


def test_one_frame_is_that_frame(renderer):
    one = renderer(SIZE)
    plain = one.render(room(), vpls=8, seed=3)
    added = Accumulation(one, room(), one.plan(room(), 8), seed=3)
    added.draw()
    for image in (added.image(), one.render(room(), vpls=8, seed=3, accumulate=1)):
        np.testing.assert_array_equal(image.radiance, plain.radiance)
        np.testing.assert_array_equal(image.display, plain.display)


def test_frames_that_do_not_differ_leave_the_picture_as_it_is(renderer):
    one = renderer(SIZE)
    plain, added = (one.render(room(), vpls=0, accumulate=count) for count in (1, 7))
    np.testing.assert_array_equal(added.radiance, plain.radiance)
    np.testing.assert_array_equal(added.display, plain.display)


def test_the_same_again_is_the_same(renderer):
    one = renderer(SIZE)
    first, other, again = (one.render(room(), vpls=4, seed=seed, accumulate=3) for seed in (1, 2, 1))
    np.testing.assert_array_equal(first.radiance, again.radiance)
    np.testing.assert_array_equal(first.display, again.display)
    assert not np.array_equal(first.radiance, other.radiance)


def test_pixels_are_the_tone_map_of_the_mean(renderer):
    one = renderer(SIZE, set={"tonemap.operator": "none", "tonemap.exposure": 1.0})
    image = one.render(room(), vpls=4, accumulate=5)
    linear = np.clip(2.0 * image.radiance.astype(np.float64), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    assert np.abs(image.display - encoded * 255).max() < 0.51
    assert image.radiance.max() > 0.5  # where clipped frames would have another mean


def test_the_error_falls_with_the_number_of_frames(renderer):
    one = renderer(SIZE, set={"vpl.pattern": "random", "shadow_maps.vpl_size": 64, "shadow_maps.spot_size": 256})
    everywhere = np.ones(SIZE[::-1], bool)
    truth = one.render(room(), vpls=1024, seed=99, accumulate=8).radiance
    few = frames(one, 96, seed=1, vpls=8)
    errors = [
        np.mean([rel_mse(mean(part), truth, everywhere) for part in few.reshape(-1, count, *truth.shape)])
        for count in (1, 4, 16)
    ]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.35)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.35)


def test_it_can_be_looked_at_on_the_way(renderer):
    one = renderer(SIZE)
    expected = frames(one, 3, vpls=4)
    added = Accumulation(one, room(), one.plan(room(), 4))
    for done in (1, 2, 3):
        added.draw()
        assert added.frames == done
        np.testing.assert_array_equal(added.image().radiance, mean(expected[:done]))


def test_a_frame_that_is_broken_off_has_never_been(renderer, monkeypatch):
    one = renderer(SIZE)
    expected = one.render(room(), vpls=4, accumulate=2)
    added = Accumulation(one, room(), one.plan(room(), 4))
    added.draw()
    added.draw()
    lighting = next(step.work for step in one.plan(room(), 4).steps if step.name == "lighting")

    def broken(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(lighting, "execute", broken)
        with pytest.raises(KeyboardInterrupt):
            added.draw()
    image = added.image()
    assert added.frames == 2
    np.testing.assert_array_equal(image.radiance, expected.radiance)
    np.testing.assert_array_equal(image.display, expected.display)


# Graphs of one's own


def test_readers_are_all_that_a_resource_reaches():
    plan = compile(
        graph(
            {"image": "last.out"},
            a=source("rgba8", other="rgba8"),
            b=(Fake(reads("x")), {"x": "a.out"}),
            c=(Fake(reads("x")), {"x": "a.other"}),
            last=(Fake(reads("x", "y")), {"x": "b.out", "y": "c.out"}),
        ),
        ["image"],
    )
    assert find_readers(plan, ("a", "out")) == {"b", "last"}
    assert find_readers(plan, ("a", "other")) == {"c", "last"}
    assert find_readers(plan, ("last", "out")) == set()


def test_pixels_that_are_not_made_of_radiance_are_refused(tmp_path, renderer):
    file = tmp_path / "two.toml"
    file.write_text(
        'extends = "deferred"\n[outputs]\nradiance = "second.radiance"\n[passes.second]\ntype = "lighting"\n'
        'inputs = { lights = "lights.lights", vpls = "vpl.vpls", depth = "gbuffer.depth", normals = "gbuffer.normals",'
        ' albedo = "gbuffer.albedo" }\n'
    )
    one = renderer(SIZE, file)
    with pytest.raises(GraphError, match=r"^two\.toml: outputs\.display: is not made of outputs\.radiance"):
        one.render(room(), vpls=4, accumulate=2)
    assert one.render(room(), vpls=4).radiance.max() > 0
    added = Accumulation(one, room(), one.plan(room(), 4, ["radiance"]))
    added.draw()
    assert added.image().display is None


def test_a_graph_without_radiance_is_refused(tmp_path, renderer):
    (tmp_path / "bare.toml").write_text('extends = "deferred"\n[outputs]\nradiance = false\n')
    with pytest.raises(GraphError, match=r"^bare\.toml: has no output 'radiance'"):
        renderer(SIZE, tmp_path / "bare.toml").render(room(), vpls=4, accumulate=2)


@pytest.mark.parametrize("count", [0, -1, 1.5, "2"])
def test_a_number_of_frames_that_is_none_is_one_line(renderer, count):
    with pytest.raises(SettingError, match=r"^accumulate .*: wants a whole number of 1 or more$"):
        renderer(SIZE).render(room(), accumulate=count)


# Time


def test_the_record_has_one_frame_for_each_picture_and_all_its_time(renderer):
    one, measurement = renderer(SIZE), Measurement()
    plan = one.plan(room(), 8)
    one.draw(room(), plan)
    for _ in range(2):
        added = Accumulation(one, room(), plan, measurement=measurement)
        for _ in range(6):
            added.draw()
        added.image()
    one.finish(measurement)
    assert len(measurement.frame_ms) == len(measurement.laps) == 2
    assert all(counters.pop("lights_skipped") for counters in measurement.counters)
    assert measurement.counters == 12 * [{"vpls_alive": 8, "maps_drawn": 9, "lights_dropped": 0}]
    for laps, wall in zip(measurement.laps, measurement.frame_ms, strict=True):
        assert list(laps) == [*(step.name for step in plan.steps if step.name != "tonemap"), "accumulate", "tonemap"]
        assert 0.7 * wall < sum(cpu for _, cpu in laps.values()) < wall


# The command


def test_the_command_averages_and_tells_how_many(tmp_path, renderer):
    names = [str(tmp_path / name) for name in ("o.npy", "o.png", "run.json")]
    assert (
        main(["render", "cornell", *SMALL, "--accumulate", "3", "-o", names[0], "-o", names[1], "--json", names[2]])
        == 0
    )
    from deferred_ir.loading.load import load

    expected = renderer((32, 32)).render(load("cornell"), vpls=4, accumulate=3)
    np.testing.assert_array_equal(np.load(names[0]), expected.radiance)
    run = json.loads(Path(names[2]).read_text())
    assert (run["frames"], run["accumulated"], len(run["maps_drawn"])) == (1, 3, 3)
    assert [entry["name"] for entry in run["passes"]][-2:] == ["accumulate", "tonemap"]


def test_without_it_one_frame_is_averaged(tmp_path):
    assert main(["render", "cornell", *SMALL, "--json", str(tmp_path / "run.json")]) == 0
    assert json.loads((tmp_path / "run.json").read_text())["accumulated"] == 1


def test_pixels_alone_are_averaged_in_radiance_too(tmp_path):
    both, alone = ([str(tmp_path / name) for name in names] for names in (("a.png", "a.npy"), ("b.png",)))
    for outputs in (both, alone):
        assert main(["render", "cornell", *SMALL, "--accumulate", "2", *(x for o in outputs for x in ("-o", o))]) == 0
    assert Path(both[0]).read_bytes() == Path(alone[0]).read_bytes()


def test_each_frame_of_many_is_a_mean(tmp_path, renderer):
    from deferred_ir.loading.load import load

    scene = load("cornell")
    assert (
        main(["render", "cornell", *SMALL, "--frames", "2", "--accumulate", "2", "-o", str(tmp_path / "%02d.npy")]) == 0
    )
    one = renderer((32, 32))
    for i in range(2):
        expected = one.render(scene, vpls=4, time=i / 30, accumulate=2).radiance
        np.testing.assert_array_equal(np.load(tmp_path / f"{i:02d}.npy"), expected)


def test_a_terminal_sees_a_progress_bar(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert main(["render", "cornell", *SMALL, "--accumulate", "3", "-o", str(tmp_path / "o.npy")]) == 0
    assert "3/3" in capsys.readouterr().err


@pytest.mark.parametrize("extra", [(), ("--frames", "3")])
def test_ctrl_c_keeps_what_is_done(tmp_path, capsys, monkeypatch, extra):
    press_ctrl_c(monkeypatch, at=4)  # the first is for --json, before the clock starts
    file, run = tmp_path / "o.npy", tmp_path / "run.json"
    arguments = ["render", "cornell", *SMALL, *extra, "--accumulate", "50", "-o", str(file), "--json", str(run)]
    assert main(arguments) == 130
    monkeypatch.undo()
    assert json.loads(run.read_text())["accumulated"] == 2
    assert capsys.readouterr().err.splitlines()[-1] == "deferred-ir: interrupted: averaged 2 of 50 frames"
    assert main(["render", "cornell", *SMALL, "--accumulate", "2", "-o", str(tmp_path / "again.npy")]) == 0
    np.testing.assert_array_equal(np.load(file), np.load(tmp_path / "again.npy"))


def test_ctrl_c_before_anything_is_done_leaves_nothing(tmp_path, capsys, monkeypatch):
    press_ctrl_c(monkeypatch, at=1)
    assert main(["render", "cornell", *SMALL, "--accumulate", "50", "-o", str(tmp_path / "o.npy")]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "deferred-ir: interrupted"
    assert not list(tmp_path.iterdir())


def press_ctrl_c(monkeypatch, at):
    """Send this process a SIGINT when it begins to draw for the `at`-th time, in code that is the package's own."""
    draw, calls = Renderer.draw, []
    ours = {"__name__": "deferred_ir", "os": os, "signal": signal}
    exec("def press(): os.kill(os.getpid(), signal.SIGINT)", ours)

    def pressed(*arguments, **options):
        calls.append(1)
        if len(calls) == at:
            ours["press"]()
        return draw(*arguments, **options)

    monkeypatch.setattr(Renderer, "draw", pressed)
