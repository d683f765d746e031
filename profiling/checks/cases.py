"""The stiff and extreme cases that `deferred-ir check` draws, as data. docs/stability.md says why the bounds are so."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi

from deferred_ir.profiling.checks import change_surfaces as surface
from deferred_ir.profiling.checks import change_triangles as shape
from deferred_ir.profiling.checks import change_views as change
from deferred_ir.profiling.checks.extremes import HALF_FLOAT, Case

ROUNDING = 2.0**-24
"""Of a 32-bit float, relative."""
ROUNDED = 16 * ROUNDING
"""Bound where a few factors are rounded otherwise."""
TEXELS = 256
"""Across a VPL's map, unless a case says otherwise."""
MOVED = 8 * TEXELS * ROUNDING
"""Bound where coordinates are rounded otherwise: by so much of a texel edges move in maps."""
NORMALS = 2.0**-14
"""Bound where normals are rounded otherwise before they are stored in 16 bits."""
SAME, OTHER = 1.5, 4.0
"""Slack where light and view stay, and where they do not."""


def coarse(size: int, slack: float = SAME) -> float:
    """Slack for maps of `size` texels: what they get wrong grows with a texel's width."""
    return slack * max(1.0, TEXELS / size)


RANDOM = {"vpl.pattern": "random"}
"""Takes any number of points as well as any other."""
SCALE = tuple(
    Case(f"scale {factor:g}, E by its square", partial(change.scaled, factor=factor), "itself", bound=MOVED)
    for factor in (1e-4, 1e-2, 1e2, 1e4)
)
AWAY = tuple(
    Case(f"{units:g} units from the origin", partial(change.shifted, by=(units, -units, units)), "itself", bound=MOVED)
    for units in (1e3, 1e5, 1e7)
)
CAMERA = (
    *(
        Case(f"near/far 1e7, card {near:g} diagonals away", partial(shape.near_and_far, near=near), slack=OTHER)
        for near in (1e-3, 1e-5)
    ),
    *(
        Case(f"camera {off:g} diagonals from a wall", partial(change.camera_at_a_wall, fraction=off), slack=OTHER)
        for off in (1e-3, 1e-5, 1e-7)
    ),
    *(
        Case(
            f"camera along a wall, {off:g} off", partial(change.camera_at_a_wall, fraction=off, along=True), slack=OTHER
        )
        for off in (1e-3, 1e-5)
    ),
    Case("camera and light in a box 0.01 wide", partial(shape.all_in_a_box, half=0.005), slack=OTHER),
    *(
        Case(f"up {angle:g} rad from the view", partial(change.looking_along_up, angle=angle), "itself", bound=MOVED)
        for angle in (1e-2, 2e-6)
    ),
)
LIGHT = (
    *(
        Case(f"light {off:g} diagonals from a wall", partial(change.light_at_a_wall, fraction=off), slack=OTHER)
        for off in (1e-3, 1e-5, 1e-7, 0.0)
    ),
    Case("light grazing a wall", partial(change.light_at_a_wall, fraction=1e-3, grazing=True), slack=OTHER),
    Case("light in a corner", change.light_in_a_corner, slack=OTHER),
    *(
        Case(f"light within a box {2 * half:g} wide", partial(shape.light_in_a_box, half=half), "black")
        for half in (0.005, 0.0005)
    ),
    Case("camera where the light is", change.facing_each_other, slack=OTHER),
    *(
        Case(f"E times {factor:g}", partial(change.brighter, factor=factor), "itself", bound=ROUNDED, gain=factor)
        for factor in (1e-20, 1e-10, 1e10, 1e20)
    ),
    Case("spotlight's fov 0.1: all VPLs in one spot", partial(change.with_light, fov=0.1), slack=OTHER),
    Case("spotlight's fov 179.9", partial(change.with_light, fov=179.9), slack=OTHER),
    *(Case(f"{count} VPLs", slack=OTHER, vpls=count, settings=RANDOM) for count in (0, 1, 3)),
    Case("4096 VPLs, maps 32", slack=coarse(32), vpls=4096, settings={"shadow_maps.vpl_size": 32}, size=(32, 32)),
    Case("vpl.fov 1", slack=OTHER, settings={"vpl.fov": 1.0}),
    Case("vpl.fov 179.9, perspective", against="unshadowed", bound=ROUNDED, settings={"vpl.fov": 179.9}),
    Case("vpl.fov 179.9, paraboloid", slack=SAME, graph="hemisphere"),
    Case(
        "albedo 0, 50 bounces", partial(surface.with_albedo, albedo=0.0), "black", settings={"vpl.bounces": 50}, vpls=8
    ),
    Case(
        "albedo 1, 50 bounces",
        partial(surface.with_albedo, albedo=1.0),
        slack=coarse(128, OTHER),
        settings={"vpl.bounces": 50, "shadow_maps.vpl_size": 128},
        vpls=8,
    ),
)
TRIANGLES = (
    Case("two walls closer than a texel", partial(shape.thin_walls, apart=1e-4), slack=SAME),
    Case("slivers of 1e-6", partial(shape.split, share=1e-6), "itself", bound=MOVED),
    Case("triangles that are points and lines", shape.degenerate, "itself", bound=ROUNDED),
    Case("each face twice", shape.doubled, "itself", bound=ROUNDED),
    Case("each face twice, once from behind", partial(shape.doubled, turned=True), "itself", bound=MOVED),
    Case("each face and its parts, coplanar", partial(shape.split, share=0.3, whole=True), "itself", bound=MOVED),
    *(
        Case(f"backdrop {times:g} diagonals away", partial(shape.with_backdrop, times=times), slack=OTHER)
        for times in (1e2, 1e3, 1e6)
    ),
    *(
        Case(f"triangle {times:g} times larger, {name}", partial(shape.with_giant, times=times, tilt=tilt), slack=OTHER)
        for times in (1e3, 1e6)
        for name, tilt in (("upright", 0.0), ("aslant", pi / 5))
    ),
)
SURFACES = (
    Case("normals 0", partial(surface.with_normals, value=0.0), "itself", wanted=surface.faceted),
    Case("normals NaN", partial(surface.with_normals, value=float("nan")), "itself", wanted=surface.faceted),
    Case("normals against the faces", surface.against_the_faces, "itself", wanted=surface.faceted, bound=NORMALS),
    *(
        Case(
            f"texture {side}x{side}",
            partial(surface.papered, size=side),
            "itself",
            wanted=surface.painted,
            bound=HALF_FLOAT,
        )
        for side in (1, 8192)
    ),
    Case(
        "texture coordinates 1e4",
        partial(surface.checkered, shift=1e4),
        "itself",
        wanted=surface.checkered,
        bound=MOVED,
    ),
)
SIZES = (
    *(
        Case(f"maps {side}x{side}", slack=coarse(side), settings={"shadow_maps.vpl_size": side}, vpls=4)
        for side in (16, 64, 1024, 4096)
    ),
    Case("image 1x1", against="itself", size=(1, 1), middle=(129, 129), bound=ROUNDED),
    *(Case(f"image {w}x{h}", slack=OTHER, size=(w, h)) for w, h in ((1, 4096), (4096, 1), (37, 53))),
)


