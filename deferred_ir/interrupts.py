"""Ctrl-C that is never lost: not even while modules are being imported.

Some libraries catch BaseException around their own imports, so a KeyboardInterrupt raised there vanishes or leaves
half a module behind. Until the import is over, the interrupt waits.
"""

from __future__ import annotations

import signal
from types import FrameType

RETRY = 0.05
"""Seconds until the next look whether the import is over."""
_IMPORT = "<frozen importlib._bootstrap>"


def install() -> None:
    """Let SIGINT raise KeyboardInterrupt at the first moment outside an import; where signals cannot wait, at once."""
    if not hasattr(signal, "setitimer") or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return
    signal.signal(signal.SIGINT, _interrupt)
    signal.signal(signal.SIGALRM, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    del number
    while frame is not None:
        if frame.f_code.co_filename == _IMPORT:
            signal.setitimer(signal.ITIMER_REAL, RETRY)
            return
        frame = frame.f_back
    raise KeyboardInterrupt
