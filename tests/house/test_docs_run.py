"""The commands on the pages run, at small sizes on the software device; each picture is made by a command."""

from __future__ import annotations

import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from PIL import Image

from deferred_ir.cli import main

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import light_pictures
import pages
import pictures

LARGEST = 500_000
"""Bytes of a picture."""
LINKED = sorted({link for page in pages.pages() for link in pages.links(page) if link.endswith((".png", ".svg"))})
MADE = pictures.SCENES | pages.picture_commands()
RENDERS = sorted({tuple(words) for page in pages.pages() for words, _ in pages.commands(page) if words[1] == "render"})
BUILTIN = [words for words in RENDERS if words[2] in ("cornell", "colors", "atrium")]


def small(words: tuple[str, ...]) -> list[str]:
    """The arguments of a command, reduced to 32x32 pixels, at most one VPL and at most two frames."""
    arguments = list(words[1:])
    for option, value in (("--size", "32x32"), ("--vpls", "1"), ("--frames", "2")):
        if option not in arguments:
            arguments += [option, value]
        elif arguments[arguments.index(option) + 1] != "0":
            arguments[arguments.index(option) + 1] = value
    return [*arguments, "--device", "software"]


def test_there_are_commands_to_run():
    assert len(BUILTIN) > 10


@pytest.mark.parametrize("words", BUILTIN, ids=" ".join)
def test_renders_write_what_they_name(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / pages.PICTURES).mkdir(parents=True)
    assert main.main(small(words)) == 0
    named = [value for flag, value in pairwise(words) if flag in ("-o", "--json")]
    assert named
    for name in named:
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.parametrize(("page", "picture"), [("README.md", "cornell.png"), ("docs/lights.md", "lights.png")])
def test_the_python_of_the_pages_runs(tmp_path, page, picture):
    (block,) = [block for block in pages.blocks(pages.ROOT / page) if block.language == "python"]
    assert block.text.count("size=(512, 512)") == 1
    text = block.text.replace("size=(512, 512)", 'size=(64, 64), device="software"')
    command = [sys.executable, "-W", "error", "-c", f"{text}\nassert image.radiance.shape == (64, 64, 3)\n"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / picture).is_file()


@pytest.mark.parametrize(("file", "picture"), [("scene.toml", "box.png"), ("lights.toml", "lights.png")])
def test_the_scene_files_of_the_page_render(tmp_path, monkeypatch, file, picture):
    (block,) = [block for block in pages.blocks(pages.ROOT / "docs" / "scene-file.md") if block.file == file]
    (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    for model in ("cornell.obj", "cornell.mtl"):
        shutil.copy(pages.ROOT / "scenes" / model, tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main.main(["render", block.file, "--size", "32x32", "--vpls", "1", "--device", "software"]) == 0
    assert (tmp_path / picture).is_file()


def test_the_moving_scene_of_the_page_moves(tmp_path, monkeypatch):
    wanted = ("moving.toml", "cube.obj")
    blocks = [block for block in pages.blocks(pages.ROOT / "docs" / "scene-file.md") if block.file in wanted]
    assert len(blocks) == 2
    for block in blocks:
        (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    for model in ("cornell.obj", "cornell.mtl"):
        shutil.copy(pages.ROOT / "scenes" / model, tmp_path)
    monkeypatch.chdir(tmp_path)
    command = ["render", "moving.toml", "--size", "32x32", "--vpls", "1", "--device", "software", "--frames", "4"]
    assert main.main([*command, "-o", "f_%04d.png"]) == 0
    assert (tmp_path / "f_0000.png").read_bytes() != (tmp_path / "f_0003.png").read_bytes()


def test_every_picture_of_the_docs_is_shown_and_every_shown_one_is_there():
    there = {path.name for path in (pages.ROOT / pages.PICTURES).iterdir()}
    assert {Path(link).name for link in LINKED} == there


@pytest.mark.parametrize("name", [Path(link).name for link in LINKED if link.endswith(".png")])
def test_a_picture_has_a_command_and_is_of_a_decent_size(name):
    scripted = (*light_pictures.PICTURES, pictures.EXAMPLE_PICTURE, pictures.VIEWER_PICTURE)
    assert name in MADE or name in scripted
    path = pages.ROOT / pages.PICTURES / name
    assert path.stat().st_size < LARGEST
    with Image.open(path) as image:
        assert image.size == ((1280, 720) if name == pictures.VIEWER_PICTURE else (512, 512))


@pytest.mark.parametrize("name", MADE)
def test_the_command_of_a_picture_writes_it_where_the_pages_look(name):
    assert f"{pages.PICTURES}/{name}" in MADE[name]
    assert name in {Path(link).name for link in LINKED}
