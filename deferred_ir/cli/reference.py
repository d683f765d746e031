"""`deferred-ir reference`: settings from command line and scene file, a progress bar, OUT.npy and OUT.json."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError, did_you_mean
from deferred_ir.base.progress import Progress
from deferred_ir.engine.settings import chosen_size, notes
from deferred_ir.loading.load import load
from deferred_ir.truth import reference as references

BOUNCES = "vpl.bounces"
"""A render's name for what is --bounces here."""


def reference(arguments: argparse.Namespace, settings: Mapping[str, Any]) -> int:
    """Trace what the command line asks for; an exit status."""
    output = Path(arguments.output)
    references.check_path(output)
    for name in settings:
        if name not in (*references.SETTINGS, BOUNCES):
            known = (*references.SETTINGS, BOUNCES)
            raise SettingError(f"--set {name}: no such setting of a reference{did_you_mean(name, known)}")
    scene = load(arguments.scene)
    size = chosen_size(arguments.size, scene.render)
    for note in notes(scene):
        print(f"note: {note}", file=sys.stderr)
    usual = scene.render.set if arguments.vpls is not None else {}
    with _progress_bar() as progress:
        made = references.reference(
            scene,
            size,
            spp=arguments.spp,
            vpls=arguments.vpls,
            bounces=_bounces(arguments.bounces, {**scene.render.set, **settings}),
            seed=arguments.seed,
            time=arguments.time,
            settings={
                **{name: value for name, value in usual.items() if name in references.SETTINGS},
                **{name: value for name, value in settings.items() if name != BOUNCES},
            },
            progress=progress,
        )
    made.save(output)
    print(_summary(made.meta), file=sys.stderr)
    return 0


def _bounces(given: int | None, settings: Mapping[str, Any]) -> int:
    """--bounces, else vpl.bounces, else 1."""
    value = settings.get(BOUNCES, 1) if given is None else given
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise SettingError(f"set {BOUNCES}: is {value!r}, but wants a whole number from 0 up")
    return value


def _summary(meta: Mapping[str, Any]) -> str:
    """What was made and how good it is, in one line."""
    if "vpls" in meta:
        return f"{meta['vpls_alive']} VPLs, {meta['seconds']:.1f} s; {meta['note']}"
    what = f"{meta['spp']} paths a pixel, {meta['seconds']:.1f} s"
    if meta["noise"] is None:
        return f"{what}; {meta['note']}"
    return f"{what}; standard error {meta['standard_error']:.2%} of the mean, relMSE of the noise {meta['noise']:.2g}"


@contextmanager
def _progress_bar() -> Iterator[Progress | None]:
    """A bar with the time left, on a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(leave=False, bar_format="{percentage:3.0f} % |{bar}| {elapsed}, {remaining} left") as bar:

        def tell(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield tell
