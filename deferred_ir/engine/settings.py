"""What to render with: options of a call or of the command line, over a scene file's [render] table, over defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from deferred_ir.base.errors import SettingError
from deferred_ir.base.image_size import parse_size
from deferred_ir.graph.params import read_value
from deferred_ir.scene.scene import RenderDefaults, Scene

DEFAULT_GRAPH = "deferred"
DEFAULT_SIZE = (512, 512)
COUNT = "vpl.count"
"""What --vpls and [render] vpls set."""


def choose_graph(name: str | None, defaults: RenderDefaults) -> str:
    """Return --graph, else the scene file's graph, else `deferred`."""
    return name if name is not None else defaults.graph or DEFAULT_GRAPH


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


def choose_settings(defaults: RenderDefaults, settings: Mapping[str, Any], vpls: int | None) -> dict[str, Any]:
    """Merge {"pass.param": value}: --vpls over --set over the scene file's [render] table."""
    if vpls is not None and settings.get(COUNT, vpls) != vpls:
        raise SettingError(f"--vpls {vpls} and --set {COUNT}={settings[COUNT]}: contradict each other; give one")
    chosen = dict(defaults.set)
    if defaults.vpls is not None:
        chosen[COUNT] = defaults.vpls
    chosen |= settings
    if vpls is not None:
        chosen[COUNT] = vpls
    return chosen


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
    yield from (f"no {what} in the file: {how.get('why', 'one was chosen')}" for what, how in scene.chosen.items())
