"""The command line: what it writes, and that each fault is one line, exit status 2 and no file."""

import json
import os
import signal
import subprocess
import sys
import time
from statistics import median

import numpy as np
import pytest
from PIL import Image

from deferred_ir.cli.main import main
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load

SMALL = ("--size", "32x32", "--vpls", "4", "--device", "software")
SCENE = """
[[model]]
path = "box.obj"
[camera]
position = [0, 0, 0.9]
look_at = [0, 0, 0]
[spotlight]
position = [0, 0.9, 0]
look_at = [0, -1, 0]
emission = [1, 1, 1]
"""
BOX = """
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 1 2 3 4
f 5 6 7 8
f 1 2 6 5
f 4 3 7 8
f 1 4 8 5
f 2 3 7 6
"""


@pytest.fixture
def box(tmp_path):
    """A scene file; call it with replacements of its text to break it."""
    (tmp_path / "box.obj").write_text(BOX)

    def write(*replacements, obj=BOX, extra=""):
        text = SCENE
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "box.obj").write_text(obj)
        (tmp_path / "scene.toml").write_text(text + extra)
        return str(tmp_path / "scene.toml")

    return write


def fault(capsys, tmp_path, *arguments):
    """The one line that a command complains with; no file may appear."""
    before = sorted(tmp_path.rglob("*"))
    try:
        status = main(arguments)
    except SystemExit as end:  # argparse's own
        status = end.code
    output = capsys.readouterr()
    assert status == 2, output
    lines = [line for line in output.err.splitlines() if not line.startswith(("note: ", "OpenGL on "))]
    assert len(lines) == 1, output.err
    assert lines[0].startswith("deferred-ir")
    assert output.out == ""
    assert sorted(tmp_path.rglob("*")) == before
    return lines[0]


def test_render_writes_all_three_kinds_of_image(tmp_path, capsys):
    files = [tmp_path / name for name in ("o.png", "o.npy", "o.exr")]
    assert main(["render", "cornell", *SMALL, *(a for file in files for a in ("-o", str(file)))]) == 0
    radiance = np.load(files[1])
    assert radiance.shape == (32, 32, 3)
    assert radiance.dtype == np.float32
    assert radiance.mean() > 0
    with Image.open(files[0]) as image:
        assert image.size == (32, 32)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["o.exr", "o.npy", "o.png"]
    assert "OpenGL on " in capsys.readouterr().err


def test_without_output_the_picture_takes_the_scenes_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["render", "cornell", *SMALL]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["cornell.png"]


