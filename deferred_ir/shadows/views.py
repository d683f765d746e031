"""Views of direct lights on the GPU: from where each of their shadow maps is drawn, and where it lies."""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.vpl_buffer import fill_view
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.scene.lights.spotlight import one_minus_cos
from deferred_ir.shadows.settings import MapParams

VIEW = np.dtype(
    [
        ("position", "f4", 3),
        ("curve", "f4"),  # c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
        ("x_axis", "f4", 3),  # right and up, divided by tan(half angle): NDC = dot(d, axis) / dot(d, z_axis)
        ("tan_half", "f4"),
        ("y_axis", "f4", 3),
        ("size", "f4"),  # edge of the map, texels
        ("z_axis", "f4", 3),  # unit; where it looks
        ("paraboloid", "f4"),  # 1: a paraboloid map, 0: a planar one
        ("rectangle", "f4", 4),  # lower left corner and edge of the map, in [0, 1] of a layer of the atlas; the layer
    ]
)
"""One view in a std140 uniform block; shaders/lib/shadows/view.glsl declares the same five vec4."""

BINDING = 3
CAPACITY = 1
"""Views that the lights of a scene can have; each has a layer of the atlas, or a texture, to itself."""
WIDEST_PLANAR = 140.0
"""A light wider than this, in degrees, gets a paraboloid map: the planar one has few texels for its middle."""
LIFT = np.float32(100.0)
"""Near planes: a millionth of the scene. A light may hang in a surface, whose roundings must not hide what it looks at;
VPLs have been lifted off theirs (frame/vpl_buffer.lift_off_surface)."""


def describe_output() -> Output:
    """Return the port of a buffer with room for the views of any scene's lights."""
    views = Buffer("view", CAPACITY, VIEW.itemsize, block=CAPACITY, binding=BINDING)
    return Output("views of the direct lights", views, {"VIEWS_BINDING": BINDING, "VIEWS_PER_BLOCK": CAPACITY})


def pack_views(frame: Frame, params: MapParams, edge: int) -> np.ndarray:
    """Return VIEW records (n,) of the scene's lights, in order, each with a layer of `edge` texels to itself."""
    described = [view for light in frame.scene.direct_lights for view in light.list_views(frame.scene.bounds)]
    views = np.zeros(len(described), VIEW)
    for i, view in enumerate(described):
        views["position"][i] = view.position
        fill_view(views[i : i + 1], view.axis[None], view.fov)
        views["paraboloid"][i] = np.float32(one_minus_cos(view.fov)) > np.float32(one_minus_cos(WIDEST_PLANAR))
    views["position"] += views["z_axis"] * (LIFT * np.float32(frame.near))
    views["size"] = params.spot_size
    views["rectangle"][:, 2] = np.float32(params.spot_size) / np.float32(edge)
    views["rectangle"][:, 3] = np.arange(len(views))
    return views
