"""Open Image Denoise takes noise, keeps the light within surfaces, and gives the same bits each time."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from deferred_ir.base.errors import DeviceError
from deferred_ir.pool.denoiser import Denoiser, find_obstacle

NEEDED = pytest.mark.skipif(find_obstacle() is not None, reason="without the extra denoise, which dev includes")


def noise(shape, seed=0):
    return np.random.default_rng(seed).gamma(2.0, 0.5, (*shape, 3)).astype(np.float32)


def two_surfaces(shape=(48, 64), bright=1e4):
    """Light of 1 on the left and `bright` on the right."""
    light = np.ones((*shape, 3), np.float32)
    light[:, shape[1] // 2 :] = bright
    return light


@NEEDED
@pytest.mark.parametrize("quality", ["fast", "balanced"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (1, 90), (48, 64)])
def test_even_light_stays_even_to_the_edges_of_the_image(shape, quality):
    light = np.full((*shape, 3), 3.0, np.float32)
    np.testing.assert_allclose(Denoiser().denoise(light, light, quality), light, rtol=0.02)


@NEEDED
@pytest.mark.parametrize("quality", ["fast", "balanced"])
def test_it_takes_noise_and_no_light_and_nothing_crosses_an_edge(quality):
    light = two_surfaces()
    denoised = Denoiser().denoise(light * noise(light.shape[:2]), light, quality) / light
    assert denoised.std() < 0.25 * noise(light.shape[:2]).std()
    assert denoised[:, :32].mean() == pytest.approx(1, abs=0.05)
    assert denoised[:, 31].mean() == pytest.approx(1, abs=0.15)


@NEEDED
@pytest.mark.parametrize("shape", [(31, 45), (8, 70)])
def test_a_shadow_that_the_filter_has_blurred_comes_back(shape):
    true = np.ones((*shape, 3), np.float32)
    true[:, shape[1] // 2 :] = 0.2
    blurred = np.full_like(true, true.mean())
    denoised = Denoiser().denoise(true * noise(shape), blurred, "fast")
    assert np.abs(denoised - true).mean() < 0.3 * np.abs(blurred - true).mean()


@NEEDED
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("quality", ["fast", "balanced"])
def test_runs_and_numbers_of_threads_give_the_same_bits(threads, quality):
    noisy, filtered = noise((70, 90)), two_surfaces((70, 90))
    expected = Denoiser(2).denoise(noisy, filtered, quality)
    one = Denoiser(threads)
    for _ in range(2):
        np.testing.assert_array_equal(one.denoise(noisy, filtered, quality), expected)


@NEEDED
def test_other_sizes_and_qualities_may_follow_each_other():
    one = Denoiser()
    for shape in ((20, 30), (30, 20), (20, 30)):
        for quality in ("fast", "balanced"):
            filtered = np.ones((*shape, 3), np.float32)
            expected = Denoiser().denoise(noise(shape), filtered, quality)
            np.testing.assert_array_equal(one.denoise(noise(shape), filtered, quality), expected)


@NEEDED
@pytest.mark.parametrize("scale", [2.0**-120, 2.0**-60, 2.0**60, 2.0**118])
def test_units_do_not_matter(scale):
    noisy, filtered = noise((20, 30)), two_surfaces((20, 30), bright=4.0)
    expected = Denoiser().denoise(noisy, filtered, "fast")
    denoised = Denoiser().denoise(noisy * np.float32(scale), filtered * np.float32(scale), "fast")
    np.testing.assert_allclose(denoised / np.float32(scale), expected, rtol=1e-6)


@NEEDED
def test_black_stays_black_and_what_is_not_finite_stays_where_it_is():
    noisy, filtered = noise((40, 40)), np.ones((40, 40, 3), np.float32)
    for image in (noisy, filtered):
        image[:10] = 0
        image[20, 20], image[25, 25] = np.nan, np.inf
    noisy[30, 30] = np.nan
    denoised = Denoiser().denoise(noisy, filtered, "fast")
    assert not denoised[:10].any()
    assert np.isnan(denoised[20, 20]).all()
    assert np.isinf(denoised[25, 25]).all()
    assert (denoised[30, 30] == 1).all()
    denoised[[20, 25], [20, 25]] = 1
    assert np.isfinite(denoised).all()
    assert denoised[11:].min() > 0.1
    assert denoised.max() < 3
    black = np.zeros((5, 6, 3), np.float32)
    assert not Denoiser().denoise(black, black, "fast").any()


def test_without_the_wheel_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)
    assert find_obstacle() == "mitsuba-oidn is not installed; pip install 'deferred-ir[denoise]'"


def test_a_broken_wheel_is_one_line(monkeypatch):
    def fail(kind):
        raise OSError("libnanothread.so:\n no such file")

    broken = SimpleNamespace(Device=fail, DeviceType=SimpleNamespace(CPU=1))
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", broken)
    light = np.ones((4, 4, 3), np.float32)
    with pytest.raises(DeviceError, match=r"^mitsuba-oidn fails: libnanothread.so: no such file; pip install"):
        Denoiser().denoise(light, light, "fast")
