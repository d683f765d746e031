"""Times of motions: references and sweeps of a scene that moves, and what is said where VPLs are still on their way."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from deferred_ir import load
from deferred_ir.cli import main
from deferred_ir.engine.renderer import Renderer
from deferred_ir.profiling.sweep import groups, sweep
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference
from deferred_ir.truth.reference_noise import ReferenceNoise

SIZE = (24, 24)
SMALL = ["--size", "24x24"]


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    """The Cornell box with a small one of its kind in it, that moves."""
    source = load("cornell").path.with_name("cornell.obj")
    path = tmp_path_factory.mktemp("moving") / "moving.toml"
    path.write_text(f"""
    [[model]]
    path = "{source}"
    scale = 0.001
    [[model]]
    path = "{source}"
    scale = 0.0003
    [model.motion]
    times = [0, 0.5]
    translations = [[0.1, 0.1, 0.0], [0.3, 0.3, 0.0]]
    rotations = [[0, 0, 0, 1], [0, 0, 0, 1]]
    """)
    return str(path)


def run(capsys, *arguments):
    """Exit status and lines of standard error."""
    status = main.main([str(argument) for argument in arguments])
    return status, capsys.readouterr().err.splitlines()


def test_a_reference_of_a_time(scene_file, tmp_path, capsys):
    made = {}
    for time in ("0", "0.3"):
        out = tmp_path / f"r{time}.npy"
        assert run(capsys, "reference", scene_file, *SMALL, "--spp", 4, "--time", time, "-o", out)[0] == 0
        made[time] = np.load(out)
        assert json.loads(out.with_suffix(".json").read_text())["time"] == float(time)
    assert not np.array_equal(made["0"], made["0.3"])
    np.testing.assert_array_equal(made["0.3"], trace_reference(load(scene_file), SIZE, spp=4, time=0.3).radiance)


def test_a_still_scene_is_of_no_time():
    assert trace_reference(load("cornell"), (4, 4), spp=1, time=5.0).meta["time"] == 0.0


def test_images_of_other_times_are_not_compared(scene_file, tmp_path, capsys):
    image, at = tmp_path / "image.npy", 6 / FRAMES_PER_SECOND
    settings = ["--vpls", "4", "--device", "software", "--set", "shadow_maps.spot_size=128"]
    run(capsys, "render", scene_file, *SMALL, *settings, "--frames", 7, "-o", image, "--json", tmp_path / "image.json")
    assert json.loads((tmp_path / "image.json").read_text())["time"] == pytest.approx(at)
    then = tmp_path / "then.npy"
    run(capsys, "reference", scene_file, *SMALL, "--spp", 1, "-o", then)
    status, lines = run(capsys, "compare", image, then)
    assert status == 2
    assert lines[-1].endswith("deferred-ir reference --time 0.2000")
    run(capsys, "reference", scene_file, *SMALL, "--spp", 1, "-o", then, "--time", "0.2")
    assert run(capsys, "compare", image, then)[0] == 0


@pytest.mark.parametrize("time", ["soon", "nan", "inf", "1e99"])
def test_a_time_that_is_no_number_of_seconds_is_refused(time, scene_file, tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main.main(["reference", scene_file, "-o", str(tmp_path / "r.npy"), "--time", time])
    assert "is no number of seconds" in capsys.readouterr().err


def profiled(scene_file, folder, *extra):
    options = ["--graphs", "incremental,deferred", "--vpls", "12", "--seeds", "1", "--peers", "none", *SMALL]
    return main.main(["profile", scene_file, "-o", str(folder), *options, "--device", "software", *extra])


@pytest.fixture(scope="module")
def swept(scene_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("swept")
    assert profiled(scene_file, folder, "--time", "0.4") == 0
    return folder


def test_a_sweep_moves_and_its_errors_are_of_the_last_frame(scene_file, swept):
    scene = load(scene_file)
    with (swept / "error_vs_time.csv").open(newline="") as file:
        rows = {row["graph"]: row for row in csv.DictReader(file)}
    truth, hit = np.load(swept / "reference.npy"), json.loads((swept / "reference.json").read_text())["hit_fraction"]
    made = sweep.Sweep(scene, SIZE, ["incremental", "deferred"], [12], 1, time=0.4)
    for graph, row in rows.items():
        with Renderer(SIZE, graph, "software") as renderer:
            plan = renderer.plan(scene, 12)
            times = made.frame_times(plan)
            assert np.diff(times) == pytest.approx(1 / FRAMES_PER_SECOND)
            assert times[-1] == 0.4
            for time in times:
                renderer.draw(scene, plan, time=time)
            assert float(row["relmse"]) == relmse(renderer.read(plan).radiance, truth, hit)[0]
            if graph == "incremental":  # 12 VPLs, 8 at once, and up to twice as long where models move
                assert len(times) == 2 * 2 + sweep.FRAMES
                assert renderer.executor.counters["vpls_waiting"] == 0
            else:
                assert len(times) == 2 + sweep.FRAMES
    page = (swept / "report.html").read_text()
    assert "end at 0.4 s" in page
    assert "incremental retains samples" in page


def test_what_retains_samples_is_neither_on_the_front_nor_recommended(scene_file, swept, capsys):
    assert profiled(scene_file, swept, "--time", "0.4") == 0
    assert "deferred, 12 VPLs" in capsys.readouterr().out  # though a frame of incremental may take less
    told = {group["graph"]: group for group in json.loads((swept / "error_vs_time.json").read_text())["groups"]}
    assert (told["incremental"]["retains_samples"], told["incremental"]["pareto"]) == (True, False)
    assert (told["deferred"]["retains_samples"], told["deferred"]["pareto"]) == (False, True)
    retaining = groups.Group("a", 8, 1, 1, 0.1, 0.1, 0.1, ReferenceNoise(0.0, ""), retains_samples=True)
    assert "No recommendation" in groups.advise([retaining], SIZE)


def test_a_sweep_takes_a_reference_of_its_time_only(scene_file, swept, tmp_path, capsys):
    given = tmp_path / "given.npy"
    run(capsys, "reference", scene_file, *SMALL, "--spp", 4, "-o", given)
    assert profiled(scene_file, tmp_path / "out", "--time", "0.4", "--reference", str(given)) == 2
    assert "shows the scene at 0.0 s, but the sweep's frames end at 0.4 s" in capsys.readouterr().err
    run(capsys, "reference", scene_file, *SMALL, "--spp", 4, "-o", given, "--time", "0.4")
    assert profiled(scene_file, tmp_path / "out", "--time", "0.4", "--reference", str(given)) == 0
    assert profiled(scene_file, swept) == 0  # of 1 s: nothing that was measured at 0.4 s is taken for it
    assert len(list((swept / "points").glob("*.json"))) == 4


def test_a_still_scene_is_settled_before_it_is_measured():
    scene = load("cornell")
    made = sweep.Sweep(scene, SIZE, ["incremental", "deferred"], [64], 1, time=0.0)
    for graph, first in (("incremental", 8), ("deferred", 1)):
        with Renderer(SIZE, graph, "software") as renderer:
            assert made.frame_times(renderer.plan(scene, 64)) == [0.0] * (first + sweep.FRAMES)


# Notes


def rendered(capsys, tmp_path, *extra):
    given = [*SMALL, "--graph", "incremental", "--vpls", "16", "--device", "software", "-o", tmp_path / "x.npy"]
    status, lines = run(capsys, "render", "cornell", *given, *extra)
    assert status == 0
    return [line for line in lines if "VPLs" in line]


def test_a_set_that_is_not_full_is_noted(tmp_path, capsys):
    (line,) = rendered(capsys, tmp_path)
    assert line.startswith("note: 8 of 16 rays for VPLs so far: 2 frames fill the set")
    assert line.endswith("--set vpl.most=16")
    assert rendered(capsys, tmp_path, "--frames", 2) == []
    assert rendered(capsys, tmp_path, "--set", "vpl.most=16") == []
    (line,) = rendered(capsys, tmp_path, "--accumulate", 2)
    assert line.startswith(
        "note: each of the 2 frames that are averaged starts afresh, with few of 16 VPLs; --set vpl."
    )
    assert rendered(capsys, tmp_path, "--accumulate", 2, "--set", "vpl.most=16") == []
