"""`deferred-ir scenes`: the scenes that come with the package."""

from __future__ import annotations

import argparse

HELP = "List the built-in scenes."
ORDER = 80


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command has no options."""


def run(arguments: argparse.Namespace) -> int:
    """Print a line for each scene: its name and what it is."""
    del arguments
    from deferred_ir.loading.load import builtin_scenes

    scenes = builtin_scenes()
    width = max(len(name) for name, _ in scenes)
    for name, text in scenes:
        print(f"{name:<{width}}  {text}")
    return 0
