"""`deferred-ir profile`: its files, how a sweep goes on, shards and their merge, and its faults."""

import csv
import json
import re
import shutil
import sys
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from importlib import import_module

import numpy as np
import pytest

from deferred_ir.base.errors import SettingError
from deferred_ir.cli.main import main
from deferred_ir.graph.file import graph_names
from deferred_ir.truth.reference_noise import ReferenceNoise

costs = import_module("deferred_ir.profiling.sweep.costs")
measure_point = import_module("deferred_ir.profiling.sweep.measure_point")
sweep_points = import_module("deferred_ir.profiling.sweep.points")
groups = import_module("deferred_ir.profiling.sweep.groups")
sweep_reference = import_module("deferred_ir.profiling.sweep.reference")

SMALL = ["--graphs", "forward,deferred", "--vpls", "4,8", "--seeds", "2", "--size", "32x32", "--device", "software"]
SMALL += ["--peers", "none"]
FILES = {"error_vs_time.csv", "error_vs_time.json", "error_vs_time.svg", "passes.csv", "trace.json", "report.html"}
MASK = {"mask.npy", "mask.json", "mask.png"}
COLUMNS = ["graph", "vpls", "seed", "frame_ms", "relmse", "relmse_untrimmed", "bias", "flip", "memory", "flagged"]


