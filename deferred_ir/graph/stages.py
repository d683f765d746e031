"""The stage of passes that can run in either of two: in fragment shaders, or in compute shaders that store images.

Such a pass has a parameter `stage`, and all of its outputs are images (`Output.image`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, Literal

from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass

Stage = Literal["auto", "fragment", "compute"]
SUFFIXES = {"fragment": ".frag", "compute": ".comp"}
"""Suffix of the shader files of each stage."""
DOC = (
    "Kind of shaders; `auto`: `compute` where `doctor --calibrate` found it faster on this machine, with equal pixels."
)


def stage_param() -> Any:
    """Declare the field `stage: Stage` of a pass's parameters."""
    return param("auto", doc=DOC)


def find_stage(work: Pass, find_computed: Callable[[], Collection[str]]) -> str | None:
    """Return "fragment" or "compute" for a pass that can run in both, else None.

    find_computed: returns the modules of the passes that "auto" runs in compute shaders.
    """
    stage: str | None = getattr(work.params, "stage", None)
    if stage == "auto":
        return "compute" if type(work).__module__ in find_computed() else "fragment"
    return stage
