"""The display transform against its formulas, on radiance chosen by a pass of the test's own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from small_scenes import build, plane

from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Output, Texture

SIZE = (16, 12)
GRAPH = '[outputs]\nradiance = "source.out"\ndisplay = "tonemap.color"\n[passes.source]\n[passes.tonemap]\n'
GRAPH += 'inputs = { radiance = "source.out" }\n'


class Source(Pass):
    """Writes `Source.pixels`, (H, W, 3), top row first."""

    pixels = np.zeros((SIZE[1], SIZE[0], 3), np.float32)

    def outputs(self, inputs):
        return {"out": Output("", Texture("rgba32f"))}

    def execute(self, frame, io):
        rgba = np.concatenate([self.pixels, np.ones((*self.pixels.shape[:2], 1))], axis=2)
        io["out"].upload(rgba[::-1].astype("f4"))


@pytest.fixture
def display(renderer, tmp_path):
    """What tonemap with these parameters makes of (H, W, 3) radiance, uint8."""
    (tmp_path / "source.toml").write_text(GRAPH)
    made = {}

    def display(pixels, **chosen):
        Source.pixels = np.asarray(pixels, np.float32)
        key = (*sorted(chosen.items()), Source.pixels.shape)
        if key not in made:
            chosen = {f"tonemap.{name}": value for name, value in chosen.items()}
            size = (Source.pixels.shape[1], Source.pixels.shape[0])
            made[key] = renderer(size, tmp_path / "source.toml", set=chosen, passes={"source": Source})
        image = made[key].render(build(plane()))
        np.testing.assert_array_equal(image.radiance, Source.pixels)
        return image.display

    return display


def encoded(linear):
    """sRGB levels 0 to 255, not rounded."""
    c = np.clip(np.asarray(linear, np.float64), 0, 1)
    return 255 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 1e-9) ** (1 / 2.4) - 0.055)


def luminance(c):
    return (c * (0.2126, 0.7152, 0.0722)).sum(axis=-1, keepdims=True)


def neutral(c):
    """Khronos PBR Neutral, as its specification has it."""
    c = np.asarray(c, np.float64)
    x = c.min(axis=-1, keepdims=True)
    offset = np.where(x < 0.08, x - 6.25 * x * x, 0.04)
    c = c - offset
    peak = c.max(axis=-1, keepdims=True)
    start, d = 0.76, 0.24
    new_peak = 1 - d * d / (peak + d - start)
    g = 1 - 1 / (0.15 * (peak - new_peak) + 1)
    bent = c * new_peak / np.maximum(peak, start) * (1 - g) + new_peak * g
    return np.where(peak < start, c, bent)


def reinhard(c):
    return c / (1 + luminance(c))


def aces(c):
    c = 0.6 * c
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14)


CURVES = {"neutral": neutral, "reinhard": reinhard, "aces": aces, "none": lambda c: c}


def colours():
    rng = np.random.default_rng(0)
    return (rng.random((SIZE[1], SIZE[0], 3)) * 10.0 ** rng.uniform(-3, 1, (SIZE[1], SIZE[0], 1))).astype(np.float32)


@pytest.mark.parametrize("operator", CURVES)
@pytest.mark.parametrize("stops", [-2.0, 0.0, 1.5])
def test_each_operator_is_its_formula(display, operator, stops):
    found = display(colours(), operator=operator, exposure=stops)
    expected = encoded(CURVES[operator](colours().astype(np.float64) * 2**stops))
    assert np.abs(found - expected).max() < 0.55  # half a level, and what single precision adds


def test_neutral_keeps_colours_that_are_not_bright(display):
    """As its specification promises: what lies between 0.04 and 0.76 is only moved by 0.04."""
    ramp = np.broadcast_to(np.linspace(0.1, 0.7, SIZE[0])[None, :, None], (SIZE[1], SIZE[0], 3))
    assert np.abs(display(ramp, operator="neutral", exposure=0.0) - encoded(ramp - 0.04)).max() < 0.55


def test_automatic_exposure_brings_the_mean_of_what_is_lit_to_middle_grey(display):
    pixels = colours()
    pixels[:, :5] = 0  # the background does not count
    lit = luminance(pixels.astype(np.float64))[:, 5:].mean()
    found = display(pixels, operator="none")
    assert np.abs(found - encoded(pixels * 0.18 / lit)).max() < 0.55


@pytest.mark.parametrize("factor", [1e-12, 1e-3, 1e6])
def test_automatic_exposure_makes_units_of_light_irrelevant(display, factor):
    one, other = display(colours()), display(colours() * np.float32(factor))
    assert np.abs(one.astype(int) - other).max() <= 1


def test_a_black_image_stays_black(display):
    assert display(np.zeros((SIZE[1], SIZE[0], 3))).max() == 0


def test_automatic_exposure_sees_a_large_image_through_an_even_grid(display):
    """Half of it bright: a sample of part of the image would be off."""
    pixels = np.full((150, 200, 3), 0.01)
    pixels[75:] = 1.0
    found = display(pixels, operator="none")
    assert found[100, 100, 0] == pytest.approx(encoded(0.18 / 0.505), abs=2.0)


@pytest.mark.parametrize("operator", CURVES)
def test_brighter_is_never_darker(display, operator):
    steps = np.concatenate([[0], np.geomspace(1e-4, 1e30, SIZE[0] * SIZE[1] - 1)])
    ramp = np.repeat(steps.reshape(SIZE[1], SIZE[0])[..., None], 3, axis=2)
    found = display(ramp, operator=operator, exposure=0.0).reshape(-1, 3).astype(int)
    assert (np.diff(found, axis=0) >= 0).all()
    assert found[0].max() == 0
    assert found[-1].min() >= 254


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    pixels=arrays.arrays(np.float32, (2, 3, 3), elements=st.floats(0, float(np.float32(1e30)), width=32)),
    operator=st.sampled_from(list(CURVES)),
    exposure=st.sampled_from(["auto", -64.0, 0.0, 64.0]),
)
def test_any_radiance_gives_a_picture(display, pixels, operator, exposure):
    """Grey stays grey, a bright pixel is no darker than a dim one, and automatic exposure shows what there is."""
    grey = np.repeat(pixels[..., :1], 3, axis=2)
    found = display(grey, operator=operator, exposure=exposure).astype(int)
    assert (np.abs(found - found[..., :1]) <= 1).all()
    order = np.argsort(grey[..., 0].ravel(), kind="stable")
    assert (np.diff(found[..., 0].ravel()[order]) >= 0).all()
    if exposure == "auto" and grey.max() > 1e-30:
        assert found.max() > 100
    display(pixels, operator=operator, exposure=exposure)


def test_stops_are_powers_of_two(display):
    pixels = np.full((SIZE[1], SIZE[0], 3), 0.1)
    for stops in (-1.0, 0.0, 2.0):
        found = display(pixels, operator="none", exposure=stops)
        assert found[0, 0, 0] == math.floor(encoded(0.1 * 2**stops) + 0.5)
