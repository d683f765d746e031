"""Takes a screenshot of a small report: `python tools/look.py`, or `make look`; the picture is out/report.png.

A browser opens the page without network, as a reader of the file would.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageChops

sys.path.insert(0, str(Path(__file__).parent))

from pages import ROOT
from system import BROWSERS

SWEEP = [
    "profile",
    "cornell",
    "--graphs",
    "forward,deferred",
    "--vpls",
    "16,64",
    "--seeds",
    "2",
    "--size",
    "128x128",
    "--peers",
    "none",
]
FOLDER = ROOT / "out" / "look"
PICTURE = ROOT / "out" / "report.png"
WIDTH, HEIGHT = 1100, 4000
TALLEST = 16000
"""Tallest window that browsers draw, pixels."""
MARGIN = 32
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
LONGEST = 120
"""Longest run of a browser, seconds."""


def save_screenshot(page: Path, picture: Path) -> None:
    """Save a screenshot of the whole page, which must end in white, as PNG."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise SystemExit(f"no browser: install one of {', '.join(BROWSERS)}")
    height = HEIGHT
    while True:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
            places = (f"--user-data-dir={profile}", f"--screenshot={picture}", f"--window-size={WIDTH},{height}")
            command = [browser, *FLAGS, *places, page.as_uri()]
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
        if done.returncode or not picture.is_file():
            raise SystemExit(f"{browser}: no picture, exit status {done.returncode}\n{done.stderr}")
        with Image.open(picture) as file:
            image = file.convert("RGB")
        used = ImageChops.invert(image).getbbox()
        if used is None:
            raise SystemExit(f"{page}: shows nothing")
        if used[3] < height or height >= TALLEST:
            image.crop((0, 0, WIDTH, min(used[3] + MARGIN, height))).save(picture)
            return
        height *= 2


def main() -> int:
    """Run the sweep, open its page, save and name the screenshot."""
    shutil.rmtree(FOLDER, ignore_errors=True)  # points of another version of the program do not count
    swept = subprocess.run([sys.executable, "-m", "deferred_ir", *SWEEP, "-o", FOLDER], cwd=ROOT, check=False)
    if swept.returncode:
        return swept.returncode
    PICTURE.unlink(missing_ok=True)
    save_screenshot(FOLDER / "report.html", PICTURE)
    print(PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
