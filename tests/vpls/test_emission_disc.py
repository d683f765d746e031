"""The disc on which equal areas get equal light."""

from __future__ import annotations

import math

import numpy as np
import pytest
from closed_forms import mean_cone_factor

from deferred_ir.sampling.patterns import sample_unit_disc
from deferred_ir.sampling.warps import build_basis, lift_to_hemisphere, square_to_disc
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.vpls.emission_disc import SpotlightDisc

FOVS = [0.1, 30.0, 100.0, 160.0, 179.99]


def make_disc(fov):
    light = Spotlight((0.3, 0.2, 0.1), (1.0, -2.0, 0.4), fov)
    return light, SpotlightDisc(light, np.stack(build_basis(light.axis)))


@pytest.mark.parametrize("fov", FOVS)
def test_points_and_directions_are_each_others_inverse(fov):
    light, emission = make_disc(fov)
    points = 0.999 * square_to_disc(np.random.default_rng(1).random((1000, 2)))
    directions = emission.unproject(points)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert emission.inside(directions).all()
    np.testing.assert_allclose(emission.project(directions), points, atol=1e-7)
    np.testing.assert_allclose(emission.unproject(np.zeros((1, 2))), light.axis[None])


@pytest.mark.parametrize("fov", FOVS)
def test_a_part_of_the_disc_gets_its_share_of_the_light(fov):
    """Light by Nusselt's analogue and the cone, summed where its points fall on the disc."""
    light, emission = make_disc(fov)
    even = sample_unit_disc("sobol", 2**16, 0) * math.sin(math.radians(fov) / 2)
    directions = lift_to_hemisphere(even, light.axis[None])
    points, sent = emission.project(directions), light.cone(directions) / len(even)
    assert emission.power == pytest.approx(math.sin(math.radians(fov) / 2) ** 2 * mean_cone_factor(fov))
    inner = [sent[np.linalg.norm(points, axis=1) < radius].sum() / sent.sum() for radius in (0.3, 0.6, 0.9, 0.98)]
    np.testing.assert_allclose(inner, np.square([0.3, 0.6, 0.9, 0.98]), rtol=3e-3)
    assert sent[points[:, 0] > 0].sum() / sent.sum() == pytest.approx(0.5, rel=3e-3)
