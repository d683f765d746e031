"""Loads a `Scene` from the name of a built-in scene, a scene file or a model file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from deferred_ir.base.errors import SceneError, did_you_mean
from deferred_ir.base.toml_tables import Faults
from deferred_ir.loading import default_views, merge, models, scene_file
from deferred_ir.loading.material_tables import MaterialOverride, check_names
from deferred_ir.loading.model_data import ModelData, Part, darken
from deferred_ir.loading.scene_file import ModelEntry, SceneFile
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.scene import Scene

ANY_CAMERA = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
"""A placeholder until default_views has chosen."""


def builtin_scenes() -> tuple[tuple[str, str], ...]:
    """Return name and description of each built-in scene, by name; the description is its file's first comment."""
    return tuple((path.stem, _read_description(path)) for path in sorted(_find_folder().glob("*.toml")))


def load(scene: str | os.PathLike[str]) -> Scene:
    """Load a built-in scene by name, else a scene file (.toml), else a model file of any format that trimesh reads.

    Raises SceneError: one line that names the file, the key and the mend.
    """
    path = _find_file(os.fspath(scene))
    is_scene_file = path.suffix.lower() == ".toml"
    described = scene_file.read(path) if is_scene_file else SceneFile(path.stem, (ModelEntry(path),))
    read = [(_read_model(entry, path, index, described), entry.motion) for index, entry in enumerate(described.models)]
    _check_names(described, (model for model, _ in read), path)
    geometry, materials, textures, ranges = merge.merge(read, str(path))
    notes = tuple(dict.fromkeys(note for model, _ in read for note in model.notes))
    result = Scene(
        name=described.name,
        path=path,
        geometry=geometry,
        materials=materials,
        textures=textures,
        models=ranges,
        camera=described.camera or ANY_CAMERA,
        lights=described.lights,
        render=described.render,
        notes=notes,
    )
    dark = not described.lights and result.surface_light is None
    return default_views.choose_views(result, camera=described.camera is None, spotlight=dark)


def _read_model(entry: ModelEntry, path: Path, index: int, described: SceneFile) -> ModelData:
    """Read the model of an entry; an error says which entry of which scene file names it."""
    overrides = described.materials
    covering = [name for name, override in overrides.items() if override.alpha_cutoff is not None]
    try:
        read = models.read(entry.path, entry.scale, entry.translate, root=path.parent, covering=covering)
        read = read if entry.lights else darken(read)
        return replace(read, parts=tuple(_override(part, read, overrides) for part in read.parts))
    except SceneError as error:
        if entry.path == path:
            raise
        key = "model.path" if len(described.models) == 1 else f"model[{index}].path"
        raise SceneError(f"{path}: {key}: {error}") from error


def _override(part: Part, model: ModelData, overrides: Mapping[str, MaterialOverride]) -> Part:
    """Return a part with what the scene file says of its material."""
    override = overrides.get(part.material.name)
    return replace(part, material=override.apply(part.material, model.textures)) if override else part


def _check_names(described: SceneFile, read: Iterable[ModelData], path: Path) -> None:
    """Raise SceneError if the scene file names materials that no surface has."""
    faults = Faults(str(path))
    check_names(faults, described.materials, {part.material.name for model in read for part in model.parts})
    if faults.found:
        faults.fail()


def _find_folder() -> Path:
    return Path(str(files("deferred_ir.scenes")))


def _read_description(path: Path) -> str:
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            return line.lstrip("# ").strip()
    return ""


def _find_file(name: str) -> Path:
    """Return the file that `name` means; a built-in name wins over a file of that name."""
    names = [path.stem for path in _find_folder().glob("*.toml")]
    if name in names:
        return _find_folder() / f"{name}.toml"
    path = Path(name)
    if os.path.isdir(name):
        raise SceneError(f"{name}: is a folder; give a scene file or a model in it")
    if os.path.isfile(name):
        return path
    if path.suffix or path.name != name:
        raise SceneError(f"{name}: no such file; give a scene file, a model, or a built-in scene ({', '.join(names)})")
    raise SceneError(f"{name}: no such file and no built-in scene of that name{did_you_mean(name, names)}")
