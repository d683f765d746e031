"""A corner of the Cornell box by clamped VPLs, with what the clamp took given back, and by rays.

    python -m deferred_ir.profiling.studies.corners -o out/corners

Means of many frames: what is left of the difference is the clamp's, not chance.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import panels
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import reference

SIZE = 256, 256
CROP = slice(150, 250), slice(60, 190)
"""Rows and columns: the foot of both boxes, and the floor between them."""
VPLS, FRAMES, SPP = 64, 32, 1024
SETTINGS = {"vpl.fov": 179.9, "vpl.clamp": 0.08, "shadow_maps.projection": "paraboloid"}


def main() -> None:
    """Draw, print how bright each is."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    scene, images = load("cornell"), {}
    for name, graph in (("clamped", "interleaved"), ("near field given back", "accurate")):
        with Renderer(SIZE, graph, set=SETTINGS) as renderer:
            images[name] = renderer.render(scene, vpls=VPLS, accumulate=FRAMES).radiance
    images["ray-traced"] = reference(scene, SIZE, spp=SPP).radiance
    crops = {name: image[CROP] for name, image in images.items()}
    white = np.quantile(crops["ray-traced"], 0.9)
    with panels(crops, folder / "corners.svg") as axes:
        for panel, crop in zip(axes, crops.values(), strict=True):
            panel.imshow(np.clip(crop / white, 0, 1) ** (1 / 2.2), interpolation="none")
            panel.set_axis_off()
    truth = crops["ray-traced"].mean()
    for name, crop in crops.items():
        print(f"{name}: {crop.mean() / truth:.3f} of the light, relMSE {relmse(crop, crops['ray-traced'])[0]:.4f}")


if __name__ == "__main__":
    main()
