"""Where figures come from: the command, the day, the version of the program, and the machine."""

from __future__ import annotations

import os
import platform
import subprocess
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import deferred_ir

DISTRIBUTION = "deferred-ir"


@dataclass(frozen=True)
class Origin:
    """A run of the program. date: of its start, UTC. commit: of the checkout that ran, None for an installed package.

    machine: processor, its cores that this process may use, system and Python.
    """

    command: str
    date: str
    version: str
    commit: str | None
    machine: str


def describe_run(command: str) -> Origin:
    """Return the origin of what this process is about to measure. command: the command line, as a shell reads it."""
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return Origin(command, now, metadata.version(DISTRIBUTION), find_commit(), describe_machine())


def find_commit() -> str | None:
    """Return the commit of the checkout that this package lies in, with "-dirty" if files differ from it, else None."""
    root = Path(deferred_ir.__file__).parent.parent
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=10", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    except OSError:
        return None  # no git here
    return done.stdout.strip() or None


def describe_machine() -> str:
    """Name the processor, the cores that this process may use, the system and Python."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    system = f"{platform.system()} {platform.release()} {platform.machine()}"
    count = f"{cores} core{'s' if cores > 1 else ''}"
    return f"{_name_processor()}, {count}; {system}; Python {platform.python_version()}"


def _name_processor() -> str:
    """Return the processor's name; where the system does not tell it, the kind of machine."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, "") or platform.processor() or platform.machine() or "processor unknown"
