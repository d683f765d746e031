"""Lights that cannot be used: one line that names file, key and mend, in files, in Python and on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from deferred_ir import SceneError
from deferred_ir.cli.main import main
from deferred_ir.loading import light_tables, scene_file
from deferred_ir.scene import environment_image
from deferred_ir.scene.environment_image import EnvironmentImage, read_image
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot

MODEL = '[[model]]\npath = "box.obj"\n'
BOX = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
PLACE = "position = [0, 1, 0]\n"
AIM = PLACE + "look_at = [0, 0, 0]\n"
SHINE = "intensity = [1, 1, 1]\n"
RADIANCE = "radiance = [1, 1, 1]\n"
SIZE = "size = [1, 1]\nup = [1, 0, 0]\n"
FALLING = "[light.motion]\nkind = 'keyframes'\ntimes = [0, 1]\npositions = [[0, 1, 0], [0, 2, 0]]\n"


def light(kind: str, *lines: str) -> str:
    return f'[[light]]\nkind = "{kind}"\n' + "".join(line if line.endswith("\n") else f"{line}\n" for line in lines)


CASES = {
    "no kind": ("[[light]]\n" + PLACE, "light.kind: missing; give one of "),
    "unknown kind": (light("pointt", PLACE), "light.kind: unknown kind of light 'pointt'; did you mean 'point'?"),
    "kind of a wrong type": ("[[light]]\nkind = 3", "light.kind: unknown kind of light 3; known: directional, disc"),
    "kind as a list": ("[[light]]\nkind = []", "light.kind: unknown kind of light []; known: directional, disc"),
    "a plain table": ('[light]\nkind = "point"', "light: must be an array of tables; write [[light]] and, below it"),
    "the second of two": (light("point", PLACE, SHINE) + light("disk"), "light[1].kind: unknown kind of light 'disk'"),
    "point without a place": (light("point", SHINE), "light.position: missing; give 3 numbers such as"),
    "point without light": (light("point", PLACE), "light.intensity: missing; give 3 numbers such as"),
    "key of another kind": (light("point", PLACE, SHINE, RADIANCE), "light.radiance: unknown key; known: "),
    "misspelt key": (light("point", PLACE, SHINE, "radios = 1"), "light.radios: unknown key; did you mean 'radius'?"),
    "spot without an aim": (light("spot", PLACE, SHINE, "fov = 40"), "light.look_at: missing; give 3 numbers"),
    "directional in W/sr": (light("directional", AIM, SHINE), "light.intensity: unknown key; known: "),
    "rect without a size": (light("rect", AIM, RADIANCE), "light.size: missing; give 2 numbers such as"),
    "disc without a radius": (light("disc", AIM, RADIANCE), "light.radius: missing; give a number"),
    "negative intensity": (light("point", PLACE, "intensity = [1, -1, 1]"), "light.intensity: must be 0 or more, not"),
    "infinite intensity": (light("point", PLACE, "intensity = [1, inf, 1]"), "light.intensity: must be finite, not"),
    "NaN intensity": (light("spot", AIM, "intensity = [nan, 1, 1]"), "light.intensity: must be finite, not nan"),
    "huge irradiance": (light("directional", AIM, "irradiance = [1e300, 1, 1]"), "light.irradiance: 1e+300 is too la"),
    "negative radiance": (
        light("sphere", PLACE, "radius = 1", "radiance = [-1, 1, 1]"),
        "light.radiance: must be 0 or",
    ),
    "rect of no width": (light("rect", AIM, RADIANCE, "size = [0, 1]"), "light.size: must be above 0 both ways, not"),
    "disc of no width": (light("disc", AIM, RADIANCE, "radius = 0"), "light.radius: must be above 0, not 0.0"),
    "sphere of no width": (light("sphere", PLACE, RADIANCE, "radius = 0"), "light.radius: must be above 0, not 0.0"),
    "negative radius": (light("point", PLACE, SHINE, "radius = -1"), "light.radius: must be 0 or more, not -1.0"),
    "inner cone outside": (
        light("spot", AIM, SHINE, "fov = 40", "inner_fov = 41"),
        "light.inner_fov: must not be more than fov, 40, but is 41",
    ),
    "spot all around": (light("spot", AIM, SHINE, "fov = 180"), "light.fov: must lie between 0 and 180 degrees"),
    "sun too wide": (
        light("directional", AIM, "irradiance = [1, 1, 1]", "angle = 91"),
        "light.angle: must lie between 0 and 90 degrees",
    ),
    "up along its direction": (
        light("rect", AIM, RADIANCE, "size = [1, 1]", "up = [0, 2, 0]"),
        "light.up: up lies along the direction of view",
    ),
    "looks at itself": (
        light("spot", PLACE, "look_at = [0, 1, 0]", SHINE),
        "light.look_at: is the same point as the position",
    ),
    "sky of nothing": (light("environment"), "light.image: missing; give it, or radiance"),
    "sky of both": (
        light("environment", 'image = "whole.exr"', RADIANCE),
        "light.image: give either image or radiance",
    ),
    "sky turned by NaN": (light("environment", RADIANCE, "rotation = nan"), "light.rotation: must be finite, not nan"),
    "sky scaled below 0": (light("environment", RADIANCE, "scale = -1"), "light.scale: must be 0 or more, not -1.0"),
    "image of a wrong type": (light("environment", "image = 3"), "light.image: must be a string"),
    "image that is missing": (light("environment", 'image = "no.hdr"'), "no.hdr: no such file; give the environment's"),
    "image of another format": (light("environment", 'image = "a.jpg"'), "a.jpg: environment images are .hdr, .exr or"),
    "image that is a folder": (light("environment", 'image = "folder.hdr"'), "folder.hdr: no such file"),
    "image that is empty": (light("environment", 'image = "empty.hdr"'), "empty.hdr: not an image that can be read ("),
    "image that is text": (light("environment", 'image = "text.png"'), "text.png: not an image that can be read ("),
    "image cut short": (light("environment", 'image = "cut.exr"'), "cut.exr: "),
    "png cut short": (light("environment", 'image = "cut.png"'), "cut.png: broken ("),
    "negative image": (light("environment", 'image = "below.exr"'), "below.exr: 1 values are negative; radiance is 0"),
    "image with NaN": (light("environment", 'image = "nan.exr"'), "nan.exr: 2 values are NaN or infinite; export it"),
    "motion of the sky": (light("environment", RADIANCE, FALLING), "light.motion: unknown key"),
    "aim of a moving point": (
        light("point", PLACE, SHINE, FALLING, "look_ats = [[0, 0, 0], [0, 0, 0]]"),
        "light.motion.look_ats: does not belong to a light that shines all around; take it away",
    ),
    "moving disc without aims": (
        light("disc", AIM, RADIANCE, "radius = 1", FALLING),
        "light.motion.look_ats: missing",
    ),
    "too many lights": (
        "[[light]]\n" * 100_000,
        "light: 100000 lights, and 4096 are the most; let surfaces emit instead",
    ),
}


def write_exr(path: Path, pixels: Any) -> None:
    import OpenImageIO

    pixels = np.asarray(pixels, np.float32)
    out = OpenImageIO.ImageOutput.create(str(path))
    out.open(str(path), OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float"))
    out.write_image(pixels)
    out.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model and broken images."""
    made = tmp_path_factory.mktemp("lights")
    (made / "box.obj").write_text(BOX)
    (made / "folder.hdr").mkdir()
    (made / "empty.hdr").write_bytes(b"")
    (made / "a.jpg").write_bytes(b"")
    (made / "text.png").write_text("no image at all")
    pixels = np.ones((32, 64, 3), np.float32)
    write_exr(made / "whole.exr", pixels)
    (made / "cut.exr").write_bytes((made / "whole.exr").read_bytes()[:400])
    noise = np.random.default_rng(1).integers(0, 255, (64, 128, 3), np.uint8)
    Image.fromarray(noise).save(made / "whole.png")
    (made / "cut.png").write_bytes((made / "whole.png").read_bytes()[:8000])
    pixels[3, 4, 1] = -1
    write_exr(made / "below.exr", pixels)
    pixels[3, 4] = (np.nan, 1, np.inf)
    write_exr(made / "nan.exr", pixels)
    return made


