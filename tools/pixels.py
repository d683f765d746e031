"""Proves that a refactoring changes no pixel: `python tools/pixels.py [SCENE ...]`, or `make pixels`.

Renders the built-in scenes, and the scene files named, with every graph: several seeds, bounces, soft shadows, wide
lights, moving lights and models, reuse between frames, and the parameters that select other code. The first run saves
pixels and their hashes in out/pixels. Later runs compare with them, report how far images differ, and exit with 1 if
any does. `--keep` replaces what was saved. Images depend on the driver, so they are never committed.

It uses the public interface only, so the environment of an older checkout can run it as well.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
SIZE = (96, 64)
VPLS = 32
GRAPHS = ("forward", "deferred", "hemisphere", "interleaved", "mapped", "accurate", "resampled", "incremental")
SCENES = ("cornell", "atrium", "colors")

BOX = "v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n"
FACES = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
ROOM = """
[[model]]
path = "box.obj"
{model}
[camera]
position = [0.1, 0.2, 0.95]
look_at = [0, -0.2, -0.5]
fov = 75
{camera}
[spotlight]
position = [-0.4, 0.9, 0.3]
look_at = [0.1, -1, -0.1]
emission = [3, 2.5, 2]
{light}
"""
BLOCK = """
[[model]]
path = "box.obj"
scale = 0.25
translate = [0.1, -0.75, -0.2]
"""
MOVING = """
[[model]]
path = "box.obj"
scale = 0.2
[model.motion]
times = [0, 1]
translations = [[-0.3, -0.8, -0.3], [0.4, -0.5, 0.1]]
rotations = [[0, 0, 0, 1], [0, 0.48, 0, 0.877]]
"""
CAMERA = """
[camera.motion]
times = [0, 1]
positions = [[0.1, 0.2, 0.95], [0.3, 0.1, 0.9]]
look_ats = [[0, -0.2, -0.5], [0.1, -0.2, -0.5]]
"""
LISSAJOUS = """
[spotlight.motion]
kind = "lissajous"
amplitude = [0.2, 0.02, 0.2]
speed = [2, 3]
"""
WRITTEN = {
    "room": ROOM.format(model=BLOCK, camera="", light="fov = 90"),
    "soft": ROOM.format(model=BLOCK, camera="", light="fov = 90\nradius = 0.08"),
    "wide": ROOM.format(model=BLOCK, camera="", light="fov = 165"),
    "wide soft": ROOM.format(model=BLOCK, camera="", light="fov = 165\nradius = 0.08"),
    "dark": ROOM.format(model=BLOCK, camera="", light="fov = 90").replace("[3, 2.5, 2]", "[0, 0, 0]"),
    "models move": ROOM.format(model=MOVING + BLOCK, camera="", light="fov = 90"),
    "light moves": ROOM.format(model=BLOCK, camera="", light="fov = 90" + LISSAJOUS),
    "all move": ROOM.format(model=MOVING, camera=CAMERA, light="fov = 90\nradius = 0.03" + LISSAJOUS),
}
"""Scene files that the tool writes itself, by name."""


@dataclass(frozen=True)
class Case:
    """Images of one Renderer: one for each of `times` and `seeds`, in that order."""

    scene: str
    graph: str
    set: Mapping[str, Any] = field(default_factory=dict)
    seeds: tuple[int, ...] = (0,)
    times: tuple[float, ...] = (0.0,)
    vpls: int | None = VPLS
    accumulate: int = 1
    reuse: bool = False
    keep_all: bool = False

    @property
    def name(self) -> str:
        """A name that no other case has."""
        changed = [f"{key}={value}" for key, value in self.set.items()]
        if self.vpls != VPLS:
            changed.append(f"vpls={self.vpls}")
        if self.accumulate > 1:
            changed.append(f"accumulate={self.accumulate}")
        changed += [name for name in ("reuse", "keep_all") if getattr(self, name)]
        return " ".join([Path(self.scene).stem, self.graph, *changed])


def cases(extra: list[str]) -> Iterator[Case]:
    """List all cases. extra: scene files."""
    for scene in (*SCENES, *extra):
        for graph in GRAPHS:
            yield Case(scene, graph, times=(0.0,) * (3 if graph == "incremental" else 1))  # VPLs fill up over frames
    times = (0.0, 0.03, 0.06, 0.5, 0.5, 1.0)
    for graph in GRAPHS:
        yield Case("cornell", graph, seeds=(1, 7))
        yield Case("room", graph, keep_all=True)
        yield from (Case(scene, graph) for scene in ("soft", "wide", "wide soft", "dark"))
        yield Case("cornell", graph, vpls=0)
        yield Case("cornell", graph, vpls=256)
        yield Case("all move", graph, accumulate=3)
        for scene in ("models move", "light moves", "all move"):
            yield Case(scene, graph, times=times)
            yield Case(scene, graph, times=times, reuse=True)
        for key, value in {"vpl.clamp": 0.0, "shadow_maps.spot_size": 256, "tonemap.operator": "aces"}.items():
            if graph not in ("resampled", "accurate") or not key.startswith("shadow_maps"):  # it has no maps
                yield Case("soft", graph, {key: value})
    for graph in ("forward", "deferred", "interleaved", "mapped"):
        yield Case("cornell", graph, {"vpl.bounces": 3})
        yield Case("room", graph, {"vpl.candidates": 4, "vpl.pattern": "halton"})
        maps = {"spot_kernel": 5.0, "vpl_kernel": 3.0, "spot_taps": 9, "vpl_taps": 5, "spot_offset": 1.0}
        yield Case("room", graph, {f"shadow_maps.{key}": value for key, value in maps.items()})
        soft = {"search_taps": 7, "soft_taps": 11, "vpl_offset": 1.5, "vpl_size": 64}
        yield Case("soft", graph, {f"shadow_maps.{key}": value for key, value in soft.items()})
        yield Case("wide", graph, {"shadow_maps.soft": "off", "shadow_maps.cull": "front"})
        for key, value in {"tessellation": "pre", "bend": 0.5}.items():
            paraboloid = {"shadow_maps.projection": "paraboloid", "vpl.fov": 179.0}
            yield Case("cornell", graph, {**paraboloid, f"shadow_maps.{key}": value})
        yield Case("colors", graph, {"shadow_maps.vpl_deviation": 2.0, "shadow_maps.projection": "perspective"})
    yield Case("colors", "forward", {"forward.lights_per_draw": 4})
    for graph in ("interleaved", "mapped"):
        yield from (Case("cornell", graph, {"interleave.n": n}) for n in (1, 2, 8))
        yield Case("room", graph, {"gather.angle": 60.0, "gather.fewest": 0.9})
        yield Case("cornell", graph, {"interleave.n": 8}, seeds=(0, 1, 1), reuse=True)
    for scale in (1, 3, 4):
        yield Case("soft", "resampled", {"sample_pixels.scale": scale, "vpl.bounces": 2}, seeds=(0, 1, 1), reuse=True)
    yield Case("cornell", "resampled", {"choose_vpls.rays": 1, "filter_samples.steps": 0, "list_vpls.entries": 64})
    yield from denoised_cases() if importlib.util.find_spec("mitsuba_oidn") else ()
    for visibility in ("maps", "rays"):
        yield Case("soft", "mapped", {"shadow_rays.visibility": visibility}, seeds=(0, 1, 1))
        yield Case("cornell", "mapped", {"shadow_rays.visibility": visibility, "near_field.samples": 0.5})
    yield Case("light moves", "incremental", {"vpl.most": 16, "vpl.least": 2}, times=times, seeds=(3,))
    yield from (Case("colors", "deferred", {"tonemap.operator": o}) for o in ("reinhard", "none"))
    yield Case("colors", "deferred", {"tonemap.exposure": 1.5})


def denoised_cases() -> Iterator[Case]:
    """List the cases of the graph that needs the extra `denoise`."""
    for quality in ("fast", "balanced"):
        yield Case("atrium", "denoised", {"denoise_samples.quality": quality}, seeds=(0, 1, 1), reuse=True)
    yield Case("all move", "denoised", {"sample_pixels.scale": 1}, times=(0.0, 0.5, 0.5, 1.0))


def render(case: Case, folder: Path) -> dict[str, np.ndarray]:
    """Render a case. Returns pixels by the names of the images. folder: of the scene files written."""
    import deferred_ir as ir

    path = folder / f"{case.scene}.toml"
    scene = ir.load(str(path) if path.exists() else case.scene)
    options = {"set": case.set, "reuse": case.reuse, "keep_all": case.keep_all, "device": "software"}
    images = {}
    with ir.Renderer(SIZE, case.graph, **options) as renderer:
        for i, time in enumerate(case.times):
            for j, seed in enumerate(case.seeds):
                image = renderer.render(scene, vpls=case.vpls, seed=seed, time=time, accumulate=case.accumulate)
                images[f"{case.name} [{i} {time:g} s, {j} seed {seed}] radiance"] = image.radiance
                images[f"{case.name} [{i} {time:g} s, {j} seed {seed}] display"] = image.display
    return images


def trace_references(folder: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and pixels of images of the path tracer, and of the sum over VPLs with shadow rays."""
    for scene in ("cornell", "soft", "all move"):
        for options in ("--spp 4", "--spp 4 --bounces 2 --seed 3", "--vpls 32", "--vpls 16 --set vpl.clamp=0.1"):
            path, out = folder / f"{scene}.toml", folder / "reference.npy"
            arguments = ["reference", str(path) if path.exists() else scene, "-o", out, "--size", "24x16"]
            command = [sys.executable, "-m", "deferred_ir", *arguments, *options.split()]
            subprocess.run(command, check=True, capture_output=True)
            yield f"reference {scene} {options}", np.load(out)


