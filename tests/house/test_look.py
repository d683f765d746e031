"""`make look`: the browser is found or named, and its picture is cut to what the page shows."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import look

# Draws a black bar of WIDTH x END into a window of the asked size, as a page would lie there.
BROWSER = """#!{python}
import sys
from PIL import Image
given = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:] if "=" in word)
size = tuple(map(int, given["window-size"].split(",")))
image = Image.new("RGB", size, "white")
image.paste("black", (0, 0, 50, min({end}, size[1])))
image.save(given["screenshot"])
"""


@pytest.fixture
def browser(tmp_path, monkeypatch):
    """Puts a program `chromium` alone on the path."""

    def install(text):
        (tmp_path / "bin").mkdir()
        (tmp_path / "bin" / "chromium").write_text(text)
        (tmp_path / "bin" / "chromium").chmod(0o755)

    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    return install


@pytest.mark.parametrize(("end", "height"), [(700, 732), (5000, 5032), (90000, look.TALLEST)])
def test_a_screenshot_ends_where_the_page_ends(browser, tmp_path, end, height):
    browser(BROWSER.format(python=sys.executable, end=end))
    look.save_screenshot(tmp_path / "page.html", tmp_path / "page.png")
    with Image.open(tmp_path / "page.png") as image:
        assert image.size == (look.WIDTH, height)


def test_an_empty_page_is_no_picture(browser, tmp_path):
    browser(BROWSER.format(python=sys.executable, end=0))
    with pytest.raises(SystemExit, match=r"page\.html: shows nothing"):
        look.save_screenshot(tmp_path / "page.html", tmp_path / "page.png")


def test_a_browser_that_fails_is_quoted(browser, tmp_path):
    browser("#!/bin/sh\necho no display >&2; exit 7\n")
    with pytest.raises(SystemExit, match="chromium: no picture, exit status 7\nno display"):
        look.save_screenshot(tmp_path / "page.html", tmp_path / "page.png")


def test_a_missing_browser_is_named(browser, tmp_path):
    del browser
    with pytest.raises(SystemExit, match="no browser: install one of chromium, "):
        look.save_screenshot(tmp_path / "page.html", tmp_path / "page.png")
    done = subprocess.run(
        [sys.executable, look.ROOT / "tools" / "system.py", "browser"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[0].startswith("no browser for screenshots: none of chromium, ")
    assert done.stderr.splitlines()[-1] == "Install by hand: apt-get install chromium fonts-dejavu-core"