def test_a_black_picture_and_frames_that_are_lost_are_told(tmp_path, box, capsys):
    away = box(("look_at = [0, 0, 0]", "look_at = [0, 0, 9]"), ("position = [0, 0, 0.9]", "position = [0, 0, 5]"))
    assert main(["render", away, *SMALL, "--frames", "2", "-o", str(tmp_path / "o.png")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert any("o_%04d.png keeps all" in line for line in lines)
    assert "note: the picture is black: the camera sees nothing that is lit" in lines
    assert lines[-1] == f"wrote {tmp_path / 'o.png'}"


def test_run_json_holds_what_the_contract_promises(tmp_path):
    file = tmp_path / "run.json"
    assert main(["render", "cornell", *SMALL, "--frames", "6", "--seed", "3", "--json", str(file)]) == 0
    run = json.loads(file.read_text())
    assert run["scene"] == "cornell"
    assert run["graph"] == "deferred"
    assert run["size"] == [32, 32]
    assert run["vpls"] == 4
    assert 0 < run["vpls_alive"] <= 4
    assert run["seed"] == 3
    assert run["frames"] == 6
    assert run["maps_drawn"] == [run["vpls_alive"] + 1] * 6
    absent = ["vertex normals", "vertex colours", "textures", "soft shadows"]
    assert [entry["what"] for entry in run["left_out"]] == absent
    assert run["memory_bytes"]["textures"] > 2 * 4 * 1024**2  # two layers of the atlas
    names = [entry["name"] for entry in run["passes"]]
    assert sorted(names) == ["gbuffer", "lighting", "shadow_maps", "tonemap", "vpl"]
    maps = next(entry for entry in run["passes"] if entry["name"] == "shadow_maps")
    assert [sub["state"] for sub in maps["subpasses"]] == ["dirty"] * (run["vpls_alive"] + 1)
    assert {sub["why"] for sub in maps["subpasses"]} == {"every frame redoes everything"}
    assert all(len(run[key]) == 16 for key in ("scene_hash", "graph_hash"))


def test_the_passes_times_add_up_to_the_frame():
    scene, measurement = load("cornell"), Measurement()
    with Renderer((256, 256), device="software") as renderer:
        plan = renderer.plan(scene, 64)
        renderer.draw(scene, plan)
        for _ in range(9):
            renderer.draw(scene, plan, measurement=measurement)
        renderer.finish(measurement)
    sums = [sum(gpu for gpu, _ in laps.values()) for laps in measurement.laps]
    shares = [total / frame for total, frame in zip(sums, measurement.frame_ms, strict=True)]
    assert median(shares) == pytest.approx(1, abs=0.1)
    assert list(measurement.laps[0]) == [step.name for step in plan.steps]


def test_only_the_asked_outputs_are_made(tmp_path):
    arguments = ["render", "cornell", *SMALL, "-o", str(tmp_path / "o.npy"), "--json", str(tmp_path / "run.json")]
    assert main(arguments) == 0
    left_out = json.loads((tmp_path / "run.json").read_text())["left_out"]
    tonemap = next(entry for entry in left_out if entry["what"] == "tonemap")
    assert tonemap.pop("ms") > 0
    assert tonemap == {"what": "tonemap", "why": "no requested output needs it", "bytes": 4 * 32 * 32}


def test_a_dark_spotlight_needs_no_shadow_maps(tmp_path, box):
    scene = box(("emission = [1, 1, 1]", "emission = [0, 0, 0]"))
    files = ["-o", str(tmp_path / "o.npy"), "--json", str(tmp_path / "run.json")]
    assert main(["render", scene, *SMALL, *files]) == 0
    run = json.loads((tmp_path / "run.json").read_text())
    assert "shadow_maps" in [entry["what"] for entry in run["left_out"]]
    assert run["vpls_alive"] == 0
    assert not np.load(tmp_path / "o.npy").any()


def test_numbered_frames_follow_the_moving_light(tmp_path, box):
    scene = box(extra='[spotlight.motion]\nkind = "lissajous"\namplitude = [0.5, 0, 0.5]\nspeed = [9.0, 1.0]\n')
    assert main(["render", scene, *SMALL, "--frames", "3", "-o", str(tmp_path / "f_%04d.npy")]) == 0
    frames = [np.load(tmp_path / f"f_{i:04d}.npy") for i in range(3)]
    assert np.abs(frames[0] - frames[1]).max() > 1e-3
    assert np.abs(frames[1] - frames[2]).max() > 1e-3


def test_the_scenes_render_table_is_the_default_and_the_command_line_wins(tmp_path, box):
    scene = box(extra='[render]\nsize = "24x16"\nvpls = 3\nseed = 5\nset = {"tonemap.exposure" = 1.0}\n')
    file = tmp_path / "run.json"
    assert main(["render", scene, "--device", "software", "--json", str(file)]) == 0
    run = json.loads(file.read_text())
    assert (run["size"], run["vpls"], run["seed"]) == ([24, 16], 3, 5)
    assert main(["render", scene, *SMALL, "--seed", "6", "--json", str(file)]) == 0
    run = json.loads(file.read_text())
    assert (run["size"], run["vpls"], run["seed"]) == ([32, 32], 4, 6)


def test_the_command_lines_vpl_count_wins_over_the_scenes(tmp_path, box, capsys):
    scene, file = box(extra="[render]\nvpls = 4\n"), tmp_path / "run.json"
    arguments = [scene, "--set", "vpl.count=16"]
    assert main(["render", *arguments, "--size", "16x16", "--device", "software", "--json", str(file)]) == 0
    assert json.loads(file.read_text())["vpls"] == 16
    assert main(["graph", "deferred", "--scene", *arguments]) == 0
    assert "17 light" in capsys.readouterr().out


def test_only_numbers_of_the_form_04d_are_frames(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["render", "cornell", *SMALL, "-o", "50%done.png"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["50%done.png"]


@pytest.mark.parametrize("name", ["../escaped", "a/b", "f%04d", "a\nb"])
def test_a_scenes_name_cannot_choose_the_folder(name, tmp_path, box, capsys):
    scene = box(("[[model]]", f"name = {json.dumps(name)}\n[[model]]"))
    assert "name" in fault(capsys, tmp_path, "render", scene)


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
    line = fault(capsys, tmp_path, "render", scene, *SMALL, "--frames", "20", "-o", str(tmp_path / "o.npy"))
    assert "spotlight.motion: at 0.5 s" in line


def test_set_reaches_the_passes(tmp_path):
    images = []
    for extra in ((), ("--set", "vpl.pattern=random"), ("--set", "vpl.fov=90")):
        main(["render", "cornell", *SMALL, *extra, "-o", str(tmp_path / "o.npy")])
        images.append(np.load(tmp_path / "o.npy"))
    assert np.abs(images[0] - images[1]).max() > 0
    assert np.abs(images[0] - images[2]).max() > 0


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
    line = fault(capsys, tmp_path, "render", box(change), "-o", str(tmp_path / "o.png"))
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
    line = fault(capsys, tmp_path, "render", box(obj=obj), "-o", str(tmp_path / "o.png"))
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
    line = fault(capsys, tmp_path, *arguments)
    assert all(word in line for word in words), line


def test_a_cycle_in_a_graph_is_named(tmp_path, capsys):
    file = tmp_path / "cycle.toml"
    file.write_text(
        'extends = "deferred"\n[passes.lighting.inputs]\nalbedo = "again.color"\n'
        '[passes.again]\ntype = "tonemap"\ninputs = { radiance = "lighting.radiance" }\n'
    )
    line = fault(capsys, tmp_path, "graph", str(file))
    assert "cycle" in line
    assert "lighting" in line
    assert "again" in line


def test_an_output_that_is_no_image_is_told(tmp_path, capsys):
    file = tmp_path / "odd.toml"
    file.write_text('extends = "deferred"\n[outputs]\ndisplay = "gbuffer.albedo"\n')
    line = fault(capsys, tmp_path, "render", "cornell", *SMALL, "--graph", str(file), "-o", str(tmp_path / "o.png"))
    assert "outputs.display: wants rgba8, but gbuffer.albedo is rgba16f" in line


def test_graph_shows_order_and_what_was_left_out(capsys, box):
    assert main(["graph", "deferred", "--scene", box(("emission = [1, 1, 1]", "emission = [0, 0, 0]"))]) == 0
    output = capsys.readouterr().out
    assert output.index(". gbuffer") < output.index(". lighting") < output.index(". tonemap")
    assert "left out: shadow_maps: no light needs one" in output
    assert "left out: soft shadows: the spotlight's radius is 0" in output
    assert main(["graph", "forward", "--dot"]) == 0
    assert capsys.readouterr().out.startswith("digraph")


def test_graph_and_its_errors_need_no_gl():
    code = (
        "import sys; from deferred_ir.cli.main import main\n"
        "status = main(['graph', 'deferred', '--scene', 'cornell'])\n"
        "sys.exit(status or int('moderngl' in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def test_scenes_lists_the_built_in_ones(capsys):
    assert main(["scenes"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["atrium", "colors", "cornell"]


def test_no_driver_is_one_line(tmp_path):
    environment = {**os.environ, "GLCONTEXT_LINUX_LIBEGL": "libNoSuchEGL.so.1"}
    command = [sys.executable, "-m", "deferred_ir", "render", "cornell", "-o", str(tmp_path / "o.png")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "apt install" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("vpls", "status"), [("0", 0), ("5", 2)])
def test_without_embreex_direct_light_works_and_more_is_one_line(vpls, status, tmp_path):
    code = (
        "import sys; sys.modules['embreex'] = None; from deferred_ir.cli.main import main; "
        f"sys.exit(main(['render', 'cornell', '--size', '32x32', '--vpls', '{vpls}', '-o', sys.argv[1]]))"
    )
    file = tmp_path / "o.npy"
    done = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    assert file.exists() == (status == 0)
    if status:
        note, _device, _fault = done.stderr.splitlines()
        assert note == "note: sobol: 5 points are not balanced, only powers of two are; take 4 or 8"
        assert "pip install embreex" in done.stderr


def test_ctrl_c_leaves_whole_frames_only(tmp_path):
    command = [sys.executable, "-m", "deferred_ir", "render", "cornell", *SMALL, "--frames", "100000"]
    running = subprocess.Popen(
        [*command, "-o", str(tmp_path / "f_%06d.npy")], stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    deadline = time.monotonic() + 60
    while not (tmp_path / "f_000003.npy").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    error = running.communicate(timeout=60)[1]
    assert running.returncode == 130
    whole = len(list(tmp_path.iterdir()))
    assert error.splitlines()[-1] == f"deferred-ir: interrupted: wrote {whole} of 100000 frames"
    assert [path.suffix for path in tmp_path.iterdir()].count(".npy") == len(list(tmp_path.iterdir()))
    assert all(np.load(path).shape == (32, 32, 3) for path in tmp_path.iterdir())
