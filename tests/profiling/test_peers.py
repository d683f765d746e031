"""Peers of `deferred-ir profile`, with a fake one: the ladder, its files, its process, and what the report tells."""

import csv
import io
import json
import os
import re
import shutil
import signal
import threading
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from importlib import import_module

import fake_peer
import numpy as np
import pytest
from small_scenes import room
from surface_scenes import mapped_plane

from deferred_ir.base.errors import SettingError
from deferred_ir.cli.main import main
from deferred_ir.report.origin import Origin
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.surfaces.materials import Sampler, Texture, TextureRef
from deferred_ir.scene.surfaces.texture_lookup import sample_texture
from deferred_ir.truth.reference_noise import ReferenceNoise

ladder = import_module("deferred_ir.profiling.peers.ladder")
peer_points = import_module("deferred_ir.profiling.peers.points")
peer_process = import_module("deferred_ir.profiling.peers.process")
equal_error = import_module("deferred_ir.profiling.sweep.equal_error")
groups = import_module("deferred_ir.profiling.sweep.groups")
peers = import_module("deferred_ir.profiling.peers.peer")

SMALL = ["--graphs", "deferred", "--vpls", "4,16", "--seeds", "2", "--size", "32x32", "--device", "software"]
EXACT = ReferenceNoise(0.0, "")
ORIGIN = Origin("deferred-ir profile", "2026-01-01 00:00 UTC", "1.0", None, "a machine")
RUNGS = 7
"""1 to 64 paths."""


class InProcess:
    """Instead of the process: the fake peer here, with a list of what it rendered."""

    rendered, made, fails_at = [], [], {}

    def __init__(self, name, scene, size, bounces, log):
        if name in self.fails_at and self.fails_at[name] == 0:
            raise peer_process.PeerError("cannot load this")
        self.made.append(name)
        self.name, self.peer, self.about = name, fake_peer.Peer(scene, size, bounces), fake_peer.Peer.about

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        return None

    def render(self, spp, seed):
        if self.fails_at.get(self.name) == spp:
            raise peer_process.PeerError("its process ended with signal 6; see the log")
        self.rendered.append((self.name, spp, seed))
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            return self.peer.render(spp, seed)


@pytest.fixture
def fake(monkeypatch):
    """All peers are the fake one, in this process, on a ladder of RUNGS."""
    state = type("State", (InProcess,), {"rendered": [], "made": [], "fails_at": {}})
    monkeypatch.setattr(peer_process, "PeerProcess", state)
    monkeypatch.setattr(peer_process, "module", lambda name: fake_peer)
    monkeypatch.setattr(ladder, "ENOUGH", 0.0)
    monkeypatch.setattr(ladder, "MOST_SPP", 1 << (RUNGS - 1))
    return state


