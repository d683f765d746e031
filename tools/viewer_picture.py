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
    """Draw the Cornell box with a second light, outlines, axes and a shadow map, as a user would by mouse and keys."""
    from deferred_ir.gl.window import Window
    from deferred_ir.loading.load import load
    from deferred_ir.output.image import Image
    from deferred_ir.scene.lights.point import Point
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
            viewer.session.lights.add(Point((0.45, 0.3, 0.05), (0.2, 0.12, 0.03)))
            for key in ("g", "f", "m"):
                act(viewer, "key", key)
            Image(None, viewer.screenshot()).save(target)
        finally:
            viewer.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
