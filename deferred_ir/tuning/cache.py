"""What is measured on a machine, and where it is kept: files in the user's cache folder."""

from __future__ import annotations

import hashlib
import logging
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import write_json

log = logging.getLogger("deferred_ir")

DISTRIBUTION = "deferred-ir"


def name_machine(device: str, opengl: str) -> str:
    """Name what measurements depend on: processor, device (GL_RENDERER), driver (GL_VERSION), and our version."""
    version = metadata.version(DISTRIBUTION)
    return f"{_name_processor()}, {os.cpu_count()} cores; {device}, OpenGL {opengl}; {DISTRIBUTION} {version}"


def _name_processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def find_file(kind: str, machine: str) -> Path:
    """Return where measurements of one kind are kept for a machine."""
    import platformdirs

    name = hashlib.sha256(machine.encode()).hexdigest()[:12]
    return Path(platformdirs.user_cache_dir(DISTRIBUTION, appauthor=False)) / f"{kind}-{name}.json"


def keep(file: Path, record: dict[str, Any]) -> None:
    """Write what was measured just now. Where it cannot be written it is good for this process only."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_json(file, record)
    except (OSError, OutputError) as error:
        log.warning("the %s of this machine cannot be kept: %s", file.name.partition("-")[0], error)
