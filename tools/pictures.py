"""Renders every picture of README and docs: `python tools/pictures.py [NAME.png ...]`, or `make pictures`.

The commands are those that the pages show, besides those of the built-in scenes; the worked example of
docs/adding-a-pass.md makes a picture of its own, and so does the viewer. Those of docs/lights.md show scenes that are
made in memory. (The plots are made by the commands that
docs/accuracy.md names.)
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import light_pictures
import viewer_picture
from pages import PICTURES, ROOT, blocks, picture_commands

SCENES = {
    f"{scene}.png": f"deferred-ir render {scene} --vpls 256 -o {PICTURES}/{scene}.png".split()
    for scene in ("cornell", "atrium", "colors")
}
"""The pictures at the top of the README."""
EXAMPLE = ROOT / "docs" / "adding-a-pass.md"
EXAMPLE_PICTURE = "false_color.png"
VIEWER_PICTURE = "viewer.png"


def write_example(folder: Path) -> str:
    """Write the files of the worked example to `folder`. Returns the script to run, which comes last on the page."""
    files = [block for block in blocks(EXAMPLE) if block.file]
    for block in files:
        (folder / block.file).write_text(block.text, encoding="utf-8")
    return files[-1].file


def run_example(target: Path) -> None:
    """Run the worked example as a reader would, and copy its picture."""
    with tempfile.TemporaryDirectory() as name:
        script = write_example(Path(name))
        subprocess.run([sys.executable, script], cwd=name, check=True)
        shutil.copy(Path(name) / EXAMPLE_PICTURE, target)


def main(wanted: list[str]) -> int:
    """Make the named pictures, or all."""
    rendered = SCENES | picture_commands()
    known = [*rendered, *light_pictures.PICTURES, EXAMPLE_PICTURE, VIEWER_PICTURE]
    if unknown := set(wanted) - set(known):
        print(f"no such picture: {', '.join(sorted(unknown))}; known: {', '.join(sorted(known))}", file=sys.stderr)
        return 2
    (ROOT / PICTURES).mkdir(exist_ok=True)
    for name in wanted or known:
        if name in rendered:
            print(" ".join(rendered[name]), flush=True)
            subprocess.run([sys.executable, "-m", "deferred_ir", *rendered[name][1:]], cwd=ROOT, check=True)
        elif name in light_pictures.PICTURES:
            scenes = light_pictures.PICTURES[name]
            print(f"{', '.join(scenes)}: {name}", flush=True)
            light_pictures.draw(scenes, ROOT / PICTURES / name)
        elif name == VIEWER_PICTURE:
            print(f"the viewer: {name}", flush=True)
            viewer_picture.main(str(ROOT / PICTURES / name))
        else:
            print(f"{EXAMPLE.name}: {name}", flush=True)
            run_example(ROOT / PICTURES / name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
