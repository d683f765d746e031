"""`deferred-ir reference`: an image traced with rays, to compare renders with; writes OUT.npy and OUT.json."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError, did_you_mean
from deferred_ir.base.progress import progress_bar
from deferred_ir.cli.options import SCENE, add_size, parse_count, parse_positive, parse_seconds, print_notes

HELP = "Trace a reference image with rays: OUT.npy, and OUT.json beside it."
ORDER = 20
BOUNCES = "vpl.bounces"
"""A render's name for what is --bounces here."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir reference`."""
    parser.add_argument("scene", metavar="SCENE", help=SCENE)
    parser.add_argument("-o", "--output", required=True, metavar="OUT.npy", help="float32 linear radiance")
    add_size(parser)
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--spp", type=parse_positive, metavar="N", help="trace N paths a pixel (default: 64)")
    kind.add_argument("--vpls", type=parse_positive, metavar="N", help="instead: N VPLs with perfect visibility")
    parser.add_argument("--bounces", type=parse_count, metavar="N", help="of indirect light (default: 1)")
    parser.add_argument("--seed", type=parse_count, default=0, metavar="N", help="of the samples (default: 0)")
    time = "of motions, seconds (default: 0)"
    parser.add_argument("--time", type=parse_seconds, default=0.0, metavar="T", help=time)
    text = "vpl.fov, vpl.clamp or vpl.pattern as in a render; may be repeated"
    parser.add_argument("--set", action="append", default=[], metavar="vpl.PARAM=VALUE", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Trace a reference, with a progress bar on a terminal, and write it."""
    from deferred_ir.engine.settings import choose_size, list_notes, parse_settings
    from deferred_ir.loading.load import load
    from deferred_ir.truth import reference as references

    settings = parse_settings(arguments.set)
    output = Path(arguments.output)
    references.check_path(output)
    known = (*references.SETTINGS, BOUNCES)
    for name in settings:
        if name not in known:
            raise SettingError(f"--set {name}: no such setting of a reference{did_you_mean(name, known)}")
    scene = load(arguments.scene)
    size = choose_size(arguments.size, scene.render)
    print_notes(list_notes(scene))
    defaults = scene.render.set if arguments.vpls is not None else {}
    with progress_bar() as bar:
        traced = references.trace_reference(
            scene,
            size,
            spp=arguments.spp,
            vpls=arguments.vpls,
            bounces=_choose_bounces(arguments.bounces, {**scene.render.set, **settings}),
            seed=arguments.seed,
            time=arguments.time,
            settings={
                **{name: value for name, value in defaults.items() if name in references.SETTINGS},
                **{name: value for name, value in settings.items() if name != BOUNCES},
            },
            progress=bar.show,
        )
    traced.save(output)
    print(_summarise(traced.meta), file=sys.stderr)
    return 0


def _choose_bounces(count: int | None, settings: Mapping[str, Any]) -> int:
    """Return --bounces, else vpl.bounces, else 1."""
    value = settings.get(BOUNCES, 1) if count is None else count
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise SettingError(f"set {BOUNCES}: is {value!r}, but wants a whole number from 0 up")
    return value


def _summarise(meta: Mapping[str, Any]) -> str:
    """Say in one line what was traced and how good it is."""
    if "vpls" in meta:
        return f"{meta['vpls_alive']} VPLs, {meta['seconds']:.1f} s; {meta['note']}"
    what = f"{meta['spp']} paths a pixel, {meta['seconds']:.1f} s"
    if meta["noise"] is None:
        return f"{what}; {meta['note']}"
    return f"{what}; standard error {meta['standard_error']:.2%} of the mean, relMSE of the noise {meta['noise']:.2g}"
