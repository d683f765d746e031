"""The extreme cases of surfaces, as data. docs/stability.md explains the bounds."""

from __future__ import annotations

from functools import partial

from deferred_ir.profiling.checks.changes import furnace
from deferred_ir.profiling.checks.changes import surfaces as surface
from deferred_ir.profiling.checks.extremes import HALF_FLOAT, MOVED, NORMALS, ROUNDED, Case

ENERGY = 0.02
"""Bound of a furnace, four standard errors: 3,000 pixels with 16 rays each, whose light varies by its own size."""
SURFACES = (
    Case("normals 0", partial(surface.with_normals, value=0.0), "itself", expected=surface.remove_normals),
    Case("normals NaN", partial(surface.with_normals, value=float("nan")), "itself", expected=surface.remove_normals),
    Case(
        "normals against the faces", surface.reverse_normals, "itself", expected=surface.remove_normals, bound=NORMALS
    ),
    *(
        Case(
            f"texture {side}x{side}",
            partial(surface.texture_grey, size=side),
            "itself",
            expected=surface.paint_grey,
            bound=HALF_FLOAT,
        )
        for side in (1, 8192)
    ),
    Case(
        "texture coordinates 1e4",
        partial(surface.texture_checkers, shift=1e4),
        "itself",
        expected=surface.texture_checkers,
        bound=MOVED,
    ),
)
COAT = partial(surface.with_gloss, roughness=0.4)
GLOSS = (
    *(
        Case(
            f"{name} of roughness {roughness:g} in a furnace",
            partial(furnace.put_ball, metallic=metallic, roughness=roughness),
            "furnace",
            bound=ENERGY,
            settings={"reflection_rays.rays": 16},
            graph="accurate",
        )
        for name, metallic in (("metal", 1.0), ("plastic", 0.0))
        for roughness in (0.0, 1e-4, 0.1, 0.5, 1.0)
    ),
    Case("a coat of nothing", partial(surface.with_gloss, specular=1e-30), "itself", bound=HALF_FLOAT),
    Case(
        "roughness 1e-4",
        partial(surface.with_gloss, roughness=1e-4),
        "itself",
        expected=partial(surface.with_gloss, roughness=0.0),
        bound=ROUNDED,
    ),
    Case("black metal", surface.turn_to_black_metal, "unshadowed", bound=ROUNDED),
    Case(
        "normal map that points into the surface",
        partial(surface.bend_normals, x=0.0, z=-1.0),
        "itself",
        expected=surface.without_map,
        bound=NORMALS,
    ),
    Case("normal map along the surface", partial(surface.bend_normals, x=1.0, z=0.0), "unshadowed", bound=ROUNDED),
    Case("texture of 16 bits", surface.texture_grey_finely, "itself", expected=surface.paint_grey, bound=HALF_FLOAT),
    *(
        Case(
            f"coated, E times 2^{power}",
            partial(surface.brighten_coated, factor=2.0**power),
            "itself",
            expected=COAT,
            bound=ROUNDED,
            gain=2.0**power,
            graph="accurate",
        )
        for power in (-66, 66)
    ),
    *(
        Case(
            f"coated, E times {factor:g}",
            partial(surface.brighten_coated, factor=factor),
            "itself",
            expected=COAT,
            bound=ROUNDED,
            gain=factor,
        )
        for factor in (1e-20, 1e20)
    ),
    Case(
        "coated, albedo 1, 50 bounces",
        partial(surface.coat_white, roughness=0.4),
        "unshadowed",
        bound=ROUNDED,
        settings={"vpl.bounces": 50, "shadow_maps.vpl_size": 128},
        vpls=8,
    ),
    Case("camera along a coated wall", partial(surface.look_along_coated_wall, off=1e-3), "unshadowed", bound=ROUNDED),
)
