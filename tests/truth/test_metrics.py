"""Distances between images: their definitions, written out again, and rules that hold for all images."""

import json
import subprocess
import sys

import flip_evaluator
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from deferred_ir.base.errors import SettingError
from deferred_ir.truth import metrics
from deferred_ir.truth.flip import FlipParameters

IMAGES = arrays(np.float32, (5, 7, 3), elements=st.floats(0, 1000, width=32)).filter(lambda image: image.max() > 0.01)


def make_pictures(seed=0, shape=(40, 50)):
    rng = np.random.default_rng(seed)
    reference = rng.gamma(1.0, 1.0, (*shape, 3)).astype(np.float32)
    return reference * rng.normal(1, 0.2, (*shape, 3)).clip(0).astype(np.float32), reference


def relmse_by_definition(image, reference, hit):
    """Return relMSE as docs/metrics.md defines it."""
    image, reference = image.astype(float), reference.astype(float)
    error = ((image - reference) ** 2 / (reference**2 + 0.01 * reference[hit].mean() ** 2)).mean(-1)[hit]
    return np.sort(error)[: int(len(error) * 0.999)].mean(), error.mean()


def test_relmse_is_the_contracts():
    image, reference = make_pictures()
    hit = np.random.default_rng(1).random(reference.shape[:2]) < 0.7
    assert metrics.relmse(image, reference, hit) == pytest.approx(relmse_by_definition(image, reference, hit))


def test_background_does_not_count_however_it_is_marked():
    image, reference = make_pictures()
    hit = np.random.default_rng(1).random(reference.shape[:2]) < 0.7
    image[~hit] = reference[~hit] = 0
    wanted = relmse_by_definition(image, reference, hit)
    for told in (hit, float(hit.mean()), None):
        assert metrics.relmse(image, reference, told) == pytest.approx(wanted)


def test_dark_surfaces_count_when_the_share_of_hits_is_known():
    image, reference = make_pictures()
    image[:10] = reference[:10] = 0  # surfaces that no light reaches
    everywhere = np.ones(reference.shape[:2], bool)
    assert metrics.relmse(image, reference, 1.0) == pytest.approx(relmse_by_definition(image, reference, everywhere))


def test_bias_is_signed_and_rmse_absolute():
    _, reference = make_pictures()
    assert metrics.bias(0.9 * reference, reference) == pytest.approx(-0.1, abs=1e-6)
    assert metrics.bias(1.2 * reference, reference) == pytest.approx(0.2, abs=1e-6)
    assert metrics.rmse(reference + 0.5, reference) == pytest.approx(0.5, abs=1e-6)


@given(IMAGES)
def test_nothing_differs_from_itself(image):
    assert metrics.relmse(image, image) == (0, 0)
    assert metrics.rmse(image, image) == metrics.bias(image, image) == 0


@given(IMAGES, IMAGES, st.integers(-10, 10))
def test_relative_errors_do_not_depend_on_exposure(image, reference, stops):
    scale = np.float32(2.0**stops)
    small = metrics.relmse(image, reference, 1.0)
    assert metrics.relmse(image * scale, reference * scale, 1.0) == pytest.approx(small, rel=1e-6)
    assert metrics.bias(image * scale, reference * scale) == pytest.approx(metrics.bias(image, reference), rel=1e-6)


@given(IMAGES, IMAGES, st.randoms())
def test_where_a_pixel_stands_does_not_matter(image, reference, random):
    order = list(range(35))
    random.shuffle(order)
    moved = [array.reshape(35, 3)[order].reshape(5, 7, 3) for array in (image, reference)]
    assert metrics.relmse(*moved) == pytest.approx(metrics.relmse(image, reference), rel=1e-9)


@given(IMAGES, IMAGES)
def test_trimming_takes_the_worst_away(image, reference):
    trimmed, whole = metrics.relmse(image, reference)
    assert trimmed <= whole * (1 + 1e-12)


@given(
    arrays(np.float32, (4, 6, 3), elements=st.sampled_from([0.5, 1.0, np.nan, np.inf, -np.inf])).filter(
        lambda image: not np.isfinite(image).all()
    ),
    st.booleans(),
)
def test_what_is_not_finite_is_refused_by_name_and_count(broken, as_reference):
    whole = np.ones((4, 6, 3), np.float32)
    pair = (whole, broken) if as_reference else (broken, whole)
    count = int((~np.isfinite(broken)).any(-1).sum())
    with pytest.raises(SettingError, match=f"^{'b' if as_reference else 'a'}: {count} of 24 pixels are not finite"):
        metrics.compare(*pair, names=("a", "b"))


@pytest.mark.parametrize(
    ("image", "reference", "words"),
    [
        (np.ones((4, 4, 3)), np.ones((4, 5, 3)), "render it at --size 5x4"),
        (np.ones((4, 4)), np.ones((4, 4, 3)), "has the shape"),
        (np.ones((4, 4, 3), int), np.ones((4, 4, 3)), "wants linear radiance in floats"),
        (np.ones((4, 4, 3)), np.zeros((4, 4, 3)), "is black"),
        (np.ones((0, 4, 3)), np.zeros((0, 4, 3)), "has the shape"),
    ],
)
def test_what_cannot_be_measured_is_refused(image, reference, words):
    with pytest.raises(SettingError, match=words):
        metrics.compare(image, reference)


@pytest.mark.parametrize(
    ("hit", "words"),
    [
        (np.ones((4, 5), bool), "wants bool"),
        (np.ones((4, 4)), "wants bool"),
        (np.zeros((4, 4), bool), "is black"),
        *((fraction, "no fraction") for fraction in (0.0, -0.5, 1.5, np.nan)),
    ],
)
def test_hits_that_cannot_be_are_refused(hit, words):
    with pytest.raises(SettingError, match=words):
        metrics.relmse(np.ones((4, 4, 3)), np.ones((4, 4, 3)), hit)


