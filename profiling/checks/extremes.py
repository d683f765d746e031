"""Stiff and extreme cases: each is drawn small and held against rays, or against what must not change.

The cases stand in stability_cases.py; what they do to a scene in stability_changes.py, stability_shapes.py and
stability_surfaces.py. docs/stability.md says where each bound comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from math import inf, isfinite
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import Error
from deferred_ir.engine.renderer import Renderer
from deferred_ir.profiling.checks.change_views import same, still
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.reference import SETTINGS, Reference, reference

UNSHADOWED = Path(__file__).with_name("unshadowed.toml")
SIZE = (128, 128)
VPLS = 64
HALF_FLOAT = 2.0**-11
"""Relative rounding of the G-buffer's albedo: no picture is nearer to rays for sure."""
Against = Literal["rays", "itself", "black", "unshadowed"]


@dataclass(frozen=True)
class Case:
    """One extreme: what is done to a scene, and how far its picture may be from what it must equal.

    against: `rays`, the same VPLs with visibility by rays; `itself`, the picture that must not change; `black`;
    `unshadowed`, the picture without shadows, which no picture with shadows may exceed.
    slack: for `rays`, how many times `Judge.usual` the figure may be. bound: for the others, on the
    figure itself. wanted: what is done to the scene for the picture of `itself`. gain: by how much the picture must be
    brighter than that. middle: that one's size where it is larger, and the picture its middle. settings, size, vpls and
    graph are those of both pictures.
    """

    name: str
    change: Callable[[Scene], Scene] = same
    against: Against = "rays"
    slack: float = 0.0
    bound: float = 0.0
    wanted: Callable[[Scene], Scene] = same
    gain: float = 1.0
    settings: Mapping[str, Any] = field(default_factory=dict)
    size: tuple[int, int] = SIZE
    middle: tuple[int, int] | None = None
    vpls: int = VPLS
    graph: str = "deferred"


@dataclass(frozen=True)
class Row:
    """What a case came to in a scene. figure: None where there was an error, which `note` tells."""

    scene: str
    case: str
    graph: str
    against: str
    figure: float | None
    bound: float
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether the figure keeps within its bound; what is not finite does not, nor bounds anything."""
        return self.figure is not None and self.figure <= self.bound < inf

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON, which knows no infinity."""
        figures = {"figure": self.figure, "bound": self.bound}
        finite = {name: value if value is not None and isfinite(value) else None for name, value in figures.items()}
        return {**asdict(self), **finite, "holds": self.holds}


