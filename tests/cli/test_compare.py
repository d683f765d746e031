"""`deferred-ir compare`: its table, its files, and what it refuses."""

import json
import sys

import numpy as np
import pytest
from PIL import Image

from deferred_ir.cli.main import main
from deferred_ir.output import image as images

METADATA = {"scene": "cornell", "scene_hash": "0123456789abcdef", "size": [32, 24]}


@pytest.fixture
def pair(tmp_path):
    """Paths of an image and of its reference, as arrays and without metadata."""
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
    assert rows == ["relMSE (trimmed)", "relMSE (whole)", "reference noise", "RMSE", "bias", "FLIP"]
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
    "metadata", ["{", '{"scene_hash": 3}', '{"scene_hash": "x", "size": [1, 1]}', '{"scene_hash": "x", "size": null}']
)
def test_metadata_that_do_not_fit_are_one_line(pair, tmp_path, capsys, metadata):
    (tmp_path / "b.json").write_text(metadata)
    assert "b.json" in fault(capsys, *pair)


def test_arrays_that_are_no_images_are_one_line(pair, tmp_path, capsys):
    whole = (tmp_path / "a.npy").read_bytes()
    for content, words in (
        (whole[:-9], "no array that can be read"),
        (whole.replace(b"(24, 32, 3)", b"(999, 99, 3)"), "no array that can be read"),
    ):
        (tmp_path / "a.npy").write_bytes(content)
        assert words in fault(capsys, *pair)
    for array, words in (
        (np.ones((24, 32), np.float32), "has the shape"),
        (np.ones((24, 32, 4), np.float32), "has the shape"),
        (np.ones((24, 32, 3), np.uint8), "holds uint8"),
        (np.ones((24, 32, 3), complex), "holds complex128"),
        (np.array([[None]]), "no array that can be read"),
    ):
        np.save(tmp_path / "a.npy", array, allow_pickle=True)
        assert words in fault(capsys, *pair)
    with (tmp_path / "a.npy").open("wb") as file:
        np.savez(file, image=np.ones((24, 32, 3)))
    assert "no array that can be read" in fault(capsys, *pair)


def test_a_broken_exr_is_one_line_though_its_library_has_more_to_say(pair, tmp_path, capfd):
    images.Image(np.load(pair[0]), None).save(tmp_path / "a.exr")
    whole = (tmp_path / "a.exr").read_bytes()
    for size in (0, 60, len(whole) - 10):
        (tmp_path / "a.exr").write_bytes(whole[:size])
        assert main(["compare", str(tmp_path / "a.exr"), pair[1]]) == 2
        output = capfd.readouterr()
        assert output.out == ""
        assert len(output.err.splitlines()) == 1, output.err
        assert "no OpenEXR image" in output.err


def test_an_exr_needs_three_channels_of_floats_and_may_have_more(pair, tmp_path, capsys):
    import OpenEXR

    def write(channels):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, channels) as file:
            file.write(str(tmp_path / "a.exr"))

    image = np.load(pair[0])
    write({"Z": image[..., 0].copy()})
    assert "has no channel 'R'" in fault(capsys, str(tmp_path / "a.exr"), pair[1])
    write({"RGB": image.astype(np.uint32)})
    assert "holds uint32" in fault(capsys, str(tmp_path / "a.exr"), pair[1])
    write({"RGBA": np.concatenate([image, image[..., :1]], -1), "Z": image[..., 0].copy()})
    assert main(["compare", str(tmp_path / "a.exr"), pair[0]]) == 0


@pytest.mark.parametrize("name", ["x" * 300 + ".npy", "loop.npy", "folder.npy"])
def test_names_that_are_no_files_are_one_line(pair, tmp_path, capsys, name):
    (tmp_path / "loop.npy").symlink_to(tmp_path / "loop.npy")
    (tmp_path / "folder.npy").mkdir()
    words = "is no file" if name == "folder.npy" else "is missing"
    assert words in fault(capsys, str(tmp_path / name), pair[1])


@pytest.mark.parametrize("fraction", ["-0.1", "1.5", "NaN", "true", '"half"', "[]"])
def test_a_share_of_hits_that_cannot_be_is_one_line(pair, tmp_path, capsys, fraction):
    text = json.dumps(METADATA)[:-1] + f', "hit_fraction": {fraction}}}'
    (tmp_path / "b.json").write_text(text)
    assert "b.json: hit_fraction: " in fault(capsys, *pair)


def test_another_json_of_the_same_name_are_no_metadata(pair, tmp_path, capsys):
    (tmp_path / "b.json").write_text('{"some": "thing"}')
    assert main(["compare", *pair]) == 0
    assert "no metadata in b.json" in capsys.readouterr().err


