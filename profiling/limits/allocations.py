"""Bytes that NumPy allocates for arrays in a frame, by pass.

NumPy takes a handler for the memory of arrays (NEP 49). One that counts stands before NumPy's own here, so each
temporary counts, and views, writes into arrays that exist and Python's own bytes do not. Handlers belong to a thread:
what passes do on several threads is done on one while bytes are counted. So the numbers are the same in each run.
"""

from __future__ import annotations

import ctypes
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np

from deferred_ir.base import parallel
from deferred_ir.engine.executor import Executor
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.rays.tracer import Tracer

SET_HANDLER, GET_HANDLER = 304, 305
"""Numbers of PyDataMem_SetHandler and PyDataMem_GetHandler in NumPy's table of C functions; they never change."""
CAPSULE = b"mem_handler"
_MALLOC = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t
_CALLOC = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t
_REALLOC = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t
_SetHandler, _GetHandler = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object), ctypes.PYFUNCTYPE(ctypes.py_object)
_get_pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
    ("PyCapsule_GetPointer", ctypes.pythonapi)
)
_make_capsule = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)(
    ("PyCapsule_New", ctypes.pythonapi)
)


class _MemHandler(ctypes.Structure):
    """PyDataMem_Handler of numpy/ndarraytypes.h."""

    _fields_ = [
        ("name", ctypes.c_char * 127),
        ("version", ctypes.c_uint8),
        ("context", ctypes.c_void_p),
        ("malloc", ctypes.c_void_p),
        ("calloc", ctypes.c_void_p),
        ("realloc", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
    ]


class _Inline:
    """Stands in for a ThreadPoolExecutor: does the work at once, in the caller's thread."""

    def __init__(self, workers: int | None = None) -> None:
        del workers

    def __enter__(self) -> _Inline:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future = Future[Any]()
        future.set_result(function(*arguments))
        return future

    def map(self, function: Callable[..., Any], *columns: Iterable[Any]) -> Iterator[Any]:
        return map(function, *columns)


def _find_function(number: int) -> int:
    """Return the address of a function of NumPy's C interface."""
    table = _get_pointer(np._core._multiarray_umath._ARRAY_API, None)  # type: ignore[attr-defined]
    address: int = ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))[number]
    return address


@contextmanager
def count_allocations() -> Iterator[list[int]]:
    """Yield a list of one number: the bytes that NumPy has allocated for arrays in this thread since."""
    set_handler, count = _SetHandler(_find_function(SET_HANDLER)), [0]
    before = _GetHandler(_find_function(GET_HANDLER))()
    own = _MemHandler.from_buffer_copy(_MemHandler.from_address(_get_pointer(before, CAPSULE)))
    # NumPy's own functions want to be called with Python's lock, which the callbacks hold.
    malloc = ctypes.PYFUNCTYPE(*_MALLOC)(own.malloc)
    calloc = ctypes.PYFUNCTYPE(*_CALLOC)(own.calloc)
    realloc = ctypes.PYFUNCTYPE(*_REALLOC)(own.realloc)

    def allocate(context: Any, size: int) -> Any:
        count[0] += size
        return malloc(context, size)

    def allocate_zeros(context: Any, items: int, size: int) -> Any:
        count[0] += items * size
        return calloc(context, items, size)

    def reallocate(context: Any, at: Any, size: int) -> Any:
        count[0] += size
        return realloc(context, at, size)

    callbacks = [
        ctypes.CFUNCTYPE(*signature)(function)
        for signature, function in ((_MALLOC, allocate), (_CALLOC, allocate_zeros), (_REALLOC, reallocate))
    ]
    own.malloc, own.calloc, own.realloc = (ctypes.cast(callback, ctypes.c_void_p) for callback in callbacks)
    KEPT.append((own, callbacks))
    set_handler(_make_capsule(ctypes.addressof(own), CAPSULE, None))
    try:
        yield count
    finally:
        set_handler(before)


KEPT = list[Any]()
"""Arrays that outlive a measurement are freed, or grown, by the handler that made them."""


def measure_allocations(scene: str, graph: str, *, vpls: int, size: tuple[int, int], device: str) -> dict[str, int]:
    """Return the bytes that NumPy allocates in each pass of a frame of `graph`, and under "" beside them."""
    loaded, found = load(scene), Counter[str]()
    execute = Executor._execute
    with (
        mock.patch.object(parallel, "ThreadPoolExecutor", _Inline),
        mock.patch.object(Tracer, "_pool", _Inline()),
        Renderer(size, graph, device) as renderer,
    ):
        plan = renderer.plan(loaded, vpls, ["radiance"])
        renderer.draw(loaded, plan)
        with count_allocations() as count:

            def step(executor: Executor, chosen: Any, *arguments: Any) -> None:
                start = count[0]
                execute(executor, chosen, *arguments)
                found[chosen.name] += count[0] - start

            with mock.patch.object(Executor, "_execute", step):
                renderer.draw(loaded, plan)
            found[""] = count[0] - sum(found.values())
    return dict(found)
