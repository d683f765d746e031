"""The noise of a reference: what metadata tell of it, and what it leaves of an error measured against it."""

from __future__ import annotations

import math

import pytest

from deferred_ir import load
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference
from deferred_ir.truth.reference_noise import BELOW, NOISY, ReferenceNoise


def test_metadata_tell_the_noise_and_how_it_is_known():
    noise = ReferenceNoise.from_metadata({"noise": 0.01, "spp": 256})
    assert noise == ReferenceNoise(0.01, "from the spread of its 256 paths a pixel")
    assert ReferenceNoise.from_metadata({"noise": None, "note": "of one set"}) == ReferenceNoise(None, "of one set")
    assert ReferenceNoise.from_metadata({"noise": 0.0}).relmse == 0


@pytest.mark.parametrize("value", [None, True, "0.1", -0.1, math.nan, math.inf, []])
def test_what_is_no_noise_is_unknown(value):
    assert ReferenceNoise.from_metadata({"noise": value}).relmse is None
    assert ReferenceNoise.from_metadata({}).relmse is None


def test_an_error_is_flagged_by_how_much_of_it_is_noise():
    noise = ReferenceNoise(0.01, "")
    assert [noise.flag(error) for error in (0.2, 0.099, 0.0201, 0.0199, 0.0)] == ["", NOISY, NOISY, BELOW, BELOW]
    assert [noise.quote(error) for error in (0.2, 0.02015, 0.0199)] == ["0.2", "0.0202", "< 0.01"]
    assert noise.level(0.011) == noise.level(0.019) < noise.level(0.021)
    unknown, exact = ReferenceNoise(None, ""), ReferenceNoise(0.0, "")
    assert (unknown.flag(0.1), unknown.quote(0.1), unknown.level(0.1)) == (NOISY, "0.1", 0.1)
    assert (exact.flag(0.0), exact.quote(0.0), exact.level(0.1)) == ("", "0", 0.1)


def test_the_noise_that_a_reference_tells_is_half_of_what_parts_two_of_them():
    scene = load("cornell")
    one, other = (trace_reference(scene, (24, 24), spp=1024, seed=seed) for seed in (0, 1))
    apart = relmse(one.radiance, other.radiance, one.hit)[1]
    told = [ReferenceNoise.from_metadata(traced.meta) for traced in (one, other)]
    assert apart == pytest.approx(sum(noise.relmse for noise in told), rel=0.25)