def test_radiance_of_any_float_type_is_taken_but_none_that_32_bits_cannot_hold():
    image = np.full((4, 4, 3), 1.5)
    for kind in (np.float16, np.float32, ">f4", np.longdouble):
        assert metrics.relmse(image.astype(kind), image) == (0, 0)
    image[1, 2, 0] = 1e39
    with pytest.raises(SettingError, match="1 of 16 pixels are not finite, first x = 2, y = 1"):
        metrics.relmse(np.ones((4, 4, 3)), image)


def test_an_image_that_is_lit_where_the_reference_has_background_is_not_flattered():
    image, reference = make_pictures()
    reference[:20] = 0
    trimmed, whole = metrics.relmse(image, reference, 0.5)
    assert trimmed <= whole
    result = metrics.compare(image, reference, 0.5)
    assert result.pixels == int(((image != 0) | (reference != 0)).any(-1).sum())


def test_figures_are_plain_data():
    image, reference = make_pictures()
    assert json.loads(json.dumps(metrics.compare(image, reference).as_dict()))["size"] == [50, 40]


def test_flip_of_an_image_with_itself_is_nothing():
    _, reference = make_pictures()
    assert metrics.compare(reference, reference).flip == pytest.approx(0, abs=1e-6)


def test_flip_is_what_its_package_says_of_an_image_without_black():
    image, reference = make_pictures(shape=(64, 64))
    _, value, used = flip_evaluator.evaluate(reference, image, "HDR", applyMagma=False)
    result = metrics.compare(image, reference)
    assert result.flip == pytest.approx(value, abs=1e-5)
    assert result.flip_parameters.start_exposure == pytest.approx(used["startExposure"], abs=1e-4)
    assert result.flip_parameters.stop_exposure == pytest.approx(used["stopExposure"], abs=1e-4)
    assert result.flip_parameters.exposures == used["numExposures"]
    assert result.flip_parameters.pixels_per_degree == pytest.approx(used["ppd"], rel=1e-6)


def test_flip_keeps_its_exposures_where_most_of_the_reference_is_background():
    image, reference = make_pictures(shape=(64, 64))
    parameters = FlipParameters.from_reference(reference[:16])
    image[16:] = reference[16:] = 0
    result = metrics.compare(image, reference)
    assert result.flip_parameters == parameters
    assert 0 < result.flip < 0.25


@pytest.mark.parametrize("scale", [1e-30, 1e-20, 1e20, 1e30])
@pytest.mark.slow
def test_flip_does_not_depend_on_the_unit_of_radiance(scale):
    image, reference = (array.astype(float) for array in make_pictures())
    plain = metrics.compare(image, reference).flip
    assert metrics.compare(image * scale, reference * scale).flip == pytest.approx(plain, abs=1e-4)


@pytest.mark.slow
def test_flip_takes_a_firefly_and_any_range_for_what_they_are():
    _, reference = make_pictures()
    firefly = reference.copy()
    firefly[5, 6] = 3e38
    parameters = FlipParameters.from_reference(reference)
    white = np.minimum(firefly, np.float32(1e6))
    flips = [metrics.compare(image, reference, flip_parameters=parameters).flip for image in (firefly, white)]
    assert 0 < flips[0] == pytest.approx(flips[1], abs=1e-6)
    wide = reference.copy()
    wide[0, 0] = 3e38
    assert 0 < metrics.compare(2 * reference.clip(0, 1e3), wide).flip <= 1


@pytest.mark.parametrize("values", [(0.0, 1.0, 1), (1.0, 0.0, 2), (0.0, np.inf, 2), (np.nan, 1.0, 2), (0.0, 41.0, 42)])
def test_exposures_that_would_hide_a_difference_are_refused(values):
    with pytest.raises(SettingError, match="stops from start to stop"):
        FlipParameters(*values)


def test_no_exposure_shows_a_black_reference():
    with pytest.raises(SettingError, match="black"):
        FlipParameters.from_reference(np.zeros((4, 4, 3)))


def test_the_flip_package_cannot_end_the_program(monkeypatch):
    def leave(*arguments, **options):
        raise SystemExit(1)

    monkeypatch.setattr(flip_evaluator, "evaluate", leave)
    with pytest.raises(SettingError, match="flip-evaluator refuses"):
        metrics.compare(*make_pictures())


def test_flip_sees_what_is_there_and_its_exposures_stay_fixed_in_a_sweep():
    image, reference = make_pictures(shape=(64, 64))
    parameters = FlipParameters.from_reference(reference)
    near = metrics.compare(0.5 * image + 0.5 * reference, reference, flip_parameters=parameters)
    far = metrics.compare(image, reference, flip_parameters=parameters)
    assert 0 < near.flip < far.flip < 1
    assert near.flip_parameters == far.flip_parameters == parameters
    assert metrics.compare(image, reference).flip == far.flip


def test_flip_is_left_out_where_it_has_no_meaning_and_says_why():
    image, reference = make_pictures()
    image[3, 4] = -0.5
    result = metrics.compare(image, reference)
    assert result.flip is None
    assert "below 0" in result.flip_note


def test_without_the_flip_package_all_other_figures_are_there():
    code = (
        "import sys; sys.modules['flip_evaluator'] = None; import numpy as np; "
        "from deferred_ir.truth.metrics import compare; "
        "r = compare(np.full((4, 4, 3), 1.1), np.ones((4, 4, 3))); "
        "assert r.flip is None and 'pip install' in r.flip_note and 0.09 < r.bias < 0.11, r"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
