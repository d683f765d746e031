"""Renders the room of profiling/light_scenes.py with light of every kind, four scenes to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

PICTURES = {
    "lights-points.png": ("spotlight", "point", "spot", "directional"),
    "lights-areas.png": ("soft sun", "rect", "disc", "sphere"),
    "lights-around.png": ("open sky", "grey sky", "panels", "mixture"),
}
"""Scenes of each picture, in rows of two."""
SIZE, VPLS, GRAPH = (256, 256), 1024, "accurate"


def draw(scenes: Sequence[str], target: Path) -> None:
    """Render four scenes and write them as one picture."""
    import numpy as np
    from PIL import Image

    from deferred_ir.engine.renderer import Renderer
    from deferred_ir.profiling.light_scenes import SCENES

    tiles = []
    with Renderer(SIZE, GRAPH) as renderer:
        for name in scenes:
            tiles.append(renderer.render(SCENES[name](), vpls=VPLS).display)
    rows = [np.concatenate(tiles[i : i + 2], axis=1) for i in (0, 2)]
    Image.fromarray(np.concatenate(rows)).save(target, optimize=True)
