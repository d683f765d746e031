"""Measures the limits and writes the table into docs/bench.md: `python tools/bench.py`, or `make bench`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pages import ROOT, replace_between

from deferred_ir.profiling.limits import bench

PAGE = ROOT / "docs" / "bench.md"
BEGIN = "<!-- limits: written by tools/bench.py -->"
END = "<!-- end of limits -->"
SCENES = ("cornell", "atrium", "colors")


def main() -> None:
    """Measure, print and write."""
    describe = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(describe, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    table = f"{bench.report(SCENES)} Commit {commit}."
    print(table)
    PAGE.write_text(replace_between(PAGE.read_text(encoding="utf-8"), BEGIN, END, table), encoding="utf-8")


if __name__ == "__main__":
    main()
