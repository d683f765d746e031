"""The reference of what is on screen: traced in the background, split into the picture, measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from virtual_display import FEW, SIZE, Spy, cornell, frames, picture, rendered

from deferred_ir.output.exposure import compute_stops
from deferred_ir.viewer.tone_map import tone_map


def test_the_reference_is_split_into_the_picture_and_measured(viewer):
    panel = viewer.panel.reference
    panel._spp, panel.at = 0, 0.5
    before = picture(viewer)
    panel.start()
    while panel.job.running:
        viewer.frame(0.02)
    frames(viewer, 2)
    assert panel.job.error == ""
    half = SIZE[0] // 2
    assert np.array_equal(picture(viewer)[:, :half], before[:, :half])
    result, stops = panel.job.result, compute_stops(viewer.session.image().radiance)
    assert np.array_equal(picture(viewer)[:, half:], tone_map(viewer.session, result.radiance, stops)[::-1, half:, :3])
    with Spy(viewer.panel) as spy:
        viewer.frame()
    assert any(word.startswith("relMSE 0.") for _, word in spy.calls), "in the status line, whatever is open"
    viewer.session.look(replace(viewer.session.camera, fov=50.0))
    frames(viewer, 2)
    assert not panel._matches


def test_both_sides_of_the_split_have_the_exposure_of_the_picture(viewer):
    """A reference four times as bright is shown two stops brighter, though the exposure is automatic."""
    panel, session = viewer.panel.reference, viewer.session
    panel._spp = 0
    panel.start()
    while panel.job.running:
        viewer.frame(0.02)
    radiance = session.image().radiance
    panel.job.result = replace(panel.job.result, radiance=4 * radiance)
    frames(viewer, 2)
    half, stops = SIZE[0] // 2, compute_stops(radiance)
    expected = rendered(cornell(), set={**FEW, "tonemap.exposure": stops + 2})
    assert np.array_equal(picture(viewer)[:, half:], expected[:, half:])
    same = rendered(cornell(), set={**FEW, "tonemap.exposure": stops}).astype(int)
    assert np.abs(picture(viewer)[:, :half] - same[:, :half]).max() <= 1
    session.adjust("vpl.count", 4)
    frames(viewer, 2)
    stops = compute_stops(session.image().radiance)
    expected = rendered(cornell(), set={"vpl.count": 8, "tonemap.exposure": compute_stops(radiance)})
    assert np.array_equal(picture(viewer)[:, half:], tone_map(session, 4 * radiance, stops)[::-1, half:, :3])


def test_a_trace_can_be_given_up(viewer):
    panel = viewer.panel.reference
    panel._spp = 3
    panel.start()
    viewer.frame()
    panel.job.stop()
    assert not panel.job.running
    assert panel.job.result is None
    panel._spp = 1
