"""Global illumination from Python in milliseconds: instant radiosity and deferred shading on OpenGL.

    import deferred_ir as ir
    scene = ir.load("cornell")
    with ir.Renderer(size=(512, 512), graph="deferred") as renderer:
        image = renderer.render(scene, vpls=64, seed=0)
    image.save("cornell.png")

Everything public is named here; modules load when something in them is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from deferred_ir.base.errors import DeviceError as DeviceError
    from deferred_ir.base.errors import Error as Error
    from deferred_ir.base.errors import GraphError as GraphError
    from deferred_ir.base.errors import OutputError as OutputError
    from deferred_ir.base.errors import SceneError as SceneError
    from deferred_ir.base.errors import SettingError as SettingError
    from deferred_ir.base.errors import ShaderError as ShaderError
    from deferred_ir.engine.accumulation import Accumulation as Accumulation
    from deferred_ir.engine.renderer import Renderer as Renderer
    from deferred_ir.loading.load import builtin_scenes as builtin_scenes
    from deferred_ir.loading.load import load as load
    from deferred_ir.output.image import Image as Image
    from deferred_ir.scene.lights.directional import Directional as Directional
    from deferred_ir.scene.lights.disc import Disc as Disc
    from deferred_ir.scene.lights.environment import Environment as Environment
    from deferred_ir.scene.lights.point import Point as Point
    from deferred_ir.scene.lights.rect import Rect as Rect
    from deferred_ir.scene.lights.sphere import Sphere as Sphere
    from deferred_ir.scene.lights.spot import Spot as Spot
    from deferred_ir.scene.lights.spotlight import Spotlight as Spotlight
    from deferred_ir.scene.scene import Scene as Scene

_NAMES = {
    "base.errors": (
        "DeviceError",
        "Error",
        "GraphError",
        "OutputError",
        "SceneError",
        "SettingError",
        "ShaderError",
    ),
    "engine.accumulation": ("Accumulation",),
    "engine.renderer": ("Renderer",),
    "loading.load": ("builtin_scenes", "load"),
    "output.image": ("Image",),
    "scene.lights.directional": ("Directional",),
    "scene.lights.disc": ("Disc",),
    "scene.lights.environment": ("Environment",),
    "scene.lights.point": ("Point",),
    "scene.lights.rect": ("Rect",),
    "scene.lights.sphere": ("Sphere",),
    "scene.lights.spot": ("Spot",),
    "scene.lights.spotlight": ("Spotlight",),
    "scene.scene": ("Scene",),
}
_WHERE = {name: module for module, names in _NAMES.items() for name in names}
__all__ = sorted(_WHERE)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'deferred_ir' has no attribute '{name}'")
    return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
