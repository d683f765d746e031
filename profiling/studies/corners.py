"""Show a corner of the Cornell box by clamped VPLs, with the clamp residual added back, and ray-traced.

    python -m deferred_ir.profiling.studies.corners -o out/corners

The images are means of many frames, so that the remaining difference is the clamp's and not noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import picture_panels
from deferred_ir.profiling.study import command_line, run
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference

SIZE = 256, 256
CROP = slice(150, 250), slice(60, 190)
"""Rows and columns of the pictures: the foot of both boxes and the floor between them."""
VPLS, FRAMES, SPP = 64, 32, 1024
SETTINGS = {"vpl.fov": 179.9, "vpl.clamp": 0.08, "shadow_maps.projection": "paraboloid"}


def report(chosen: argparse.Namespace) -> None:
    """Draw the pictures, and print each one's brightness and error."""
    scene, images = load("cornell"), {}
    for name, graph in (("clamped", "interleaved"), ("residual added back", "mapped")):
        with Renderer(SIZE, graph, set=SETTINGS) as renderer:
            images[name] = renderer.render(scene, vpls=VPLS, accumulate=FRAMES).radiance
    images["ray-traced"] = trace_reference(scene, SIZE, spp=SPP).radiance
    crops = {name: image[CROP] for name, image in images.items()}
    white = float(np.quantile(crops["ray-traced"], 0.9))
    picture_panels(crops, white, chosen.output / "corners.svg")
    truth = crops["ray-traced"].mean()
    for name, crop in crops.items():
        print(f"{name}: {crop.mean() / truth:.3f} of the light, relMSE {relmse(crop, crops['ray-traced'])[0]:.4f}")


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, scenes=False, output=True), report, words)


if __name__ == "__main__":
    main()
