"""Measure the error that shadow maps add: the same VPLs with maps and with rays, against a reference.

    python -m deferred_ir.profiling.studies.maps_and_rays cornell colors atrium --graphs deferred,hemisphere --seeds 5

The reference is path-traced (`--spp`), or `--reference F.npz` with the arrays image, direct and hit, for one scene.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from deferred_ir.base.progress import track
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, read_or_trace, run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference

HEAD = (
    *("scene", "graph", "relMSE with maps", "relMSE with rays", "maps / rays"),
    "indirect light, maps / rays",
)


def measure(
    scene: Scene, truth: Mapping[str, Any], *, graph: str, size: tuple[int, int], vpls: int, seeds: int
) -> dict[str, Any]:
    """Return the relMSE of maps and of rays, one a seed, and the mean ratio of their indirect light."""
    image, direct, hit = (np.asarray(truth[key]) for key in ("image", "direct", "hit"))
    maps, rays, ratios = [], [], []
    with Renderer(size, graph) as renderer:
        cone = {"vpl.fov": renderer.graph().nodes["vpl"].work.params.fov}
        plan = renderer.plan(scene, vpls, ["radiance"])
        for seed in track(range(seeds), scene.name):
            renderer.draw(scene, plan, seed=seed)
            mapped = renderer.read(plan).radiance
            traced = trace_reference(scene, size, vpls=vpls, seed=seed, settings=cone)
            maps.append(relmse(mapped, image, hit)[0])
            rays.append(relmse(traced.radiance, image, hit)[0])
            ratios.append((mapped - direct)[hit].mean() / traced.indirect[hit].mean())
    return {"maps": maps, "rays": rays, "indirect": float(np.mean(ratios))}


def row(scene: str, graph: str, result: Mapping[str, Any]) -> Sequence[str]:
    """Return the cells of HEAD."""
    maps, rays = np.mean(result["maps"]), np.mean(result["rays"])
    errors = [
        f"{mean:.4f} ({min(result[key]):.4f} to {max(result[key]):.4f})"
        for key, mean in (("maps", maps), ("rays", rays))
    ]
    return [scene, graph, *errors, f"{maps / rays:.2f}", f"{result['indirect']:.3f}"]


def report(chosen: argparse.Namespace) -> None:
    """Print a row for each scene and graph."""
    options = {"size": chosen.size, "vpls": chosen.vpls, "seeds": chosen.seeds}
    rows = []
    for name in chosen.scenes:
        scene = load(name)
        truth = read_or_trace(scene, chosen)
        rows += [row(scene.name, graph, measure(scene, truth, graph=graph, **options)) for graph in chosen.graphs]
    print(markdown(HEAD, rows))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    parser = command_line(__doc__, graphs=["deferred"], vpls=256, seeds=5, size=(256, 256), spp=1024, reference=None)
    run(parser, report, words)


if __name__ == "__main__":
    main()
