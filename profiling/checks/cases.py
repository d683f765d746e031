"""The extreme cases of `deferred-ir check`, as data. docs/stability.md explains the bounds."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi

from deferred_ir.graph.file import find_obstacles
from deferred_ir.profiling.checks.changes import lights
from deferred_ir.profiling.checks.changes import surfaces as surface
from deferred_ir.profiling.checks.changes import triangles as shape
from deferred_ir.profiling.checks.changes import views as change
from deferred_ir.profiling.checks.extremes import MOVED, ROUNDED, TEXELS, Case
from deferred_ir.profiling.checks.surface_cases import GLOSS, SURFACES

SAME, OTHER = 1.5, 4.0
"""Slack where light and view stay, and where they change."""


def coarse(size: int, slack: float = SAME) -> float:
    """Return the slack for maps of `size` texels: their errors grow with a texel's width."""
    return slack * max(1.0, TEXELS / size)


RANDOM = {"vpl.pattern": "random"}
"""A pattern that suits every number of points."""
SCALE = tuple(
    Case(f"scale {factor:g}, E by its square", partial(change.scale, factor=factor), "itself", bound=MOVED)
    for factor in (1e-4, 1e-2, 1e2, 1e4)
)
AWAY = tuple(
    Case(f"{units:g} units from the origin", partial(change.shift, by=(units, -units, units)), "itself", bound=MOVED)
    for units in (1e3, 1e5, 1e7)
)
CAMERA = (
    *(
        Case(f"near/far 1e7, card {near:g} diagonals away", partial(shape.add_near_and_far, near=near), slack=OTHER)
        for near in (1e-3, 1e-5)
    ),
    *(
        Case(f"camera {off:g} diagonals from a wall", partial(change.put_camera_at_wall, fraction=off), slack=OTHER)
        for off in (1e-3, 1e-5, 1e-7)
    ),
    *(
        Case(
            f"camera along a wall, {off:g} off",
            partial(change.put_camera_at_wall, fraction=off, along=True),
            slack=OTHER,
        )
        for off in (1e-3, 1e-5)
    ),
    Case("camera and light in a box 0.01 wide", partial(shape.put_all_in_box, half=0.005), slack=OTHER),
    *(
        Case(f"up {angle:g} rad from the view", partial(change.tilt_up, angle=angle), "itself", bound=MOVED)
        for angle in (1e-2, 2e-6)
    ),
)
LIGHT = (
    *(
        Case(f"light {off:g} diagonals from a wall", partial(change.put_light_at_wall, fraction=off), slack=OTHER)
        for off in (1e-3, 1e-5, 1e-7, 0.0)
    ),
    Case("light grazing a wall", partial(change.put_light_at_wall, fraction=1e-3, grazing=True), slack=OTHER),
    Case("light in a corner", change.put_light_in_corner, slack=OTHER),
    *(
        Case(f"light within a box {2 * half:g} wide", partial(shape.put_light_in_box, half=half), "black")
        for half in (0.005, 0.0005)
    ),
    Case("camera where the light is", change.put_camera_at_light, slack=OTHER),
    *(
        Case(f"E times {factor:g}", partial(change.brighten, factor=factor), "itself", bound=ROUNDED, gain=factor)
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
KINDS = (
    Case("sun 1e5 times as bright as the sky", lights.put_sun_and_sky, slack=OTHER),
    Case("environment of one bright texel", lights.put_texel, slack=OTHER),
    Case("point inside a wall", partial(lights.put_in_wall, area=False), "black"),
    Case("sphere inside a wall", partial(lights.put_in_wall, area=True), "black"),
    Case("point 1e-05 diagonals from a wall", partial(lights.put_on_wall, area=False), slack=OTHER),
    Case("disc on a wall", partial(lights.put_on_wall, area=True), slack=OTHER),
    Case("rectangle seen edge-on", lights.put_edge_on, slack=OTHER),
    *(
        Case(f"disc {width:g} diagonals wide", partial(lights.put_disc, width=width), slack=OTHER)
        for width in (1e-3, 1.0)
    ),
    Case(
        "1,000 points of which one shines",
        partial(lights.put_points, dark=999),
        "itself",
        expected=partial(lights.put_points, dark=0),
        bound=ROUNDED,
    ),
    *(
        Case(
            f"all kinds times {factor:g}",
            partial(lights.mix, factor=factor),
            "itself",
            expected=lights.mix,
            bound=ROUNDED,
            gain=factor,
        )
        for factor in (1e-20, 1e20)
    ),
    Case("all kinds", lights.mix, slack=OTHER),
)
TRIANGLES = (
    Case("two walls closer than a texel", partial(shape.add_thin_walls, apart=1e-4), slack=SAME),
    Case("slivers of 1e-6", partial(shape.split_faces, fraction=1e-6), "itself", bound=MOVED),
    Case("triangles that are points and lines", shape.add_degenerate, "itself", bound=ROUNDED),
    Case("each face twice", shape.double_faces, "itself", bound=ROUNDED),
    Case("each face twice, once from behind", partial(shape.double_faces, turned=True), "itself", bound=MOVED),
    Case(
        "each face and its parts, coplanar", partial(shape.split_faces, fraction=0.3, whole=True), "itself", bound=MOVED
    ),
    *(
        Case(f"backdrop {times:g} diagonals away", partial(shape.add_backdrop, times=times), slack=OTHER)
        for times in (1e2, 1e3, 1e6)
    ),
    *(
        Case(
            f"triangle {times:g} times larger, {name}",
            partial(shape.add_large_triangle, times=times, tilt=tilt),
            slack=OTHER,
        )
        for times in (1e3, 1e6)
        for name, tilt in (("upright", 0.0), ("aslant", pi / 5))
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


NAMED = {case.name: case for case in (*SCALE, *AWAY, *CAMERA, *LIGHT, *KINDS, *TRIANGLES, *SURFACES, *GLOSS, *SIZES)}


def _repeat(graph: str, *names: str) -> tuple[Case, ...]:
    """Repeat cases with another graph."""
    return tuple(replace(NAMED[name], graph=graph) for name in names)


CHOOSING = "resampled", "accurate"
"""Graphs in which each sample chooses its VPLs. Where a change rounds numbers, one choice in thousands flips."""
EXACT = tuple(
    Case(
        f"E times 2^{power}",
        partial(change.brighten, factor=2.0**power),
        "itself",
        bound=ROUNDED,
        gain=2.0**power,
        graph=graph,
    )
    for graph in CHOOSING
    for power in (-66, 66)  # products are exact, so that no choice may flip
)
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
DENOISED = (
    *_repeat("denoised", *LINEAR[:2], BOX, "0 VPLs", "1 VPLs"),
    # A choice of a VPL that a rounding flips changes the denoised light of all samples around.
    replace(NAMED[LINEAR[2]], graph="denoised", bound=4 * MOVED),
)
GRAPHS = (
    *_repeat("forward", *LINEAR, BOX, *MAPS, *TWICE),
    *_repeat("hemisphere", *LINEAR, BOX, *MAPS),
    # The choice of triangles to split depends on their neighbours in memory, so images are not the same to the bit.
    *(replace(case, against="rays", slack=SAME) for case in _repeat("hemisphere", *TWICE)),
    *_repeat("interleaved", *LINEAR, BOX),
    *_repeat("mapped", *LINEAR, BOX),
    *EXACT,
    *_repeat("accurate", LINEAR[2], BOX),
    *_repeat("resampled", LINEAR[2], BOX, "0 VPLs", "1 VPLs", "light grazing a wall", *TWICE[:1]),
    # The filter spreads the light of a choice that flips over a few hundred pixels, which change by up to 4 %.
    replace(NAMED["slivers of 1e-6"], graph="resampled", bound=4 * MOVED),
    *(() if "denoised" in find_obstacles() else DENOISED),
    *_repeat("incremental", *LINEAR, BOX),
)
"""Cases that matter for single maps, paraboloid maps and the passes of other graphs, repeated with those."""

CASES = (Case("as it is", slack=1.0), *NAMED.values(), *GRAPHS)
