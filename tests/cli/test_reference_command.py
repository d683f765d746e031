"""`deferred-ir reference`: the files it writes, what it takes from the scene file, and its faults."""

import json
import sys

import numpy as np
import pytest

from deferred_ir.cli.main import main
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.truth.reference import make_vpl_params


@pytest.mark.parametrize("kind", ["paths", "vpls"])
def test_the_command_writes_the_image_and_its_record(kind, tmp_path, capsys):
    out = tmp_path / "out.npy"
    extra = [] if kind == "paths" else ["--vpls", "16", "--set", "vpl.fov=180", "--set", "vpl.pattern=random"]
    assert main(["reference", "cornell", "-o", str(out), "--size", "24x16", "--seed", "5", *extra]) == 0
    image, record = np.load(out), json.loads((tmp_path / "out.json").read_text())
    assert image.shape == (16, 24, 3)
    assert image.dtype == np.float32
    assert image.mean() > 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.json", "out.npy"]
    assert record["scene"] == "cornell"
    assert len(record["scene_hash"]) == 16
    assert (record["size"], record["bounces"], record["seed"]) == ([24, 16], 1, 5)
    assert record["seconds"] > 0
    assert 0 < record["hit_fraction"] <= 1
    if kind == "paths":
        assert (record["spp"], record["settings"]) == (64, {})
        assert 0 < record["standard_error"] < 1
        assert 0 < record["noise"] < 1
        assert "vpls" not in record
    else:
        assert record["settings"] == {"vpl.fov": 180.0, "vpl.clamp": make_vpl_params({}).clamp, "vpl.pattern": "random"}
        assert (record["vpls"], record["standard_error"], record["noise"]) == (16, None, None)
        assert "seeds" in record["note"]
        assert "spp" not in record
    output = capsys.readouterr()
    assert output.out == ""
    assert "%|" not in output.err  # a bar is for terminals


def test_a_terminal_sees_a_progress_bar(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert main(["reference", "cornell", "-o", str(tmp_path / "o.npy"), "--size", "8x8", "--spp", "4"]) == 0
    assert "% |" in capsys.readouterr().err


def test_one_sample_cannot_tell_its_error(tmp_path):
    main(["reference", "cornell", "-o", str(tmp_path / "o.npy"), "--size", "8x8", "--spp", "1"])
    record = json.loads((tmp_path / "o.json").read_text())
    assert record["standard_error"] is None
    assert record["noise"] is None
    assert "sample" in record["note"]


def scene_file(folder, render):
    """A scene file with a [render] table, around the built-in Cornell box."""
    from deferred_ir.loading.load import load

    model = load("cornell").path.parent / "cornell.obj"
    file = folder / "scene.toml"
    file.write_text(f"[[model]]\npath = '{model}'\n[render]\n{render}\n")
    return str(file)


def test_the_scenes_render_table_is_the_default(tmp_path):
    render = 'size = "12x8"\nset = {"vpl.fov" = 120.0, "vpl.bounces" = 2, "tonemap.exposure" = 1.0}'
    scene, out = scene_file(tmp_path, render), str(tmp_path / "o.npy")
    assert main(["reference", scene, "-o", out, "--vpls", "8", "--set", "vpl.clamp=0.5"]) == 0
    record = json.loads((tmp_path / "o.json").read_text())
    assert (record["size"], record["bounces"]) == ([12, 8], 2)
    assert (record["settings"]["vpl.fov"], record["settings"]["vpl.clamp"]) == (120.0, 0.5)
    assert main(["reference", scene, "-o", out, "--spp", "2", "--bounces", "1"]) == 0  # paths have no cone
    record = json.loads((tmp_path / "o.json").read_text())
    assert (record["bounces"], record["settings"]) == (1, {})


def test_bounces_also_go_by_the_name_they_have_in_a_render(tmp_path):
    out = str(tmp_path / "o.npy")
    small = ["reference", "cornell", "-o", out, "--size", "8x8"]
    assert main([*small, "--spp", "2", "--set", "vpl.bounces=3"]) == 0
    assert json.loads((tmp_path / "o.json").read_text())["bounces"] == 3


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (["--spp", "0"], ["--spp", "'0'"]),
        (["--spp", "-4"], ["--spp"]),
        (["--vpls", "0"], ["--vpls", "'0'"]),
        (["--vpls", "-1"], ["--vpls"]),
        (["--vpls", "many"], ["--vpls", "'many'"]),
        (["--vpls", "100000"], ["vpl.count", "65536"]),
        (["--spp", "4", "--vpls", "4"], ["--spp", "--vpls"]),
        (["--bounces", "-1"], ["--bounces"]),
        (["--size", "0x5"], ["--size 0x5"]),
        (["--size", "big"], ["--size big"]),
        (["--size", "99999x99999"], ["99999x99999", "pixels"]),
        (["--vpls", "4", "--set", "vpl.fv=20"], ["vpl.fv", "did you mean 'vpl.fov'"]),
        (["--vpls", "4", "--set", "tonemap.exposure=1"], ["tonemap.exposure", "vpl.clamp"]),
        (["--vpls", "4", "--set", "vpl.fov=181"], ["vpl.fov", "181"]),
        (["--vpls", "4", "--set", "vpl.clamp=-1"], ["vpl.clamp", "-1"]),
        (["--vpls", "4", "--set", "vpl.pattern=sobl"], ["vpl.pattern", "did you mean 'sobol'"]),
        (["--vpls", "4", "--set", "vpl.bounces=few"], ["vpl.bounces", "few"]),
        (["--vpls", "4", "--bounces", "1000"], ["bounces", "1000"]),
        (["--spp", "4", "--set", "vpl.clamp=0.1"], ["vpl.clamp", "--vpls"]),
        (["-o", "o.png"], ["o.png", ".npy"]),
        (["-o", "missing/o.npy"], ["missing"]),
        (["--seed", "-1"], ["--seed"]),
    ],
)
def test_a_faulty_command_is_one_line_and_leaves_no_file(extra, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["reference", "cornell", "-o", "o.npy", "--size", "8x8", *extra])
    except SystemExit as end:  # argparse's own
        status = end.code
    lines = capsys.readouterr().err.splitlines()
    assert status == 2
    assert len(lines) == 1, lines
    assert lines[0].startswith("deferred-ir")
    assert all(word in lines[0] for word in words), lines[0]
    assert not list(tmp_path.iterdir())


def test_without_embreex_it_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    assert main(["reference", "cornell", "-o", str(tmp_path / "o.npy"), "--size", "8x8"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "embreex: not installed" in line


def test_an_interrupt_ends_with_one_line_and_no_file(tmp_path, capsys, monkeypatch):
    """Ctrl-C between two tasks: those that wait are dropped."""
    begun = []

    def interrupted(self, surfaces, count, rng):
        del self, count, rng
        begun.append(1)
        if len(begun) == 3:
            raise KeyboardInterrupt
        return np.zeros((len(surfaces.hits.face), 3)), np.zeros((len(surfaces.hits.face), 3))

    monkeypatch.setattr(PathTracer, "_follow_bounces", interrupted)
    monkeypatch.setattr("deferred_ir.truth.path_tracer.RAYS", 256)
    assert main(["reference", "cornell", "-o", str(tmp_path / "o.npy"), "--size", "64x64", "--spp", "64"]) == 130
    assert capsys.readouterr().err == "deferred-ir: interrupted\n"
    assert not list(tmp_path.iterdir())
    assert len(begun) < 1000
