"""Loads all broken files, each in a folder of its own below the one that is given, and prints a line of JSON for each.

A process of its own, so that a crash, a hang or too much memory meets no other.
"""

from __future__ import annotations

import faulthandler
import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

from bad_file_makers import document, glb
from bad_files import CASES

MEMORY = 2 << 30
"""Bytes of address space beyond those of the loaded program that any of these files may take."""


def outcome(path: Path) -> dict[str, Any]:
    """What loading a file comes to: its error, or the number of triangles."""
    from deferred_ir import load
    from deferred_ir.base.errors import Error

    try:
        return {"faces": len(load(path).geometry.faces)}
    except Error as error:
        return {"error": str(error)}
    except Exception as error:
        return {"fault": f"{type(error).__name__}: {str(error)[:200]}"}


def main(folder: Path) -> None:
    """Load all files, with memory bounded from here on."""
    (folder / "first").mkdir()
    (folder / "first" / "m.glb").write_bytes(glb(document()))
    outcome(folder / "first" / "m.glb")  # so that all libraries are there
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    for index, (name, make) in enumerate(CASES.items()):
        inner = folder / str(index)
        inner.mkdir()
        path = make(inner)
        faulthandler.dump_traceback_later(60, exit=True)
        start = time.process_time()
        told = outcome(path) | {"name": name, "path": str(path)}
        print(json.dumps(told | {"seconds": time.process_time() - start}), flush=True)
    faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
