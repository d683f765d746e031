"""mypy --strict over the whole package: `python tools/typecheck.py`.

The folders passes, profiling, scenes and shaders lie beside deferred_ir in the checkout but inside it once installed
(pyproject.toml, package-dir), and mypy does not know that mapping. So the package is installed plainly into a
temporary folder and checked there; paths in the messages are mapped back, and it is a fault if a file was not checked.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOLDERS: dict[str, str] = PROJECT["tool"]["setuptools"]["package-dir"]


def modules() -> dict[str, Path]:
    """Return the file in the checkout of each module, by the name it has once installed."""
    files = {}
    for package, folder in FOLDERS.items():
        for file in (ROOT / folder).rglob("*.py"):
            inner = file.relative_to(ROOT / folder).with_suffix("").parts
            parts = [package, *(inner[:-1] if inner[-1] == "__init__" else inner)]
            files[".".join(parts)] = file
    return files


def install(target: Path) -> None:
    """Install the package into `target`, built from a copy, since a build leaves stale modules in its tree."""
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name)
        for folder in FOLDERS.values():
            shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
        for file in ("pyproject.toml", "README.md", "LICENSE"):
            if (ROOT / file).exists():
                shutil.copy(ROOT / file, copy / file)
        pip = [sys.executable, "-m", "pip", "install", "-qq", "--disable-pip-version-check"]
        subprocess.run([*pip, "--no-deps", "--no-build-isolation", "--target", target, copy], check=True)


def map_to_checkout(text: str, known: dict[str, Path]) -> str:
    """Replace the paths of installed files in mypy's messages by those in the checkout."""

    def path(match: re.Match[str]) -> str:
        module = match[1].removesuffix("/__init__").replace("/", ".")
        return str(known[module].relative_to(ROOT)) if module in known else match[0]

    # Every line of mypy's begins with the path.
    return re.sub(r"^(deferred_ir(?:/\w+)+)\.py(?=:)", path, text, flags=re.MULTILINE)


def main() -> int:
    """Check all files. Exit status 0 if every file was checked and none has a fault."""
    known = modules()
    with tempfile.TemporaryDirectory() as name:
        installed = Path(name)
        install(installed)
        left_out = [file for module, file in known.items() if not installed_file(installed, module).exists()]
        if left_out:
            files = ", ".join(str(file.relative_to(ROOT)) for file in left_out)
            print(f"not in the package, so not checked: {files}; add the folder to pyproject.toml's packages")
            return 1
        mypy = [sys.executable, "-m", "mypy", "-p", "deferred_ir"]
        options = [f"--config-file={ROOT / 'pyproject.toml'}", f"--cache-dir={ROOT / '.mypy_cache'}"]
        done = subprocess.run([*mypy, *options], cwd=installed, capture_output=True, text=True, check=False)
    sys.stdout.write(map_to_checkout(done.stdout, known))
    sys.stderr.write(done.stderr)
    count = re.search(r"(?:checked|in) (\d+) source files", done.stdout)
    if not count or int(count[1]) < len(known):  # mypy counts folders of shaders as well
        print(f"mypy checked {count[1] if count else 'none'} of {len(known)} files")
        return 1
    return done.returncode


def installed_file(folder: Path, module: str) -> Path:
    """Return the file of `module` once installed into `folder`."""
    path = folder.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


if __name__ == "__main__":
    sys.exit(main())
