"""Command lines of the studies and measurements, which run as `python -m deferred_ir.profiling...`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import Error
from deferred_ir.base.image_size import parse_size
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.reference import trace_reference


def _names(text: str) -> list[str]:
    return text.split(",")


OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "vpls": {"type": int, "metavar": "N", "help": "number of VPLs"},
    "size": {"type": parse_size, "metavar": "WIDTHxHEIGHT", "help": "pixels of the images"},
    "seeds": {"type": int, "metavar": "N", "help": "number of seeds"},
    "turns": {"type": int, "metavar": "N", "help": "timed frames of each variant"},
    "frames": {"type": int, "metavar": "N", "help": "number of frames"},
    "spp": {"type": int, "metavar": "N", "help": "paths a pixel of the reference"},
    "pairs": {"type": int, "metavar": "N", "help": "pairs of a pixel and a VPL that are checked"},
    "fov": {"type": float, "metavar": "DEGREES", "help": "opening angle of the VPLs' cones"},
    "graphs": {"type": _names, "metavar": "A,B", "help": "render graphs"},
    "tables": {"type": _names, "metavar": "A,B", "help": "tables to print"},
    "device": {"metavar": "DEVICE", "help": "as in `deferred-ir devices`"},
    "reference": {"type": Path, "metavar": "FILE", "help": "a reference to use instead of a new one"},
}
"""Options that several studies share."""


def command_line(
    doc: str | None, *, scenes: bool = True, output: bool = False, **defaults: Any
) -> argparse.ArgumentParser:
    """Declare a study's command line. Its help is the first line of `doc`, the module's docstring.

    scenes: takes scenes, at least one. output: takes `-o DIR`, a folder for the files it writes. defaults: the
    default values of the OPTIONS that the study takes.
    """
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    if scenes:
        parser.add_argument("scenes", nargs="+", metavar="SCENE")
    if output:
        parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder of the files")
    for name, default in defaults.items():
        parser.add_argument(f"--{name}", default=default, **OPTIONS[name])
    return parser


def run(
    parser: argparse.ArgumentParser, study: Callable[[argparse.Namespace], None], words: Sequence[str] | None = None
) -> None:
    """Parse the command line (`words`, None for the process's own), create the output folder and run the study.

    An Error ends the process with its message in one line.
    """
    chosen = parser.parse_args(words)
    try:
        if folder := getattr(chosen, "output", None):
            folder.mkdir(parents=True, exist_ok=True)
        study(chosen)
    except Error as error:
        raise SystemExit(str(error)) from None


def read_or_trace(scene: Scene, chosen: argparse.Namespace) -> Mapping[str, Any]:
    """Return the arrays image and direct (H, W, 3) and hit (H, W) of `--reference F.npz`, or trace them."""
    if chosen.reference:
        arrays: Mapping[str, Any] = np.load(chosen.reference)
        return arrays
    traced = trace_reference(scene, chosen.size, spp=chosen.spp)
    return {"image": traced.radiance, "direct": traced.direct, "hit": traced.hit}