def test_what_the_counted_pixels_rest_on_is_told(pair, tmp_path, capsys):
    arrays = [np.load(path) for path in pair]
    for path, array in zip(pair, arrays, strict=True):
        array[:12] = 0
        np.save(path, array)
    assert main(["compare", *pair]) == 0
    assert "384 pixels, black in both images, are taken for background" in capsys.readouterr().err
    for name in "ab":
        (tmp_path / f"{name}.json").write_text(json.dumps(METADATA | {"hit_fraction": 0.5}))
    assert main(["compare", *pair]) == 0
    assert capsys.readouterr().err == ""
    arrays[0][11] = 1
    np.save(pair[0], arrays[0])
    assert main(["compare", *pair]) == 0
    assert "is lit in 32 pixels more than the reference's camera rays hit" in capsys.readouterr().err


def test_without_flip_the_line_says_why(pair, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert main(["compare", *pair]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith("FLIP")
    assert line.endswith("pip install 'deferred-ir[report]'")


def test_the_noise_of_the_reference_is_told_and_no_error_below_it_is_quoted(pair, tmp_path, capsys):
    """The image is a tenth darker everywhere, so the relMSE is a little below 0.01."""
    figures = {}
    for noise in (0.0002, 0.002, 0.008, None):
        (tmp_path / "b.json").write_text(json.dumps(METADATA | {"noise": noise, "spp": 64}))
        assert main(["compare", *pair, "--json", str(tmp_path / "f.json")]) == 0
        lines = capsys.readouterr().out.splitlines()
        figures[noise] = [" ".join(line.split()) for line in lines[:3]], json.loads((tmp_path / "f.json").read_text())
    told = {noise: json_file["flagged"] for noise, (_, json_file) in figures.items()}
    assert told == {0.0002: "", 0.002: "reference_noise", 0.008: "below_noise", None: "reference_noise"}
    how = "from the spread of its 64 paths a pixel"
    assert figures[0.0002][1]["reference_noise"] == {"relmse": 0.0002, "how": how}
    relmse = figures[0.0002][1]["relmse"]
    assert figures[0.0002][0][0].startswith(f"relMSE (trimmed) {relmse:.4g} without")
    assert figures[0.0002][0][2] == f"reference noise 0.0002 its own relMSE, {how}"
    assert figures[0.002][0][0].endswith(f"{0.002 / relmse:.0%} of it is the reference's noise")
    assert figures[0.008][0][0].startswith("relMSE (trimmed) < 0.008 ")
    assert f"{relmse:.4g} was measured, most of it the reference's noise" in figures[0.008][0][0]
    assert figures[0.008][1]["relmse"] == relmse
    assert figures[None][0][2].startswith("reference noise - unknown")


@pytest.mark.parametrize("width", [1, 32, 300])
def test_the_picture_shows_sign_and_size_above_a_legend(tmp_path, capsys, width):
    reference = np.ones((6, width, 3))
    image = np.repeat([0.0, 0.8, 1.0, 1.2, 2.0, 50.0], width).reshape(6, width, 1) * reference
    np.save(tmp_path / "a.npy", image)
    np.save(tmp_path / "b.npy", reference)
    paths = [str(tmp_path / name) for name in ("a.npy", "b.npy", "d.png")]
    assert main(["compare", *paths[:2], "--diff", paths[2]]) == 0
    with Image.open(paths[2]) as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    missing, little, same, more, double, far = pixels[:6, width // 2]
    assert missing[2] - missing[0] > little[2] - little[0] > 0
    assert same.min() == same.max() > 240
    assert double[0] - double[2] > more[0] - more[2] > 0
    assert (far - double)[0] == pytest.approx(0, abs=2)
    legend = pixels[6:]
    assert legend.shape[1] >= width
    assert (legend[10, 8] == [33, 64, 154]).all()
    assert (legend[10, -9] == [165, 15, 38]).all()
    assert legend[18:].max(-1).min() < 100  # its words


def test_the_picture_appears_whole_or_not_at_all(pair, tmp_path, capsys, monkeypatch):
    def break_off(self, path, **options):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(Image.Image, "save", break_off)
    assert "d.png: cannot be written: No space left on device" in fault(
        capsys, *pair, "--diff", str(tmp_path / "d.png")
    )
    assert sorted(tmp_path.iterdir()) == before


def test_outputs_are_checked_before_the_work_and_never_take_an_inputs_place(pair, tmp_path, capsys):
    assert "no_folder" in fault(capsys, *pair, "--json", str(tmp_path / "no_folder" / "f.json"))
    assert ".png" in fault(capsys, *pair, "--diff", str(tmp_path / "d.jpg"))
    assert "choose another name" in fault(capsys, *pair, "--json", str(tmp_path / "b.json"))
