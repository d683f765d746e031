"""The parameter of passes that draw the scene's textures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from deferred_ir.graph.params import param


@dataclass(frozen=True)
class MipmapParams:
    """How textures are read where they are made smaller."""

    mipmaps: Literal["auto", "always", "never"] = param(
        "auto", doc="Filter textures over mipmaps: auto, where the file asks for it."
    )
