"""Node trees and matrices of Blender, which lights, materials and the camera are made of."""

from __future__ import annotations

from typing import Any

from deferred_ir.base.arrays import Array, Vec3


def make_matrix(x: Array, y: Array, z: Array, position: Vec3) -> list[list[float]]:
    """Return the matrix to world space from axes and origin. Blender reads a list as columns."""
    return [[*map(float, column), last] for column, last in ((x, 0.0), (y, 0.0), (z, 0.0), (position, 1.0))]


class Nodes:
    """A node tree built bottom up. Inputs are constants or sockets of other nodes."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        tree.nodes.clear()

    def add(self, kind: str, **inputs: Any) -> Any:
        """Add a node with inputs by name."""
        node = self._tree.nodes.new(kind)
        for name, source in inputs.items():
            self.join(source, node.inputs[name])
        return node

    def join(self, source: Any, socket: Any) -> None:
        """Set an input to a constant, or link it."""
        if isinstance(source, float | tuple):
            socket.default_value = source
        else:
            self._tree.links.new(source, socket)

    def value(self, color: Vec3) -> Any:
        """Return a constant colour as a socket."""
        node = self.add("ShaderNodeCombineXYZ", X=color[0], Y=color[1], Z=color[2])
        return node.outputs[0]

    def vector(self, operation: str, a: Any, b: Any) -> Any:
        """Apply a vector operation to `a` and `b`."""
        node = self._tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        self.join(a, node.inputs[0])
        self.join(b, node.inputs[1])
        return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]

    def math(self, a: Any, factor: Any, summand: float, *, clamp: bool = False) -> Any:
        """Compute a * factor + summand, clamped to [0, 1] on request."""
        node = self._tree.nodes.new("ShaderNodeMath")
        node.operation, node.use_clamp = "MULTIPLY_ADD", clamp
        for source, socket in zip((a, factor, summand), node.inputs, strict=True):
            self.join(source, socket)
        return node.outputs["Value"]
