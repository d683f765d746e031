"""What wraps OpenGL: textures, framebuffers, buffers, timestamps, and how faults of the driver are told."""

from __future__ import annotations

import time

import numpy as np
import pytest

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.formats import FORMATS
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.gl.raw import GL
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.gl.timers import Timers
from deferred_ir.graph.ports import Buffer, Texture

RECORD = np.dtype([("a", "f4", 4), ("b", "f4", 4)])


@pytest.mark.parametrize("format", sorted(set(FORMATS) - {"depth32f"}))
@pytest.mark.parametrize("size", [(4, 3), (1, 1), (5, 7)])
def test_what_is_uploaded_is_read_back(gpu, format, size):
    """Odd sizes, for rows need not be aligned."""
    known = FORMATS[format]
    top = {"u1": 255, "u4": 2**32 - 1}.get(known.dtype, 1)
    pixels = np.random.default_rng(0).integers(0, top, (size[1], size[0], known.channels), endpoint=True)
    if known.dtype == "f4":
        pixels = pixels * 0.5
    texture = GpuTexture(gpu, Texture(format, size), size)
    texture.upload(pixels)
    np.testing.assert_allclose(texture.read(), pixels.astype(known.dtype), atol=1e-5 if format == "rgba16" else 0)
    assert texture.nbytes == size[0] * size[1] * known.bytes
    texture.release()


def test_array_layers_are_read_as_layers(gpu):
    array = GpuTexture(gpu, Texture("depth32f", (4, 2), layers=3), (4, 2))
    target = Framebuffer(gpu, {"depth": array}, "test")
    target.bind()
    target.clear_depth(0.75)
    pixels = array.read()
    assert pixels.shape == (3, 2, 4, 1)
    assert (pixels == 0.75).all()  # a layered target is cleared whole
    target.release()
    array.release()


def test_targets_of_different_kinds_do_not_fit_together(gpu):
    flat = GpuTexture(gpu, Texture("rgba8", (4, 4)), (4, 4))
    layered = GpuTexture(gpu, Texture("depth32f", (4, 4), layers=2), (4, 4))
    with pytest.raises(
        ValueError, match=r"^mixed: framebuffer incomplete \(0x....\): outputs differ in size or layers$"
    ):
        Framebuffer(gpu, {"color": flat, "depth": layered}, "mixed")
    flat.release()
    layered.release()


def test_a_texture_that_does_not_fit_is_told_and_leaves_no_error_behind(gpu):
    layers, edge = gpu.max_layers, min(gpu.max_size, 16384)
    with pytest.raises(DeviceError, match=r"^texture rgba32f .* of \d+ MiB: .*; use a smaller size or fewer VPLs$"):
        GpuTexture(gpu, Texture("rgba32f", (edge, edge), layers=layers), (edge, edge))


def test_buffers_hold_whole_blocks(gpu):
    buffer = GpuBuffer(gpu, Buffer("light", 5, RECORD.itemsize, block=4))
    assert buffer.nbytes == 8 * RECORD.itemsize
    records = np.zeros(5, RECORD)
    records["a"] = np.arange(5)[:, None]
    buffer.write(records)
    assert buffer.records is records
    assert buffer.buffer.read(records.nbytes) == records.tobytes()
    buffer.write(records[:2])
    assert len(buffer.records) == 2
    buffer.release()


def test_more_records_than_a_buffer_holds_or_of_another_kind_are_an_error(gpu):
    buffer = GpuBuffer(gpu, Buffer("light", 2, RECORD.itemsize))
    for records in (np.zeros(3, RECORD), np.zeros(1, "f4")):
        with pytest.raises(ValueError, match="into a buffer of 2 light"):
            buffer.write(records)
    buffer.release()


def test_samplers_are_shared_and_differ_where_their_use_does(gpu):
    assert gpu.sampler(linear=True) is gpu.sampler(linear=True)
    assert gpu.sampler(linear=True) is not gpu.sampler(linear=False)
    assert gpu.sampler(linear=True, compare=">=") is not gpu.sampler(linear=True)
    plain = gpu.image_sampler("linear", "linear", None, ("repeat", "repeat"))
    assert plain is gpu.image_sampler("linear", "linear", None, ("repeat", "repeat"))
    assert plain is not gpu.image_sampler("linear", "linear", None, ("repeat", "mirror"))


def test_a_function_that_the_driver_lacks_is_one_line():
    class Empty:
        def load(self, name: str) -> int:
            return 0

    with pytest.raises(DeviceError, match=r"^OpenGL: this driver has no glClipControl; update the driver"):
        GL(Empty()).ClipControl(0, 0)


def test_a_pending_error_is_told_once(gpu):
    gpu.gl.BindTexture(0x1234, 0)
    with pytest.raises(DeviceError, match=r"^testing: OpenGL error 0x0500; "):
        gpu.gl.check("testing")
    gpu.gl.check("testing")


def test_laps_follow_one_another_and_span_the_frame(gpu):
    timers = Timers(gpu)
    for _ in range(2):
        with timers.frame():
            for label in ("first", "second"):
                timers.mark(label)
                time.sleep(0.01)
    assert timers.collect() == []  # still in flight
    frames = timers.collect(wait=True)
    assert len(frames) == 2
    for laps in frames:
        assert list(laps) == ["first", "second"]
        assert all(9 < cpu < 500 for _, cpu in laps.values())
        assert all(gpu_ms >= 0 for gpu_ms, _ in laps.values())
    assert timers.collect(wait=True) == []
    timers.release()


def test_a_frame_that_fails_leaves_no_laps(gpu):
    timers = Timers(gpu)

    def fail():
        with timers.frame():
            timers.mark("first")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    with timers.frame():
        timers.mark("only")
    assert [list(laps) for laps in timers.collect(wait=True)] == [["only"]]
    timers.release()
