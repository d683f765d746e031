"""Traces a reference of what is on screen in the background, and measures how far the picture is from it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

from deferred_ir.base.errors import Error, SettingError
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import Reference, trace_reference

PERIOD = 0.5
"""Least seconds between two measurements of a picture that changes."""


class _Cancelled(Exception):  # noqa: N818 - no fault: the way out of a callback
    """Nobody waits for the reference any more."""


class ReferenceJob:
    """At most one reference at a time. progress: from 0 to 1. error: why there is no result, "" if nothing failed."""

    def __init__(self) -> None:
        self.error = ""
        self.progress = 0.0
        self.result: Reference | None = None
        self._view: tuple[Any, ...] = ()
        self._thread: threading.Thread | None = None
        self._cancel = threading.Event()
        self._measured: tuple[float, float | None] = 0.0, None

    @property
    def running(self) -> bool:
        """Whether a reference is being traced."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, scene: Scene, size: tuple[int, int], spp: int, bounces: int) -> None:
        """Trace `scene` in (width, height) pixels with spp paths each, in place of what was traced before."""
        self.stop()
        self._cancel.clear()
        self._measured = 0.0, None
        self.error, self.progress, self.result, self._view = "", 0.0, None, _identify(scene, size, bounces)
        # A daemon ends with the program, whatever it is doing.
        self._thread = threading.Thread(target=self._trace, args=(scene, size, spp, bounces), daemon=True)
        self._thread.start()

    def _trace(self, scene: Scene, size: tuple[int, int], spp: int, bounces: int) -> None:
        def advance(done: int, total: int) -> None:
            self.progress = done / total
            if self._cancel.is_set():
                raise _Cancelled

        try:
            threads = max((os.cpu_count() or 2) - 1, 1)
            self.result = trace_reference(scene, size, spp=spp, bounces=bounces, threads=threads, progress=advance)
        except _Cancelled:
            return
        except Error as error:
            self.error = str(error)

    def stop(self) -> None:
        """Cancel the tracing, and wait until it has ended."""
        self._cancel.set()
        if self._thread:
            self._thread.join()
        self._thread = None

    def matches(self, scene: Scene, size: tuple[int, int], bounces: int) -> bool:
        """Return whether the reference is there and shows this view."""
        return self.result is not None and self._view == _identify(scene, size, bounces)

    def measure(self, read: Callable[[], Any], changed: bool) -> float | None:
        """Return the relMSE (trimmed) of the picture that `read` reads, None where nothing is lit.

        A picture that has `changed` is measured again every PERIOD; until then the last figure stands.
        """
        assert self.result is not None
        when, before = self._measured
        if when and not (changed and time.monotonic() > when + PERIOD):
            return before
        try:
            error: float | None = relmse(read(), self.result.radiance, self.result.hit)[0]
        except SettingError:  # a black reference
            error = None
        self._measured = time.monotonic(), error
        return error


def _identify(scene: Scene, size: tuple[int, int], bounces: int) -> tuple[Any, ...]:
    """Return all that a reference depends on, apart from its samples."""
    return scene.geometry, scene.camera, scene.lights, size, bounces
