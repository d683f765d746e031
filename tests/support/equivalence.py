"""Rendering a scene by forward and by deferred shading, and holding both images against each other."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from distance import rel_mse, share_off

from deferred_ir.engine.renderer import Renderer
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene

SIZE = (128, 128)
VPLS = 64


@lru_cache
def hit_pixels(name: str, scene: Scene) -> np.ndarray:
    """Which pixels see a surface, bool (H, W); cached by `name` and scene."""
    rays = scene.camera.rays(SIZE).reshape(-1, 3)
    hits = Tracer(scene).closest(np.broadcast_to(scene.camera.position, rays.shape), rays)
    return hits.hit.reshape(SIZE[1], SIZE[0])


def render_both(
    make: Callable[..., Renderer],
    scene: Scene,
    settings: dict[str, Any] | None = None,
    *,
    prepare: Callable[[Renderer], object] | None = None,
    forward: dict[str, Any] | None = None,
    vpls: int = VPLS,
) -> list[np.ndarray]:
    """Radiance by deferred and by forward; `prepare` is called with each Renderer before it draws.

    `make` is the fixture `renderer`; `forward` holds settings of the forward graph alone.
    """
    images = []
    for graph, more in (("deferred", {}), ("forward", forward or {})):
        one = make(SIZE, graph, set={**(settings or {}), **more})
        if prepare:
            prepare(one)
        images.append(one.render(scene, vpls=vpls, seed=1).radiance)
    return images


def assert_equivalent(deferred: np.ndarray, forward: np.ndarray, hit: np.ndarray, untrimmed: float = 1e-6) -> None:
    """Assert that two images agree in hit pixels but for roundings; `untrimmed` bounds relMSE over all of them."""
    assert forward[hit].mean() > 1e-3
    assert np.isfinite(deferred).all()
    assert np.isfinite(forward).all()
    assert rel_mse(deferred, forward, hit, trim=1e-3) < 1e-6
    assert rel_mse(deferred, forward, hit) < untrimmed
    assert share_off(deferred, forward, hit) < 1e-3
    assert deferred[hit].mean() == pytest.approx(forward[hit].mean(), rel=5e-4)
