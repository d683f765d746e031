"""A base for passes that are one shader over the whole target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import NO_DEFINES, Io
from deferred_ir.gl.shaders import Define
from deferred_ir.graph.params import specs
from deferred_ir.graph.pass_base import Pass


class FullscreenPass(Pass):
    """A pass that runs the shader `fragment` once a pixel; inputs are samplers, parameters uniforms of their name."""

    fragment: ClassVar[str]
    vertex: ClassVar[str] = "fullscreen.vert"

    def uniforms(self) -> Mapping[str, Any]:
        """Return the values of uniforms: the parameters, unless overridden."""
        return {name: getattr(self.params, name) for name in specs(self.Params)}

    def defines(self, frame: Frame) -> Mapping[str, Define]:
        """Return defines that choose a variant of the shader for this frame: none, unless overridden."""
        del frame
        return NO_DEFINES

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the fullscreen triangle."""
        program = io.program(self.fragment, self.vertex, defines=self.defines(frame))
        program.set(**self.uniforms())
        program.draw_fullscreen()
