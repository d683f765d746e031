"""Reading and checking of the TOML scene file."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from toml_text import to_toml

from deferred_ir.base.errors import SceneError
from deferred_ir.loading import scene_file
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import KeyframedLight, LissajousMotion

MODEL = '[[model]]\npath = "box.obj"\n'
CAMERA = "[camera]\nposition = [0, 1, 5]\nlook_at = [0, 1, 0]\n"
SPOTLIGHT = "[spotlight]\nposition = [0, 4, 0]\nlook_at = [0, 0, 0]\nemission = [1, 2, 3]\n"
WHOLE = """
name = "room"
[[model]]
path = "sub/box.obj"
scale = 2
translate = [1, 2.5, 3]
[model.motion]
times = [0, 2]
translations = [[0, 0, 0], [0.3, 0, 0]]
rotations = [[0, 0, 0, 1], [0, 3, 0, 4]]
[[model]]
path = "other.glb"
[camera]
position = [0, 1, 5]
look_at = [0, 1, 0]
up = [0, 1, 0.1]
fov = 50
[camera.motion]
times = [0, 1, 2]
positions = [[0, 1, 5], [0, 1, 4], [0, 1, 3]]
look_ats = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]
[spotlight]
position = [0, 4, 0]
look_at = [0, 0, 0]
fov = 100
emission = [10, 9.5, 8]
radius = 0.1
[spotlight.motion]
kind = "lissajous"
amplitude = [9, 1, 2.5]
speed = [0.6, 0.5]
[render]
graph = "graphs/own.toml"
size = "640x480"
vpls = 128
seed = 7
set = {"tonemap.exposure" = 1.0, "shadow_maps.projection" = "cube"}
"""


def read(folder: Path, text: str) -> scene_file.SceneFile:
    path = folder / "room.toml"
    path.write_text(text, encoding="utf-8")
    return scene_file.read(path)


def fault(folder: Path, text: str) -> str:
    """The error message for `text`, which must be one line that names the file."""
    with pytest.raises(SceneError) as caught:
        read(folder, text)
    message = str(caught.value)
    assert message.startswith(f"{folder / 'room.toml'}: ")
    assert "\n" not in message
    return message


def test_every_key_arrives(tmp_path: Path) -> None:
    result = read(tmp_path, WHOLE)
    assert result.name == "room"
    first, second = result.models
    assert (first.path, first.scale, first.translate) == (tmp_path / "sub/box.obj", 2.0, (1.0, 2.5, 3.0))
    assert first.motion is not None
    assert first.motion.rotations[1] == pytest.approx((0, 0.6, 0, 0.8))
    assert (second.path, second.scale, second.motion) == (tmp_path / "other.glb", 1.0, None)
    assert result.camera is not None
    assert (result.camera.position, result.camera.fov) == ((0.0, 1.0, 5.0), 50.0)
    assert result.camera.motion is not None
    assert result.camera.motion.times == (0.0, 1.0, 2.0)
    (light,) = result.lights
    assert isinstance(light, Spotlight)
    assert (light.emission, light.radius) == ((10.0, 9.5, 8.0), 0.1)
    assert light.motion == LissajousMotion((9.0, 1.0, 2.5), (0.6, 0.5))
    render = result.render
    assert (render.graph, render.size) == (str(tmp_path / "graphs/own.toml"), (640, 480))
    assert (render.vpls, render.seed) == (128, 7)
    assert render.set == {"tonemap.exposure": 1.0, "shadow_maps.projection": "cube"}


def test_defaults(tmp_path: Path) -> None:
    result = read(tmp_path, MODEL + CAMERA + SPOTLIGHT)
    assert result.name == "room"  # the file's
    assert result.camera is not None
    assert (result.camera.up, result.camera.fov, result.camera.motion) == ((0.0, 1.0, 0.0), 60.0, None)
    (light,) = result.lights
    assert isinstance(light, Spotlight)
    assert (light.fov, light.radius) == (80.0, 0.0)
    assert result.render.size is None


def test_camera_and_spotlight_may_be_missing(tmp_path: Path) -> None:
    result = read(tmp_path, MODEL)
    assert result.camera is None
    assert result.lights == ()


def test_keyframed_spotlight(tmp_path: Path) -> None:
    motion = "[spotlight.motion]\nkind = 'keyframes'\ntimes = [0, 1]\n"
    motion += "positions = [[0, 4, 0], [1, 4, 0]]\nlook_ats = [[0, 0, 0], [1, 0, 0]]\n"
    result = read(tmp_path, MODEL + SPOTLIGHT + motion)
    (light,) = result.lights
    assert isinstance(light, Spotlight)
    assert isinstance(light.motion, KeyframedLight)
    assert light.at(1.0).position == pytest.approx((1, 4, 0))


def test_a_graph_by_name_stays_a_name(tmp_path: Path) -> None:
    assert read(tmp_path, MODEL + '[render]\ngraph = "forward"\n').render.graph == "forward"


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"room\.toml: cannot be read: No such file"):
        scene_file.read(tmp_path / "room.toml")


@pytest.mark.parametrize("content", [b"[camera", b"\xff\xfe\x00", b"a = " + b"[" * 5000])
def test_not_toml(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "room.toml"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=r"room\.toml: not a TOML file"):
        scene_file.read(path)


CASES = {
    "unknown table": ("[camra]", "camra: unknown key; did you mean 'camera'?"),
    "unknown key": (CAMERA + "fow = 60", "camera.fow: unknown key; did you mean 'fov'?"),
    "unknown key with a line break": ('"a\\nb" = 1', "a b: unknown key"),
    "unknown key of a model": (
        MODEL + "size = 2",
        "model[1].size: unknown key; known: lights, motion, path, scale, translate",
    ),
    "no path": ("[[model]]", "model[1].path: missing; give the model's file"),
    "path of a wrong type": ("[[model]]\npath = 3", "model[1].path: must be a string"),
    "name of a wrong type": ("name = 3", 'name: must be a string such as "name", not 3'),
    "scale 0": (MODEL + "scale = 0", "model[1].scale: must be above 0, not 0.0"),
    "negative scale": (MODEL + "scale = -1", "model[1].scale: must be above 0"),
    "infinite scale": (MODEL + "scale = inf", "model[1].scale: must be finite, not inf"),
    "camera as a number": ("camera = 3", "camera: must be a table, not 3"),
    "no look_at": ("[camera]\nposition = [0, 0, 0]", "camera.look_at: missing; give 3 numbers such as [0.0, 0.0, 0.0]"),
    "position of a wrong type": ("[camera]\nposition = 'here'", "camera.position: must be 3 numbers such as"),
    "two numbers": ("[camera]\nposition = [0, 1]", "camera.position: must be 3 numbers such as [0.0, 0.0, 0.0]"),
    "text in numbers": ("[camera]\nposition = [0, '1', 2]", "camera.position: must be a number, not '1'"),
    "true is no number": ("[camera]\nposition = [0, true, 2]", "camera.position: must be a number, not True"),
    "NaN": ("[camera]\nposition = [0, nan, 2]", "camera.position: must be finite, not nan"),
    "too large": ("[camera]\nposition = [0, 1e30, 2]", "camera.position: 1e+30 is too large for 32-bit floats"),
    "huge integer": ("[spotlight]\nradius = 0x1" + "0" * 4000, "spotlight.radius: a number of too many digits"),
    "fov 0": (CAMERA + "fov = 0", "camera.fov: must lie between 0 and 180 degrees, not 0.0"),
    "fov 180": (CAMERA + "fov = 180", "camera.fov: must lie between 0 and 180 degrees, not 180.0"),
    "negative fov": (SPOTLIGHT + "fov = -10", "spotlight.fov: must lie between 0 and 180 degrees"),
    "camera looks at itself": (
        "[camera]\nposition = [3, 1, 2]\nlook_at = [3, 1, 2]",
        "camera.look_at: is the same point as the position",
    ),
    "light looks at itself": (
        SPOTLIGHT.replace("[0, 0, 0]", "[0, 4, 0]"),
        "spotlight.look_at: is the same point as the position",
    ),
    "up along the view": (CAMERA + "up = [0, 0, -2]", "camera.up: up lies along the direction of view"),
    "up is zero": (CAMERA + "up = [0, 0, 0]", "camera.up: must not be zero"),
    "negative emission": (SPOTLIGHT.replace("2", "-2"), "spotlight.emission: must be 0 or more, not [1.0, -2.0, 3.0]"),
    "no emission": ("[spotlight]\nposition = [0, 4, 0]\nlook_at = [0, 0, 0]", "spotlight.emission: missing"),
    "negative radius": (SPOTLIGHT + "radius = -1", "spotlight.radius: must be 0 or more"),
    "times descend": (
        CAMERA + "[camera.motion]\ntimes = [1, 1]\npositions = [[0,0,0],[0,0,0]]\nlook_ats = [[1,0,0],[1,0,0]]",
        "camera.motion.times: must be ascending",
    ),
    "no times": (
        CAMERA + "[camera.motion]\npositions = []\nlook_ats = []",
        "camera.motion.times: missing; give seconds such as [0, 2]",
    ),
    "empty times": (CAMERA + "[camera.motion]\ntimes = []\npositions = []\nlook_ats = []", "camera.motion.times: must"),
    "lengths differ": (
        CAMERA + "[camera.motion]\ntimes = [0, 1]\npositions = [[0,0,0]]\nlook_ats = [[1,0,0],[1,0,0]]",
        "camera.motion.positions: has 1 entries but times has 2; give one for each time",
    ),
    "keyframe looks at itself": (
        CAMERA + "[camera.motion]\ntimes = [0]\npositions = [[1,0,0]]\nlook_ats = [[1,0,0]]",
        "camera.motion.look_ats[0]: is the same point as the position",
    ),
    "keyframe of two numbers": (
        CAMERA + "[camera.motion]\ntimes = [0]\npositions = [[1,0]]\nlook_ats = [[1,0,0]]",
        "camera.motion.positions[0]: must be 3 numbers",
    ),
    "unknown motion": (
        SPOTLIGHT + "[spotlight.motion]\nkind = 'lissajus'",
        "spotlight.motion.kind: unknown motion 'lissajus'; did you mean 'lissajous'?",
    ),
    "motion without a kind": (
        SPOTLIGHT + "[spotlight.motion]\nspeed = [1, 1]",
        "spotlight.motion.kind: missing; give one of lissajous, keyframes",
    ),
    "no rotations": (
        MODEL + "[model.motion]\ntimes = [0]\ntranslations = [[0,0,0]]",
        "model[1].motion.rotations: missing; give one for each time, such as [0, 0, 0, 1]",
    ),
    "rotation of three": (
        MODEL + "[model.motion]\ntimes = [0]\ntranslations = [[0,0,0]]\nrotations = [[0,0,0]]",
        "model[1].motion.rotations[0]: must be 4 numbers such as [0, 0, 0, 1], not",
    ),
    "time without an end": (
        MODEL + "[model.motion]\ntimes = [0, inf]\ntranslations = [[0,0,0]]\nrotations = [[0,0,0,1]]",
        "model[1].motion.times: must be finite, not inf",
    ),
    "key of the other kind": (
        SPOTLIGHT + "[spotlight.motion]\nkind = 'lissajous'\namplitude = [1,1,1]\nspeed = [1,1]\ntimes = [0]",
        'spotlight.motion.times: does not belong to kind = "lissajous"',
    ),
    "speed of three": (
        SPOTLIGHT + "[spotlight.motion]\nkind = 'lissajous'\namplitude = [1,1,1]\nspeed = [1,1,1]",
        "spotlight.motion.speed: must be 2 numbers",
    ),
    "zero quaternion": (
        MODEL + "[model.motion]\ntimes = [0]\ntranslations = [[0,0,0]]\nrotations = [[0,0,0,0]]",
        "model[1].motion.rotations[0]: a quaternion of zeros is no rotation",
    ),
    "size 0": ("[render]\nsize = '0x512'", "render.size: must be"),
    "size as text": ("[render]\nsize = 'big'", "render.size: must be"),
    "size of a float": ("[render]\nsize = [512, 512.5]", "render.size: must be"),
    "size as a number": ("[render]\nsize = 512", "render.size: must be"),
    "negative vpls": ("[render]\nvpls = -1", "render.vpls: must be an integer of 0 or more, not -1"),
    "vpls as a float": ("[render]\nvpls = 64.5", "render.vpls: must be an integer of 0 or more"),
    "seed of a wrong type": ("[render]\nseed = 'x'", "render.seed: must be an integer of 0 or more"),
    "graph of a wrong type": ("[render]\ngraph = 3", "render.graph: must be a string"),
    "set without quotes": (
        "[render]\nset.tonemap.exposure = 1.0",
        "render.set.tonemap: write pass and parameter as one",
    ),
    "set without a pass": ("[render]\nset = {exposure = 1.0}", "render.set.'exposure': must name pass and parameter"),
    "set to an array": ("[render]\nset = {'tonemap.exposure' = [1]}", "render.set.tonemap.exposure: must be a string"),
    "set of a wrong type": ("[render]\nset = 3", "render.set: must be a table"),
}


@pytest.mark.parametrize(("text", "expected"), CASES.values(), ids=CASES.keys())
def test_each_fault_names_its_key_and_the_mend(tmp_path: Path, text: str, expected: str) -> None:
    # A second model follows the first; everything else, top-level keys included, comes before it.
    assert expected in fault(tmp_path, MODEL + text if text.startswith("[[model]]") else f"{text}\n{MODEL}")


def test_a_model_as_a_plain_table(tmp_path: Path) -> None:
    message = fault(tmp_path, '[model]\npath = "box.obj"\n')
    assert 'model: must be an array of tables; write [[model]] and, below it, path = "FILE"' in message


@pytest.mark.parametrize("text", ["", "model = []", "model = [3]"])
def test_no_model(tmp_path: Path, text: str) -> None:
    assert "write [[model]]" in fault(tmp_path, text)


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    message = fault(tmp_path, MODEL + CAMERA + "fov = 200\n" + SPOTLIGHT + "radius = -1\n[render]\nvpls = -1\n")
    assert "camera.fov: " in message
    assert "; spotlight.radius: " in message
    assert "; render.vpls: " in message


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e3, 1e12])
def test_the_view_is_checked_at_any_scale(tmp_path: Path, scale: float) -> None:
    def camera(up: str) -> str:
        position, look_at = [0, scale, 5 * scale], [0, scale, 0]
        return f"{MODEL}[camera]\nposition = {position}\nlook_at = {look_at}\nup = {up}\n"

    assert read(tmp_path, camera(f"[0, {scale}, 0]")).camera is not None
    assert "camera.up" in fault(tmp_path, camera(f"[0, 0, {scale}]"))


WORDS = (
    "name model path scale translate motion times translations rotations camera position look_at up fov positions "
    "look_ats spotlight emission radius kind amplitude speed render graph size vpls seed set x.y"
)
KEYS = st.sampled_from(sorted(WORDS.split()))
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cs"], max_codepoint=0xFFFF), max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=12,
)
TRIPLES = st.lists(st.integers(-2, 2) | st.floats(), min_size=3, max_size=3)
TABLES = st.dictionaries(KEYS, VALUES | TRIPLES, max_size=6)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.fixed_dictionaries(
        {"model": st.lists(TABLES, max_size=2) | VALUES},
        optional={"camera": TABLES, "spotlight": TABLES, "render": TABLES, "name": VALUES},
    )
)
@pytest.mark.slow
def test_any_tables_give_a_scene_or_one_line(tmp_path: Path, data: dict[str, object]) -> None:
    text = "\n".join(f"{key} = {to_toml(value)}" for key, value in data.items())
    try:
        read(tmp_path, text)
    except SceneError as error:
        message = str(error)
    else:
        message = "read"
    assert len(message.splitlines()) == 1
