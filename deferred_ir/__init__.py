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
    from .accumulation import Accumulation
    from .errors import DeviceError, Error, GraphError, OutputError, SceneError, SettingError, ShaderError
    from .image import Image
    from .loading import builtin_scenes, load
    from .renderer import Renderer
    from .scene import Scene

_WHERE = {
    "Accumulation": "accumulation",
    "DeviceError": "errors",
    "Error": "errors",
    "GraphError": "errors",
    "OutputError": "errors",
    "SceneError": "errors",
    "SettingError": "errors",
    "ShaderError": "errors",
    "Image": "image",
    "builtin_scenes": "loading",
    "load": "loading",
    "Renderer": "renderer",
    "Scene": "scene",
}

__all__ = [
    "Accumulation",
    "DeviceError",
    "Error",
    "GraphError",
    "Image",
    "OutputError",
    "Renderer",
    "Scene",
    "SceneError",
    "SettingError",
    "ShaderError",
    "builtin_scenes",
    "load",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'deferred_ir' has no attribute '{name}'")
    return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
