"""The pages are true: their links, commands, plans and tables, and the worked example of a pass."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deferred_ir.cli import main
from deferred_ir.graph.file import load_graph
from deferred_ir.loading import scene_file
from deferred_ir.loading.load import builtin_scenes, load

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import pages
import pass_tables
import pictures

PAGES = pages.pages()
PLACEHOLDERS = {"room.glb"}
"""Scenes in commands that stand for a file of the reader's own, as the page says."""
COMMAND = re.compile(r"^ *(?:\$ )?(deferred-ir .*)$", re.MULTILINE)
EXAMPLE = pages.ROOT / "docs" / "adding-a-pass.md"
SHOWN = [
    (page.name, words, output)
    for page in PAGES
    for words, output in pages.commands(page)
    if output and words[1] in ("graph", "scenes")
]
FILES = [(page.name, block) for page in PAGES for block in pages.blocks(page) if block.file.endswith(".toml")]


def by_name(page: object) -> str | None:
    return page.name if isinstance(page, Path) else None


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_links_lead_somewhere(page):
    for link in pages.links(page):
        if re.match(r"[a-z]+:", link):
            continue
        file, _, anchor = link.partition("#")
        target = page.parent / file if file else page
        assert target.exists(), link
        assert not anchor or anchor in pages.anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_paths_are_those_of_the_repository(page):
    missing = [path for path in pages.paths(page) if not (pages.ROOT / path).exists()]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_commands_are_understood(page):
    for line in COMMAND.findall(page.read_text(encoding="utf-8")):
        words = shlex.split(re.split(r" [|>&] ?", line)[0], comments=True)
        try:
            main._parse(words[1:])
        except SystemExit:
            pytest.fail(f"{page.name}: {line}")


@pytest.mark.parametrize("page", PAGES, ids=by_name)
def test_scenes_in_commands_are_built_in_or_on_a_page(page):
    known = {*(name for name, _ in builtin_scenes()), *PLACEHOLDERS, *(block.file for _, block in FILES)}
    options = [main._parse(words[1:]) for words, _ in pages.commands(page)]
    assert {scene for found in options if (scene := getattr(found, "scene", None))} <= known


@pytest.mark.parametrize("shown", SHOWN, ids=lambda shown: " ".join(shown[1]))
def test_commands_print_what_the_page_shows(shown, tmp_path, monkeypatch, capsys):
    page, words, output = shown
    for name, block in FILES:
        if name == page:
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    for model in ("cornell.obj", "cornell.mtl"):
        shutil.copy(pages.ROOT / "scenes" / model, tmp_path)
    monkeypatch.chdir(tmp_path)
    status = main.main(words[1:])
    printed = "".join(capsys.readouterr())
    assert status == (2 if output.startswith("deferred-ir: ") else 0)
    assert printed.endswith(output)


def test_tables_of_passes_are_up_to_date():
    page = pass_tables.PAGE.read_text(encoding="utf-8")
    assert pass_tables.update(page) == page, "run: python tools/pass_tables.py"


def test_the_worked_example_of_a_pass_draws_what_it_says(tmp_path, renderer):
    script = tmp_path / pictures.write_example(tmp_path)
    text = script.read_text(encoding="utf-8")
    assert text.count("size=(512, 512)") == 1
    script.write_text(text.replace("size=(512, 512)", 'size=(64, 64), device="software"'), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (plan,) = [block.text for block in pages.blocks(EXAMPLE) if block.language == "text"]
    assert done.stdout.endswith(plan)

    code = (tmp_path / "false_color.py").read_text(encoding="utf-8")
    middle, stops = (float(re.search(rf"{name}: float = param\(([\d.]+)", code)[1]) for name in ("middle", "stops"))
    radiance = renderer((64, 64)).render(load("cornell"), vpls=256).radiance
    luminance = radiance @ [0.2126, 0.7152, 0.0722]
    lit = luminance > 0
    scale = np.clip(np.log2(np.where(lit, luminance, 1.0) / middle) / stops, -1, 1)[..., None]
    expected = np.clip(1.5 - abs(2 * scale - [1, 0, -1]), 0, 1) * lit[..., None]
    drawn = np.asarray(Image.open(tmp_path / "false_color.png"), np.float64) / 255
    np.testing.assert_allclose(drawn, expected, atol=0.01)
    assert np.ptp(drawn[lit], axis=0).min() > 0.5  # blue, green and red are all there


@pytest.mark.parametrize(
    "block", [block for name, block in FILES if name != EXAMPLE.name], ids=lambda block: block.file
)
def test_files_on_the_pages_are_read(block, tmp_path):
    path = tmp_path / block.file
    path.write_text(block.text, encoding="utf-8")
    if "[[model]]" in block.text:
        assert scene_file.read(path).models
    else:
        assert load_graph(path).nodes
