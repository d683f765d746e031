"""A scene file that tests of commands can break."""

import pytest

SCENE = """
[[model]]
path = "box.obj"
[camera]
position = [0, 0, 0.9]
look_at = [0, 0, 0]
[spotlight]
position = [0, 0.9, 0]
look_at = [0, -1, 0]
emission = [1, 1, 1]
"""
BOX = """
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
f 1 2 3 4
f 5 6 7 8
f 1 2 6 5
f 4 3 7 8
f 1 4 8 5
f 2 3 7 6
"""


@pytest.fixture
def box(tmp_path):
    """A scene file; call it with replacements of its text to break it."""
    (tmp_path / "box.obj").write_text(BOX)

    def write(*replacements, obj=BOX, extra=""):
        text = SCENE
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "box.obj").write_text(obj)
        (tmp_path / "scene.toml").write_text(text + extra)
        return str(tmp_path / "scene.toml")

    return write