def profile(folder, *extra):
    return main(["profile", "cornell", "-o", str(folder), *SMALL, *extra])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a finished sweep."""
    folder = tmp_path_factory.mktemp("whole")
    assert profile(folder) == 0
    return folder


@pytest.fixture
def copied(whole, tmp_path):
    """A copy of it, to be spoilt."""
    return shutil.copytree(whole, tmp_path / "copied")


@pytest.fixture
def measured(monkeypatch):
    """The (graph, VPLs, seed) of the points that are measured from here on."""
    done, measure = [], measure_point.measure

    def watched(setup, renderer, graph, key):
        done.append((graph, key.vpls, key.seed))
        return measure(setup, renderer, graph, key)

    monkeypatch.setattr(measure_point, "measure", watched)
    return done


def table(folder, name="error_vs_time.csv"):
    with (folder / name).open(newline="") as file:
        return list(csv.DictReader(file))


def points(folder):
    return sorted((folder / "points").glob("*.json"))


def test_the_tables_hold_every_point(whole):
    assert {path.name for path in whole.iterdir()} == FILES | MASK | {"points", "reference.npy", "reference.json"}
    rows = table(whole)
    assert list(rows[0])[: len(COLUMNS)] == COLUMNS
    expected = {(graph, n, seed) for graph in ("deferred", "forward") for n in "48" for seed in "01"}
    assert {(row["graph"], row["vpls"], row["seed"]) for row in rows} == expected
    assert len(rows) == len(points(whole)) == len(expected)
    for row in rows:
        assert float(row["frame_ms"]) > 0
        assert 0 < float(row["relmse"]) <= float(row["relmse_untrimmed"])
        assert float(row["relmse_masked"]) > 0
        assert row["spp"] == ""
        assert 0 < float(row["flip"]) < 1
        assert int(row["memory"]) > 0
        assert "llvmpipe" in row["device"]
        assert len(row["scene_hash"]) == len(row["graph_hash"]) == 16
    told = json.loads((whole / "error_vs_time.json").read_text())
    assert [str(row["relmse"]) for row in told["rows"]] == [row["relmse"] for row in rows]
    assert told["size"] == [32, 32]
    assert told["flip_parameters"]["exposures"] >= 2


def test_the_error_is_that_of_compare(whole, tmp_path, capsys):
    image = str(tmp_path / "i.npy")
    size = ["--size", "32x32", "--vpls", "8", "--seed", "1", "--device", "software"]
    assert main(["render", "cornell", "-o", image, *size]) == 0
    assert main(["compare", image, str(whole / "reference.npy"), "--json", str(tmp_path / "f.json")]) == 0
    capsys.readouterr()
    figures = json.loads((tmp_path / "f.json").read_text())
    (row,) = [row for row in table(whole) if (row["graph"], row["vpls"], row["seed"]) == ("deferred", "8", "1")]
    for name in ("relmse", "relmse_untrimmed", "bias", "flip"):
        assert float(row[name]) == pytest.approx(figures[name], rel=1e-6)


def test_the_reference_is_quiet_enough_or_the_rows_say_so(whole):
    record = json.loads((whole / "reference.json").read_text())
    assert record["spp"] >= sweep_reference.FIRST_SPP
    for row in table(whole):
        part = record["noise"] / float(row["relmse"])
        assert row["flagged"] == ("below_noise" if part > 0.5 else "reference_noise" if part > 0.1 else "")


def test_passes_add_up_to_the_frame(whole):
    rows = table(whole, "passes.csv")
    assert {"vpl", "gbuffer", "shadow_maps", "lighting", "tonemap"} <= {
        row["pass"] for row in rows if row["graph"] == "deferred"
    }
    for row in rows:
        assert float(row["cpu_ms_q1"]) <= float(row["cpu_ms_median"]) <= float(row["cpu_ms_q3"])
    for group in {(row["graph"], row["vpls"]) for row in rows}:
        ours = {row["pass"]: float(row["cpu_ms_median"]) for row in rows if (row["graph"], row["vpls"]) == group}
        assert ours["(sum)"] <= ours["(frame)"]


def test_the_trace_has_a_frame_of_each_graph_on_two_tracks(whole):
    events = json.loads((whole / "trace.json").read_text())["traceEvents"]
    names = {event["args"]["name"] for event in events if event["ph"] == "M"}
    assert names == {"deferred, 8 VPLs", "forward, 8 VPLs", "GPU", "CPU"}
    spans = [event for event in events if event["ph"] == "X"]
    assert {(event["pid"], event["tid"]) for event in spans} == {(1, 1), (1, 2), (2, 1), (2, 2)}
    for track in {(event["pid"], event["tid"]) for event in spans}:
        end = 0.0
        for event in (event for event in spans if (event["pid"], event["tid"]) == track):
            assert event["ts"] >= end - 0.2  # both are rounded
            end = event["ts"] + event["dur"]


class Page(HTMLParser):
    """Collects tags and attributes, and checks that tags close."""

    def __init__(self, text):
        super().__init__()
        self.attributes, self.tags, self.open = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_stands_alone(whole):
    text = (whole / "report.html").read_text()
    page = Page(text)
    assert not page.open
    for tag, name, value in page.attributes:
        if name in ("src", "href", "xlink:href", "data", "srcset"):
            assert value.startswith(("data:image/png;base64,", "#")), (tag, name, value[:60])
    rest = re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert "http" not in rest
    assert not re.search(r"@import|url\((?!#)|//\w", re.sub(r"base64,[^\"]*", "", rest))
    assert page.tags.count("svg") == 1
    assert page.tags.count("img") == 2 * 4
    assert "GPU time is CPU time" in text


def test_the_page_says_what_was_measured_how_where_and_against_what(whole):
    page = (whole / "report.html").read_text()
    told = json.loads((whole / "error_vs_time.json").read_text())
    (origin,) = told["origins"]
    assert origin["command"].startswith("deferred-ir profile cornell -o ")
    assert origin["command"].endswith("--size 32x32 --device software --peers none")
    for word in (*(value for value in origin.values() if value), *told["devices"], *told["drivers"]):
        assert escape(word) in page, word
    record = json.loads((whole / "reference.json").read_text())
    noise = told["reference"]["noise"]
    assert noise == {"relmse": record["noise"], "how": f"from the spread of its {record['spp']} paths a pixel"}
    assert f"relMSE {record['noise']:.2g}, {noise['how']}" in page
    assert "reference.npy beside this page" in page


def test_errors_that_the_noise_hides_are_bounds_on_the_page(copied):
    quiet = (copied / "report.html").read_text()
    assert "hidden by noise</td>" not in quiet
    for path in points(copied):
        data = json.loads(path.read_text())
        data["reference_about"]["noise"]["relmse"] = data["relmse"]
        path.write_text(json.dumps(data))
    assert profile(copied) == 0
    told = json.loads((copied / "error_vs_time.json").read_text())
    hidden = [group for group in told["groups"] if group["flagged"] == "below_noise"]
    page = (copied / "report.html").read_text()
    assert page.count("hidden by noise</td>") == len(hidden) > 0
    for group in hidden:
        assert f">{group['relmse']:.3g}<" not in page
        assert group["relmse"] > 0  # as it was measured


def test_a_finished_sweep_measures_nothing_again(copied, measured, monkeypatch):
    before = {name: (copied / name).read_bytes() for name in FILES | MASK | {"reference.npy"}}
    monkeypatch.setattr(sweep_reference, "trace_reference", None)  # would fail if it were called
    assert profile(copied) == 0
    assert not measured
    assert {name: (copied / name).read_bytes() for name in before} == before


def truncate(path):
    path.write_text(path.read_text()[:100])


def other(**changes):
    def change(path):
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))

    return change


@pytest.mark.parametrize(
    "spoil",
    [truncate, other(reference="0" * 16), other(device="another"), other(laps=3), other(key={}), lambda p: p.unlink()],
    ids=["truncated", "reference", "device", "laps", "key", "missing"],
)
def test_an_unusable_point_is_measured_again(spoil, copied, measured):
    victim = points(copied)[3]
    spoil(victim)
    assert profile(copied) == 0
    assert len(measured) == 1
    assert json.loads(victim.read_text())["relmse"] > 0
    assert len(table(copied)) == 8


def test_a_point_without_its_picture_is_measured_again(copied, measured):
    next((copied / "points").glob("*.error.png")).unlink()
    assert profile(copied) == 0
    assert len(measured) == 1


def test_ctrl_c_saves_finished_points(whole, tmp_path, capsys, monkeypatch):
    (tmp_path / "points").mkdir()
    for name in ("reference.npy", "reference.json"):
        shutil.copy(whole / name, tmp_path)
    done, measure = [], measure_point.measure

    def interrupted(*arguments, **options):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(measure(*arguments, **options))
        return done[-1]

    with monkeypatch.context() as patch:
        patch.setattr(measure_point, "measure", interrupted)
        assert profile(tmp_path) == 130
    estimate, interrupted = capsys.readouterr().err.splitlines()
    assert estimate.startswith("this takes about ")
    assert interrupted == "deferred-ir: interrupted"
    assert len(points(tmp_path)) == 3
    assert profile(tmp_path) == 0
    assert "3 of 8 points are there already" in capsys.readouterr().err
    assert len(table(tmp_path)) == 8


def test_how_long_it_takes_is_said_before_what_takes_it(whole, copied, tmp_path, capsys):
    """Of points, of the reference unless there is one, of the edges unless they are known."""
    size = r"[\d.]+ (s|min|h)( to [\d.]+ (s|min|h))?|\d+ to \d+ (s|min)"
    assert profile(copied) == 0
    assert "this takes" not in capsys.readouterr().err
    for path in points(copied)[:2]:
        path.unlink()
    assert profile(copied) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("this")]
    assert re.fullmatch(rf"this takes about ({size}): 2 points ({size})", line)
    given = ["--reference", str(whole / "reference.npy"), "--shard", "1/8"]
    assert profile(tmp_path, *given) == 0
    assert re.search(rf": 1 points ({size}), edges ({size})$", capsys.readouterr().err.splitlines()[0])
    for path in (tmp_path / "mask.npy", *points(tmp_path)):
        path.unlink()
    assert profile(tmp_path, "--shard", "1/8") == 0
    assert "a reference of 256 to 1024 paths a pixel" in capsys.readouterr().err.splitlines()[0]


def test_a_point_is_estimated_from_the_time_of_frames_between_the_fewest_and_the_most_vpls():
    trial = costs.Trial(np.ones((4, 4, 3)), 2.0, {16: 0.1, 64: 0.4}, frames=9)
    found = costs.estimate_points({"a": trial}, [("a", 16, 0), ("a", 32, 0), ("a", 64, 0)])
    first, between, last = found.values()
    assert between - 10 * 0.2 == pytest.approx(last - 10 * 0.4)  # what comparing takes
    assert first - 10 * 0.1 == pytest.approx(between - 10 * 0.2 + 2.0)
    one = costs.Trial(np.ones((4, 4, 3)), 0.0, {64: 0.4}, frames=9)
    assert one.estimate_point(64) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("bounds", "text"),
    [((0.1, 0.2), "1 s"), ((8, 43), "8 to 43 s"), ((80, 260), "80 s to 4 min"), ((5000, 9000), "83 min to 2.5 h")],
)
def test_times_are_told_as_a_person_would(bounds, text):
    assert costs.format_range(*bounds) == text


def test_the_budget_is_that_of_the_advice(copied, capsys):
    assert profile(copied, "--budget", "99s") == 0
    assert capsys.readouterr().out.startswith("For 99 s at 32x32: ")
    assert profile(copied, "--budget", "0.001ms") == 0
    assert capsys.readouterr().out.startswith("Nothing here takes 0.001 ms at 32x32 or less; ")
    assert "Nothing here takes 0.001 ms" in (copied / "report.html").read_text()


def test_the_quick_default_is_small_and_the_thorough_one_is_that_of_a_render(monkeypatch, tmp_path):
    made = []

    def stop(sweep, *_):
        made.append(sweep)
        raise SettingError("enough")

    monkeypatch.setattr(import_module("deferred_ir.profiling.sweep.run"), "run", stop)
    for extra in ([], ["--thorough"], ["--thorough", "--vpls", "8", "--peers", "none"], ["--size", "300x200"]):
        assert main(["profile", "cornell", "-o", str(tmp_path), *extra]) == 2
    quick, thorough, named, sized = made
    assert (quick.size, quick.seeds, quick.vpls, quick.peers) == ((128, 128), 1, [16, 64], ())
    assert set(quick.graphs) < set(thorough.graphs) <= set(graph_names())  # not those whose extra is not installed
    assert (thorough.size, thorough.seeds, thorough.vpls) == ((512, 512), 3, [16, 64, 256])
    assert thorough.most_spp > quick.most_spp
    assert thorough.peers
    assert (named.vpls, named.seeds, named.peers) == ([8], 3, ())
    assert (sized.size, sized.most_spp) == ((300, 200), quick.most_spp)


def test_the_quick_size_keeps_the_proportions_of_the_scenes():
    command = import_module("deferred_ir.cli.commands.profile")
    scene = import_module("deferred_ir.scene.scene")
    for size, expected in (((1600, 400), (256, 64)), ((64, 64), (64, 64))):
        assert command._choose_size(None, scene.RenderDefaults(size=size), command.QUICK) == expected
        assert command._choose_size(None, scene.RenderDefaults(size=size), command.THOROUGH) == size


def test_shards_merge_to_the_table_of_the_whole(whole, tmp_path, measured):
    given = ["--reference", str(whole / "reference.npy")]
    shards = [tmp_path / name for name in "ab"]
    for i, shard in enumerate(shards, start=1):
        assert profile(shard, "--shard", f"{i}/2", *given) == 0
        assert len(table(shard)) == 4
    assert len(set(measured)) == len(measured) == 8
    merged = tmp_path / "merged"
    assert main(["profile", "--merge", *map(str, shards), "-o", str(merged)]) == 0
    assert {path.name for path in merged.iterdir()} == FILES | MASK | {"points"}
    shutil.copytree(merged / "points", tmp_path / "resumed" / "points")
    assert profile(tmp_path / "resumed", *given) == 0
    assert len(measured) == 8
    for name in FILES | MASK:
        assert (merged / name).read_bytes() == (tmp_path / "resumed" / name).read_bytes(), name
    errors = [(row["graph"], row["vpls"], row["seed"], row["relmse"]) for row in table(merged)]
    assert errors == [(row["graph"], row["vpls"], row["seed"], row["relmse"]) for row in table(whole)]


def group(graph, vpls, frame_ms, relmse, noise=0.0001):
    return groups.Group(graph, vpls, 1, frame_ms, relmse, relmse, relmse, ReferenceNoise(noise, ""))


def test_nothing_faster_beats_the_pareto_front(whole):
    first = sweep_points.read(whole, points(whole)[0].stem)
    figures = {
        ("a", 4): (10, 0.1),
        ("a", 8): (20, 0.05),
        ("b", 4): (15, 0.0999),
        ("b", 8): (20, 0.06),
        ("c", 4): (30, 0.04),
    }
    found = [
        replace(first, key=replace(first.key, vpls=n), graph=graph, frames=[ms], relmse=error)
        for (graph, n), (ms, error) in figures.items()
    ]
    on = {(group.graph, group.vpls) for group in groups.group_points(found) if group.pareto}
    assert on == {("a", 4), ("a", 8), ("c", 4)}


def test_the_advice_is_the_best_that_is_fast_enough():
    choices = [group("a", 16, 10, 0.1), group("a", 64, 49, 0.02), group("b", 64, 45, 0.05), group("a", 256, 90, 0.01)]
    assert groups.advise(choices, (64, 48)) == "For 50 ms at 64x48: a, 64 VPLs, relMSE 0.02 in 49 ms."
    equal = [group("slow", 64, 45, 0.02), group("fast", 64, 20, 0.0201)]
    assert "fast" in groups.advise(equal, (64, 48))
    none = "Nothing here takes 5 ms at 64x48 or less; the fastest: a, 16 VPLs"
    assert groups.advise(choices, (64, 48), 5).startswith(none)


def test_the_advice_tells_how_much_of_the_error_is_noise():
    advice = groups.advise([group("a", 16, 10, 0.1, 0.02)], (64, 48))
    assert advice.endswith("relMSE 0.1 in 10 ms; the noise of the reference is 20% of that.")
    assert groups.advise([group("a", 16, 10, 0.1, None)], (64, 48)).endswith("the noise of the reference is unknown.")
    hidden = [group("slow", 64, 45, 0.021, 0.02), group("fast", 16, 20, 0.039, 0.02)]
    advice = groups.advise(hidden, (64, 48))
    assert "fast, 16 VPLs, relMSE < 0.02 in 20 ms; that is the noise of the reference" in advice


def fault(capsys, *arguments):
    """The one line of a command that fails."""
    try:
        status = main(["profile", *arguments])
    except SystemExit as end:  # argparse's own
        status = end.code
    lines = capsys.readouterr().err.splitlines()
    assert status == 2
    assert len(lines) == 1, lines
    assert lines[0].startswith("deferred-ir")
    return lines[0]


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--graphs", "forward,defered"], ["defered", "did you mean 'deferred'"]),
        (["--graphs", ""], ["--graphs", "nothing to measure"]),
        (["--vpls", ","], ["--vpls", "nothing to measure"]),
        (["--seeds", "0"], ["--seeds", "nothing to measure"]),
        (["--vpls", "4,x"], ["--vpls 4,x", "'x'"]),
        (["--vpls", "-4"], ["--vpls"]),
        (["--vpls", "99999999"], ["vpl.count"]),
        (["--shard", "3/2"], ["--shard 3/2"]),
        (["--shard", "0/2"], ["--shard 0/2"]),
        (["--shard", "9/9"], ["--shard 9/9", "8 points"]),
        (["--size", "big"], ["--size big"]),
        (["--reference", "missing.npy"], ["missing.npy", "missing"]),
        (["--device", "toaster"], ["toaster"]),
        (["-o", "file"], ["file", "cannot be written"]),
        (["-o", "file/deeper"], ["file/deeper", "cannot be written"]),
    ],
)
def test_a_faulty_command_is_one_line(extra, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    line = fault(capsys, "cornell", "-o", "out", *SMALL, *extra)
    assert all(word in line for word in words), line
    assert (tmp_path / "file").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_reference_of_another_scene_or_size_is_refused(whole, tmp_path, capsys):
    given = [
        "-o",
        str(tmp_path / "out"),
        "--reference",
        str(whole / "reference.npy"),
        "--vpls",
        "4",
        "--graphs",
        "forward",
    ]
    line = fault(capsys, "colors", "--size", "32x32", *given)
    assert "shows the scene cornell" in line
    assert "colors" in line
    line = fault(capsys, "cornell", "--size", "16x32", *given)
    assert "is 32x32" in line
    np.save(tmp_path / "bare.npy", np.ones((32, 32, 3), np.float32))
    line = fault(capsys, "cornell", "--size", "32x32", *given, "--reference", str(tmp_path / "bare.npy"))
    assert "no metadata file bare.json" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("what", ["scene", "size", "reference"])
def test_a_merge_of_unlike_sweeps_is_refused(what, whole, copied, tmp_path, capsys):
    for path in points(copied):
        data = json.loads(path.read_text())
        if what == "size":
            path.unlink()
            data["key"]["size"] = [16, 16]
            data["pictures"] = False
            name = sweep_points.Key(**data["key"]).name
            path.with_name(f"{name}.json").write_text(json.dumps(data))
        else:
            other(**{what: "another"})(path)
    line = fault(capsys, "--merge", str(whole), str(copied), "-o", str(tmp_path / "m"))
    assert f"{copied}: {what}: is" in line
    assert not (tmp_path / "m").exists()


def test_other_faults_of_a_merge(whole, copied, tmp_path, capsys):
    out = ["-o", str(tmp_path / "m")]
    (tmp_path / "empty").mkdir()
    assert "holds no points" in fault(capsys, "--merge", str(tmp_path / "empty"), *out)
    assert "is no folder" in fault(capsys, "--merge", str(tmp_path / "none"), *out)
    assert "--vpls" in fault(capsys, "--merge", str(whole), "--vpls", "4", *out)
    assert "SCENE" in fault(capsys, *out)
    truncate(points(copied)[0])
    assert main(["profile", "--merge", str(copied), *out]) == 0
    assert "1 points were unusable" in capsys.readouterr().err
    assert len(table(tmp_path / "m")) == 7


@pytest.mark.parametrize("library", ["matplotlib", "jinja2"])
def test_without_the_extra_it_names_the_package_to_install(library, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    line = fault(capsys, "cornell", "-o", str(tmp_path / "out"), *SMALL)
    assert library in line
    assert "pip install 'deferred-ir[report]'" in line
    assert not (tmp_path / "out").exists()


def test_a_terminal_sees_a_progress_bar(whole, copied, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    points(copied)[0].unlink()
    assert profile(copied) == 0
    assert "left" in capsys.readouterr().err
