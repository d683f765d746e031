"""The rooms of the house: who may import whom, read from the source."""

import ast
import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOLDERS = PROJECT["tool"]["setuptools"]["package-dir"]
SHADERS = {".glsl", ".vert", ".frag", ".geom", ".comp"}
LONGEST = 350
OPEN_TO_PASSES = {
    *("graph", "params", "gl", "camera", "lights", "tracing", "timing", "sampling", "errors", "typing"),
    *("frame", "io", "maps", "map_meshes", "paraboloid_maps", "vpls"),
    *("near_field", "surfaces", "resampling", "interleaving", "ray_visibility", "vpl_reference", "parallel"),
    *("vpl_buffer", "dropping", "variants", "screen_tiles", "incremental", "kept_maps", "direct_light"),
}
CLOSED_TO_PASSES = {"renderer", "executor", "config", "cli", "doctor", "viewer"}


def modules():
    """Every module's installed name, e.g. deferred_ir.passes.gbuffer, and its file."""
    for package, folder in FOLDERS.items():
        for file in sorted((ROOT / folder).rglob("*.py")):
            inner = file.relative_to(ROOT / folder).with_suffix("").parts
            yield ".".join([package, *(inner[:-1] if inner[-1] == "__init__" else inner)]), file


MODULES = dict(modules())
PASSES = [name for name in MODULES if name.startswith("deferred_ir.passes.") and "graphs" not in name]
LIBRARY = [name for name in MODULES if ROOT / "deferred_ir" in MODULES[name].parents]


def imports(name):
    """All modules that `name` imports, anywhere in it; `from x import y` gives x.y where that is a module, else x."""
    file = MODULES[name]
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                yield inner if inner in MODULES else source


def third_party(name):
    tops = {module.partition(".")[0] for module in imports(name)}
    return tops - set(sys.stdlib_module_names) - {"deferred_ir"}


def strings(name):
    for node in ast.walk(ast.parse(MODULES[name].read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_the_rules_below_see_imports_as_they_are():
    assert "deferred_ir.errors" in set(imports("deferred_ir.gl.devices"))
    assert "moderngl" in third_party("deferred_ir.gl.devices")
    assert "deferred_ir.gl.devices" in set(imports("deferred_ir.doctor"))


@pytest.mark.parametrize("name", LIBRARY)
def test_the_library_reaches_passes_in_one_place_only(name):
    assert not [module for module in imports(name) if module.startswith("deferred_ir.passes")]
    named = [text for text in strings(name) if re.match(r"deferred_ir\.passes\b", text)]
    assert not named or name == "deferred_ir.config"


@pytest.mark.parametrize("name", PASSES)
def test_a_pass_knows_the_tools_but_neither_the_renderer_nor_another_pass(name):
    ours = [module.removeprefix("deferred_ir.") for module in imports(name) if module.startswith("deferred_ir")]
    assert {module.partition(".")[0] for module in ours} <= OPEN_TO_PASSES


@pytest.mark.parametrize("name", PASSES)
def test_a_pass_does_not_reach_the_renderer_through_others_either(name):
    reached, ahead = set(), {name}
    while ahead:
        reached |= ahead
        ahead = {module for known in ahead for module in imports(known) if module in MODULES} - reached
    assert not {f"deferred_ir.{module}" for module in CLOSED_TO_PASSES} & reached


@pytest.mark.parametrize("name", ["deferred_ir.graph", "deferred_ir.params"])
def test_compiling_a_graph_needs_no_opengl(name):
    assert not third_party(name)
    ours = {module for module in imports(name) if module.startswith("deferred_ir")}
    assert ours <= {"deferred_ir.errors", "deferred_ir.params"}


@pytest.mark.parametrize("name", [name for name in MODULES if not name.startswith("deferred_ir.gl")])
def test_raw_opengl_lives_in_gl_only(name):
    tops = {module.partition(".")[0] for module in imports(name)}
    c = set() if name == "deferred_ir.profiling.soak" else {"ctypes"}  # which asks C's allocator, not OpenGL
    assert not tops & {"glcontext", "OpenGL", *c}


def test_every_third_party_import_is_a_declared_dependency():
    extras = PROJECT["project"]["optional-dependencies"]
    lines = PROJECT["project"]["dependencies"] + [line for key in extras if key != "dev" for line in extras[key]]
    declared = {re.match(r"[\w.-]+", line)[0].lower() for line in lines}
    distributions = metadata.packages_distributions()
    undeclared = {
        f"{name}: {top}"
        for name in MODULES
        for top in third_party(name)
        if not {distribution.lower() for distribution in distributions.get(top, [top])} & declared
    }
    assert not undeclared


@pytest.mark.parametrize("name", MODULES)
def test_every_module_says_what_it_is_for(name):
    assert ast.get_docstring(ast.parse(MODULES[name].read_text()))


def test_no_file_does_so_much_that_it_grows_long():
    files = [*MODULES.values(), *(file for file in (ROOT / "shaders").rglob("*") if file.suffix in SHADERS)]
    lengths = {str(file.relative_to(ROOT)): len(file.read_text().splitlines()) for file in files}
    assert not {file: length for file, length in lengths.items() if length > LONGEST}
