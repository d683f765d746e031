"""What several commands do with their options and with what a scene file says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from deferred_ir.base.errors import SettingError
from deferred_ir.graph.params import read_value
from deferred_ir.loading.scene_file import parse_size
from deferred_ir.scene.scene import RenderDefaults, Scene

DEFAULT_SIZE = (512, 512)
COUNT = "vpl.count"
"""What --vpls and [render] vpls set."""


def chosen_size(text: str | None, defaults: RenderDefaults) -> tuple[int, int]:
    """(width, height): --size, else the scene file's, else 512x512."""
    if text is None:
        return defaults.size or DEFAULT_SIZE
    size = parse_size(text)
    if size is None:
        raise SettingError(f"--size {text}: wants WIDTHxHEIGHT in pixels, both above 0, such as 512x512")
    return size


def parse_settings(pairs: Sequence[str]) -> dict[str, Any]:
    """{"pass.param": value} of `--set` arguments."""
    result = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise SettingError(f"--set {pair}: wants PASS.PARAM=VALUE")
        result[key.strip()] = read_value(value.strip())
    return result


def chosen_settings(defaults: RenderDefaults, settings: Mapping[str, Any], vpls: int | None) -> dict[str, Any]:
    """{"pass.param": value}: the scene file's [render], under --set, under --vpls."""
    if vpls is not None and settings.get(COUNT, vpls) != vpls:
        raise SettingError(f"--vpls {vpls} and --set {COUNT}={settings[COUNT]}: contradict each other; give one")
    chosen = dict(defaults.set)
    if defaults.vpls is not None:
        chosen[COUNT] = defaults.vpls
    chosen |= settings
    if vpls is not None:
        chosen[COUNT] = vpls
    return chosen


def notes(scene: Scene) -> Iterator[str]:
    """What of the files is not honoured, and what was chosen."""
    yield from scene.notes
    yield from (f"no {what} in the file: {how.get('why', 'one was chosen')}" for what, how in scene.chosen.items())
