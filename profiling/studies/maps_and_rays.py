"""What shadow maps cost in accuracy: the same VPLs with maps and with ray-cast visibility, both held against truth.

    python -m deferred_ir.profiling.studies.maps_and_rays cornell colors atrium --graphs deferred,hemisphere --seeds 5

Truth is path-traced (`--spp`), or `--reference F.npz` with arrays image, direct and hit, for one scene.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from deferred_ir.base.image_size import parse_size
from deferred_ir.base.progress import track
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import reference


def measure(
    scene: Scene, truth: Mapping[str, Any], *, graph: str, size: tuple[int, int], vpls: int, seeds: int
) -> dict[str, Any]:
    """relMSE of maps and of rays, one a seed, and the mean ratio of their indirect light."""
    image, direct, hit = (np.asarray(truth[key]) for key in ("image", "direct", "hit"))
    maps, rays, ratios = [], [], []
    with Renderer(size, graph) as renderer:
        cone = {"vpl.fov": renderer.graph().nodes["vpl"].work.params.fov}
        plan = renderer.plan(scene, vpls, ["radiance"])
        for seed in track(range(seeds), scene.name):
            renderer.draw(scene, plan, seed=seed)
            mapped = renderer.read(plan).radiance
            traced = reference(scene, size, vpls=vpls, seed=seed, settings=cone)
            maps.append(relmse(mapped, image, hit)[0])
            rays.append(relmse(traced.radiance, image, hit)[0])
            ratios.append((mapped - direct)[hit].mean() / traced.indirect[hit].mean())
    return {"maps": maps, "rays": rays, "indirect": float(np.mean(ratios))}


def main() -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--graphs", type=lambda text: text.split(","), default=["deferred"], metavar="A,B")
    parser.add_argument("--vpls", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--size", type=parse_size, default=(256, 256))
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--reference", metavar="F.npz")
    arguments = parser.parse_args()
    print("| scene | graph | relMSE with maps | relMSE with rays | maps / rays | indirect light, maps / rays |")
    print("|---" * 6 + "|")
    for name in arguments.scenes:
        scene = load(name)
        if arguments.reference:
            truth: Mapping[str, Any] = np.load(arguments.reference)
        else:
            traced = reference(scene, arguments.size, spp=arguments.spp)
            truth = {"image": traced.radiance, "direct": traced.direct, "hit": traced.hit}
        for graph in arguments.graphs:
            found = measure(scene, truth, graph=graph, size=arguments.size, vpls=arguments.vpls, seeds=arguments.seeds)
            maps, rays = np.mean(found["maps"]), np.mean(found["rays"])
            cells = [scene.name, graph]
            cells += [
                f"{mean:.4f} ({min(found[key]):.4f} to {max(found[key]):.4f})"
                for key, mean in (("maps", maps), ("rays", rays))
            ]
            cells += [f"{maps / rays:.2f}", f"{found['indirect']:.3f}"]
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
