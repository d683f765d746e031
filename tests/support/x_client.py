"""An X client that does to a window what file managers and window managers do: drop files on it, minimise it, close it.

Drops follow XDND, version 5 (freedesktop.org). ctypes on libX11, which GLFW needs, too.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 33, 30, 31
ICONIC, NORMAL = 3, 1
PATIENCE = 5.0

Event = ctypes.c_long * 24
"""XEvent on 64 bits: each field of the events used here takes up 8 bytes."""


class Client:
    """A connection of its own to $DISPLAY, and an invisible window on it."""

    def __init__(self) -> None:
        self._x = x = ctypes.CDLL("libX11.so.6")
        for name in ("XOpenDisplay", "XDefaultRootWindow", "XCreateSimpleWindow", "XInternAtom"):
            getattr(x, name).restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(x.XOpenDisplay(None))
        self._root = x.XDefaultRootWindow(self._display)
        root = ctypes.c_ulong(self._root)
        zero = ctypes.c_ulong(0)
        self._window = x.XCreateSimpleWindow(self._display, root, 0, 0, 1, 1, 0, zero, zero)

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._x.XCloseDisplay(self._display)

    def _atom(self, name: str) -> int:
        atom: int = self._x.XInternAtom(self._display, name.encode(), 0)
        return atom

    def _send(self, window: int, kind: str, *data: int) -> None:
        event = Event(CLIENT_MESSAGE, 0, 0, 0, window, self._atom(kind), 32, *data)
        self._post(window, event)

    def _post(self, window: int, event: Any) -> None:
        self._x.XSendEvent(self._display, ctypes.c_ulong(window), 0, ctypes.c_long(0), event)
        self._x.XSync(self._display, 0)

    def _receive(self, kind: int, pump: Callable[[], object]) -> Any:
        """Wait for the next event of this kind; `pump` lets the other side work."""
        event, end = Event(), time.monotonic() + PATIENCE
        while time.monotonic() < end:
            pump()
            while self._x.XPending(self._display):
                self._x.XNextEvent(self._display, event)
                if event[0] & 0xFFFFFFFF == kind:
                    return event
        raise AssertionError(f"no event {kind} came")

    def _change(self, window: int, name: int, kind: int, data: bytes | Any) -> None:
        """Set a property to bytes, or to numbers, which have 32 bits in the protocol and are longs here."""
        words = ctypes.c_ulong(window), ctypes.c_ulong(name), ctypes.c_ulong(kind)
        bits = 8 if isinstance(data, bytes) else 32
        self._x.XChangeProperty(self._display, *words, bits, 0, data, len(data))

    def drop(self, window: int, paths: Sequence[Path], pump: Callable[[], object]) -> None:
        """Drop files on the middle of `window`, which lies in the screen's corner."""
        selection, own, text = self._atom("XdndSelection"), self._window, self._atom("text/uri-list")
        self._x.XSetSelectionOwner(self._display, ctypes.c_ulong(selection), ctypes.c_ulong(own), ctypes.c_ulong(0))
        self._send(window, "XdndEnter", own, 5 << 24, text, 0, 0)
        self._send(window, "XdndPosition", own, 0, 20 << 16 | 20, 0, self._atom("XdndActionCopy"))
        status = self._receive(CLIENT_MESSAGE, pump)
        assert status[5] == self._atom("XdndStatus")
        assert status[8] & 1, "the window takes the drop"
        self._send(window, "XdndDrop", own, 0, 0, 0, 0)
        asked = self._receive(SELECTION_REQUEST, pump)
        requestor, target, place = asked[5], asked[7], asked[8]
        data = "".join(f"{path.as_uri()}\r\n" for path in paths).encode()
        self._change(requestor, place, target, data)
        self._post(requestor, Event(SELECTION_NOTIFY, 0, 0, 0, requestor, selection, target, place, 0))
        finished = self._receive(CLIENT_MESSAGE, pump)
        assert finished[5] == self._atom("XdndFinished")

    def minimise(self, window: int) -> None:
        """Minimise a window as a window manager does."""
        self._state(window, ICONIC)
        self._x.XUnmapWindow(self._display, ctypes.c_ulong(window))
        self._x.XSync(self._display, 0)

    def restore(self, window: int) -> None:
        """Bring a minimised window back."""
        self._state(window, NORMAL)
        self._x.XMapWindow(self._display, ctypes.c_ulong(window))
        self._x.XSync(self._display, 0)

    def _state(self, window: int, state: int) -> None:
        name = self._atom("WM_STATE")
        self._change(window, name, name, (ctypes.c_long * 2)(state, 0))

    def scale(self, factor: float) -> None:
        """Tell programs that start while this client is there how large text is to be: 1 at 96 dots an inch."""
        data = f"Xft.dpi:\t{round(96 * factor)}\n".encode()
        self._change(self._root, self._atom("RESOURCE_MANAGER"), self._atom("STRING"), data)
        self._x.XSync(self._display, 0)

    def close(self, window: int) -> None:
        """Press its cross."""
        self._send(window, "WM_PROTOCOLS", self._atom("WM_DELETE_WINDOW"), 0, 0, 0, 0)
