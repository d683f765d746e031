"""Each fault is one line, exit status 2 and no file."""

import json
import os
import subprocess
import sys

import pytest
from command_line import SMALL, find_fault

from deferred_ir.cli.main import main


@pytest.mark.parametrize("name", ["../escaped", "a/b", "f%04d", "a\nb"])
def test_a_scenes_name_cannot_choose_the_folder(name, tmp_path, box, capsys):
    scene = box(("[[model]]", f"name = {json.dumps(name)}\n[[model]]"))
    assert "name" in find_fault(capsys, tmp_path, "render", scene)


def test_a_light_that_meets_its_target_on_its_way_is_told(tmp_path, box, capsys):
    motion = '[spotlight.motion]\nkind = "lissajous"\namplitude = [0, 0, 0.3]\nspeed = [0.0, 1.0]\n'
    scene = box(("look_at = [0, -1, 0]", "look_at = [0, 0.9, 0.3]"), extra=motion)
    assert main(["render", scene, *SMALL, "-o", str(tmp_path / "o.npy")]) == 0
    scene = box(
        ("position = [0, 0.9, 0]\nlook_at = [0, -1, 0]", "position = [0, 0.9, 0]\nlook_at = [0, 0.9, 0]"),
        extra='[spotlight.motion]\nkind = "keyframes"\ntimes = [0, 1]\npositions = [[0, 0.8, 0], [0, -0.8, 0]]\n'
        "look_ats = [[0, 0, 0], [0, 0, 0]]\n",
    )
    (tmp_path / "o.npy").unlink()
    capsys.readouterr()
    line = find_fault(capsys, tmp_path, "render", scene, *SMALL, "--frames", "20", "-o", str(tmp_path / "o.npy"))
    assert "spotlight.motion: at 0.5 s" in line


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("emission = [1, 1, 1]", "emision = [1, 1, 1]"), ["spotlight.emision", "did you mean 'emission'"]),
        (("emission = [1, 1, 1]", "emission = [-1, 1, 1]"), ["spotlight.emission"]),
        (("emission = [1, 1, 1]", 'emission = "bright"'), ["spotlight.emission"]),
        (("look_at = [0, 0, 0]", "look_at = [0, 0, 0.9]"), ["camera", "look_at"]),
        (("look_at = [0, 0, 0]", "look_at = [0, 0, 0]\nup = [0, 0, 1]"), ["camera.up"]),
        (("look_at = [0, 0, 0]", "look_at = [0, 0, 0]\nfov = 180"), ["camera.fov", "180"]),
        (("look_at = [0, 0, 0]", "look_at = [0, 0, 0]\nfov = 0"), ["camera.fov"]),
        (('path = "box.obj"', 'path = "bos.obj"'), ["bos.obj"]),
        (("[camera]", "[camera"), ["scene.toml"]),
    ],
)
def test_a_faulty_scene_is_one_line(change, words, tmp_path, capsys, box):
    line = find_fault(capsys, tmp_path, "render", box(change), "-o", str(tmp_path / "o.png"))
    assert all(word in line for word in ["scene.toml", *words]), line


