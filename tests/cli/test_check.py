"""`deferred-ir check`: its table, its figures as JSON, and its faults."""

import json
import re
import signal
import subprocess
import sys
from dataclasses import replace
from importlib import import_module

import pytest

from deferred_ir.cli.main import main
from deferred_ir.loading.load import builtin_scenes, load

SMALL = ("--visibility", "--size", "32x32", "--vpls", "4", "--pairs", "100", "--device", "software")
ONE = (*SMALL, "--set", "shadow_maps.spot_size=128", "--sizes", "32")
SHARES = ["mismatch", "leaks", "false_shadows", "light_wrong", "light_leaked", "light_lost"]


def checked(capsys, *arguments):
    """The lines that a check prints."""
    assert main(["check", *arguments]) == 0
    return capsys.readouterr().out.splitlines()


def fault(capsys, tmp_path, *arguments):
    """The one line that a command complains with; no file may appear."""
    try:
        status = main(["check", *arguments])
    except SystemExit as end:  # argparse's own
        status = end.code
    output = capsys.readouterr()
    assert status == 2, output
    assert output.out == ""
    assert not list(tmp_path.iterdir())
    (line,) = output.err.splitlines()
    return line


@pytest.fixture
def small_scene(tmp_path):
    """A scene file with a [render] table of its own."""

    def write(render):
        path = tmp_path / "scene.toml"
        text = '[[model]]\npath = "MODEL"\n[render]\n' + render
        path.write_text(text.replace("MODEL", str(load("cornell").path.with_name("cornell.obj"))))
        return str(path)

    return write


def test_the_table_has_a_line_for_each_kind_of_light_and_size(capsys):
    head, *lines = checked(capsys, "cornell", *SMALL, "--sizes", "16,32")
    assert re.split(r"  +", head)[:4] == ["scene", "lights", "projection", "map"]
    assert len({len(line) for line in [head, *lines]}) == 1
    found = [re.split(r"  +", line) for line in lines]
    assert [cells[3] for cells in found if cells[1:3] == ["vpls", "perspective"]] == ["16", "32"]
    assert [cells[3] for cells in found if cells[1:3] == ["spotlight", "perspective"]] == ["2048"]
    for cells in found:
        assert cells[0] == "cornell"
        assert int(cells[4].replace(",", "")) >= 100
        assert all(re.fullmatch(r"\d+\.\d{3}( \+-\d\.\d{3})?", share) for share in cells[5:])
        mismatch, leaks, false_shadows = (float(cell.split()[0]) for cell in cells[5:8])
        assert mismatch == pytest.approx(leaks + false_shadows, abs=0.002)


def test_json_holds_every_figure(capsys, tmp_path):
    path = tmp_path / "f.json"
    lines = checked(capsys, "cornell", *ONE, "--json", str(path))
    told = json.loads(path.read_text())
    assert list(told) == ["visibility"]
    assert len(told["visibility"]) == len(lines) - 1
    for row, line in zip(told["visibility"], lines[1:], strict=True):
        assert row["scene_hash"] == load("cornell").hash
        assert row["map_size"] == {"spotlight": 128, "vpls": 32}[row["lights"]]
        assert (row["size"], row["vpls"], row["seed"]) == ([32, 32], 4, 0)
        assert row["frames"] >= 8
        assert "llvmpipe" in row["device"]
        for name in SHARES:
            assert set(row[name]) == {"value", "error"}
            assert f" {100 * row[name]['value']:.3f}" in line
        assert row["light_wrong"]["value"] == pytest.approx(row["light_leaked"]["value"] + row["light_lost"]["value"])
    assert list(tmp_path.iterdir()) == [path]


def test_a_seed_gives_the_same_figures_again(capsys):
    first, again, other = (checked(capsys, "cornell", *ONE, "--seed", seed) for seed in ("3", "3", "4"))
    assert first == again
    assert first != other


def test_without_a_scene_all_are_checked(capsys):
    lines = checked(capsys, *ONE)
    assert {line.split()[0] for line in lines[1:]} == {name for name, _ in builtin_scenes()}


def test_set_narrows_the_sizes(capsys):
    lines = checked(capsys, "cornell", *SMALL, "--set", "shadow_maps.vpl_size=24")
    assert {line.split()[3] for line in lines[1:] if "vpls" in line} == {"24"}


def test_the_scene_file_has_a_say(capsys, small_scene):
    """Its VPLs, its seed, and those of its parameters that the graph has."""
    arguments = ["--visibility", "--size", "32x32", "--pairs", "100", "--device", "software", "--sizes", "32"]
    render = (
        'graph = "forward"\nvpls = 4\nseed = 3\nset = { "forward.lights_per_draw" = 2, "shadow_maps.spot_size" = 128 }'
    )
    assert checked(capsys, small_scene(render), *arguments) == checked(
        capsys, small_scene(""), *arguments, "--vpls", "4", "--seed", "3", "--set", "shadow_maps.spot_size=128"
    )


