"""The shader library: includes, defines, the cache of programs, and errors that name file and line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from deferred_ir.base.errors import ShaderError
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import Program, ShaderLibrary, Source, _locate, flatten, package_shaders
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture

VERTEX = "void main() { gl_Position = vec4(0.0); }\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "lib").mkdir()
    write(tmp_path, "none.vert", VERTEX)
    return tmp_path


@pytest.fixture
def library(gpu: Gpu) -> Iterator[ShaderLibrary]:
    library = ShaderLibrary(gpu)
    yield library
    library.release()


def write(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, encoding="utf-8")


def program(library: ShaderLibrary, folder: Path, text: str, **defines: int | float) -> Program:
    write(folder, "own.frag", text)
    return library.program("own.frag", "none.vert", defines=defines, folder=folder)


def fault(library: ShaderLibrary, folder: Path, text: str) -> str:
    with pytest.raises(ShaderError) as raised:
        program(library, folder, text)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_a_compute_shader_runs_for_each_texel_of_a_rectangle(gpu, library, folder):
    write(
        folder,
        "mark.comp",
        """
        #include "lib/compute.glsl"
        layout(binding = 0, rgba32f) uniform image2D image;
        void main() {
            ivec2 at = find_texel();
            if (is_inside(at)) imageStore(image, at, imageLoad(image, at) + vec4(at, STEP, 1.0));
        }
        """,
    )
    program = library.program("mark.comp", defines={"STEP": 2}, folder=folder)
    texture = GpuTexture(gpu, Texture("rgba32f"), (21, 13))
    texture.fill(0)
    texture.bind_image(0)
    expected = np.zeros((13, 21, 4), np.float32)
    for x, y, width, height in [(3, 2, 17, 9), (20, 11, 1, 1), (0, 0, 8, 1)]:
        program.dispatch((x, y, width, height))
        gpu.barrier()
        rows, columns = np.mgrid[y : y + height, x : x + width]
        expected[y : y + height, x : x + width] += np.stack([columns, rows, 2 + 0 * rows, 1 + 0 * rows], axis=-1)
    np.testing.assert_array_equal(texture.read(), expected)
    texture.release()


def test_a_fault_in_a_compute_shader_names_file_and_line(library, folder):
    write(folder, "wrong.comp", '#include "lib/compute.glsl"\nvoid main() {\n    nothing;\n}\n')
    with pytest.raises(ShaderError, match=r"^wrong\.comp:3: [^\n]*$"):
        library.program("wrong.comp", folder=folder)


# Flattening


def test_version_defines_and_text_follow_one_another(folder):
    write(folder, "a.frag", "SIZE\nEDGE\n")
    source = flatten("a.frag", [folder], {"SIZE": 4, "EDGE": 0.5})
    assert source.text == "#version 430 core\n#define EDGE 0.5\n#define SIZE 4\nSIZE\nEDGE\n"
    assert source.lines[-2:] == (("a.frag", 1), ("a.frag", 2))
    assert len(source.lines) == len(source.text.splitlines())


def test_only_defines_that_the_text_names_are_written(folder):
    write(folder, "a.frag", '#include "lib/b.glsl"\n#ifdef ASKED\nTHERE_AND_MORE\n#endif\n')
    write(folder, "lib/b.glsl", "INCLUDED + 1\n")
    source = flatten("a.frag", [folder], dict.fromkeys(("ASKED", "INCLUDED", "THERE", "MORE", "FOREIGN"), 1))
    assert [line for line in source.text.splitlines() if "#define" in line] == ["#define ASKED 1", "#define INCLUDED 1"]


def test_includes_are_replaced_once_at_any_depth(folder):
    write(folder, "a.frag", '#include "lib/b.glsl"\na\n  #include "lib/c.glsl"  \nend\n')
    write(folder, "lib/b.glsl", 'b\n#include "lib/c.glsl"\nb again')
    write(folder, "lib/c.glsl", '#include "lib/b.glsl"\nc\n')
    source = flatten("a.frag", [folder], {})
    assert source.text.splitlines()[1:] == ["b", "c", "b again", "a", "end"]
    assert source.lines[1:] == (
        ("lib/b.glsl", 1),
        ("lib/c.glsl", 2),
        ("lib/b.glsl", 3),
        ("a.frag", 2),
        ("a.frag", 4),
    )


def test_a_file_that_includes_itself_is_there_once(folder):
    write(folder, "a.frag", '#include "a.frag"\na\n')
    assert flatten("a.frag", [folder], {}).text.splitlines()[1:] == ["a"]


def test_the_first_folder_wins(folder):
    (folder / "own").mkdir()
    write(folder, "a.frag", "theirs")
    write(folder / "own", "a.frag", "ours")
    assert "ours" in flatten("a.frag", [folder / "own", folder], {}).text
    assert "theirs" in flatten("a.frag", [folder, folder / "own"], {}).text


def test_a_missing_include_names_the_line_and_the_nearest_file(folder):
    write(folder, "a.frag", '#include "lib/b.glsl"\n')
    write(folder, "lib/b.glsl", '\n#include "lib/ligth.glsl"\n')
    write(folder, "lib/light.glsl", "")
    with pytest.raises(ShaderError, match=r"^lib/b\.glsl:2: no shader file 'lib/ligth\.glsl'; did you mean 'lib/light"):
        flatten("a.frag", [folder], {})


def test_a_missing_file_gets_the_list_of_shaders_and_nothing_else(folder):
    write(folder, "own.frag", "")
    for other in ("__init__.py", "lib/__init__.cpython-311.pyc", "notes.txt"):
        write(folder, other, "")
    with pytest.raises(ShaderError) as raised:
        flatten("zzz", [folder, package_shaders()], {})
    known = str(raised.value).partition("known: ")[2].split(", ")
    assert {"own.frag", "lighting.frag", "lib/lights/light.glsl"} <= set(known)
    assert {Path(name).suffix for name in known} <= {".vert", ".frag", ".geom", ".tesc", ".tese", ".comp", ".glsl"}


# Compiling


def test_programs_are_kept_by_files_and_defines(library, folder):
    text = "out vec4 color; void main() { color = vec4(SIZE); }"
    first = program(library, folder, text, SIZE=1)
    assert program(library, folder, text, SIZE=1) is first
    assert library.compiled == 1
    assert program(library, folder, text, SIZE=2) is not first
    assert library.compiled == 2


def test_a_define_that_no_stage_names_compiles_nothing(library, folder):
    write(folder, "placed.vert", "void main() { gl_Position = vec4(PLACE); }\n")
    write(folder, "own.frag", "out vec4 color;\nvoid main() {\n#ifdef BRIGHT\ncolor = vec4(1.0);\n#endif\n}\n")

    def made(**defines: int) -> Program:
        return library.program("own.frag", "placed.vert", defines=defines, folder=folder)

    first = made(PLACE=1, FOREIGN=1)
    assert made(PLACE=1, FOREIGN=2) is made(PLACE=1) is first
    assert library.compiled == 1
    made(PLACE=2)
    made(PLACE=2, BRIGHT=1)
    assert library.compiled == 3


def test_a_define_that_an_edited_file_names_from_now_on_is_written(library, folder):
    first = program(library, folder, "out vec4 color; void main() { color = vec4(1.0); }", SIZE=1)
    other = program(library, folder, "out vec4 color; void main() { color = vec4(1.0); }", SIZE=2)
    assert first is other
    write(folder, "own.frag", "out vec4 color; void main() { color = vec4(SIZE); }")
    assert library.reload()
    assert not library.reload()
    compiled = library.compiled
    changed = [library.program("own.frag", "none.vert", defines={"SIZE": size}, folder=folder) for size in (1, 2)]
    assert ["#define SIZE 1" in one.text for one in changed] == [True, False]
    assert library.compiled == compiled + 1


def test_every_shader_knows_what_the_driver_can_do(library, folder):
    program(
        library,
        folder,
        "#if !defined(CLIP_CONTROL) || !defined(LAYER_FROM_VERTEX)\n#error missing\n#endif\nvoid main() {}",
    )


def test_a_compile_error_names_the_file_and_line_it_is_in(library, folder):
    write(folder, "lib/b.glsl", "// fine\nfloat f() { return missing; }\n")
    message = fault(library, folder, '// one\n#include "lib/b.glsl"\nvoid main() { also_missing = 1.0; }\n')
    assert message.startswith("lib/b.glsl:2: ")
    assert "missing" in message
    assert "more)" in message


def test_an_error_behind_an_include_names_its_own_line(library, folder):
    write(folder, "lib/b.glsl", "float f() { return 1.0; }\n")
    message = fault(library, folder, '// one\n#include "lib/b.glsl"\n\nvoid main() { missing = 1.0; }\n')
    assert message.startswith("own.frag:4: ")


def test_an_error_in_the_vertex_shader_names_that_file(library, folder):
    write(folder, "own.frag", "void main() {}")
    write(folder, "broken.vert", "\nvoid main() { gl_Position = missing; }")
    with pytest.raises(ShaderError, match=r"^broken\.vert:2: "):
        library.program("own.frag", "broken.vert", folder=folder)


def test_a_link_error_is_one_line_with_the_shader(library, folder):
    message = fault(library, folder, "in float absent; out vec4 color; void main() { color = vec4(absent); }")
    assert message.startswith("own.frag: ")
    assert "absent" in message


def test_a_failed_program_is_not_kept(library, folder):
    fault(library, folder, "void main() { missing = 1.0; }")
    program(library, folder, "void main() {}")


SOURCES = {
    "vertex_shader": Source("", (("defines", 1), ("a.vert", 1))),
    "fragment_shader": Source("", (("defines", 1), ("a.frag", 1), ("lib/b.glsl", 1), ("a.frag", 3))),
}
HEAD = "GLSL Compiler failed\n\nfragment_shader\n===============\n"


@pytest.mark.parametrize(
    ("log", "located"),
    [
        ("0:3(11): error: `x' undeclared", "lib/b.glsl:1: error: `x' undeclared"),
        ('0(3) : error C1503: undefined variable "x"', 'lib/b.glsl:1: error C1503: undefined variable "x"'),
        ("ERROR: 0:3: error(#143) Undeclared identifier: x", "lib/b.glsl:1: error(#143) Undeclared identifier: x"),
        ("ERROR: 0:3: 'x' : undeclared identifier", "lib/b.glsl:1: 'x' : undeclared identifier"),
        ("0:2(1): error: one\n0:4(1): error: two\n", "a.frag:1: error: one (and 1 more)"),
        ("0:2(1): warning: `y' unused\n0:3(1): error: two\n", "lib/b.glsl:1: error: two"),
        ("0(2) : warning C7050: y\n0(3) : error C1503: x\n", "lib/b.glsl:1: error C1503: x"),
        ("WARNING: 0:2: y\nERROR: 0:3: x\n", "lib/b.glsl:1: x"),
        ("0:99(1): error: beyond the end", "a.frag:3: error: beyond the end"),
        ("no line at all", "a.frag: no line at all"),
    ],
)
def test_each_drivers_message_is_led_back_to_its_file(log, located):
    assert _locate(HEAD + log + "\n", SOURCES, "a.frag") == located


def test_the_stage_says_which_file():
    assert _locate("GLSL Compiler failed\n\nvertex_shader\n=====\n0:2(1): error: x\n", SOURCES, "a.frag") == (
        "a.vert:1: error: x"
    )


# Uniforms

UNIFORMS = """
uniform float used;
uniform float unused;
uniform bool flag;
uniform sampler2D image;
uniform sampler2DArrayShadow maps;
uniform usampler2DArray numbers;
uniform isampler2D signed_numbers;
uniform samplerCube sky;
out vec4 color;
void main() {
    color = vec4(used) * texture(image, vec2(0.0)) * texture(maps, vec4(0.0)) * float(texture(numbers, vec3(0.0)).x)
          * float(texture(signed_numbers, vec2(0.0)).x) * texture(sky, vec3(1.0)) * float(flag);
}
"""


def test_uniforms_are_set_by_name(library, folder):
    one = program(library, folder, UNIFORMS)
    one.set(used=2.5, flag=True)
    assert one.glsl["used"].value == 2.5
    assert one.has("used")
    assert not one.has("unused")


def test_a_uniform_that_this_variant_does_not_use_is_passed_over(library, folder):
    program(library, folder, UNIFORMS).set(unused=1.0)


def test_an_unknown_uniform_is_an_error(library, folder):
    with pytest.raises(ShaderError, match=r"^own\.frag: no uniform 'usde'; did you mean 'used'\?$"):
        program(library, folder, UNIFORMS).set(usde=1.0)


def test_samplers_of_every_kind_are_found(library, folder):
    found = program(library, folder, UNIFORMS).samplers
    assert found == {"image", "maps", "numbers", "signed_numbers", "sky"}


def test_an_array_of_samplers_is_found_by_its_name(library, folder):
    text = """
    uniform sampler2DShadow maps[2];
    out vec4 color;
    void main() { color = vec4(texture(maps[0], vec3(0.0)) + texture(maps[1], vec3(0.0))); }
    """
    assert program(library, folder, text).samplers == {"maps"}