def describe_difference(image: np.ndarray, before: np.ndarray) -> str:
    """Describe how far two images differ."""
    if image.shape != before.shape:
        return f"{image.shape} instead of {before.shape}"
    a, b = image.astype(float), before.astype(float)
    error = ((a - b) ** 2 / (b**2 + 0.01 * b.mean() ** 2 + 1e-300)).mean()
    return f"{int((image != before).any(axis=-1).sum())} pixels, relMSE {error:.3g}"


def write_scenes(folder: Path) -> None:
    """Write the scene files of WRITTEN and their model."""
    (folder / "box.obj").write_text(BOX + FACES)
    for name, scene in WRITTEN.items():
        (folder / f"{name}.toml").write_text(scene)


def draw_all(scenes: list[str], only: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and pixels of each image. only: of the cases with this in their names, without references."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(name)
        write_scenes(folder)
        for case in tqdm([case for case in cases(scenes) if only in case.name], desc="pixels", unit="case"):
            yield from render(case, folder).items()
        if not only:
            yield from trace_references(folder)


class Store:
    """Saved images: their hashes in one file, and the pixels of each in another."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._file = folder, folder / "hashes.json"
        self.hashes: dict[str, str] = json.loads(self._file.read_text()) if self._file.exists() else {}

    @staticmethod
    def hash(pixels: np.ndarray) -> str:
        """Return 32 hex digits for the pixels, their type and their shape."""
        return hashlib.sha256(repr((pixels.dtype, pixels.shape)).encode() + pixels.tobytes()).hexdigest()[:32]

    def _path(self, name: str) -> Path:
        return self._folder / f"{hashlib.sha256(name.encode()).hexdigest()[:16]}.npy"

    def load(self, name: str) -> np.ndarray:
        """Load the pixels of a saved image."""
        pixels: np.ndarray = np.load(self._path(name))
        return pixels

    def save(self, images: Iterator[tuple[str, np.ndarray]]) -> int:
        """Replace all that is saved. Returns the number of images."""
        self.hashes = {}
        for name, pixels in images:
            self.hashes[name] = self.hash(pixels)
            np.save(self._path(name), pixels)
        self._file.write_text(json.dumps(self.hashes, indent=0))
        return len(self.hashes)


def compare(images: Iterator[tuple[str, np.ndarray]], store: Store, *, complete: bool) -> bool:
    """Compare images with saved ones and print the differences. Returns whether all are the same.

    complete: the images are all there are, so a saved one that is missing is a difference.
    """
    names, same, new = set[str](), 0, 0
    for name, pixels in images:
        names.add(name)
        if name not in store.hashes:
            new += 1
        elif store.hashes[name] == store.hash(pixels):
            same += 1
        else:
            tqdm.write(f"{name}: {describe_difference(pixels, store.load(name))}")
    missing = sorted(store.hashes.keys() - names) if complete else []
    for name in missing:
        print(f"not drawn any more: {name}")
    print(f"{same} of {len(names)} pictures are the same" + (f", {new} are new" if new else ""))
    return same + new == len(names) and not missing


def main() -> int:
    """Save images, or compare with saved ones. Exit status 0 if there were none, or all are the same."""
    parser = argparse.ArgumentParser(description="Render many images and compare them with images saved before.")
    parser.add_argument("scenes", nargs="*", help="scene files to render besides the built-in scenes")
    parser.add_argument("--keep", action="store_true", help="replace the saved images")
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "pixels", help="where the images are saved")
    parser.add_argument("--only", default="", help="only cases with this in their names")
    options = parser.parse_args()
    store, images = Store(options.folder), draw_all(options.scenes, options.only)
    if options.keep or not store.hashes:
        print(f"{store.save(images)} pictures saved in {options.folder}; change the code and run this again")
        return 0
    return 0 if compare(images, store, complete=not options.only) else 1


if __name__ == "__main__":
    sys.exit(main())
