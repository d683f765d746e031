"""Renderers that deferred-ir is held against: path tracers that render the same scene, each in a process of its own.

A peer is a module of this package with `INSTALL` (what pip installs), `available()` and a class `Peer`, a `Renderer`.
Its library is imported in that process only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from deferred_ir.base.arrays import Array
from deferred_ir.scene.scene import Scene

NAMES = ("mitsuba", "cycles")
"""The modules of this package that are peers, in the order of tables."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """One image of a peer. radiance: float32 (H, W, 3), top row first, mean over each pixel. ms: wall time.

    `ms` is what a warm renderer takes from asking to having the image in memory: scene loaded, kernels compiled.
    """

    radiance: Array
    ms: float


class Renderer(Protocol):
    """A peer with one scene loaded: direct light and `bounces` diffuse bounces, as docs/conventions.md defines them.

    Making one raises SettingError for a scene that it cannot render as that document says.
    """

    about: str
    """Name, version and variant, such as 'Mitsuba 3.9.1, llvm_ad_rgb'."""

    def __init__(self, scene: Scene, size: tuple[int, int], bounces: int) -> None: ...

    def render(self, spp: int, seed: int) -> Rendered:
        """An image of `spp` paths a pixel, through the peer's denoiser if it has one."""


class Module(Protocol):
    """What this package's modules offer."""

    INSTALL: str
    Peer: type[Renderer]

    def available(self) -> str | None:
        """None if the peer can be used here, else the reason why not."""
