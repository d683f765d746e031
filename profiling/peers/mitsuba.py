"""Mitsuba 3's path tracer on the CPU, with the scene and the light of docs/conventions.md.

A light with a cone is Mitsuba's `spot`, with its intensity as the texture that it projects. Not possible: a spotlight
with a radius, a cone too wide for that texture, two environments, and vertex colours that vary over an image texture.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import time
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError
from deferred_ir.profiling.peers.peer import Rendered
from deferred_ir.scene.scene import Scene

INSTALL = "mitsuba"

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
"""Variants of Mitsuba, the fastest first. None uses CUDA, since all peers run on the CPU."""
PROBE = """
import sys, mitsuba, numpy
mitsuba.set_variant(sys.argv[1])
scene = mitsuba.load_dict({**mitsuba.cornell_box(), "integrator": {"type": "path", "max_depth": 3}})
sys.exit(not numpy.isfinite(numpy.asarray(mitsuba.render(scene, spp=1))).all())
"""
"""A program that tries a variant. It runs in a process of its own: LLVM aborts if it is too old for the kernels."""
LANES = 1 << 24
"""Most paths at once, since the LLVM variant holds the state of all of them in memory."""
SOON = 5000.0
"""Milliseconds. A first image that takes longer is not rendered again to leave the kernel's compilation out."""


def available() -> str | None:
    """Return None if Mitsuba can be used here, else the reason why not."""
    return None if importlib.util.find_spec("mitsuba") else "mitsuba is not installed"


class Peer:
    """Mitsuba with `scene` at time 0 loaded, for images of `size` (width, height)."""

    about: str

    def __init__(self, scene: Scene, size: tuple[int, int], bounces: int) -> None:
        import mitsuba

        from deferred_ir.profiling.peers import mitsuba_scene

        self._mi: Any = mitsuba
        variant = next((name for name in VARIANTS if _works(name)), None)
        if variant is None:
            raise SettingError(f"mitsuba: none of its variants {', '.join(VARIANTS)} works here; install it again")
        mitsuba.set_variant(variant)
        failed = "".join(f", {name} does not work here" for name in VARIANTS[: VARIANTS.index(variant)])
        self.about = f"Mitsuba {mitsuba.__version__}, {variant}{failed}"
        self._pixels = size[0] * size[1]
        self._scene = mitsuba.load_dict(mitsuba_scene.describe(mitsuba, scene.at(0.0), size, bounces))
        self._warm: set[int] = set()

    def render(self, spp: int, seed: int) -> Rendered:
        """Render with `spp` paths a pixel, a power of two. `ms` is without the compilation of kernels."""
        rendered = self._time(spp, seed)
        if spp not in self._warm and rendered.ms < SOON:
            rendered = self._time(spp, seed)
        self._warm.add(spp)
        return rendered

    def _time(self, spp: int, seed: int) -> Rendered:
        at_once = min(spp, 1 << max(0, (LANES // self._pixels).bit_length() - 1))
        start = time.perf_counter()
        image: Array | float = 0.0
        for part in range(spp // at_once):
            part_image = self._mi.render(self._scene, spp=at_once, seed=seed * spp + part)
            image = image + np.asarray(part_image, np.float64) / (spp // at_once)
        return Rendered(np.asarray(image, np.float32), (time.perf_counter() - start) * 1e3)


def _works(variant: str) -> bool:
    command = [sys.executable, "-c", PROBE, variant]
    return subprocess.run(command, check=False, capture_output=True, stdin=subprocess.DEVNULL).returncode == 0
