"""The materials of a session: by name, and what the user replaces of their values. Knows no window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from deferred_ir.loading.material_tables import MaterialOverride
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, Texture


class MaterialList:
    """All materials of a scene, and overrides of them by name, as in scene files; equal names are one.

    shown: the scene's materials with the overrides; the same object until one changes. selected: a number in `names`.
    changed: called after each change.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._loaded: tuple[Material, ...] = ()
        self._textures: tuple[Texture, ...] = ()
        self.shown: tuple[Material, ...] = ()
        self.names: tuple[str, ...] = ()
        self.overrides: dict[str, MaterialOverride] = {}
        self.selected = 0

    def use(self, scene: Scene) -> None:
        """Take the materials of a scene as they are."""
        self._loaded, self._textures = scene.materials, scene.textures
        self.names = tuple(dict.fromkeys(material.name for material in scene.materials))
        self.shown, self.overrides, self.selected = scene.materials, {}, 0
        self._changed()

    @property
    def material(self) -> Material:
        """The first material of the selected name, as it is shown."""
        return self._find(self.shown)

    @property
    def loaded(self) -> Material:
        """The first material of the selected name, as it was loaded."""
        return self._find(self._loaded)

    def edit(self, key: str, value: Any) -> None:
        """Set a value of the materials of the selected name; key: a field of `MaterialOverride`."""
        name = self.names[self.selected]
        self.overrides[name] = replace(self.overrides.get(name, MaterialOverride()), **{key: value})
        self._apply()

    def reset(self) -> None:
        """Give the materials of the selected name back what they were loaded with."""
        self.overrides.pop(self.names[self.selected], None)
        self._apply()

    def _find(self, materials: tuple[Material, ...]) -> Material:
        return next(material for material in materials if material.name == self.names[self.selected])

    def _apply(self) -> None:
        nothing = MaterialOverride()
        self.shown = tuple(
            self.overrides.get(material.name, nothing).apply(material, self._textures) for material in self._loaded
        )
        self._changed()
