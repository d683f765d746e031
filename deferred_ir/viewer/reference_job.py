"""A reference of what is on screen, traced in the background, and how far the picture is from it."""

from __future__ import annotations

import os
import threading
import time
from typing import Any

from deferred_ir.base.errors import Error, SettingError
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import Reference, reference

PERIOD = 0.5
"""Least seconds between two measurements of a picture that changes."""


class _Cancelled(Exception):  # noqa: N818 - no fault: the way out of a callback
    """Nobody waits for the reference any more."""


class Truth:
    """At most one reference at a time. `error` says why there is none."""

    def __init__(self) -> None:
        self.error = ""
        self.progress = 0.0
        self.result: Reference | None = None
        self._of: tuple[Any, ...] = ()
        self._thread: threading.Thread | None = None
        self._cancel = threading.Event()
        self._measured: tuple[float, float | None] = 0.0, None

    @property
    def running(self) -> bool:
        """Whether it is being traced."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, scene: Scene, size: tuple[int, int], spp: int, bounces: int) -> None:
        """Trace `scene` in place of what was traced before."""
        self.stop()
        self._cancel.clear()
        self.error, self.progress, self.result, self._of = "", 0.0, None, _view(scene, size, bounces)
        # A thread of the system's own: it ends with the program, whatever it is doing.
        self._thread = threading.Thread(target=self._trace, args=(scene, size, spp, bounces), daemon=True)
        self._thread.start()

    def _trace(self, scene: Scene, size: tuple[int, int], spp: int, bounces: int) -> None:
        def tell(done: int, total: int) -> None:
            self.progress = done / total
            if self._cancel.is_set():
                raise _Cancelled

        try:
            threads = max((os.cpu_count() or 2) - 1, 1)
            self.result = reference(scene, size, spp=spp, bounces=bounces, threads=threads, progress=tell)
        except _Cancelled:
            return
        except Error as error:
            self.error = str(error)

    def stop(self) -> None:
        """Give the tracing up, and wait until it has ended."""
        self._cancel.set()
        if self._thread:
            self._thread.join()
        self._thread = None

    def fits(self, scene: Scene, size: tuple[int, int], bounces: int) -> bool:
        """Whether the reference is there and of this view."""
        return self.result is not None and self._of == _view(scene, size, bounces)

    def distance(self, radiance: Any, changed: bool) -> float | None:
        """relMSE (trimmed) of the picture, None where nothing is lit; measured again now and then if it `changed`."""
        assert self.result is not None
        when, before = self._measured
        if when and not (changed and time.monotonic() > when + PERIOD):
            return before
        try:
            found: float | None = relmse(radiance(), self.result.radiance, self.result.hit)[0]
        except SettingError:  # a black reference
            found = None
        self._measured = time.monotonic(), found
        return found


def _view(scene: Scene, size: tuple[int, int], bounces: int) -> tuple[Any, ...]:
    return scene.geometry, scene.camera, scene.spotlight, size, bounces
