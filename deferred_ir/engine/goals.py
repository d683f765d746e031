"""One image with a goal: the mean of so many frames, an error, or a time."""

from __future__ import annotations

import math
from numbers import Real
from typing import TYPE_CHECKING, Any

from deferred_ir.base.errors import SettingError
from deferred_ir.engine.accumulation import Accumulation, count_most
from deferred_ir.engine.settings import FOR_ERROR, set_vpls
from deferred_ir.engine.setup import IMAGES, UNFILTERED
from deferred_ir.engine.within import Choice, choose
from deferred_ir.graph.graph import Plan
from deferred_ir.output.image import Image
from deferred_ir.scene.scene import Scene
from deferred_ir.tuning.ladder import GRAPH

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer


class Goals:
    """Renders images with one Renderer; what it chooses for a time it keeps for the next image of the same surfaces.

    named: whether the user named the renderer's graph, which then stays.
    """

    def __init__(self, renderer: Renderer, *, named: bool) -> None:
        self._renderer, self._named = renderer, named
        self._choices: dict[Any, tuple[Any, Choice]] = {}

    def render(
        self,
        scene: Scene,
        *,
        vpls: int | None,
        seed: int,
        time: float,
        accumulate: int | None,
        error: float | None,
        within: float | None,
    ) -> Image:
        """Do what Renderer.render says; the renderer's setup is afterwards what it was."""
        renderer, before = self._renderer, self._renderer.setup
        if error is not None and within is not None:
            raise SettingError(f"error {error!r} and within {within!r}: contradict each other; give one")
        most = count_most(accumulate, error)
        try:
            if within is not None:
                choice = self._choose(scene, vpls, within, accumulate)
                renderer.configure(graph=choice.graph, set=choice.set)
                most, vpls = choice.frames, None
            elif error is not None and not self._named:
                graph, set = FOR_ERROR
                renderer.configure(graph=graph, set={**set, **before.set})
            plan = self._plan(scene, vpls, estimated=error is not None)
            if most == 1:
                renderer.draw(scene, plan, seed=seed, time=time)
                return renderer.read(plan)
            mean = Accumulation(renderer, scene, plan, seed=seed, time=time, blend=error is not None)
            for _ in mean.draw_until(error, most):
                pass
            return mean.image()
        finally:
            renderer.setup = before

    def _plan(self, scene: Scene, vpls: int | None = None, *, estimated: bool = False) -> Plan:
        wanted = (*IMAGES, UNFILTERED) if estimated else IMAGES
        known = self._renderer.graph(vpls).outputs
        return self._renderer.plan(scene, vpls, [name for name in known if name in wanted])

    def _choose(self, scene: Scene, vpls: int | None, within: float, frames: int | None) -> Choice:
        """Choose settings for a time, once for each combination of surfaces, size and what is given."""
        if not (isinstance(within, Real) and 0 < float(within) < math.inf):
            raise SettingError(f"within {within!r}: wants seconds above 0, such as 0.2")
        renderer, surfaces = self._renderer, scene.geometry.rest
        kept = renderer.setup.set
        key = (id(surfaces), renderer.size, vpls, within, frames, repr(kept), str(renderer.setup.name))
        if key not in self._choices:
            if not self._named:
                renderer.configure(graph=GRAPH)
            if vpls is not None:
                renderer.configure(set={**kept, **set_vpls(renderer.graph(), vpls)})
            self._choices[key] = surfaces, choose(renderer, scene, within, lambda: self._plan(scene), frames=frames)
        return self._choices[key][1]
