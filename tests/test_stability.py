"""Stiff and extreme cases, each of which went wrong once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_scenes import box, build, room

from deferred_ir.lights import Spotlight


def test_vpls_beside_an_edge_do_not_shine_through_the_other_wall(renderer) -> None:
    """In a closed box a hundredth of the scene wide, where many lie within 0.0001 of it of another wall."""
    light = Spotlight((0.0, 0.0, 0.0), (0.3, -1.0, 0.2), 130.0, (1.0, 1.0, 1.0))
    walls = box((-1, -1, -1), (1, 1, 1))
    small = box((-0.015, -0.015, -0.015), (0.015, 0.015, 0.015))
    scene = build(walls, small, camera=room().camera, spotlight=light)
    one = renderer((64, 64), set={"vpl.count": 128, "shadow_maps.vpl_size": 64})
    assert one.render(scene).radiance.max() == 0
    inside = replace(scene, camera=replace(scene.camera, position=(0.0, 0.0, 0.012), look_at=(0.0, 0.0, 0.0)))
    assert np.all(one.render(inside).radiance.max(axis=-1) > 0)