@pytest.mark.parametrize(
    ("obj", "words"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ["triangle"]),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ["finite"]),
        ("v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ["finite"]),
        ("", ["box.obj"]),
    ],
)
def test_a_faulty_model_is_one_line(obj, words, tmp_path, capsys, box):
    line = find_fault(capsys, tmp_path, "render", box(obj=obj), "-o", str(tmp_path / "o.png"))
    assert all(word in line for word in ["box.obj", *words]), line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["render", "cornel"], ["cornel", "did you mean 'cornell'"]),
        (["render", "missing.obj"], ["missing.obj"]),
        (["render", "cornell", "--graph", "defered"], ["defered", "did you mean 'deferred'"]),
        (["render", "cornell", "--graph", "missing.toml"], ["missing.toml"]),
        (["render", "cornell", "--size", "0x5"], ["--size 0x5"]),
        (["render", "cornell", "--size", "big"], ["--size big"]),
        (["render", "cornell", "--size", "99999x8", "--device", "software"], ["99999x8", "16384"]),
        (["render", "cornell", "--vpls", "-1"], ["--vpls", "-1"]),
        (["render", "cornell", "--frames", "0"], ["--frames"]),
        (["render", "cornell", "--device", "egl:99"], ["egl:99"]),
        (["render", "cornell", "--set", "tonemap.exposre=1"], ["tonemap.exposre", "did you mean 'exposure'"]),
        (["render", "cornell", "--set", "tonemapp.exposure=1"], ["tonemapp", "did you mean 'tonemap'"]),
        (["render", "cornell", "--set", "tonemap.exposure=bright"], ["tonemap.exposure", "'auto'"]),
        (["render", "cornell", "--set", "tonemap"], ["--set tonemap"]),
        (["render", "cornell", "--set", "vpl.fov=180"], ["vpl.fov", "179.9"]),
        (["render", "cornell", "--vpls", "4096", "--set", "shadow_maps.vpl_size=1024"], ["MiB", "VPLs fit"]),
        (["render", "cornell", "-o", "image.jpg"], ["image.jpg", ".png"]),
        (["render", "cornell", "-o", "no_such_folder/o.png"], ["no_such_folder"]),
        (["render", "cornell", "--json", "no_such_folder/run.json"], ["no_such_folder"]),
        (["render", "cornell", "-o", "a" * 300 + ".png"], ["too long"]),
        (["render", "cornell", "-o", "x.png", "--json", "x.png"], ["x.png", "twice"]),
        (["render", "cornell", "-o", "x.png", "-o", "./x.png"], ["x.png", "twice"]),
        (["render", "cornell", "--graph", ""], ["graph ''"]),
        (["render", "cornell", "--device", ""], ["device ''"]),
        (["render", "cornell", "--vpls", "4", "--set", "vpl.count=9"], ["--vpls 4", "vpl.count=9"]),
        (["render", "cornell", "--vpls", "4", "--set", "shadow_maps.budget=1"], ["spot_size", "16 MiB"]),
        (["reference", "cornell", "-o", "r.npy", "--bounces", "65"], ["bounces", "64"]),
        (["graph", "nonesuch"], ["nonesuch"]),
        (["rendr"], ["rendr"]),
        ([], ["COMMAND"]),
    ],
)
def test_a_faulty_command_is_one_line(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = find_fault(capsys, tmp_path, *arguments)
    assert all(word in line for word in words), line


def test_a_cycle_in_a_graph_is_named(tmp_path, capsys):
    file = tmp_path / "cycle.toml"
    file.write_text(
        'extends = "deferred"\n[passes.lighting.inputs]\nalbedo = "again.color"\n'
        '[passes.again]\ntype = "tonemap"\ninputs = { radiance = "lighting.radiance" }\n'
    )
    line = find_fault(capsys, tmp_path, "graph", str(file))
    assert "cycle" in line
    assert "lighting" in line
    assert "again" in line


def test_an_output_that_is_no_image_is_told(tmp_path, capsys):
    file = tmp_path / "odd.toml"
    file.write_text('extends = "deferred"\n[outputs]\ndisplay = "gbuffer.albedo"\n')
    line = find_fault(
        capsys, tmp_path, "render", "cornell", *SMALL, "--graph", str(file), "-o", str(tmp_path / "o.png")
    )
    assert "outputs.display: wants rgba8, but gbuffer.albedo is rgba16f" in line


def test_no_driver_is_one_line(tmp_path):
    environment = {**os.environ, "GLCONTEXT_LINUX_LIBEGL": "libNoSuchEGL.so.1"}
    command = [sys.executable, "-m", "deferred_ir", "render", "cornell", "-o", str(tmp_path / "o.png")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "apt install" in done.stderr
    assert not list(tmp_path.iterdir())
