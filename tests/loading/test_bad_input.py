"""Broken and hostile files: one line or a picture, never a traceback, a crash, a hang, or memory without bound."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bad_file_makers
import bad_files
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from deferred_ir import load
from deferred_ir.base.errors import Error, GraphError, SceneError
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.compile import compile
from deferred_ir.graph.file import load_graph
from deferred_ir.loading import models
from deferred_ir.loading.formats import gltf_checks
from deferred_ir.loading.textures import decode_texture

MENDED = {
    "glTF nodes.0.rotation = [0, 0, 0, 0]",
    "glTF scenes.0.nodes = [0, 0]",
    "OBJ with a million slashes",
    "OBJ texture coordinates out of range",
    "PLY with a face of 255 corners",
    "PNG with rows missing",
    "TOML that would set a function",
    *bad_file_makers.PICTURES,
}
"""Cases that give a picture, and nothing but a line otherwise."""


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Return the outcome of each broken file, loaded in another process."""
    folder = tmp_path_factory.mktemp("bad")
    script = Path(bad_files.__file__).with_name("bad_files_process.py")
    run = subprocess.run(
        [sys.executable, "-W", "error", script, folder], capture_output=True, text=True, timeout=300, check=False
    )
    told = {line["name"]: line for line in map(json.loads, run.stdout.splitlines())}
    missing = next((name for name in bad_files.CASES if name not in told), None)
    assert missing is None, f"{missing}: the process ended with {run.returncode}: {run.stderr[-2000:]}"
    assert not run.stderr
    assert not list(folder.rglob("run"))  # nothing that files ask for was done
    return told


def test_there_are_enough_of_them() -> None:
    assert len(bad_files.CASES) >= 60


@pytest.mark.parametrize("name", bad_files.CASES)
def test_a_broken_file_gives_one_line_or_a_picture(name: str, outcomes: dict[str, dict[str, Any]]) -> None:
    told = outcomes[name]
    assert told["seconds"] < 10
    assert "fault" not in told
    assert (name in MENDED) == ("faces" in told), told.get("error")
    if "error" in told:
        assert told["path"].rpartition("/")[0] in told["error"] or "i." in told["error"] or "number 0" in told["error"]
        assert len(told["error"].splitlines()) == 1
        assert len(told["error"]) < 3000
        assert "more memory than there is" not in told["error"]


@pytest.fixture(scope="module")
def small() -> Iterator[Renderer]:
    with Renderer((16, 16), device="software", set={"vpl.count": 2}) as made:
        yield made


@pytest.mark.parametrize("name", sorted(MENDED - {"TOML that would set a function"}))
def test_what_is_mended_gives_a_picture(name: str, small: Renderer, tmp_path: Path) -> None:
    image = small.render(load(bad_files.CASES[name](tmp_path)))
    assert np.isfinite(image.radiance).all()


def test_a_scene_cannot_set_what_is_no_parameter(tmp_path: Path) -> None:
    scene = load(bad_files.CASES["TOML that would set a function"](tmp_path))
    with pytest.raises(GraphError, match=r"set os\.system: no pass 'os' in this graph"):
        Renderer(device="software", set=scene.render.set)


def test_a_model_reads_the_scenes_folder_but_nothing_outside(tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    for name in ("models", "textures"):
        (folder / name).mkdir(parents=True)
    (folder / "models" / "m.obj").write_text(bad_file_makers.TEXTURED)
    (folder / "models" / "m.mtl").write_text("newmtl m\nmap_Kd ../textures/i.png\n")
    (folder / "textures" / "i.png").write_bytes(bad_file_makers.png(1, 1))
    (folder / "scene.toml").write_text('[[model]]\npath = "models/m.obj"\n')
    assert len(load(folder / "scene.toml").textures) == 1
    with pytest.raises(SceneError, match=r"image \.\./textures/i\.png is missing"):
        load(folder / "models" / "m.obj")


def test_the_largest_image_is_one_that_drivers_take() -> None:
    image = Image.new("1", (8193, 8192))
    with pytest.raises(SceneError, match="big: 8193x8192 pixels, and 67108864 are the most; scale it down"):
        decode_texture(image, "big")


def test_many_images_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "MOST_TEXELS", 5)
    (tmp_path / "m.obj").write_text(bad_file_makers.TEXTURED)
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd i.png\n")
    (tmp_path / "i.png").write_bytes(bad_file_makers.png(3, 2))
    with pytest.raises(SceneError, match=r"m\.obj: its images have more than 5 pixels"):
        load(tmp_path / "m.obj")


def changed(draw: Callable[[Any], Any], value: Any) -> Any:
    """`value`, JSON, with something else in one of its places."""
    junk = st.sampled_from([None, True, -1, 0, 7, 2**31, 10**20, 0.5, "x", [], {}, [[]], {"x": 1}])
    if not isinstance(value, dict | list) or not value or draw(st.integers(0, 5)) == 0:
        return draw(junk)
    if isinstance(value, dict):
        key = draw(st.sampled_from(sorted(value)))
        return {**value, key: changed(draw, value[key])}
    index = draw(st.integers(0, len(value) - 1))
    return [*value[:index], changed(draw, value[index]), *value[index + 1 :]]


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_gltf_with_a_wrong_value_gives_a_scene_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    document = bad_file_makers.document()
    for _ in range(data.draw(st.integers(1, 2))):
        document = changed(data.draw, document)
    path = tmp_path / "m.glb"
    path.write_bytes(bad_file_makers.glb(document))
    try:
        message = f"{len(models.read(path).parts)} parts"
    except SceneError as error:
        message = str(error)
    assert len(message.splitlines()) == 1


def test_nodes_and_sizes_are_held_to_their_bounds() -> None:
    document = bad_file_makers.document()
    contents = [bad_file_makers.POSITIONS + bad_file_makers.INDICES]
    gltf_checks.check(document, contents)
    document["nodes"] = bad_files.tree(1, gltf_checks.DEEPEST)
    gltf_checks.check(document, contents)
    document["nodes"] = bad_files.tree(1, gltf_checks.DEEPEST + 1)
    with pytest.raises(SceneError, match="lies deeper than 256 levels"):
        gltf_checks.check(document, contents)


@settings(deadline=None, max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_graph_gives_a_plan_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    import deferred_ir.passes.graphs as folder

    text = bytearray((Path(folder.__path__[0]) / "deferred.toml").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "graph.toml"
    path.write_bytes(text)
    message = "planned"
    try:
        graph = load_graph(path)
        compile(graph, list(graph.outputs))
    except GraphError as error:
        message = str(error)
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a = " + "[" * 100000,
        "[passes" + ".a" * 5000 + "]\n",
        'extends = "deferred"\n[passes.vpl' + ".a" * 5000 + "]\n",
        'extends = "graph.toml"\n',
        'extends = "/dev/zero"\n',
        "[passes.vpl]\ntype = 'os.system'\n",
        "[passes.vpl]\ntype = '../graphs'\n",
        "[passes.'deferred_ir.cli.main']\n[outputs]\nradiance = 'x.y'\n",
        f"[passes.vpl]\ncount = {'9' * 5000}\n",
        'extends = "deferred"\n[passes.vpl]\ncount = 1000000000000000000000000000000\n',
        'extends = "deferred"\n[passes.shadow_maps]\nvpl_size = nan\n',
        b"\xff\xfe",
    ],
)
def test_hostile_graph_files(tmp_path: Path, text: str | bytes) -> None:
    path = tmp_path / "graph.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(Error) as caught:
        compile((graph := load_graph(path)), list(graph.outputs))
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 3000
