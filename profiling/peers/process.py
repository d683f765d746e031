"""A peer in a process of its own: its output goes to a log, and its crash does not end ours."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any

from deferred_ir.base.errors import Error
from deferred_ir.profiling.peers.peer import Rendered
from deferred_ir.scene.scene import Scene

LIMIT = 600.0
"""Longest wait for an answer, seconds."""
GRACE = 5.0
"""Longest wait for a process to end by itself, seconds."""


class PeerError(Error):
    """A peer cannot load the scene or render."""


@dataclass(frozen=True)
class _Refusal:
    why: str


@dataclass(frozen=True, eq=False)
class _Task:
    module: str
    scene: Scene
    size: tuple[int, int]
    bounces: int
    log: Path


def module(name: str) -> Any:
    """Import a peer's module, see peer.Module; that does not import the peer's library."""
    return importlib.import_module(f"deferred_ir.profiling.peers.{name}")


class PeerProcess:
    """A process of the peer `name` with `scene` loaded; a context manager. Raises PeerError, also from `render`."""

    def __init__(self, name: str, scene: Scene, size: tuple[int, int], bounces: int, log: Path) -> None:
        self._log = log
        context = multiprocessing.get_context("spawn")
        self._end, theirs = context.Pipe()
        task = _Task(module(name).__name__, scene, size, bounces, log)
        self._process = context.Process(target=serve, args=(theirs, task), daemon=True, name=f"peer {name}")
        # Another thread waits for answers: Python gives Ctrl-C at once to a main thread that waits for a thread.
        self._waiting = ThreadPoolExecutor(1)
        with _block_interrupts():
            self._process.start()
        theirs.close()
        try:
            self.about: str = self._answer()
        except BaseException:
            self._kill()
            raise

    def __enter__(self) -> PeerProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            with suppress(OSError):  # the process has ended already
                self._end.send(None)
            self._process.join(GRACE)
        self._kill()
        if kind is None or not issubclass(kind, Exception):  # nothing failed
            self._log.unlink(missing_ok=True)

    def render(self, spp: int, seed: int) -> Rendered:
        """Render with `spp` paths a pixel."""
        try:
            self._end.send((spp, seed))
        except OSError:
            raise PeerError(self._describe_end()) from None
        rendered: Rendered = self._answer()
        return rendered

    def _answer(self) -> Any:
        try:
            answer = self._waiting.submit(self._end.recv).result(LIMIT)
        except TimeoutError:
            raise PeerError(f"gave no answer for {LIMIT:g} s; see {self._log}") from None
        except (EOFError, OSError):
            raise PeerError(self._describe_end()) from None
        if isinstance(answer, _Refusal):
            raise PeerError(answer.why)
        return answer

    def _describe_end(self) -> str:
        self._process.join(GRACE)
        code = self._process.exitcode
        how = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
        return f"its process ended with {how}; see {self._log}"

    def _kill(self) -> None:
        if self._process.is_alive():
            self._process.kill()
        self._process.join()
        self._waiting.shutdown()  # its wait ends with the process
        self._end.close()


@contextmanager
def _block_interrupts() -> Iterator[None]:
    """Block Ctrl-C, which a terminal sends to all processes, in processes started inside; their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def serve(end: Connection, task: _Task) -> None:
    """Run in the peer's process: load the scene, then render on request until None comes."""
    to_log = os.open(task.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    for number in (1, 2):
        os.dup2(to_log, number)
    try:
        peer = importlib.import_module(task.module).Peer(task.scene, task.size, task.bounces)
        end.send(peer.about)
        while (wanted := end.recv()) is not None:
            end.send(peer.render(*wanted))
    except EOFError:
        return  # the parent has ended
    except Error as error:
        end.send(_Refusal(str(error)))
    except Exception as error:  # a library's: one line for the user, the traceback in the log
        traceback.print_exc()
        sys.stderr.flush()  # before the answer, after which the parent may end this process
        line = " ".join(str(error).split())[:200]
        end.send(_Refusal(f"{type(error).__name__}: {line}; see {task.log}"))
