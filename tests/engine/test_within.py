"""Images for a given time: what is chosen, with times that the tests make up, and how it is told."""

import json
import re
import shlex

import numpy as np
import pytest
from command_line import find_fault
from small_scenes import room

from deferred_ir.base.errors import SettingError
from deferred_ir.cli.main import main
from deferred_ir.engine import within
from deferred_ir.tuning import machine_costs
from deferred_ir.tuning.ladder import GRAPH, RUNGS

SIZE = (32, 32)
SMALL = ("--size", "32x32", "--device", "software")
STEP = 10.0
"""Made-up milliseconds from rung to rung."""


@pytest.fixture(autouse=True)
def made_up_times(tmp_path, monkeypatch):
    """Frames cost STEP more from rung to rung, and STEP for each VPL in other graphs; the cache is the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(folder))

    def time_frames(renderer, scene, plan):
        renderer.draw(scene, plan)
        set = dict(renderer.setup.set)
        if str(renderer.setup.name) != GRAPH:
            return [STEP * renderer.graph().nodes["vpl"].work.params.count]
        numbers = [number for number, rung in enumerate(RUNGS) if rung.items() <= set.items()]
        return [STEP * (1 + max(numbers, key=lambda number: len(RUNGS[number])))]

    def time_mean(renderer, scene, plan):
        return time_frames(renderer, scene, plan)[0], STEP

    monkeypatch.setattr(within, "_time_frames", time_frames)
    monkeypatch.setattr(within, "_measure_mean", time_mean)


def choose(one, seconds, frames=None):
    """Choose for the small room."""
    return within.choose(one, room(), seconds, lambda: one.plan(room(), outputs=["radiance"]), frames=frames)


@pytest.mark.parametrize("number", range(len(RUNGS) - 1))
def test_the_best_rung_that_fits_is_chosen(renderer, number):
    choice = choose(renderer(SIZE, GRAPH), STEP * (1.5 + number) / 1e3 / within.FILLED)
    assert (choice.set, choice.frames, choice.ms) == (RUNGS[number], 1, STEP * (1 + number))


def test_more_time_than_a_frame_takes_is_filled_with_frames(renderer):
    choice = choose(renderer(SIZE, GRAPH), STEP * (1 + 4.5 * len(RUNGS)) / 1e3 / within.FILLED)
    assert (choice.set, choice.frames) == (RUNGS[-1], 4)
    assert choice.ms == pytest.approx(STEP * (1 + 4 * len(RUNGS)))
    assert choice.arguments[-2:] == ["--accumulate", "4"]


def test_a_number_of_frames_that_is_given_shares_the_time(renderer):
    choice = choose(renderer(SIZE, GRAPH), STEP * (1 + 4 * 2.5) / 1e3 / within.FILLED, frames=4)
    assert (choice.set, choice.frames) == (RUNGS[1], 4)


def test_a_graph_that_is_named_stays_and_its_vpls_are_chosen(renderer):
    choice = choose(renderer(SIZE, "deferred"), STEP * 40 / 1e3)
    assert (choice.graph, choice.set, choice.frames) == ("deferred", {"vpl.count": 32}, 1)
    choice = choose(renderer(SIZE, "deferred", set={"vpl.count": 4}), STEP * 40 / 1e3)
    assert (choice.set, choice.frames) == ({"vpl.count": 4}, 9)


def test_a_machine_is_measured_once(renderer, monkeypatch):
    one = renderer(SIZE, GRAPH)
    machine = within.describe_device(one)
    assert machine_costs.read(machine) is None
    choose(one, 0.05)
    assert len(machine_costs.read(machine).ms) == len(RUNGS)
    assert one.size == SIZE
    monkeypatch.setattr(within, "measure_machine", None)
    choose(one, 0.05)


def test_python_chooses_once_for_a_scene_and_goes_back(renderer, monkeypatch):
    one = renderer(SIZE, None)
    before = one.render(room(), vpls=4).radiance
    scene = room()
    image = one.render(scene, seed=3, within=STEP * 2.5 / 1e3)
    same = renderer(SIZE, GRAPH, set=RUNGS[1]).render(room(), seed=3)
    np.testing.assert_array_equal(image.radiance, same.radiance)
    monkeypatch.setattr("deferred_ir.engine.goals.choose", None)
    np.testing.assert_array_equal(one.render(scene, seed=3, within=STEP * 2.5 / 1e3).radiance, image.radiance)
    np.testing.assert_array_equal(one.render(room(), vpls=4).radiance, before)


def test_vpls_beside_a_time_are_kept(renderer):
    one = renderer(SIZE, None)
    image = one.render(room(), vpls=16, within=STEP * 2.5 / 1e3)
    same = renderer(SIZE, GRAPH, set={**RUNGS[1], "vpl.count": 16}).render(room())
    np.testing.assert_array_equal(image.radiance, same.radiance)


@pytest.mark.parametrize("wrong", [0, -1.0, float("nan"), "0.2s"])
def test_a_time_that_is_none_is_one_line(renderer, wrong):
    with pytest.raises(SettingError, match=r"^within .*: wants seconds above 0, such as 0\.2$"):
        renderer(SIZE).render(room(), within=wrong)


def test_error_and_time_contradict_each_other(renderer):
    with pytest.raises(SettingError, match=r"^error 0\.1 and within 0\.2: contradict each other; give one$"):
        renderer(SIZE).render(room(), error=0.1, within=0.2)


# The command


@pytest.mark.parametrize("given", [("25ms",), ("0.5s",), ("0.045", "--set", "filter_samples.steps=1", "--vpls", "8")])
def test_what_was_chosen_is_told_and_gives_the_same_pixels_again(tmp_path, capsys, given):
    image, run, again = (tmp_path / name for name in ("o.npy", "run.json", "again.npy"))
    files = ["-o", str(image), "--json", str(run)]
    assert main(["render", "cornell", *SMALL, "--within", *given, *files]) == 0
    told = json.loads(run.read_text())["within"]
    assert told["predicted_ms"] <= told["target_ms"]
    note = re.search(r"note: chosen for .* ms an image: (.*)", capsys.readouterr().err)
    assert shlex.split(note[1]) == told["arguments"]
    if len(given) > 1:
        assert {"filter_samples.steps=1", "vpl.count=8"} <= set(told["arguments"])
    assert main(["render", "cornell", *SMALL, *told["arguments"], "-o", str(again)]) == 0
    np.testing.assert_array_equal(np.load(image), np.load(again))


def test_a_time_too_short_takes_the_fastest_and_says_so(tmp_path, capsys):
    assert main(["render", "cornell", *SMALL, "--within", "1ms", "-o", str(tmp_path / "o.npy")]) == 0
    assert "note: nothing faster is known here; a smaller --size takes less than 10 ms" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--within", "soon"), ("--within", "1s", "--error", "0.1"), ("--within", "-1s")])
def test_what_makes_no_sense_is_one_line(tmp_path, capsys, words):
    find_fault(capsys, tmp_path, "render", "cornell", *SMALL, "-o", str(tmp_path / "o.npy"), *words)


def test_doctor_tells_the_costs_and_measures_them_anew(capsys, monkeypatch):
    monkeypatch.setattr("deferred_ir.profiling.checks.stages.SIZE", SIZE)
    main(["doctor", "--device", "software"])
    told = capsys.readouterr().out
    assert re.search(r"- +costs of frames +not known; render --within measures them first", told)
    assert re.search(r"- +compute shaders +not tried; `deferred-ir doctor --calibrate` does", told)
    main(["doctor", "--device", "software", "--calibrate"])
    told = capsys.readouterr().out
    most = rf"up to {10 * len(RUNGS)} ms"
    assert re.search(rf"ok +costs of frames +measured \d{{4}}-\d\d-\d\d, {most}, kept in .*costs-", told)
    trial = r"{} [\d.]+ ms, computed [\d.]+ ms, (used|not faster|other pixels); "
    passes = "".join(trial.format(name) for name in ("list_vpls", "choose_vpls", "light_samples", "filter_samples"))
    assert re.search(rf"ok +compute shaders +{passes}tried \d{{4}}-\d\d-\d\d", told)
