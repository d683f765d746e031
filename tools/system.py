"""System parts that pip cannot install: `python tools/system.py venv|opengl|browser|display`.

Looks for the part, installs it by apt-get where that is possible and allowed, else says in one line what to install.
Runs before anything is installed, so it uses the standard library only (`opengl` runs with deferred-ir in place).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

PACKAGES = {
    "venv": ["python3-venv"],
    "opengl": ["libegl1", "libgl1-mesa-dri"],
    "browser": ["chromium", "fonts-dejavu-core"],
    "display": ["xvfb", "xdotool", "libgl1"],
}
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPEN_CONTEXT = """
from deferred_ir.base.errors import Error
from deferred_ir.gl.devices import create_context
try:
    create_context()
except Error as error:
    raise SystemExit(str(error))
"""
FIND_BROWSER = f"""
import shutil
if not any(map(shutil.which, {BROWSERS})):
    raise SystemExit("no browser for screenshots: none of {", ".join(BROWSERS)} is installed")
"""
FIND_DISPLAY = """
import shutil
for program in ("Xvfb", "xdotool"):
    if not shutil.which(program):
        raise SystemExit(f"no virtual display for the viewer's tests: {program} is not installed")
"""
PROBES = {
    "venv": "import venv, ensurepip",
    "opengl": OPEN_CONTEXT,
    "browser": FIND_BROWSER,
    "display": FIND_DISPLAY,
}


def fault(part: str) -> str:
    """Return what is wrong with `part`, "" if nothing. A new process checks, to see what apt-get just installed."""
    probe = subprocess.run([sys.executable, "-c", PROBES[part]], capture_output=True, text=True, check=False)
    return (probe.stderr.strip().splitlines() or ["no message"])[-1] if probe.returncode else ""


def apt_get() -> list[str]:
    """Return the command that may install packages, [] if there is none."""
    if sys.platform != "linux" or not shutil.which("apt-get"):
        return []
    if os.geteuid() == 0:
        return ["apt-get"]
    sudo = shutil.which("sudo")
    allowed = sudo and subprocess.run([sudo, "-n", "true"], capture_output=True, check=False).returncode == 0
    return [sudo, "-n", "apt-get"] if sudo and allowed else []


def install(command: list[str], packages: list[str]) -> None:
    """Update the package lists and install. Prints a failure, but leaves the verdict to a second check."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for arguments in (["update"], ["install", "-y", "--no-install-recommends", *packages]):
        done = subprocess.run(
            [*command, "-qq", *arguments],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if done.returncode:
            print(f"apt-get {arguments[0]} failed: {(done.stdout.strip().splitlines() or [''])[-1]}", file=sys.stderr)


def main(part: str) -> int:
    """Install `part` if it is missing. Exit status 0 if it is there."""
    first = fault(part)
    if not first:
        return 0
    packages = PACKAGES[part]
    command = apt_get()
    if command:
        print(f"Installing {' '.join(packages)} (apt-get)", flush=True)
        install(command, packages)
        first = fault(part)
        if not first:
            return 0
    print(f"{first}\nInstall by hand: apt-get install {' '.join(packages)}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
