"""Buffers of records, which passes write on the CPU and shaders read."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.base.versions import new_version
from deferred_ir.gl.context import Gpu
from deferred_ir.graph.ports import Buffer


class GpuBuffer:
    """A buffer of records that a pass writes from the CPU; `records` is what it wrote last.

    versions: a number for each record; as long as it is the same, so is what is drawn for that record. None: unknown.
    version: another number whenever what it holds has changed.
    """

    def __init__(self, gpu: Gpu, description: Buffer) -> None:
        self.gpu, self.description = gpu, description
        self.nbytes = -(-description.records // description.block) * description.block * description.stride
        self.buffer = gpu.ctx.buffer(reserve=self.nbytes, dynamic=True)
        gpu.gl.check(f"buffer of {description}")
        self.records: np.ndarray = np.zeros(0)
        self._held: tuple[bytes, bytes | None] = b"", None
        self.versions: Ints | None = None
        self.version = new_version()

    def write(self, records: np.ndarray, versions: Ints | None = None) -> None:
        """Replace the first len(records) records."""
        if len(records) > self.description.records or records.itemsize != self.description.stride:
            raise ValueError(f"{len(records)} records of {records.itemsize} bytes into a buffer of {self.description}")
        held = records.tobytes(), None if versions is None else versions.tobytes()
        self.records, self.versions = records, versions
        self.buffer.write(held[0])
        if held != self._held:
            self.version = new_version()
        self._held = held  # last: a write that is broken off is none, and must be new when it is done again

    def bind_uniform(self, binding: int, block: int) -> None:
        """Make block number `block` of the records visible as a uniform block."""
        nbytes = self.description.block * self.description.stride
        self.buffer.bind_to_uniform_block(binding, offset=block * nbytes, size=nbytes)

    def release(self) -> None:
        """Give the buffer back."""
        self.buffer.release()
