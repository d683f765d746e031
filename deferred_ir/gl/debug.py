"""OpenGL's debug output: reports errors where they happen, with the line of Python that made the call."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl import raw

SWITCH = "DEFERRED_IR_DEBUG"
"""Environment variable that turns debug output on, with any value."""
_HERE = Path(__file__).resolve().parent.parent
_OUTSIDE = ("moderngl", "glcontext")
_CALLBACKS: list[Any] = []
"""References to all callbacks: OpenGL calls them as long as their contexts live, a window's beyond its Gpu."""


class DebugOutput:
    """Collects the faults that OpenGL reports in one context, which is current."""

    def __init__(self, ctx: Any, gl: raw.GL) -> None:
        self.faults: list[str] = []
        callback = gl.debug_callback(self._collect)
        _CALLBACKS.append(callback)
        ctx.enable_direct(raw.DEBUG_OUTPUT)
        ctx.enable_direct(raw.DEBUG_OUTPUT_SYNCHRONOUS)  # inside the call that is at fault
        gl.DebugMessageCallback(callback, None)

    def _collect(self, source: int, kind: int, *rest: Any) -> None:
        _number, _severity, _length, text, _user = rest
        # Compilers' messages become a ShaderError, and hints on speed are no faults.
        if source == raw.DEBUG_SOURCE_API and kind in raw.DEBUG_FAULTS:
            self.faults.append(f"{text.decode(errors='replace').strip()}, called at {_find_caller()}")

    def check(self, where: str) -> None:
        """Raise DeviceError with the faults since the last call, if any."""
        if self.faults:
            faults = "; ".join(self.faults)
            self.faults.clear()
            raise DeviceError(f"{where}: {faults}")


def _find_caller() -> str:
    """Return file and line of the innermost frame that is not moderngl's."""
    frames = [
        frame
        for frame, _ in traceback.walk_stack(sys._getframe(2))
        if not frame.f_globals.get("__name__", "").startswith(_OUTSIDE)
    ]
    code, line = frames[0].f_code, frames[0].f_lineno
    file = Path(code.co_filename)
    return f"{file.relative_to(_HERE.parent) if file.is_relative_to(_HERE) else file.name}:{line}"
