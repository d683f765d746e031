"""What is written beside an image, OUT.json beside OUT.npy: what it shows and how it was made."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError, format_value, summarise


def metadata_path(path: Path) -> Path:
    """Return where the metadata of the image `path` lie: OUT.json beside OUT.npy."""
    return path.with_suffix(".json")


def read_metadata(path: Path, size: tuple[int, int]) -> dict[str, Any]:
    """Read the metadata of the image `path`; {} if there are none.

    A JSON file without `scene_hash` is something else of the same name. `size`: (width, height) of the image, which
    the metadata have to state too, or the two do not belong together. Raises SettingError.
    """
    file = metadata_path(path)
    if not os.path.exists(file):
        return {}
    try:
        metadata = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SettingError(f"{file}: cannot be read as JSON: {summarise(error)}; mend or remove it") from error
    if not isinstance(metadata, dict) or "scene_hash" not in metadata:
        return {}
    if not isinstance(metadata["scene_hash"], str):
        raise SettingError(f"{file}: scene_hash: must be text, not {format_value(metadata['scene_hash'])}")
    if metadata.get("size") != list(size):
        raise SettingError(
            f"{file}: size: is {format_value(metadata.get('size'))}, but {path.name} is {size[0]}x{size[1]};"
            " the two do not belong together"
        )
    hit = metadata.get("hit_fraction")
    if hit is not None and (isinstance(hit, bool) or not isinstance(hit, int | float) or not 0 <= hit <= 1):
        raise SettingError(f"{file}: hit_fraction: {format_value(hit)} is no number from 0 to 1")
    return metadata
