"""Buffers of records, which passes write on the CPU and shaders read."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.base.versions import new_version
from deferred_ir.gl.context import Gpu
from deferred_ir.graph.ports import Buffer


class GpuBuffer:
    """A buffer of records that a pass writes on the CPU; `records` are the last ones.

    versions: a number for each record, the same as long as what is drawn for that record is; None if unknown. version:
    a process-wide unique number, a new one whenever the buffer's contents change.
    """

    def __init__(self, gpu: Gpu, description: Buffer) -> None:
        self.gpu, self.description = gpu, description
        blocks = max(-(-description.records // description.block), 1)  # shaders may bind one, though they read nothing
        self.nbytes = blocks * description.block * description.stride
        self.buffer = gpu.ctx.buffer(reserve=self.nbytes, dynamic=True)
        gpu.gl.check(f"buffer of {description}")
        self.records: np.ndarray = np.zeros(0)
        self._contents: tuple[bytes, bytes | None] | None = None
        self.versions: Ints | None = None
        self.version = new_version()

    def write(self, records: np.ndarray, versions: Ints | None = None) -> None:
        """Replace the first len(records) records."""
        if len(records) > self.description.records or records.itemsize != self.description.stride:
            raise ValueError(f"{len(records)} records of {records.itemsize} bytes into a buffer of {self.description}")
        contents = records.tobytes(), None if versions is None else versions.tobytes()
        self.records, self.versions = records, versions
        if contents == self._contents:
            return
        self._contents = None  # after a write that fails, the next one counts as a change
        self.buffer.write(contents[0])
        self.version = new_version()
        self._contents = contents

    def bind(self, block: int = 0) -> None:
        """Bind block number `block` of the records as the uniform block of its description."""
        nbytes = self.description.block * self.description.stride
        self.buffer.bind_to_uniform_block(self.description.binding, offset=block * nbytes, size=nbytes)

    def release(self) -> None:
        """Delete the buffer."""
        self.buffer.release()
