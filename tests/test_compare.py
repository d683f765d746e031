"""`deferred-ir compare`: its table, its files, and what it refuses."""

import json

import numpy as np
import pytest
from PIL import Image

from deferred_ir import image as images
from deferred_ir.cli import main


@pytest.fixture
def pair(tmp_path):
    """Paths of an image and of its reference, as arrays and without records."""
    rng = np.random.default_rng(0)
    reference = rng.gamma(1.0, 1.0, (24, 32, 3)).astype(np.float32)
    np.save(tmp_path / "b.npy", reference)
    np.save(tmp_path / "a.npy", reference * 0.9)
    return str(tmp_path / "a.npy"), str(tmp_path / "b.npy")


def fault(capsys, *arguments):
    """The one line of a command that fails."""
    assert main(["compare", *arguments]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("note: ")]
    assert len(lines) == 1, lines
    return lines[0]


def test_the_table_the_json_and_the_picture(pair, tmp_path, capsys):
    assert main(["compare", *pair, "--json", str(tmp_path / "f.json"), "--diff", str(tmp_path / "d.png")]) == 0
    output = capsys.readouterr()
    rows = [line.split("  ")[0] for line in output.out.splitlines()]
    assert rows == ["relMSE (trimmed)", "relMSE (whole)", "RMSE", "bias", "FLIP"]
    assert "-10.000 %" in output.out
    assert "not checked" in output.err  # bare arrays are taken, with a note
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["bias"] == pytest.approx(-0.1, abs=1e-6)
    assert figures["flip"] > 0
    with Image.open(tmp_path / "d.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    assert (pixels[:24, :32, 2] > pixels[:24, :32, 0]).mean() > 0.9  # too dark is blue


def test_exr_and_npy_are_the_same_image(pair, tmp_path, capsys):
    images.Image(np.load(pair[0]), None).save(tmp_path / "a.exr")
    assert main(["compare", str(tmp_path / "a.exr"), pair[0]]) == 0
    assert "relMSE (whole)           0" in capsys.readouterr().out


def test_a_reference_tells_its_scene_and_its_hits(tmp_path, capsys):
    reference, image = str(tmp_path / "r.npy"), str(tmp_path / "i.npy")
    small = ["--size", "32x32"]
    assert main(["reference", "cornell", *small, "--spp", "16", "-o", reference]) == 0
    run = ["--json", str(tmp_path / "i.json"), "--device", "software", "--vpls", "16"]
    assert main(["render", "cornell", *small, *run, "-o", image]) == 0
    assert main(["compare", image, reference, "--json", str(tmp_path / "f.json")]) == 0
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["pixels_by"] == "hit fraction"
    assert figures["pixels"] == round(json.loads((tmp_path / "r.json").read_text())["hit_fraction"] * 1024)
    assert "not checked" not in capsys.readouterr().err
    assert main(["render", "colors", *small, *run, "-o", image]) == 0
    capsys.readouterr()
    line = fault(capsys, image, reference)
    assert "'colors'" in line
    assert "'cornell'" in line


def test_the_wrong_size_is_told_with_the_right_one(pair, tmp_path, capsys):
    np.save(tmp_path / "c.npy", np.ones((8, 8, 3), np.float32))
    assert "--size 32x24" in fault(capsys, str(tmp_path / "c.npy"), pair[1])


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("which", [0, 1])
def test_what_is_not_finite_is_refused(pair, tmp_path, capsys, value, which):
    broken = np.load(pair[which])
    broken[2, 3, 1] = value
    np.save(pair[which], broken)
    line = fault(capsys, *pair, "--json", str(tmp_path / "f.json"))
    assert pair[which] in line
    assert "1 of 768 pixels are not finite, first x = 3, y = 2" in line
    assert not (tmp_path / "f.json").exists()


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (("a.npy", b""), "no array that can be read"),
        (("a.npy", b"\x93NUMPY\x01\x00 broken"), "no array that can be read"),
        (("a.exr", b"not an image"), "no OpenEXR image"),
        (("a.png", b""), "tone-mapped"),
        (("a.jpg", b""), "unknown kind"),
        (("missing.npy", None), "is missing"),
    ],
)
def test_what_is_no_image_is_one_line(pair, tmp_path, capsys, file, words):
    name, content = file
    if content is not None:
        (tmp_path / name).write_bytes(content)
    line = fault(capsys, str(tmp_path / name), pair[1])
    assert name in line
    assert words in line


@pytest.mark.parametrize(
    "record", ["{", '{"scene_hash": 3}', '{"scene_hash": "x", "size": [1, 1]}', '{"scene_hash": "x", "size": null}']
)
def test_a_record_that_does_not_fit_is_one_line(pair, tmp_path, capsys, record):
    (tmp_path / "b.json").write_text(record)
    assert "b.json" in fault(capsys, *pair)


def test_outputs_are_checked_before_the_work_and_never_take_an_inputs_place(pair, tmp_path, capsys):
    assert "no_folder" in fault(capsys, *pair, "--json", str(tmp_path / "no_folder" / "f.json"))
    assert ".png" in fault(capsys, *pair, "--diff", str(tmp_path / "d.jpg"))
    assert "choose another name" in fault(capsys, *pair, "--json", str(tmp_path / "b.json"))
