"""Views of direct lights on the GPU: from where each of their shadow maps is drawn, and where it lies."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.direct_lights import LIGHTS_PER_BLOCK, VIEWS_PER_BLOCK, DescribedViews
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.vpl_buffer import fill_parallel_view, fill_view
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.scene.lights.spotlight import one_minus_cos
from deferred_ir.shadows.layout import ViewLayout
from deferred_ir.shadows.settings import MapParams

VIEW = np.dtype(
    [
        ("position", "f4", 3),
        ("curve", "f4"),  # paraboloid: c / (1 + c), c the cosine of the half cone angle; parallel: 1 over its depth
        ("x_axis", "f4", 3),  # right and up, divided by tan(half angle), or by half the width of a parallel view
        ("tan_half", "f4"),  # 0 in a parallel view
        ("y_axis", "f4", 3),
        ("size", "f4"),  # edge of the map, texels
        ("z_axis", "f4", 3),  # unit; where it looks
        ("projection", "f4"),  # PLANAR, PARABOLOID or PARALLEL
        ("rectangle", "f4", 4),  # lower left corner and edge of the map, in [0, 1] of a layer of the atlas; the layer
    ]
)
"""One view in a std140 uniform block; shaders/lib/shadows/view.glsl declares the same five vec4."""

PLANAR, PARABOLOID, PARALLEL = range(3)
NAMES = ("perspective", "paraboloid", "orthographic")
"""Names of the projections, by number."""
BINDING = 3
WIDEST_PLANAR = 140.0
"""A light wider than this, in degrees, gets a paraboloid map: the planar one has few texels for its middle."""
LIFT = np.float32(100.0)
"""Near planes: a millionth of the scene. A light may hang in a surface, whose roundings must not hide what it looks at;
VPLs have been lifted off theirs (frame/vpl_buffer.lift_off_surface)."""


def describe_output(lights: int, views: int) -> Output:
    """Return the port of a buffer with room for the `views` of `lights` direct lights."""
    block = max(views, 1) if lights <= LIGHTS_PER_BLOCK else VIEWS_PER_BLOCK
    blocks = max(-(-lights // LIGHTS_PER_BLOCK), 1)
    buffer = Buffer("view", blocks * block, VIEW.itemsize, block=block, binding=BINDING)
    return Output("views of the direct lights", buffer, {"VIEWS_BINDING": BINDING, "VIEWS_PER_BLOCK": block})


def pack_views(frame: Frame, described: DescribedViews, layout: ViewLayout, edge: int) -> np.ndarray:
    """Return VIEW records (n,) of the views of the scene's direct lights, in layers of `edge` texels."""
    views = np.zeros(len(described.views), VIEW)
    for record, view in zip(views, described.views, strict=True):
        record["position"] = view.position
        one = record.reshape(1)
        if view.fov == 0:
            record["projection"] = PARALLEL
            fill_parallel_view(one, view.axis[None], view.reach, view.depth)
            continue
        fill_view(one, view.axis[None], view.fov)
        wide = np.float32(one_minus_cos(view.fov)) > np.float32(one_minus_cos(WIDEST_PLANAR))
        record["projection"] = PARABOLOID if wide else PLANAR
    # The faces of a cube look everywhere: a step along each would lead some through a surface that the light lies on.
    alone = np.bincount(described.owners)[described.owners] == 1 if len(views) else np.zeros(0, bool)
    lifted = (views["projection"] != PARALLEL) & alone
    views["position"][lifted] += views["z_axis"][lifted] * (LIFT * np.float32(frame.near))
    views["size"] = layout.sizes
    places: Ints = np.array(layout.places, int).reshape(-1, 3)
    views["rectangle"][:, :2] = places[:, 1:].astype(np.float32) / np.float32(edge)
    views["rectangle"][:, 2] = np.array(layout.sizes, np.float32) / np.float32(edge)
    views["rectangle"][:, 3] = places[:, 0]
    return views


def find_projections(records: np.ndarray, params: MapParams) -> Ints:
    """Return the projections of the maps of VPL or VIEW records (n,), int (n,)."""
    if records.dtype == VIEW:
        return records["projection"].astype(int)
    found: Ints = np.full(len(records), PARABOLOID if params.projection == "paraboloid" else PLANAR)
    found[records["one_minus_cos"] >= 1] = PARABOLOID  # the whole hemisphere
    found[records["tan_half"] == 0] = PARALLEL
    return found


def place_views(views: np.ndarray, rows: Ints, block: int) -> np.ndarray:
    """Return VIEW records (m,) with `views` (n,) in their `rows` (n,) of the buffer, whole blocks of `block`."""
    placed = np.zeros(-(-(int(rows.max(initial=-1)) + 1) // block) * block, VIEW)
    placed[rows] = views
    return placed
