"""The house rule: rooms stand in one order, and a file imports its own room and earlier ones. Read from the source."""

import ast
import re
import sys
from importlib import metadata

import pytest
from source_imports import MODULES, PROJECT, ROOT, imports

ROOMS = (
    *("base", "sampling", "graph", "gl", "scene", "meshes", "rays", "output", "loading", "vpls", "frame", "pool"),
    *("shadows", "passes", "tuning", "engine", "report", "truth", "viewer", "profiling", "cli"),
)
MOST_FILES = 12
LONGEST = 300
SHADERS = {".glsl", ".vert", ".tesc", ".tese", ".geom", ".frag", ".comp"}
THIRD_PARTIES = {
    "moderngl": ("gl",),
    "glcontext": ("gl",),
    "ctypes": ("gl",),
    "embreex": ("rays",),
    "mitsuba_oidn": ("pool",),
    "trimesh": ("loading",),
    "PIL": ("loading", "output", "truth"),
    "OpenEXR": ("output",),
    "OpenImageIO": ("loading", "scene"),
    "glfw": ("gl", "viewer"),
    "imgui_bundle": ("gl", "viewer"),
    "argparse": ("cli",),
    "tqdm": ("base", "cli"),
}
"""Rooms that may import them. The rooms of profiling are commands of their own and measure peers and systems."""


FILES = [name for name, file in MODULES.items() if file.name != "__init__.py"]


def room(module):
    """The room of a module, `frame` of deferred_ir.frame.pass_io; "" for what lies in none."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in ROOMS else ""


def third_party(name):
    tops = {module.partition(".")[0] for module in imports(name)}
    return tops - set(sys.stdlib_module_names) - {"deferred_ir"}


@pytest.mark.parametrize("name", [name for name in FILES if room(name)])
def test_a_file_imports_its_own_room_and_earlier_ones(name):
    rooms = {room(module) for module in imports(name) if module.startswith("deferred_ir.")} - {""}
    assert not {other for other in rooms if ROOMS.index(other) > ROOMS.index(room(name))}


@pytest.mark.parametrize("name", [name for name in FILES if room(name) == "passes"])
def test_passes_do_not_import_each_other(name):
    assert "passes" not in {room(module) for module in imports(name)}


@pytest.mark.parametrize("name", [name for name in MODULES if name not in FILES and name != "deferred_ir"])
def test_importing_a_room_imports_nothing(name):
    assert not list(imports(name))


def test_no_room_has_so_many_files_that_one_gets_lost():
    counts = {}
    for name in FILES:
        if room(name) != "passes":  # a file a pass
            counts[MODULES[name].parent] = counts.get(MODULES[name].parent, 0) + 1
    assert not {folder: count for folder, count in counts.items() if count > MOST_FILES}


def test_no_file_does_so_much_that_it_grows_long():
    files = [*MODULES.values(), *(file for file in (ROOT / "shaders").rglob("*") if file.suffix in SHADERS)]
    lengths = {str(file.relative_to(ROOT)): len(file.read_text().splitlines()) for file in files}
    assert not {file: length for file, length in lengths.items() if length > LONGEST}


@pytest.mark.parametrize("name", [name for name in FILES if room(name) not in ("", "profiling")])
def test_third_parties_stay_in_their_rooms(name):
    tops = {module.partition(".")[0] for module in imports(name)}
    assert not {top for top in tops & THIRD_PARTIES.keys() if room(name) not in THIRD_PARTIES[top]}


def test_every_third_party_import_is_a_declared_dependency():
    extras = PROJECT["project"]["optional-dependencies"]
    lines = PROJECT["project"]["dependencies"] + [line for key in extras if key != "dev" for line in extras[key]]
    declared = {re.match(r"[\w.-]+", line)[0].lower() for line in lines}
    distributions = metadata.packages_distributions()
    undeclared = {
        f"{name}: {top}"
        for name in MODULES
        for top in third_party(name)
        if not {distribution.lower() for distribution in distributions.get(top, [top.replace("_", "-")])} & declared
    }
    assert not undeclared


@pytest.mark.parametrize("name", MODULES)
def test_every_module_says_what_it_is_for(name):
    assert ast.get_docstring(ast.parse(MODULES[name].read_text()))
