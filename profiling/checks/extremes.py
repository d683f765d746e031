"""Extreme cases: each is rendered small and compared with rays, or with an image that it must not change.

The cases are in cases.py; The files of changes/ change scenes for them.
docs/stability.md explains each bound.
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
from deferred_ir.profiling.checks.changes.furnace import find_error
from deferred_ir.profiling.checks.changes.views import Unsuited, freeze, same
from deferred_ir.profiling.checks.trace_points import trace_with_points
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.reference import SETTINGS, Reference, trace_reference

UNSHADOWED = Path(__file__).with_name("unshadowed.toml")
SIZE = (128, 128)
VPLS = 64
HALF_FLOAT = 2.0**-11
"""Relative rounding error of the G-buffer's albedo: no image is sure to be nearer to rays."""
ROUNDING = 2.0**-24
"""Relative rounding error of a 32-bit float."""
ROUNDED = 16 * ROUNDING
"""Bound where a few factors are rounded differently."""
TEXELS = 256
"""Width of a VPL's map, unless a case sets another."""
MOVED = 8 * TEXELS * ROUNDING
"""Bound where coordinates are rounded differently: edges in maps move by this fraction of a texel."""
NORMALS = 2.0**-14
"""Bound where normals are rounded differently before they are stored in 16 bits."""
Against = Literal["rays", "itself", "black", "unshadowed", "furnace"]


@dataclass(frozen=True)
class Case:
    """One extreme case: a change of a scene, and how far the image may differ from the expected one.

    against: `rays`, the same VPLs with visibility by rays; `itself`, an image that must not change; `black`;
    `unshadowed`, the image without shadows, which no image with shadows may exceed; `furnace`, what a ball reflects in
    light that is the same from all around (furnace.py). slack: for `rays`, the largest
    figure as a multiple of `Judge.usual_error`. bound: for the others, the largest figure. expected: the change of the
    scene for the expected image of `itself`. gain: factor by which the image must be brighter than that. middle: size
    of the expected image if it is larger; then its middle is compared. settings, size, vpls and graph apply to both
    images.
    """

    name: str
    change: Callable[[Scene], Scene] = same
    against: Against = "rays"
    slack: float = 0.0
    bound: float = 0.0
    expected: Callable[[Scene], Scene] = same
    gain: float = 1.0
    settings: Mapping[str, Any] = field(default_factory=dict)
    size: tuple[int, int] = SIZE
    middle: tuple[int, int] | None = None
    vpls: int = VPLS
    graph: str = "deferred"