PLAIN = TextureRef(0)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"normal_texture": PLAIN}, "a normal map"),
        ({"alpha_cutoff": 0.5}, "holes"),
        ({"unlit": True, "emission": (1.0, 1.0, 1.0)}, "unlit emission"),
        ({"base_color_texture": TextureRef(0, uv_set=1)}, "images that are moved"),
        ({"metallic_roughness_texture": TextureRef(0, sampler=Sampler(magnify="nearest"))}, "or not filtered"),
    ],
)
def test_what_a_peer_cannot_render_as_authored_is_named(change, what):
    scene = room()
    peers.check_materials("mitsuba", scene)
    changed = replace(scene, materials=(scene.materials[0], replace(scene.materials[1], **change)))
    with pytest.raises(SettingError, match=f"^mitsuba: does not render .*{what}.* 'material 1' has"):
        peers.check_materials("mitsuba", changed)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_peers_read_images_as_we_do(dtype):
    scene, rng = mapped_plane(), np.random.default_rng(2)
    pixels = rng.integers(0, np.iinfo(dtype).max + 1, (4, 4, 3)).astype(dtype)
    image = Texture("image", pixels)
    x, y = np.meshgrid((np.arange(4) + 0.5) / 4, 1 - (np.arange(4) + 0.5) / 4)
    uvs = np.stack([x, y], axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(peers.decode(image).reshape(-1, 3), sample_texture(image, uvs), atol=1e-6)
    scene = replace(scene, textures=(image, image))
    found = peers.find_numbers(scene, scene.materials[0])
    np.testing.assert_allclose(found.reshape(-1, 2), sample_texture(image, uvs, color=False)[:, 1:], atol=1e-6)
    assert peers.find_numbers(scene, replace(scene.materials[0], metallic_roughness_texture=None)) is None


def profile(folder, *extra):
    return main(["profile", "cornell", "-o", str(folder), *SMALL, *extra])


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """The folder of a sweep without peers."""
    folder = tmp_path_factory.mktemp("bare")
    assert profile(folder, "--peers", "none") == 0
    return folder


@pytest.fixture
def folder(bare, tmp_path):
    """A copy of it, so that only peers are left to measure."""
    return shutil.copytree(bare, tmp_path / "copied")


def table(folder):
    with (folder / "error_vs_time.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def told(folder):
    return json.loads((folder / "error_vs_time.json").read_text())


def files(folder):
    return sorted(path for path in (folder / "peers").glob("*.json") if path.name != "notes.json")


def test_the_report_holds_the_peer_beside_ours(folder, fake, capsys):
    assert profile(folder, "--peers", "mitsuba") == 0
    out = capsys.readouterr()
    assert re.search(r": deferred, \d+ VPLs, ", out.out)  # peers are not recommended, however busy the machine is
    assert out.out.count("\n") == 1
    rows = [row for row in table(folder) if row["graph"] == "mitsuba"]
    ladder = [1 << i for i in range(RUNGS)]
    assert [(int(row["spp"]), row["seed"]) for row in rows] == [(spp, seed) for spp in ladder for seed in "01"]
    assert len(rows) == len(files(folder)) == len(fake.rendered)
    errors = [float(row["relmse_masked"]) for row in rows]
    assert errors[-1] < 0.1 * errors[0]
    for row in rows:
        assert float(row["frame_ms"]) == 10 * int(row["spp"])
        assert row["device"] == "Fake 1.0"
        assert row["vpls"] == row["memory"] == row["flip"] == ""
    data = told(folder)
    assert [row["relmse"] for row in data["equal_error"]] == [0.1, 0.03, 0.01, 0.003]
    assert [rung["spp"] for rung in data["peers"]] == ladder
    assert 0 < data["left_out_by_mask"] < 0.5
    page = (folder / "report.html").read_text()
    assert "Fake 1.0" in page
    assert "Equal error" in page
    assert "not reached, floor = " in page
    assert f"{100 * data['left_out_by_mask']:.1f} % of the pixels" in page
    assert "no edge pixels" in (folder / "error_vs_time.svg").read_text()
    assert "http" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", page)


def test_without_peers_the_report_says_nothing_of_them(bare):
    page = (bare / "report.html").read_text()
    assert "Equal error" not in page
    assert "mitsuba" not in page
    assert told(bare)["peers"] == told(bare)["equal_error"] == []
    assert not (bare / "peers").exists()


def test_a_finished_ladder_starts_no_process_again(folder, fake):
    assert profile(folder, "--peers", "mitsuba,cycles") == 0
    assert fake.made == ["mitsuba", "cycles"]
    before = {name: (folder / name).read_bytes() for name in ("error_vs_time.csv", "report.html")}
    assert profile(folder, "--peers", "mitsuba,cycles") == 0
    assert fake.made == ["mitsuba", "cycles"]
    assert {name: (folder / name).read_bytes() for name in before} == before


def truncate(path):
    path.write_text(path.read_text()[:60])


def other(**changes):
    return lambda path: path.write_text(json.dumps(json.loads(path.read_text()) | changes))


@pytest.mark.parametrize(
    "spoil",
    [
        truncate,
        other(reference="0" * 16),
        other(mask="0" * 16),
        other(ms=0),
        other(ms="1"),
        other(key={}),
        lambda p: p.unlink(),
    ],
    ids=["truncated", "reference", "mask", "no time", "text", "key", "missing"],
)
def test_a_peers_point_that_is_not_to_be_trusted_is_measured_again(spoil, folder, fake):
    assert profile(folder, "--peers", "mitsuba") == 0
    fake.rendered.clear()
    victim = files(folder)[3]
    key = json.loads(victim.read_text())["key"]
    spoil(victim)
    assert profile(folder, "--peers", "mitsuba") == 0
    assert fake.rendered == [("mitsuba", key["spp"], key["seed"])]
    assert json.loads(victim.read_text())["key"] == key


def test_ctrl_c_keeps_the_rungs_that_are_finished(folder, fake, monkeypatch):
    render = InProcess.render

    def interrupted(self, spp, seed):
        if spp == 8:
            raise KeyboardInterrupt
        return render(self, spp, seed)

    with monkeypatch.context() as patch:
        patch.setattr(fake, "render", interrupted, raising=False)
        assert profile(folder, "--peers", "mitsuba") == 130
    assert len(files(folder)) == 2 * 3
    fake.rendered.clear()
    assert profile(folder, "--peers", "mitsuba") == 0
    assert len(fake.rendered) == 2 * (RUNGS - 3)


def test_a_peer_that_fails_gets_a_line_and_the_others_go_on(folder, fake, capsys):
    fake.fails_at.update(mitsuba=4)
    assert profile(folder, "--peers", "mitsuba,cycles") == 0
    line = "peer mitsuba: its process ended with signal 6; see the log"
    assert capsys.readouterr().err.splitlines()[-2] == f"note: {line}"
    assert f"Peer {line[5:]}" in (folder / "report.html").read_text()
    assert {rung["spp"] for rung in told(folder)["peers"] if rung["peer"] == "mitsuba"} == {1, 2}
    assert {rung["spp"] for rung in told(folder)["peers"] if rung["peer"] == "cycles"} == {1 << i for i in range(RUNGS)}
    fake.fails_at.update(mitsuba=0, cycles=0)  # nothing is left of them
    for path in files(folder):
        path.unlink()
    assert profile(folder, "--peers", "mitsuba,cycles") == 0
    assert told(folder)["peers"] == []
    assert len(told(folder)["peer_notes"]) == 2


def test_a_peer_that_is_not_installed_gets_a_line(folder, fake, capsys, monkeypatch):
    monkeypatch.setattr(fake_peer, "available", lambda: "fake is not installed")
    assert profile(folder, "--peers", "mitsuba,cycles") == 0
    line = "peer mitsuba: fake is not installed; pip install fake-renderer"
    assert f"note: {line}" in capsys.readouterr().err.splitlines()
    page = (folder / "report.html").read_text()
    assert f"Peer {line[5:]}" in page
    assert "Equal error" not in page
    assert not fake.made


def test_the_real_peers_know_whether_they_are_installed(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for name in peers.NAMES:
        module = peer_process.module(name)
        assert f"{module.INSTALL} is not installed" in module.available()


def test_peers_belong_to_the_first_shard_and_are_merged(folder, fake, tmp_path):
    given = ["--reference", str(folder / "reference.npy"), "--peers", "mitsuba"]
    shards = [tmp_path / name for name in "ab"]
    for i, shard in enumerate(shards, start=1):
        assert profile(shard, *given, "--shard", f"{i}/2") == 0
        assert (shard / "peers").exists() == (i == 1)
    truncate(files(shards[0])[0])
    stranger = json.loads(files(shards[0])[1].read_text())
    stranger["reference"] = "0" * 16
    files(shards[0])[1].write_text(json.dumps(stranger))
    merged = tmp_path / "merged"
    assert main(["profile", "--merge", *map(str, shards), "-o", str(merged)]) == 0
    rows = table(merged)
    assert sum(row["graph"] == "mitsuba" for row in rows) == 2 * RUNGS - 2
    assert sum(row["graph"] == "deferred" for row in rows) == 4
    assert len(files(merged)) == 2 * RUNGS - 2
    assert "Equal error" in (merged / "report.html").read_text()


def test_notes_are_merged(folder, fake, tmp_path, monkeypatch):
    monkeypatch.setattr(fake_peer, "available", lambda: "fake is not installed")
    assert profile(folder, "--peers", "cycles") == 0
    assert main(["profile", "--merge", str(folder), "-o", str(tmp_path / "m")]) == 0
    assert told(tmp_path / "m")["peer_notes"] == {"cycles": "fake is not installed; pip install fake-renderer"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mitsubas", ["--peers mitsubas", "did you mean 'mitsuba'"]),
        ("mitsuba,luxcore", ["'luxcore'", "cycles, mitsuba"]),
        ("", ["--peers", "none"]),
        ("none,cycles", ["'none' stands alone"]),
    ],
)
def test_a_faulty_name_is_one_line(text, words, tmp_path, capsys):
    assert profile(tmp_path / "out", "--peers", text) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert all(word in line for word in words), line
    assert not (tmp_path / "out").exists()


def test_names_of_peers():
    assert ladder.choose(None) == peers.NAMES
    assert ladder.choose("none") == ()
    assert list(ladder.choose(" cycles,mitsuba,cycles")) == ["cycles", "mitsuba"]
    assert main(["profile", "--merge", ".", "-o", "x", "--peers", "none"]) == 2


# The ladder.


def point(spp, seed, ms, error):
    key = peer_points.PeerKey("s", [4, 4], 1, "mitsuba", spp, seed)
    return peer_points.PeerPoint(key, "Fake", ORIGIN, "r", "m", ms, error, error, 0.0, error)


def climbed(ms_a_path, error_of_one, seeds=3):
    """(paths, seed) where the error is inverse to the paths."""

    def measure(spp, seed):
        error = None if error_of_one is None else error_of_one / spp
        return point(spp, seed, ms_a_path * spp, error)

    return [(made.key.spp, made.key.seed) for made in ladder.climb(measure, seeds, ladder.ENOUGH)]


def test_the_ladder_ends_below_the_least_error_that_is_asked_for():
    assert climbed(1.0, 0.01) == [(spp, seed) for spp in (1, 2, 4, 8) for seed in range(3)]
    assert min(equal_error.TARGETS) > ladder.ENOUGH
    assert climbed(1.0, None) == [(1, 0), (1, 1), (1, 2)]


def test_the_ladder_ends_with_its_time_and_slow_rungs_have_one_seed():
    rungs = climbed(1000.0, 1e9)
    spent = sum(1000.0 * spp for spp, _ in rungs)
    assert spent <= ladder.BUDGET < spent + 2000.0 * rungs[-1][0]
    assert [seed for spp, seed in rungs if spp == 1] == [0, 1, 2]
    assert [seed for spp, seed in rungs if spp == 2] == [0]
    assert climbed(1e-3, 1e9, seeds=1)[-1][0] == ladder.MOST_SPP


def test_the_ladder_ends_where_the_error_falls_no_longer():
    errors = {1: 0.4, 2: 0.5, 4: 0.2, 8: 0.199, 16: 0.1, 32: 0.0999, 64: 0.0998}
    made = ladder.climb(lambda spp, seed: point(spp, seed, 1.0, errors[spp]), 1, ladder.ENOUGH)
    assert [one.key.spp for one in made] == list(errors)


# Equal error.


def reach(choices, target):
    return equal_error.reach("x", choices, target)


def test_times_are_interpolated_in_logarithms_along_the_front():
    choices = [(10, 0.1), (20, 0.5), (1000, 0.001), (500, 0.2)]
    assert reach(choices, 0.01).ms == pytest.approx(100)
    assert reach(choices, 0.001).ms == pytest.approx(1000)
    assert reach(choices, 0.0999).ms == pytest.approx(10, rel=1e-2)
    assert reach([(10, 0.1), (20, 0.0)], 0.01).ms == 20


def test_nothing_is_extrapolated():
    choices = [(10, 0.1), (100, 0.02), (300, 0.03)]
    missed = reach(choices, 0.01)
    assert (missed.ms, missed.floor, missed.beyond) == (None, 0.02, 100)
    assert str(missed) == "not reached, floor = 0.02"
    early = reach(choices, 0.3)
    assert early.at_most
    assert str(early) == "at most 10 ms"
    assert str(reach(choices, 0.05)) == f"{reach(choices, 0.05).ms:.3g} ms"


def rung(spp, ms, error, peer="mitsuba"):
    return equal_error.Rung(peer, spp, 1, ms, error, error, error, "Fake")


def group(graph, vpls, ms, error):
    return groups.Group(graph, vpls, 1, ms, error, error, error, EXACT)


def test_graphs_that_retain_samples_are_left_out():
    filled = replace(group("incremental", 16, 1, 0.001), frames_to_fill=2, retains_samples=True)
    ours = [replace(group("incremental", 8, 1, 0.05), retains_samples=True), filled, group("a", 4, 100, 0.02)]
    theirs = [rung(1, 100, 0.2), rung(2, 1000, 0.02)]
    (row,) = equal_error.rows(ours, theirs, EXACT, (0.05,))
    assert row.ours.name == "a"
    assert equal_error.find_retaining(ours) == {"incremental": 2}
    (row,) = equal_error.rows([filled], theirs, EXACT, (0.05,))
    assert row.ours is None
    assert row.speedup("mitsuba") == ""


def test_the_speedup_is_over_our_fastest_graph():
    ours = [group("a", 4, 10, 0.2), group("a", 8, 20, 0.02), group("b", 4, 12, 0.05), group("b", 8, 900, 0.005)]
    theirs = [rung(1, 100, 0.2), rung(2, 1000, 0.02), rung(4, 2000, 0.015), rung(1, 7, 0.06, "cycles")]
    rows = {
        row.relmse: row
        for row in equal_error.rows(ours, theirs, ReferenceNoise(0.0004, ""), (0.5, 0.1, 0.05, 0.02, 0.01, 0.001))
    }
    assert (rows[0.1].ours.name, rows[0.1].ours.at_most) == ("b", True)
    assert rows[0.1].speedup("mitsuba") == f"at least {rows[0.1].peers['mitsuba'].ms / 12:.3g}x"
    assert rows[0.02].ours.name == "a"
    assert rows[0.02].speedup("mitsuba") == "50x"
    assert rows[0.02].speedup("cycles") == f"over {7 / 20:.3g}x"
    assert rows[0.01].ours.name == "b"
    assert str(rows[0.01].peers["mitsuba"]) == "not reached, floor = 0.015"
    assert rows[0.001].ours.ms is None
    assert rows[0.001].ours.floor == 0.005
    assert rows[0.001].speedup("mitsuba") == ""
    assert rows[0.5].speedup("mitsuba") == ""  # both start below it
    assert [row.flagged for row in rows.values()] == [""] * 5 + ["reference_noise"]
    assert rows[0.1].as_dict()["speedup"]["mitsuba"]
    assert equal_error.rows(ours, [], EXACT) == []
    assert equal_error.rows([], theirs, EXACT)[0].ours is None


def test_an_error_that_the_noise_hides_has_no_times():
    ours, theirs = [group("a", 4, 10, 0.2), group("a", 8, 20, 0.002)], [rung(1, 100, 0.2), rung(2, 1000, 0.002)]
    shown, hidden = equal_error.rows(ours, theirs, ReferenceNoise(0.002, ""), (0.01, 0.003))
    assert (shown.flagged, shown.ours.name) == ("reference_noise", "a")
    assert (hidden.flagged, hidden.ours, hidden.peers, hidden.speedup("mitsuba")) == ("below_noise", None, {}, "")


def test_rungs_are_means_over_seeds():
    made = equal_error.group_rungs([point(4, 0, 10.0, 0.1), point(4, 1, 30.0, 0.3), point(8, 0, 5.0, None)])
    assert [(one.spp, one.seeds, one.ms, one.relmse, one.relmse_low) for one in made] == [
        (4, 2, 20.0, pytest.approx(0.2), 0.1)
    ]


# The process.


@pytest.fixture
def process(monkeypatch, tmp_path):
    """Starts the fake peer in a process of its own."""
    monkeypatch.setattr(peer_process, "module", lambda name: fake_peer)

    def start(scene=None):
        return peer_process.PeerProcess("mitsuba", scene or room(), (8, 6), 1, tmp_path / "mitsuba.log")

    start.log = tmp_path / "mitsuba.log"
    return start


def test_a_peer_in_a_process_prints_nothing_here(process, capfd):
    with process() as peer:
        assert peer.about == "Fake 1.0"
        assert peer.render(2, 0).radiance.shape == (6, 8, 3)
        assert peer.render(4, 1).ms == 40
        assert process.log.read_text().count("chatter") + process.log.read_text().count("more of it") >= 2
    assert not peer._process.is_alive()
    assert not process.log.exists()
    assert capfd.readouterr() == ("", "")


def test_a_peer_that_crashes_leaves_one_line_and_its_log(process, capfd):
    line = r"^its process ended with (signal 6|exit status \d+); see .*\.log$"
    with pytest.raises(peer_process.PeerError, match=line), process() as peer:
        peer.render(fake_peer.ABORTS, 0)
    assert "more of it" in process.log.read_text()
    assert capfd.readouterr() == ("", "")


def test_an_error_of_a_peers_library_is_one_line(process, capfd):
    line = r"^RuntimeError: out of luck; see .*\.log$"
    with pytest.raises(peer_process.PeerError, match=line), process() as peer:
        peer.render(fake_peer.RAISES, 0)
    assert "Traceback" in process.log.read_text()
    assert capfd.readouterr() == ("", "")


def test_a_scene_that_a_peer_cannot_render_is_refused_in_its_words(process):
    scene = room()
    with pytest.raises(peer_process.PeerError, match=r"^fake: has no such light$"):
        process(replace(scene, lights=(replace(scene.spotlight, radius=0.1),)))


def test_a_peer_that_hangs_is_ended(process, capfd, monkeypatch):
    peer = process()
    monkeypatch.setattr(peer_process, "LIMIT", 0.2)
    with pytest.raises(peer_process.PeerError, match=r"gave no answer for 0\.2 s"), peer:
        peer.render(fake_peer.HANGS, 0)
    assert not peer._process.is_alive()
    assert capfd.readouterr() == ("", "")


def test_ctrl_c_ends_a_peer_that_renders(process, capfd):
    peer = process()
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt), peer:
        peer.render(fake_peer.HANGS, 0)
    assert not peer._process.is_alive()
    assert not process.log.exists()
    assert capfd.readouterr() == ("", "")


def test_mitsuba_refuses_a_scene_that_it_cannot_render():
    mitsuba_lights = import_module("deferred_ir.profiling.peers.mitsuba_lights")
    scene, light = room(), room().spotlight
    with pytest.raises(SettingError, match="no radius"):
        mitsuba_lights.convert_lights(None, replace(scene, lights=(replace(light, radius=0.1),)))
    with pytest.raises(SettingError, match="one environment"):
        mitsuba_lights.convert_lights(None, replace(scene, lights=(Environment(radiance=(1.0, 1.0, 1.0)),) * 2))
    with pytest.raises(SettingError, match=r"179\.9 degrees is too wide"):
        mitsuba_lights._profile(replace(light, fov=179.9))
    for fov in (1.0, 80.0, 170.0):
        profile = mitsuba_lights._profile(replace(light, fov=fov))
        assert profile.max() == pytest.approx(1, abs=2e-3)
        assert profile[len(profile) // 2, 0] < 0.1 * profile.max()
