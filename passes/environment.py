"""Upload the image of light from all around, which shows behind everything: -> environment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from deferred_ir.frame.facts import ENVIRONMENT
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output, Texture
from deferred_ir.scene.environment_image import EnvironmentImage


@dataclass
class State:
    """The image that the texture holds, None for a constant one, and whether it holds anything."""

    image: EnvironmentImage | None = None
    filled: bool = False


class Environment(Pass):
    """Radiance by direction, latitude and longitude, as the image has it; one texel of 1 where it is constant."""

    State = State

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what a constant environment needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return a texture of the image's size."""
        del inputs
        texture = Texture("rgba32f", facts[ENVIRONMENT] or (1, 1), mend="a smaller environment image")
        return {"environment": Output("radiance by direction, over the light's emission", texture, attach=False)}

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where the background is black."""
        return None if facts[ENVIRONMENT] else "there is no environment"

    def depends(self) -> frozenset[str]:
        """The lights: readers take rotation and scale from there, so a change of these counts as one of the texture."""
        return frozenset({"light"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Upload the image, unless it is there."""
        light, texture, state = frame.scene.environment, io["environment"], io.state
        image = light.image if light else None
        if state.filled and state.image is image:
            return
        width, height = texture.size
        pixels = np.ones((height, width, 4), np.float32)
        if image is not None:
            pixels[..., :3] = image.pixels
        texture.upload(pixels)
        state.image, state.filled = image, True


PASS = Environment
