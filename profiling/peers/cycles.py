"""Blender's Cycles on the CPU, with its denoiser (Open Image Denoise), through the `bpy` wheel.

Its lights are ours: nodes give Cycles' lights the same intensity. What differs is that a pixel is averaged over its
area. Not possible: two environments. One scene a process: Blender has one set of data.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.output.image import read_radiance
from deferred_ir.profiling.peers.peer import Rendered
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import MOST_REFLECTIONS

INSTALL = "bpy"

LARGEST_SEED = 2**31 - 1


def available() -> str | None:
    """Return None if Cycles can be used here, else the reason why not."""
    if importlib.util.find_spec("bpy") is None:
        return "bpy is not installed (its wheels are for one Python version each)"
    return None


class Peer:
    """Cycles with `scene` at time 0 loaded, for images of `size` (width, height)."""

    about: str

    def __init__(self, scene: Scene, size: tuple[int, int], bounces: int) -> None:
        from deferred_ir.profiling.peers import cycles_scene

        with _silent():
            import bpy

            self._bpy: Any = bpy
            bpy.ops.wm.read_factory_settings(use_empty=True)
            cycles_scene.build(bpy, scene.at(0.0))
            _set_up(bpy.context.scene, size, bounces, MOST_REFLECTIONS if scene.has_gloss else 0)
        self.about = f"Cycles of Blender {bpy.app.version_string}, CPU"
        self.render(1, 0)  # builds its BVH and the denoiser's network

    def render(self, spp: int, seed: int, *, denoise: bool = True) -> Rendered:
        """Render with `spp` paths a pixel, and denoise on request.

        `ms` is the time of Blender's render operator: updating Cycles' scene, tracing, denoising and returning the
        image. The file through which the image leaves Blender is not part of it.
        """
        view = self._bpy.context.scene
        view.cycles.samples, view.cycles.seed = spp, seed % LARGEST_SEED
        view.cycles.use_denoising = denoise
        with _silent():
            start = time.perf_counter()
            self._bpy.ops.render.render()
            ms = (time.perf_counter() - start) * 1e3
            radiance = self._pixels()
        return Rendered(radiance, ms)

    def _pixels(self) -> Array:
        """Read the pixels of the render result, which Blender gives only as a file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "image.exr"
            self._bpy.data.images["Render Result"].save_render(str(path))
            return read_radiance(path).astype(np.float32)


def _set_up(view: Any, size: tuple[int, int], bounces: int, reflections: int) -> None:
    """Set direct light, `bounces` diffuse bounces, glossy reflections, but none after a diffuse bounce (caustics).

    And a box filter over the pixel, and no clamping or early ends.
    """
    render, cycles = view.render, view.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = False
    render.film_transparent = False
    render.dither_intensity = 0
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGB"
    render.image_settings.color_depth = "32"
    render.image_settings.exr_codec = "NONE"
    view.view_settings.view_transform = "Raw"

    cycles.device = "CPU"
    cycles.diffuse_bounces, cycles.glossy_bounces = bounces, reflections
    cycles.max_bounces = bounces + reflections
    cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.blur_glossy = 0
    cycles.use_fast_gi = cycles.use_guiding = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0
    cycles.use_adaptive_sampling = False
    cycles.use_auto_tile = False
    cycles.use_light_tree = len(view.objects) > 3  # than the body, the camera and one light
    cycles.pixel_filter_type = "BOX"
    # This pattern, prefilter and quality had the least error x time on cornell at 256x256 and 4 spp.
    cycles.sampling_pattern = "BLUE_NOISE"
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = "FAST"
    cycles.denoising_quality = "HIGH"
    cycles.denoising_use_gpu = False


@contextmanager
def _silent() -> Iterator[None]:
    """Silence what Blender prints on standard output, such as a warning that there is no CUDA."""
    sys.stdout.flush()
    stdout = os.dup(1)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        yield
    finally:
        os.dup2(stdout, 1)
        os.close(null)
        os.close(stdout)