def _of(graph: str, *cases: Case) -> tuple[Case, ...]:
    return tuple(replace(case, graph=graph) for case in cases)


NAMED = {case.name: case for case in (*SCALE, *AWAY, *CAMERA, *LIGHT, *TRIANGLES, *SURFACES, *SIZES)}


def _again(graph: str, *names: str) -> tuple[Case, ...]:
    """Cases in another graph."""
    return tuple(replace(NAMED[name], graph=graph) for name in names)


LINEAR = ("E times 1e-20", "E times 1e+20", "scale 10000, E by its square")
BOX = "light within a box 0.01 wide"
MAPS = (
    "light within a box 0.001 wide",
    "0 VPLs",
    "1 VPLs",
    "camera 1e-05 diagonals from a wall",
    "light 1e-05 diagonals from a wall",
    "light grazing a wall",
    "two walls closer than a texel",
    "backdrop 1e+06 diagonals away",
    "triangle 1e+06 times larger, aslant",
    "slivers of 1e-6",
)
TWICE = ("triangles that are points and lines", "each face twice")
GRAPHS = (
    *_again("forward", *LINEAR, BOX, *MAPS, *TWICE),
    *_again("hemisphere", *LINEAR, BOX, *MAPS),
    # Which triangles are split, and may bend less, goes by their neighbours in memory: not the same to the bit.
    *(replace(case, against="rays", slack=SAME) for case in _again("hemisphere", *TWICE)),
    *_again("interleaved", *LINEAR, BOX),
    *_again("accurate", *LINEAR, BOX),
    *_again("incremental", *LINEAR, BOX),
)
"""Where it matters, again with plain maps, with paraboloid maps, and with what other graphs add."""

CASES = (Case("as it is", slack=1.0), *NAMED.values(), *GRAPHS)