@pytest.mark.parametrize(("text", "expected"), CASES.values(), ids=CASES.keys())
def test_each_fault_of_a_light_is_one_line(
    folder: Path, capfd: pytest.CaptureFixture[str], text: str, expected: str
) -> None:
    path = folder / "room.toml"
    path.write_text(MODEL + text)
    with pytest.raises(SceneError) as caught:
        scene_file.read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert expected in message
    assert len(message.splitlines()) == 1
    assert len(message) < 1000
    assert main(["render", str(path), "-o", str(folder / "out.png"), "--device", "software"]) == 2
    said = capfd.readouterr()
    assert said.out == ""
    assert said.err == f"deferred-ir: {message}\n"
    assert not (folder / "out.png").exists()


WRONG = {
    "Point.intensity: must be finite": lambda: Point((0, 0, 0), (np.inf, 0, 0)),
    "Point.position: must be 3 numbers": lambda: Point((0, 0)),  # type: ignore[arg-type]
    "Point.radius: must be a number": lambda: Point((0, 0, 0), radius="1"),  # type: ignore[arg-type]
    "Spot.inner_fov: must not be more": lambda: Spot((0, 0, 0), (0, 1, 0), 30, 31),
    "Spot.look_at: is the same point": lambda: Spot((0, 0, 0), (0, 0, 0)),
    "Directional.irradiance: must be 0": lambda: Directional((0, 1, 0), (0, 0, 0), (-1, 0, 0)),
    "Rect.size: must be above 0": lambda: Rect((0, 1, 0), (0, 0, 0), (1, 0), (1, 0, 0)),
    "Rect.up: ": lambda: Rect((0, 1, 0), (0, 0, 0), (1, 1), (0, -1, 0)),
    "Disc.radius: must be finite": lambda: Disc((0, 1, 0), (0, 0, 0), np.nan),
    "Sphere.radius: must be above 0": lambda: Sphere((0, 1, 0), 0),
    "Environment.image: missing": Environment,
    "Environment.image: give either": lambda: Environment(image=np.ones((2, 4, 3)), radiance=(1, 1, 1)),
    "image: has the shape (2, 4)": lambda: Environment(image=np.ones((2, 4))),
    "image: has the shape (0, 4, 3)": lambda: Environment(image=np.ones((0, 4, 3))),
    "image: 24 values are negative": lambda: Environment(image=-np.ones((2, 4, 3))),
    "image: 24 values are NaN": lambda: Environment(image=np.full((2, 4, 3), np.nan)),
    "no.exr: no such file": lambda: Environment(image="no.exr"),
}


