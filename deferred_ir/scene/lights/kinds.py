"""The kinds of lights, found by their files: each module of this folder that says `LIGHT`."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from deferred_ir.scene import lights


@cache
def find_kinds() -> dict[str, Any]:
    """Return the class of each kind by its name, in alphabetical order."""
    modules = (importlib.import_module(f"{lights.__name__}.{m.name}") for m in pkgutil.iter_modules(lights.__path__))
    return {module.LIGHT.kind: module.LIGHT for module in modules if hasattr(module, "LIGHT")}