class Judge:
    """Draws the cases of one scene after another; close it, or use `with`."""

    def __init__(self, device: str = "auto") -> None:
        self._device = device
        self._renderers: dict[str, Renderer] = {}
        self._plain: dict[str, float] = {}
        self._scene: Scene | None = None

    def rows(self, scene: Scene, cases: Iterable[Case]) -> Iterator[Row]:
        """Draw and judge each case in `scene`, as it is at 0 s."""
        scene = still(scene)
        if scene is not self._scene:
            self._scene, self._plain = scene, {}
        for case in cases:
            figure: float | None = None
            bound, note = case.bound, ""
            try:
                if case.against == "rays":
                    bound = max(case.slack * self.usual(scene, case.graph), HALF_FLOAT)
                figure = self._figure(scene, case)
            except Error as error:
                note = str(error)
            yield Row(scene.name, case.name, case.graph, case.against, figure, bound, note)

    def usual(self, scene: Scene, graph: str = "deferred") -> float:
        """The share of light that maps get wrong in the scene as it is: of direct or of indirect light, the larger."""
        if graph not in self._plain:
            direct, whole = (Case("as it is", vpls=vpls, graph=graph) for vpls in (0, VPLS))
            alone, lit = self._drawn(scene, direct), self._drawn(scene, whole)
            alone_free, free = self._unshadowed(scene, direct), self._unshadowed(scene, whole)
            found = self._traced(scene, whole)
            self._plain[graph] = max(
                _ratio(np.abs(alone - found.direct).sum(), alone_free.sum()),
                _ratio(np.abs(lit - alone - found.indirect).sum(), (free - alone_free).sum()),
            )
        return self._plain[graph]

    def _figure(self, scene: Scene, case: Case) -> float:
        changed = case.change(scene)
        image = self._drawn(changed, case)
        if not np.isfinite(image).all() or image.min() < 0:
            return inf
        if case.against == "black":
            return float(image.max())
        if case.against == "itself":
            wanted = self._wanted(scene, case) * case.gain
            return _ratio(np.abs(image - wanted).sum(), wanted.sum())
        unshadowed = self._unshadowed(changed, case)
        if case.against == "unshadowed":
            return _ratio(np.maximum(image - unshadowed, 0).sum(), unshadowed.sum())
        return _ratio(np.abs(image - self._traced(changed, case).radiance).sum(), unshadowed.sum())

    def _wanted(self, scene: Scene, case: Case) -> Array:
        """The picture that must not change."""
        size = case.middle or case.size
        drawn = self._drawn(case.wanted(scene), replace(case, size=size))
        top, left = (size[1] - case.size[1]) // 2, (size[0] - case.size[0]) // 2
        return drawn[top : top + case.size[1], left : left + case.size[0]]

    def _traced(self, scene: Scene, case: Case) -> Reference:
        """With visibility by rays."""
        bounces = case.settings.get("vpl.bounces", 1) if case.vpls else 0
        settings = {name: value for name, value in self._values(case).items() if name in SETTINGS}
        return reference(scene, case.size, vpls=max(case.vpls, 1), bounces=bounces, settings=settings)

    def _unshadowed(self, scene: Scene, case: Case) -> Array:
        """With the same lights and no shadows."""
        values = {name: value for name, value in self._values(case).items() if name.startswith("vpl.")}
        return self._drawn(scene, replace(case, graph=str(UNSHADOWED), settings=values))

    def _values(self, case: Case) -> dict[str, Any]:
        """The settings of a case, and those of VPLs that its graph has."""
        params = self._renderer(case.graph).graph().nodes["vpl"].work.params
        own = {name: getattr(params, name[4:]) for name in SETTINGS if hasattr(params, name[4:])}
        return {**own, **case.settings}

    def _drawn(self, scene: Scene, case: Case) -> Array:
        """Radiance, float64 (H, W, 3)."""
        renderer = self._renderer(case.graph)
        renderer.configure(size=case.size, set=case.settings)
        renderer.reset()  # `incremental` keeps lights
        radiance = renderer.render(scene, vpls=case.vpls).radiance
        assert radiance is not None
        drawn: Array = radiance.astype(np.float64)
        return drawn

    def _renderer(self, graph: str) -> Renderer:
        if graph not in self._renderers:
            self._renderers[graph] = Renderer(SIZE, graph, self._device)
        return self._renderers[graph]

    def __enter__(self) -> Judge:
        self._renderer("deferred")  # raises DeviceError
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for renderer in self._renderers.values():
            renderer.close()


def _ratio(part: float, whole: float) -> float:
    """part / whole; where there is nothing, nothing may be wrong."""
    if whole > 0:
        return float(part / whole)
    return 0.0 if part == 0 else inf


def heading(width: int) -> str:
    """The table's first line; width: of the scenes' names."""
    return f"{'scene':<{width}}  {'case':<44}  {'graph':<11}  {'against':<10}  {'figure':>7}  {'bound':>7}  verdict"


def line(row: Row, width: int) -> str:
    """A row as the table has it."""
    figure = "error" if row.figure is None else f"{row.figure:.1e}"
    verdict = "holds" if row.holds else "FAILS"
    text = (
        f"{row.scene:<{width}}  {row.case:<44}  {row.graph:<11}  {row.against:<10}  "
        f"{figure:>7}  {row.bound:>7.1e}  {verdict}"
    )
    return f"{text}: {row.note}" if row.note else text
