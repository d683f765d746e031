"""Texture aliasing: which outputs of a plan can use the texture of another whose last reader is done. No OpenGL."""

from __future__ import annotations

from deferred_ir.graph.graph import Plan

Source = tuple[str, str]
"""An output of a pass: (pass, port)."""


def alias_textures(plan: Plan) -> dict[Source, Source]:
    """Find the transient outputs that can use another output's texture. Returns {output: the output whose texture}.

    Both have the same description, and the last reader of the one runs before the other is written.
    """
    aliases: dict[Source, Source] = {}
    free: list[Source] = []
    described = {(step.name, port): output for step in plan.steps for port, output in step.outputs.items()}
    transient = {source: output.description for source, output in described.items() if output.transient}
    for number, step in enumerate(plan.steps):
        for source in [(step.name, port) for port in step.outputs if (step.name, port) in transient]:
            home = next((other for other in free if transient[other] == transient[source]), None)
            if home:
                free.remove(home)
                aliases[source] = home
        free += [aliases.get(source, source) for source in transient if plan.lifetimes[source][1] == number]
    return aliases
