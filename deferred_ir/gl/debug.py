"""OpenGL's debug output: errors where they happen, each with the line of Python that made the call."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl import raw

SWITCH = "DEFERRED_IR_DEBUG"
"""Environment variable: anything in it turns debug output on."""
_HERE = Path(__file__).resolve().parent.parent
_OUTSIDE = ("moderngl", "glcontext")
_CALLBACKS: list[Any] = []
"""OpenGL calls them as long as their contexts live, and a window's outlives all that is known of it here."""


class DebugOutput:
    """Collects what OpenGL complains about in one context, which is current."""

    def __init__(self, ctx: Any, gl: raw.GL) -> None:
        self.faults: list[str] = []
        callback = gl.debug_callback(self._heard)
        _CALLBACKS.append(callback)
        ctx.enable_direct(raw.DEBUG_OUTPUT)
        ctx.enable_direct(raw.DEBUG_OUTPUT_SYNCHRONOUS)  # inside the call that is at fault
        gl.DebugMessageCallback(callback, None)

    def _heard(self, source: int, kind: int, *rest: Any) -> None:
        _number, _severity, _length, text, _user = rest
        # What compilers say of shaders is raised as a ShaderError; what is slow is no fault.
        if source == raw.DEBUG_SOURCE_API and kind in raw.DEBUG_FAULTS:
            self.faults.append(f"{text.decode(errors='replace').strip()}, called at {_caller()}")

    def check(self, where: str) -> None:
        """Raise DeviceError with what was heard since the last time."""
        if self.faults:
            told = "; ".join(self.faults)
            self.faults.clear()
            raise DeviceError(f"{where}: {told}")


def _caller() -> str:
    """The innermost line of ours, or of whoever called OpenGL without us."""
    frames = [
        frame
        for frame, _ in traceback.walk_stack(sys._getframe(2))
        if not frame.f_globals.get("__name__", "").startswith(_OUTSIDE)
    ]
    code, line = frames[0].f_code, frames[0].f_lineno
    file = Path(code.co_filename)
    return f"{file.relative_to(_HERE.parent) if file.is_relative_to(_HERE) else file.name}:{line}"