@dataclass(frozen=True)
class Row:
    """The result of a case in a scene. figure: None after an error, which `note` describes.

    left_out: the scene lacks what the case changes, as `note` says.
    """

    scene: str
    case: str
    graph: str
    against: str
    figure: float | None
    bound: float
    note: str = ""
    left_out: bool = False

    @property
    def holds(self) -> bool:
        """Whether the figure is within its bound, where there is one; neither may be infinite or NaN."""
        return self.left_out or (self.figure is not None and self.figure <= self.bound < inf)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, which has no infinity."""
        figures = {"figure": self.figure, "bound": self.bound}
        finite = {name: value if value is not None and isfinite(value) else None for name, value in figures.items()}
        return {**asdict(self), **finite, "holds": self.holds}


class Judge:
    """Renders and judges the cases of scenes. A context manager, which closes its renderers."""

    def __init__(self, device: str = "auto") -> None:
        self._device = device
        self._renderers: dict[str, Renderer] = {}
        self._usual: dict[str, float] = {}
        self._scene: Scene | None = None

    def rows(self, scene: Scene, cases: Iterable[Case]) -> Iterator[Row]:
        """Yield the result of each case in `scene` at 0 s."""
        scene = freeze(scene)
        if scene is not self._scene:
            self._scene, self._usual = scene, {}
        for case in cases:
            figure: float | None = None
            bound, note, left_out = case.bound, "", False
            try:
                if case.against == "rays":
                    bound = max(case.slack * self.usual_error(scene, case.graph), HALF_FLOAT)
                figure = self._figure(scene, case)
            except Unsuited as reason:
                note, left_out = str(reason), True
            except Error as error:
                note = str(error)
            yield Row(scene.name, case.name, case.graph, case.against, figure, bound, note, left_out)

    def usual_error(self, scene: Scene, graph: str = "deferred") -> float:
        """Return the fraction of direct or indirect light, the larger, that maps get wrong in the unchanged scene."""
        if graph not in self._usual:
            direct, whole = (Case("as it is", vpls=vpls, graph=graph) for vpls in (0, VPLS))
            alone, lit = self._render(scene, direct), self._render(scene, whole)
            alone_free, free = self._render_unshadowed(scene, direct), self._render_unshadowed(scene, whole)
            traced = self._trace(scene, whole)
            self._usual[graph] = max(
                _ratio(np.abs(alone - traced.direct - traced.emission).sum(), (alone_free - traced.emission).sum()),
                _ratio(np.abs(lit - alone - traced.indirect).sum(), (free - alone_free).sum()),
            )
        return self._usual[graph]

    def _figure(self, scene: Scene, case: Case) -> float:
        changed = case.change(scene)
        image = self._render(changed, case)
        if not np.isfinite(image).all() or image.min() < 0:
            return inf
        if case.against == "black":
            return float(image.max())
        if case.against == "furnace":
            return find_error(changed, image, case.size)
        if case.against == "itself":
            expected = self._render_expected(scene, case) * case.gain
            return _ratio(np.abs(image - expected).sum(), expected.sum())
        unshadowed = self._render_unshadowed(changed, case)
        if case.against == "unshadowed":
            return _ratio(np.maximum(image - unshadowed, 0).sum(), unshadowed.sum())
        traced = self._trace(changed, case)
        return _ratio(np.abs(image - traced.radiance).sum(), (unshadowed - traced.emission).sum())

    def _render_expected(self, scene: Scene, case: Case) -> Array:
        """Render the image that the case must equal."""
        size = case.middle or case.size
        image = self._render(case.expected(scene), replace(case, size=size))
        top, left = (size[1] - case.size[1]) // 2, (size[0] - case.size[0]) // 2
        return image[top : top + case.size[1], left : left + case.size[0]]

    def _trace(self, scene: Scene, case: Case) -> Reference:
        """Sum the same VPLs, and the same points of lights, with visibility by rays."""
        bounces = case.settings.get("vpl.bounces", 1) if case.vpls else 0
        settings = {name: value for name, value in self._values(case).items() if name in SETTINGS}
        count = max(case.vpls, 1)
        if scene.sampled_lights:
            samples = self._renderer(case.graph).graph().nodes["light_points"].work.params.samples
            return trace_with_points(scene, case.size, vpls=count, bounces=bounces, settings=settings, samples=samples)
        return trace_reference(scene, case.size, vpls=count, bounces=bounces, settings=settings)

    def _render_unshadowed(self, scene: Scene, case: Case) -> Array:
        """Render with the same lights and without shadows."""
        values = {name: value for name, value in self._values(case).items() if name.startswith("vpl.")}
        return self._render(scene, replace(case, graph=str(UNSHADOWED), settings=values))

    def _values(self, case: Case) -> dict[str, Any]:
        """Return the settings of a case, and its graph's parameters of VPLs."""
        params = self._renderer(case.graph).graph().nodes["vpl"].work.params
        own = {name: getattr(params, name[4:]) for name in SETTINGS if hasattr(params, name[4:])}
        return {**own, **case.settings}

    def _render(self, scene: Scene, case: Case) -> Array:
        """Render radiance, float64 (H, W, 3)."""
        renderer = self._renderer(case.graph)
        renderer.configure(size=case.size, set=case.settings)
        renderer.reset()  # `incremental` retains VPLs
        radiance = renderer.render(scene, vpls=case.vpls).radiance
        assert radiance is not None
        image: Array = radiance.astype(np.float64)
        return image

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
    """Return part / whole; 0 / 0 is 0."""
    if whole > 0:
        return float(part / whole)
    return 0.0 if part == 0 else inf


def heading(width: int) -> str:
    """Return the table's first line. width: of the scenes' names."""
    return f"{'scene':<{width}}  {'case':<44}  {'graph':<11}  {'against':<10}  {'figure':>7}  {'bound':>7}  verdict"


def line(row: Row, width: int) -> str:
    """Return a line of the table."""
    missing = "-" if row.left_out else "error"
    figure = missing if row.figure is None else f"{row.figure:.1e}"
    verdict = "left out" if row.left_out else "holds" if row.holds else "FAILS"
    text = (
        f"{row.scene:<{width}}  {row.case:<44}  {row.graph:<11}  {row.against:<10}  "
        f"{figure:>7}  {row.bound:>7.1e}  {verdict}"
    )
    return f"{text}: {row.note}" if row.note else text
