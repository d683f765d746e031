"""Ctrl-C that is never lost and interrupts no library halfway through its work.

A KeyboardInterrupt is raised wherever the main thread happens to be. Some libraries catch BaseException around their
own imports, and compiled ones may ignore an exception and go on with half of their tables. So the interrupt waits until
this package's own code, or a wait for threads, is at the top of the stack.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

RETRY = 0.02
"""Seconds until the handler looks again where the main thread is."""
PATIENCE = 2.0
"""Seconds after which the interrupt is raised in a library, too, but never during an import."""
_IMPORT = "<frozen importlib._bootstrap>"
_SAFE = ("deferred_ir", "__main__", "threading", "concurrent.futures")


class _Handler:
    """The handler of SIGINT and of the timer that tries again."""

    def __init__(self) -> None:
        self.asked: float | None = None

    def __call__(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        self.asked = self.asked or now
        if _importing(frame) or (not _safe(frame) and now < self.asked + PATIENCE):
            signal.setitimer(signal.ITIMER_REAL, RETRY)
            return
        self.asked = None
        raise KeyboardInterrupt


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT:
            return True
        frame = frame.f_back
    return False


def _safe(frame: FrameType | None) -> bool:
    return frame is not None and str(frame.f_globals.get("__name__")).startswith(_SAFE)


@contextmanager
def patient() -> Iterator[None]:
    """Delay SIGINT within the context until it is safe to raise KeyboardInterrupt, then restore the handlers.

    Nothing changes outside the main thread, on systems without interval timers (Windows), and where SIGINT has another
    handler already.
    """
    main = threading.current_thread() is threading.main_thread()
    if (
        not main
        or not hasattr(signal, "setitimer")
        or signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    handler = _Handler()
    before = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGALRM)}
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, old in before.items():
            signal.signal(number, old)
    if handler.asked is not None:  # an interrupt was still waiting
        raise KeyboardInterrupt
