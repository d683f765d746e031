"""Checks the essentials in under a minute on two cores: `python tools/quick.py`, or `make quick`.

Lint, types (with its cache mypy checks only what has changed), an image of each graph, and the tests that need no
OpenGL, no other process and little time. The whole suite is `make test`.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PYTHON = (sys.executable, "-m")
SIZE, VPLS = (32, 32), 8
TESTS = ROOT / "tests"
FIRST = ("base", "graph", "house", "loading", "output", "rays", "sampling")
"""Folders of the first half of the tests; both halves take about as long."""
OPENGL = ("gl", "passes", "support", "viewer")
"""Folders with hardly a test without OpenGL: reading them would take longer than those tests."""


def run(*command: str) -> str | None:
    """Run a command. Returns what it printed if it failed, else None."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return f"{done.stdout}{done.stderr}" if done.returncode else None


def lint() -> str | None:
    """Check style and formatting."""
    return run(*PYTHON, "ruff", "check", "--quiet", ".") or run(*PYTHON, "ruff", "format", "--quiet", "--check", ".")


def types() -> str | None:
    """Check types."""
    return run(sys.executable, str(ROOT / "tools" / "typecheck.py"))


def first_tests() -> str | None:
    """Run the quick tests of the folders FIRST."""
    return test(*(TESTS / name for name in FIRST))


def other_tests() -> str | None:
    """Run the quick tests of the other folders."""
    names = sorted(folder.name for folder in TESTS.iterdir() if folder.is_dir())
    return test(*(TESTS / name for name in names if name not in (*FIRST, *OPENGL) and not name.startswith("_")))


def test(*folders: Path) -> str | None:
    """Run the quick tests of some folders."""
    return run(*PYTHON, "pytest", "--quick", "-p", "no:cacheprovider", *map(str, folders))


def images() -> str | None:
    """Render an image with each graph that can run here. Returns the names of those that are black or not finite."""
    import numpy as np

    import deferred_ir as ir
    from deferred_ir.graph.file import find_obstacles, graph_names

    faults = []
    scene = ir.load("cornell")
    for graph in sorted(set(graph_names()) - set(find_obstacles())):
        with ir.Renderer(SIZE, graph, device="software") as renderer:
            radiance = renderer.render(scene, vpls=VPLS).radiance
        if radiance is None or not np.isfinite(radiance).all() or not radiance.any():
            faults.append(f"{graph}: the image is black or not finite\n")
    return "".join(faults) or None


def report(check: Callable[[], str | None]) -> bool:
    """Run a check, and print its name, its time and what is wrong. Returns whether it passed."""
    start = time.perf_counter()
    try:
        fault = check()
    except Exception as error:  # of a graph that does not render at all
        fault = f"{type(error).__name__}: {error}\n"
    print(
        f"{check.__name__}: {'FAILED' if fault else 'ok'}, {time.perf_counter() - start:.0f} s\n{fault or ''}", end=""
    )
    return fault is None


def main() -> int:
    """Run all checks, three at a time. Exit status 0 if all passed."""
    start = time.perf_counter()
    with ThreadPoolExecutor(2) as beside:
        tested = [beside.submit(report, check) for check in (first_tests, other_tests)]
        passed = [report(check) for check in (lint, types, images)]
        passed += [future.result() for future in tested]
    print(f"{time.perf_counter() - start:.0f} s in all")
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
