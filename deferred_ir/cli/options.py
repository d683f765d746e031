"""Options that several commands have, the values that they take, and notes to the user."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable

from deferred_ir.base.errors import SettingError

LATEST = 1e9
"""Largest time in seconds, forwards and backwards."""
SCENE = "a built-in scene, a scene file (.toml) or a model"


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add --device, auto unless given."""
    parser.add_argument("--device", default="auto", metavar="D", help="see `deferred-ir devices` (default: auto)")


def add_graph(parser: argparse.ArgumentParser) -> None:
    """Add --graph."""
    parser.add_argument("--graph", metavar="NAME|FILE", help="render graph (default: deferred)")


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add --seed."""
    parser.add_argument("--seed", type=parse_count, metavar="N", help="of the samples (default: 0)")


def add_set(parser: argparse.ArgumentParser) -> None:
    """Add --set, a list of "PASS.PARAM=VALUE" (engine.settings.parse_settings reads it)."""
    text = "a parameter of a pass, e.g. --set shadow_maps.vpl_size=512; may be repeated"
    parser.add_argument("--set", action="append", default=[], metavar="PASS.PARAM=VALUE", help=text)


def add_size(parser: argparse.ArgumentParser, of: str = "pixels", default: str = "512x512") -> None:
    """Add --size, a text (engine.settings.choose_size reads it)."""
    parser.add_argument("--size", metavar="WxH", help=f"{of} (default: {default})")


def add_vpls(parser: argparse.ArgumentParser) -> None:
    """Add --vpls."""
    parser.add_argument("--vpls", type=parse_count, metavar="N", help="virtual point lights (default: 64)")


def parse_count(text: str) -> int:
    """Read a whole number from 0 up."""
    return _parse_whole(text, 0)


def parse_positive(text: str) -> int:
    """Read a whole number from 1 up."""
    return _parse_whole(text, 1)


def _parse_whole(text: str, least: int) -> int:
    if not _is_whole(text) or int(text) < least:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number from {least} up")
    return int(text)


def _is_whole(text: str) -> bool:
    return text.isascii() and text.isdecimal()


def parse_seconds(text: str) -> float:
    """Read a time in seconds."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not abs(seconds) <= LATEST:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of seconds, such as 1.5")
    return seconds


def parse_duration(text: str) -> float:
    """Read how long something may take: "200ms", "0.2s" or "0.2". Returns seconds, above 0."""
    number, factor = text, 1.0
    for unit, seconds in (("ms", 1e-3), ("s", 1.0)):
        if text.endswith(unit):
            number, factor = text.removesuffix(unit), seconds
            break
    try:
        duration = float(number) * factor
    except ValueError:
        duration = math.nan
    if not 0 < duration <= LATEST:
        raise argparse.ArgumentTypeError(f"'{text}' is no duration, such as 200ms or 0.2s")
    return duration


def parse_relmse(text: str) -> float:
    """Read an error, a number above 0."""
    try:
        error = float(text)
    except ValueError:
        error = math.nan
    if not 0 < error < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is no relMSE above 0, such as 0.01")
    return error


def split_list(text: str) -> list[str]:
    """Split "a, b,a" at the commas: each word once, in order, without white space and empty words."""
    return list(dict.fromkeys(word for part in text.split(",") if (word := part.strip())))


def parse_counts(option: str, text: str, example: str) -> list[int]:
    """Read the whole numbers of `option`, "64,256", each once. Raises SettingError, which shows the `example`."""
    words = [word.strip() for word in text.split(",")]
    for word in words:
        if not (_is_whole(word) and len(word) < 10):
            raise SettingError(f"{option} {text}: '{word}' is no whole number; write {example}")
    return list(dict.fromkeys(int(word) for word in words))


def print_notes(notes: Iterable[str]) -> None:
    """Print remarks on standard error, a line each."""
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
