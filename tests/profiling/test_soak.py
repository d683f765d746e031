"""The long run, shortened, and what it must notice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from small_scenes import room

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture
from deferred_ir.output.image import Image
from deferred_ir.profiling.checks import soak
from deferred_ir.profiling.checks.soak import ROUND, STRETCH, Count, Soak


def test_objects_are_counted_by_opengl(gpu):
    before = gpu.gl.count_objects()
    texture, buffer = GpuTexture(gpu, Texture("r32f"), (4, 4)), gpu.ctx.buffer(reserve=4)
    assert gpu.gl.count_objects() == {**before, "Texture": before["Texture"] + 1, "Buffer": before["Buffer"] + 1}
    texture.release()
    buffer.release()
    assert gpu.gl.count_objects() == before


def test_two_rounds_leave_nothing_behind(monkeypatch, capsys):
    monkeypatch.setattr(soak, "STRETCH", 2)
    monkeypatch.setattr(soak, "SLACK", 64)  # of all that other tests have left behind
    frames = 2 * 2 * ROUND
    monkeypatch.setattr(sys, "argv", ["soak", "--frames", str(frames), "--loads", "8"])
    status = soak.main()
    told = capsys.readouterr()
    assert (status, told.err) == (0, "")
    assert [line.split(" | ")[:3] for line in told.out.splitlines()[2:]] == [
        ["| a tenth", str(frames // 2), "4"],
        ["| half-way", str(frames), "8"],
        ["| end", str(frames), "8"],
    ]


def test_growth_and_different_images_are_faults():
    first = Count(10, 1, {"Texture": 4, "Buffer": 2}, 100.0)
    done = Soak(counts=[first, Count(20, 2, {"Texture": 5, "Buffer": 1}, 100.0 + soak.SLACK + 1)])
    for value in (0.0, 0.0, 1.0):
        done.compare("a", Image(np.full((1, 1, 3), value, np.float32), np.zeros((1, 1, 3), np.uint8)))
    assert done.faults == [
        "Texture: 4 became 5",
        "memory: 100 MiB became 109",
        "another image: a, after 0 frames and 0 loads",
    ]
    assert not Soak(counts=[first, first]).faults


def test_a_run_that_is_cut_short_is_no_success(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["soak", "--frames", str(2 * STRETCH), "--loads", "0", "--minutes", "0"])
    assert soak.main() == 1
    assert "too few to compare" in capsys.readouterr().err


def test_a_lost_context_is_one_line(renderer, monkeypatch):
    one = renderer((8, 8))
    monkeypatch.setattr(one.gpu.gl, "GetError", lambda: 0x0507)
    with pytest.raises(DeviceError, match=r": the driver was reset and the context is lost; make another Renderer$"):
        one.render(room(), vpls=2)


def test_a_killed_run_leaves_whole_frames(tmp_path):
    command = [sys.executable, "-m", "deferred_ir", "render", "cornell", "--size", "64x64", "--vpls", "4"]
    process = subprocess.Popen([*command, "--frames", "100000", "-o", "f_%04d.npy"], cwd=tmp_path, stderr=-3)
    while len(list(tmp_path.glob("f_*.npy"))) < 3:
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    files = sorted(tmp_path.glob("f_*.npy"))
    assert [file.name for file in files] == [f"f_{i:04d}.npy" for i in range(len(files))]
    assert all(np.load(file).shape == (64, 64, 3) for file in files)
