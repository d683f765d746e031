"""The interface of peers: path tracers that render the same scene for comparison, each in a process of its own.

A peer is a module of this package with `INSTALL` (what pip installs), `available()` and a class `Peer`, a `Renderer`.
Its library is imported in that process only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from deferred_ir.base.arrays import Array
from deferred_ir.scene.scene import Scene

NAMES = ("mitsuba", "cycles")
"""The modules of this package that are peers, in the order of the tables."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """One image of a peer. radiance: float32 (H, W, 3), top row first, mean over each pixel.

    ms: wall time from the call to a warm renderer, with scene loaded and kernels compiled, until the image is in
    memory.
    """

    radiance: Array
    ms: float


class Renderer(Protocol):
    """A peer with one scene loaded: direct light and `bounces` diffuse bounces, as docs/conventions.md defines them.

    The constructor raises SettingError for a scene that the peer cannot render as that document says.
    """

    about: str
    """Name, version and variant, such as 'Mitsuba 3.9.1, llvm_ad_rgb'."""

    def __init__(self, scene: Scene, size: tuple[int, int], bounces: int) -> None: ...

    def render(self, spp: int, seed: int) -> Rendered:
        """Render with `spp` paths a pixel, and denoise if the peer has a denoiser."""


class Module(Protocol):
    """What a module of a peer offers."""

    INSTALL: str
    Peer: type[Renderer]

    def available(self) -> str | None:
        """Return None if the peer can be used here, else the reason why not."""