def test_a_dark_light_is_told(capsys, monkeypatch, tmp_path):
    scene = load("cornell")
    dark = replace(scene, lights=(replace(scene.spotlight, emission=(0.0, 0.0, 0.0)),))
    monkeypatch.setattr("deferred_ir.loading.load.load", lambda _: dark)
    assert main(["check", "cornell", *ONE, "--json", str(tmp_path / "f.json")]) == 0
    output = capsys.readouterr()
    assert output.err == "note: cornell: nothing shines: no light that a map could be wrong about\n"
    assert json.loads((tmp_path / "f.json").read_text()) == {"visibility": []}


def test_few_pairs_are_told(capsys, monkeypatch):
    monkeypatch.setattr("deferred_ir.profiling.checks.visibility.MOST_FRAMES", 8)
    assert main(["check", "cornell", *ONE, "--pairs", "1000000"]) == 0
    notes = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"note: cornell, spotlight: hardly a pixel faces a light: \d+ pairs, no more", notes[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: no such file and no built-in scene of that name"),
        (["cornell", "--pairs", "0"], "argument --pairs: '0' is no whole number from 1 up"),
        (["cornell", "--visibility", "--sizes", "256,big"], "--sizes 256,big: 'big' is no whole number; write 256,512"),
        (["cornell", "--visibility", "--sizes", "256,,512"], "--sizes 256,,512: '' is no whole number"),
        (
            ["cornell", "--visibility", "--sizes", "8"],
            "shadow_maps.vpl_size: is 8, but wants a whole number at least 16",
        ),
        (
            ["cornell", "--visibility", "--sizes", "64", "--set", "shadow_maps.vpl_size=32"],
            "contradict each other; give one",
        ),
        (["cornell", "--visibility", "--size", "64"], "--size 64: wants WIDTHxHEIGHT"),
        (
            ["cornell", "--visibility", "--set", "shadow_maps.vpl_siez=64"],
            "no such parameter; did you mean 'vpl_size'?",
        ),
        (["cornell", "--visibility", "--set", "shadow_map.vpl_size=64"], "no pass 'shadow_map' in this graph"),
        (["cornell", "--visibility", "--vpls", "4", "--set", "vpl.count=8"], "contradict each other; give one"),
        (["cornell", "--size", "64x64"], "--size: the extreme cases have settings of their own; give --visibility"),
        (["cornell", "--set", "vpl.count=8"], "--set vpl.count: the extreme cases have settings of their own"),
        (["cornell", "--json", "no/such/f.json"], "no/such/f.json: "),
        (["cornell", "--device", "no such"], "no such"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_faults_are_one_line(capsys, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    line = fault(capsys, tmp_path, *arguments)
    assert line.startswith("deferred-ir")
    assert message in line


# Extreme cases


@pytest.fixture
def few_cases(monkeypatch):
    """One that holds, one that fails."""
    cases = import_module("deferred_ir.profiling.checks.cases")
    stability = import_module("deferred_ir.profiling.checks.extremes")
    fails = stability.Case("brighter", cases.NAMED["E times 1e+10"].change, "itself", bound=1e-6, size=(16, 16), vpls=1)
    monkeypatch.setattr(cases, "CASES", (replace(cases.NAMED["image 1x1"], middle=(3, 3)), fails))
    return cases.CASES


def test_extreme_cases_make_a_table_and_a_status(capsys, few_cases, monkeypatch, tmp_path):
    path = tmp_path / "f.json"
    assert main(["check", "cornell", "--device", "software", "--json", str(path)]) == 1
    head, good, bad, total = capsys.readouterr().out.splitlines()
    assert head.split() == ["scene", "case", "graph", "against", "figure", "bound", "verdict"]
    assert re.fullmatch(r"cornell  image 1x1 +deferred +itself +\S+ +9\.5e-07  holds", good)
    assert re.fullmatch(r"cornell  brighter +deferred +itself +1\.0e\+10 +1\.0e-06  FAILS", bad)
    assert total == "2 of 2 cases, 1 failed"
    one, other = json.loads(path.read_text())["stability"]
    assert one["holds"] is True
    assert (other["case"], other["scene"], other["holds"]) == ("brighter", "cornell", False)
    assert other["figure"] == pytest.approx(1e10, rel=1e-3)
    monkeypatch.setattr("deferred_ir.profiling.checks.cases.CASES", few_cases[:1])
    assert main(["check", "cornell", "--device", "software"]) == 0


def test_a_scene_that_moves_is_checked_as_it_is_at_0_s(capsys, monkeypatch, tmp_path):
    """Motions overrode what cases do to camera and light, and triangles were counted against those at rest."""
    cases = import_module("deferred_ir.profiling.checks.cases")
    small = {"size": (16, 16), "vpls": 2}
    names = ("scale 100, E by its square", "light within a box 0.01 wide", "slivers of 1e-6")
    monkeypatch.setattr(cases, "CASES", [replace(cases.NAMED[name], **small) for name in names])
    (tmp_path / "ball.obj").write_text("v -0.1 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\n")
    (tmp_path / "floor.obj").write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 4 3 2\n")
    scene = tmp_path / "moving.toml"
    scene.write_text("""
        [[model]]
        path = "ball.obj"
        [model.motion]
        times = [0, 1]
        translations = [[0, 0.3, 0], [0.5, 0.3, 0]]
        rotations = [[0, 0, 0, 1], [0, 1, 0, 0]]
        [[model]]
        path = "floor.obj"
        [camera]
        position = [0, 1, 2]
        look_at = [0, 0, 0]
        [camera.motion]
        times = [0, 1]
        positions = [[0, 1, 2], [0.5, 1, 2]]
        look_ats = [[0, 0, 0], [0, 0, 0]]
        [spotlight]
        position = [0, 1, 0]
        emission = [1, 1, 1]
        look_at = [0, 0, 0]
        [spotlight.motion]
        kind = "lissajous"
        amplitude = [0.2, 0, 0.2]
        speed = [1, 1]
    """)
    assert main(["check", str(scene), "--device", "software"]) == 0
    said = capsys.readouterr()
    assert "3 of 3 cases, 0 failed" in said.out
    assert "note: moving: things move; checked as it is at 0 s" in said.err


def test_what_is_not_finite_bounds_nothing(capsys, few_cases, monkeypatch, tmp_path):
    """A picture of the scene itself that is no picture must not let all others pass."""
    path, rays = tmp_path / "f.json", replace(few_cases[0], against="rays", slack=2.0)
    monkeypatch.setattr("deferred_ir.profiling.checks.cases.CASES", (rays,))
    monkeypatch.setattr("deferred_ir.profiling.checks.extremes.Judge.usual_error", lambda *_: float("inf"))
    assert main(["check", "cornell", "--device", "software", "--json", str(path)]) == 1
    assert "FAILS" in capsys.readouterr().out.splitlines()[1]
    (row,) = json.loads(path.read_text())["stability"]
    assert (row["bound"], row["holds"]) == (None, False)


def test_a_case_that_cannot_be_drawn_fails_with_its_reason(capsys, few_cases, monkeypatch):
    broken = replace(few_cases[0], settings={"shadow_maps.budget": 1})
    monkeypatch.setattr("deferred_ir.profiling.checks.cases.CASES", (broken,))
    assert main(["check", "cornell", "--device", "software"]) == 1
    assert "error" in (line := capsys.readouterr().out.splitlines()[1])
    assert "the spotlight's map of 2048x2048 alone needs 16 MiB" in line.partition("FAILS: ")[2]


def test_ctrl_c_tells_what_was_done(tmp_path):
    running = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "deferred_ir",
            "check",
            "cornell",
            "--device",
            "software",
            "--json",
            str(tmp_path / "f"),
        ],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert [running.stdout.readline()[:7] for _ in range(2)] == ["scene  ", "cornell"]
    running.send_signal(signal.SIGINT)
    output, error = running.communicate(timeout=60)
    assert running.returncode == 130
    assert re.fullmatch(r"\d+ of \d+ cases, \d+ failed", output.splitlines()[-1])
    assert error.splitlines()[-1] == "deferred-ir: interrupted"
    assert not list(tmp_path.iterdir())


# Both


def test_ctrl_c_leaves_no_file(tmp_path):
    """While the second of many rows is measured."""
    arguments = [*ONE, "--pairs", "1000000", "--sizes", "32,33,34,35,36,37", "--json", str(tmp_path / "f.json")]
    running = subprocess.Popen(
        [sys.executable, "-m", "deferred_ir", "check", "cornell", *arguments],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert running.stdout.readline().startswith("scene")
    running.send_signal(signal.SIGINT)
    error = running.communicate(timeout=60)[1]
    assert running.returncode == 130
    assert error.splitlines()[-1] == "deferred-ir: interrupted"
    assert "Traceback" not in error
    assert not list(tmp_path.iterdir())
