"""`deferred-ir render`: the files that it writes, and what chooses them."""

import json
import signal
import subprocess
import sys
import time
from statistics import median

import numpy as np
import pytest
from command_line import SMALL
from PIL import Image

from deferred_ir.cli.main import main
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load


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
    what = [entry["what"] for entry in run["left_out"]]
    assert what[:4] == absent
    assert what[4].endswith(" pairs of tile and light")
    assert what[5:] == ["light_points", "environment", "gbuffer.emission", "gbuffer.material"]
    assert run["memory_bytes"]["textures"] > 2 * 4 * 1024**2  # two layers of the atlas
    names = [entry["name"] for entry in run["passes"]]
    assert sorted(names) == ["cull_lights", "gbuffer", "lighting", "lights", "shadow_maps", "tonemap", "vpl"]
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
    assert "16 vpl" in capsys.readouterr().out


def test_only_numbers_of_the_form_04d_are_frames(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["render", "cornell", *SMALL, "-o", "50%done.png"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["50%done.png"]


def test_set_reaches_the_passes(tmp_path):
    images = []
    for extra in ((), ("--set", "vpl.pattern=random"), ("--set", "vpl.fov=90")):
        main(["render", "cornell", *SMALL, *extra, "-o", str(tmp_path / "o.npy")])
        images.append(np.load(tmp_path / "o.npy"))
    assert np.abs(images[0] - images[1]).max() > 0
    assert np.abs(images[0] - images[2]).max() > 0


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
