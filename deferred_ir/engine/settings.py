"""What to render with: options of a call or of the command line, over a scene file's [render] table, over defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.base.image_size import parse_size
from deferred_ir.graph.file import load_graph
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.params import read_value
from deferred_ir.graph.roles import find_parameters
from deferred_ir.scene.scene import RenderDefaults, Scene

VPLS = "vpls"
"""Role of the parameters that are the number of VPLs."""
DEFAULT_GRAPH = "deferred"
DEFAULT_SIZE = (512, 512)
FOR_ERROR: tuple[str, Mapping[str, Any]] = "resampled", {"sample_pixels.scale": 1}
"""Graph and parameters for a given error unless others are named: its frames share no error that they cannot tell."""


def choose_graph(name: str | None, defaults: RenderDefaults) -> str:
    """Return --graph, else the scene file's graph, else `deferred`."""
    return name if name is not None else defaults.graph or DEFAULT_GRAPH


def choose_start(
    name: str | None, defaults: RenderDefaults, start: tuple[str, Mapping[str, Any]]
) -> tuple[str, Mapping[str, Any]]:
    """Return a graph, and parameters that --set may change: `start` unless --graph or the scene file names a graph."""
    named = name if name is not None else defaults.graph
    return start if named is None else (named, {})


def choose_seed(seed: int | None, defaults: RenderDefaults) -> int:
    """Return --seed, else the scene file's seed, else 0."""
    return seed if seed is not None else defaults.seed or 0


def choose_size(text: str | None, defaults: RenderDefaults) -> tuple[int, int]:
    """Return (width, height) in pixels: --size, else the scene file's size, else 512x512."""
    if text is None:
        return defaults.size or DEFAULT_SIZE
    size = parse_size(text)
    if size is None:
        raise SettingError(f"--size {text}: wants WIDTHxHEIGHT in pixels, both above 0, such as 512x512")
    return size


def choose_settings(
    graph: str | Path, defaults: RenderDefaults, settings: Mapping[str, Any], vpls: int | None
) -> dict[str, Any]:
    """Merge {"pass.param": value}: --vpls over --set over the scene file's [render] table.

    graph: name or file; its parameters with the role `vpls` are what --vpls and [render] vpls set.
    """
    chosen = dict(defaults.set)
    if defaults.vpls is not None:
        chosen |= set_vpls(load_graph(graph), defaults.vpls)
    chosen |= settings
    if vpls is not None:
        counts = set_vpls(load_graph(graph), vpls)
        for key in counts.keys() & settings.keys():
            if settings[key] != vpls:
                raise SettingError(f"--vpls {vpls} and --set {key}={settings[key]}: contradict each other; give one")
        chosen |= counts
    return chosen


def set_vpls(graph: Graph, vpls: int) -> dict[str, int]:
    """Return {"pass.param": vpls} for each parameter that is a number of VPLs. Raises GraphError if there is none."""
    counts = dict.fromkeys(find_parameters(graph, VPLS), vpls)
    if not counts:
        raise GraphError(f'{graph.origin}: no pass has a number of VPLs to set, a parameter with role="{VPLS}"')
    return counts


def parse_settings(pairs: Sequence[str]) -> dict[str, Any]:
    """Read {"pass.param": value} from the arguments of `--set`."""
    result = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise SettingError(f"--set {pair}: wants PASS.PARAM=VALUE")
        result[key.strip()] = read_value(value.strip())
    return result


def list_notes(scene: Scene) -> Iterator[str]:
    """Yield what the files say but the renderer ignores, then what was chosen because the files leave it out."""
    yield from scene.notes
    yield from (
        f"no {what} in the file, one was placed: {how.get('why', 'see RUN.json')}" for what, how in scene.chosen.items()
    )
