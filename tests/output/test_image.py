"""Images and the files they become: whole or not at all, and what they hold."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import pytest

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import write_whole
from deferred_ir.output.find_format import check_path, find_format, list_suffixes
from deferred_ir.output.image import Image

RNG = np.random.default_rng(0)
RADIANCE = (RNG.random((5, 7, 3)) * 10.0 ** RNG.integers(-6, 6, (5, 7, 3))).astype(np.float32)
DISPLAY = RNG.integers(0, 256, (5, 7, 3)).astype(np.uint8)
IMAGE = Image(RADIANCE, DISPLAY)


def read_exr(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path)) as file:
        return file.channels()["RGB"].pixels


READERS = {".png": lambda path: np.asarray(PIL.Image.open(path)), ".npy": np.load, ".exr": read_exr}
EXPECTED = {".png": DISPLAY, ".npy": RADIANCE, ".exr": RADIANCE}


@pytest.mark.parametrize("suffix", READERS)
def test_what_is_saved_is_read_back_exactly(tmp_path, suffix):
    path = tmp_path / f"image{suffix}"
    IMAGE.save(path)
    found = READERS[suffix](path)
    assert found.dtype == EXPECTED[suffix].dtype
    np.testing.assert_array_equal(found, EXPECTED[suffix])
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize("suffix", list_suffixes())
def test_every_format_reads_what_it_writes(tmp_path, suffix):
    path = tmp_path / f"image{suffix.upper()}"
    IMAGE.save(path)
    found = find_format(path)
    np.testing.assert_array_equal(found.read(path), getattr(IMAGE, found.LAYER))


def test_every_format_says_what_it_holds():
    assert set(list_suffixes()) == set(READERS)
    assert list_suffixes("display") == [".png"]
    assert list_suffixes("radiance") == [".exr", ".npy"]


def test_exr_is_32_bit_float(tmp_path):
    IMAGE.save(tmp_path / "image.exr")
    with OpenEXR.File(str(tmp_path / "image.exr"), separate_channels=True) as file:
        assert {name: channel.pixels.dtype for name, channel in file.channels().items()} == dict.fromkeys(
            "RGB", np.dtype("f4")
        )


def test_npy_needs_no_pickle_and_is_contiguous(tmp_path):
    strided = Image(RADIANCE[::-1, :, ::-1], DISPLAY)
    for suffix in (".npy", ".exr"):
        strided.save(tmp_path / f"image{suffix}")
        np.testing.assert_array_equal(READERS[suffix](tmp_path / f"image{suffix}"), RADIANCE[::-1, :, ::-1])


@pytest.mark.parametrize("name", ["IMAGE.PNG", "a b.Exr", "a.b.npy", "grün.png"])
def test_names_of_all_kinds(tmp_path, name):
    IMAGE.save(str(tmp_path / name))
    assert os.listdir(tmp_path) == [name]


def test_a_file_that_is_there_is_replaced(tmp_path):
    path = tmp_path / "image.npy"
    path.write_text("before")
    IMAGE.save(path)
    np.testing.assert_array_equal(np.load(path), RADIANCE)


# Faults


def fault(path: Path, image: Image = IMAGE) -> str:
    with pytest.raises(OutputError) as raised:
        image.save(path)
    message = str(raised.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("image.jpg", "unknown kind of image '.jpg'"),
        ("image.pnj", "did you mean '.png'?"),
        ("image", f"unknown kind of image ''; known: {', '.join(list_suffixes())}"),
        ("image.png.bak", "unknown kind of image '.bak'"),
        ("none/image.png", "create it first"),
        ("folder.png", "is a folder; name a file in it"),
        ("file.txt/image.png", "there is no folder"),
    ],
)
def test_a_path_that_cannot_be_one_line_with_the_mend(tmp_path, name, message):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file.txt").write_text("")
    path = tmp_path / name
    told = fault(path)
    assert told.startswith(f"{path}: ")
    assert message in told
    with pytest.raises(OutputError):
        check_path(path)
    assert sorted(os.listdir(tmp_path)) == ["file.txt", "folder.png"]


def test_a_path_that_can_be_written_is_fine_before_there_is_an_image(tmp_path, monkeypatch):
    check_path(tmp_path / "image.exr")
    monkeypatch.chdir(tmp_path)
    check_path("image.png")
    assert not os.listdir(tmp_path)


def test_a_folder_without_write_permission_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "not writable" in fault(tmp_path / "image.png")


@pytest.mark.parametrize("suffix", READERS)
def test_what_the_graph_did_not_make_cannot_be_saved(tmp_path, suffix):
    path = tmp_path / f"image{suffix}"
    path.write_text("before")
    told = fault(path, Image(None, None))
    assert told.startswith(f"{path}: this graph has no output '{'display' if suffix == '.png' else 'radiance'}'")
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == [path.name]


# Whole or not at all


@pytest.mark.parametrize("existing", [True, False])
@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), ValueError("bad pixels"), KeyboardInterrupt()]
)
def test_a_writer_that_fails_leaves_nothing_and_what_was_there(tmp_path, existing, error):
    path = tmp_path / "image.png"
    if existing:
        path.write_text("before")

    def write(part: Path) -> None:
        part.write_text("half")
        raise error

    with pytest.raises(OutputError if isinstance(error, OSError) else type(error)) as raised:
        write_whole(path, write)
    assert os.listdir(tmp_path) == ([path.name] if existing else [])
    if existing:
        assert path.read_text() == "before"
    if isinstance(error, OSError):
        assert str(raised.value) == f"{path}: cannot be written: No space left on device"


def test_the_file_is_not_seen_before_it_is_whole(tmp_path):
    path = tmp_path / "image.png"
    path.write_text("before")

    def write(part: Path) -> None:
        part.write_text("half")
        assert path.read_text() == "before"
        assert part.parent == path.parent  # or it could not be renamed at once
        part.write_text("whole")

    write_whole(path, write)
    assert path.read_text() == "whole"


def test_a_file_that_cannot_be_put_in_place_is_one_line(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "replace", refuse)
    assert "cannot be written: Permission denied" in fault(tmp_path / "image.png")
    assert not os.listdir(tmp_path)


def test_openexrs_own_errors_are_one_line_too(tmp_path, monkeypatch):
    class Refuses(OpenEXR.File):
        def write(self, name):
            raise RuntimeError("Cannot open image file. No space left on device.")

    monkeypatch.setattr(OpenEXR, "File", Refuses)
    assert fault(tmp_path / "image.exr").endswith("cannot be written: Cannot open image file. No space left on device.")
    assert not os.listdir(tmp_path)
