"""Takes a screenshot of the viewer on a virtual display: `python tools/viewer_picture.py OUT.png [SCALE]`.

SCALE: how large the desktop wants text, 1 at 96 dots an inch.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))

from virtual_display import act, display, xdo
from x_client import Client

WINDOW = 1280, 720


def main(target: str, scale: str = "1") -> int:
    """Draw the Cornell box with axes of its lights and the shadow map, by the keys that a user would press."""
    from deferred_ir.gl.window import Window
    from deferred_ir.loading.load import load
    from deferred_ir.output.image import Image
    from deferred_ir.viewer.app import Viewer
    from deferred_ir.viewer.session import Session

    with display(), Client() as desktop:
        desktop.scale(float(scale))
        window = Window("deferred-ir", WINDOW)
        viewer = Viewer(window, Session(load("cornell"), WINDOW, window))
        try:
            viewer.frame()
            xdo("search", "--sync", "--name", "deferred-ir", "windowfocus", "--sync")
            act(viewer, "mousemove", 450, 10)
            act(viewer, "mousedown", 3)
            for x in range(440, 350, -10):
                act(viewer, "mousemove", x, 10, frames=2)
            act(viewer, "mouseup", 3)
            for key in ("f", "m"):
                act(viewer, "key", key)
            Image(None, viewer.screenshot()).save(target)
        finally:
            viewer.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
