"""No pass reads what no pass has written."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small_scenes import build, plane, room, sphere

from deferred_ir.engine.unwritten_reads import unwritten_reads
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.graph.file import find_obstacles

SIZE = (40, 28)
GRAPHS = [
    "forward",
    "deferred",
    "hemisphere",
    "interleaved",
    "mapped",
    "mapped by rays",
    "incremental",
    "resampled",
    "accurate",
    *(["denoised"] if "denoised" not in find_obstacles() else []),
]
SETTINGS = {"vpl.count": 16, "shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 16}
OPEN = build(plane(), sphere(0.3))
"""With background."""


def found(renderer, graph, scene, vpls=16):
    name, *rays = graph.split(" by ")
    maps = SETTINGS if name not in ("resampled", "accurate", "denoised") else {}
    settings = {**maps, "vpl.count": vpls} | ({"shadow_rays.visibility": "rays"} if rays else {})
    one = renderer(SIZE, name, set=settings)
    return unwritten_reads(one, scene, one.plan(scene))


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("scene", [room(), OPEN], ids=["room", "open"])
def test_every_texel_that_is_read_was_written(renderer, graph, scene):
    assert found(renderer, graph, scene) == []


@pytest.mark.parametrize("graph", GRAPHS)
def test_without_vpls_as_well(renderer, graph):
    assert found(renderer, graph, OPEN, vpls=0) == []


def test_with_a_disc_that_casts_soft_shadows(renderer):
    scene = replace(OPEN, lights=(replace(OPEN.spotlight, radius=0.2),))
    assert found(renderer, "deferred", scene) == []
    assert found(renderer, "mapped by rays", scene) == []


def test_a_target_that_is_not_cleared_is_found(renderer, monkeypatch):
    monkeypatch.setattr(Framebuffer, "clear_depth", lambda self: None)
    assert {"gbuffer.depth", "shadow_maps.atlas", "lighting.radiance"} <= set(found(renderer, "deferred", OPEN))


def test_blending_onto_what_is_there_is_found(renderer, monkeypatch):
    monkeypatch.setattr(Framebuffer, "clear_color", lambda self, index=0: None)
    assert "forward.radiance" in found(renderer, "forward", OPEN)
