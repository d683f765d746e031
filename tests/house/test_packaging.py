"""The wheel holds everything, works outside the checkout, and starts light."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-dir"]
HEAVY = {"moderngl", "trimesh", "scipy", "embreex", "PIL", "OpenEXR", "glfw", "glm", "matplotlib", "imgui_bundle"}


def run(*command, **options):
    """Standard output of a command that must succeed, run without the checkout on its path."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy: a build leaves files in its tree, and stale ones get into the next wheel."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for folder in FOLDERS.values():
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", target, cwd=source)
    (file,) = target.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """The Python of a new environment with the wheel.

    Dependencies are borrowed from the running environment by a path entry. Its editable deferred_ir is not: it
    hangs on a .pth file, and those count only in an environment's own folder.
    """
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=False)
    binaries = home / ("Scripts" if os.name == "nt" else "bin")
    python = binaries / ("python.exe" if os.name == "nt" else "python")
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    run(*pip, "install", "--quiet", "--no-deps", wheel)
    own = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    assert own.is_relative_to(home)
    borrowed = dict.fromkeys(sysconfig.get_path(kind) for kind in ("purelib", "platlib"))
    (own / "borrowed.pth").write_text("\n".join(borrowed))
    return python


def test_the_wheel_holds_every_file_of_the_package(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    missing = {
        f"{folder}/{inner}"
        for package, folder in FOLDERS.items()
        for inner in (file.relative_to(ROOT / folder) for file in (ROOT / folder).rglob("*") if file.is_file())
        if "__pycache__" not in inner.parts and f"{package.replace('.', '/')}/{inner.as_posix()}" not in names
    }
    assert not missing, "not in pyproject.toml's packages or package-data"
    assert any(name.endswith("licenses/LICENSE") for name in names)


def test_the_wheel_takes_no_top_level_name_but_its_own(wheel):
    tops = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert tops == {"deferred_ir", next(top for top in tops if top.endswith(".dist-info"))}


def test_the_installed_package_renders_from_another_folder(python, tmp_path):
    home = Path(run(python, "-c", "import deferred_ir; print(deferred_ir.__file__)", cwd=tmp_path).strip())
    assert home.is_relative_to(python.parent.parent)
    arguments = ["render", "cornell", "--size", "64x64", "--vpls", "4", "-o", "o.png"]
    run(python.with_name("deferred-ir"), *arguments, cwd=tmp_path)
    with Image.open(tmp_path / "o.png") as image:
        assert image.size == (64, 64)
        assert max(high for _, high in image.convert("RGB").getextrema()) > 0


@pytest.mark.parametrize(
    ("script", "extra"),
    [
        ("import deferred_ir", {"numpy"}),
        ("from deferred_ir.cli.main import main\ntry: main(['--help'])\nexcept SystemExit: pass", {"numpy"}),
    ],
    ids=["import", "help"],
)
def test_it_starts_light(script, extra):
    """Heavy libraries load when they are first used."""
    out = run(sys.executable, "-c", f"{script}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))")
    assert not set(json.loads(out.splitlines()[-1])) & (HEAVY | extra)


@pytest.fixture
def missing_driver(tmp_path):
    """Runs the look for system parts where EGL finds no driver and the only programs are those in the folder `bin`."""
    (tmp_path / "bin").mkdir()

    def look():
        environment = {"PATH": str(tmp_path / "bin"), "__EGL_VENDOR_LIBRARY_FILENAMES": "/missing.json"}
        command = [sys.executable, ROOT / "tools" / "system.py", "opengl"]
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment)

    def add(name, script):
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / "bin" / name).chmod(0o755)

    look.add, look.log = add, tmp_path / "log"
    return look


def test_a_missing_system_part_that_cannot_be_installed_is_named(missing_driver):
    done = missing_driver()
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "Install by hand: apt-get install libegl1 libgl1-mesa-dri"


def test_a_missing_system_part_is_installed_where_that_is_allowed(missing_driver):
    missing_driver.add("apt-get", f'echo "$@" >> {missing_driver.log}')
    missing_driver.add("sudo", 'shift; exec "$@"')
    missing_driver()
    update, install = missing_driver.log.read_text().splitlines()
    assert "update" in update
    assert install.endswith("libegl1 libgl1-mesa-dri")