@pytest.mark.parametrize(("expected", "make"), WRONG.items(), ids=WRONG.keys())
def test_constructors_raise_the_same(expected: str, make: Any) -> None:
    with pytest.raises(SceneError) as caught:
        make()
    assert str(caught.value).startswith(expected)
    assert len(str(caught.value).splitlines()) == 1


def test_a_huge_image_is_refused_before_it_is_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment_image, "LARGEST_IMAGE", 32 * 64 - 1)
    with pytest.raises(SceneError, match=r"whole\.exr: 64x32 pixels, and 2047 are the most; scale it down"):
        read_image(folder / "whole.exr")


def test_an_image_of_one_pixel_or_channel_is_fine(folder: Path) -> None:
    assert EnvironmentImage(np.ones((1, 1, 3))).flux == pytest.approx(4 * np.pi)
    Image.fromarray(np.full((2, 4), 255, np.uint8)).save(folder / "grey.png")
    assert read_image(folder / "grey.png").pixels.tolist() == np.ones((2, 4, 3)).tolist()


def test_as_many_lights_as_there_may_be_are_read(tmp_path: Path) -> None:
    path = tmp_path / "room.toml"
    path.write_text(MODEL + light("point", PLACE, SHINE) * light_tables.MOST_LIGHTS)
    assert len(scene_file.read(path).lights) == light_tables.MOST_LIGHTS
