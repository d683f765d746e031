"""The shader library: `#include`, defines, programs cached by source and defines, errors with file and line.

Files have no `#version`; the library writes it, then the defines, then the file with its includes, each once.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import ShaderError, did_you_mean
from deferred_ir.gl import raw
from deferred_ir.gl.context import Gpu

VERSION = "#version 430 core"
COMPUTE = "compute_shader"
STAGES = {
    ".vert": "vertex_shader",
    ".tesc": "tess_control_shader",
    ".tese": "tess_evaluation_shader",
    ".geom": "geometry_shader",
    ".frag": "fragment_shader",
    ".comp": COMPUTE,
}
"""moderngl's name of a file's stage, by its suffix."""
FULLSCREEN = "fullscreen.vert"
WORK_GROUP = 8
"""Edge of the squares of texels that are the work groups of compute shaders (shaders/lib/compute.glsl)."""
_WORD = re.compile(r"[A-Za-z_]\w*")
_SUFFIXES = {*STAGES, ".glsl"}
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_MESSAGE = re.compile(r"^(?:ERROR: )?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:\s*(.*)$", re.MULTILINE)  # Mesa, NVIDIA, AMD, Intel


@dataclass(frozen=True)
class Source:
    """A flattened shader: its text, for each line the file and line that it came from, and the words in its files."""

    text: str
    lines: tuple[tuple[str, int], ...]
    words: frozenset[str] = frozenset()


Define = int | float | str
"""What a word of a shader is replaced by: a number, or another word."""
Files = tuple[tuple[str, ...], Path | None]
"""A program's files, one a stage, and the folder searched before the package's."""
Key = tuple[tuple[str, ...], Path | None, tuple[tuple[str, Define], ...]]
"""A program's files, the folder, and those of its defines that the files name."""


def package_shaders() -> Path:
    """Return the folder with the package's own shaders."""
    return Path(importlib.import_module("deferred_ir.shaders").__path__[0])


def flatten(name: str, folders: Iterable[Path], defines: Mapping[str, Define]) -> Source:
    """Read the shader file `name`, looked for in `folders` in order, with its includes, each once.

    An include that ends in a slash means all .glsl files of that folder.

    Of `defines` it gets those that its text names.
    """
    search = tuple(folders)
    body: list[str] = []
    lines: list[tuple[str, int]] = []
    seen: set[str] = set()

    def add(file: str, included_by: str) -> None:
        seen.add(file)
        path = next((folder / file for folder in search if (folder / file).is_file()), None)
        if path is None:
            known = [p.relative_to(f).as_posix() for f in search for p in f.rglob("*.*") if p.suffix in _SUFFIXES]
            raise ShaderError(f"{included_by}: no shader file '{file}'{did_you_mean(file, known)}")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            include = _INCLUDE.match(line)
            if include is None:
                body.append(line)
                lines.append((file, number))
            else:
                for other in _list_folder(include[1], search) if include[1].endswith("/") else [include[1]]:
                    if other not in seen:
                        add(other, f"{file}:{number}")

    add(name, name)
    words = frozenset(word for line in body for word in _WORD.findall(line))
    head = [VERSION, *(f"#define {key} {defines[key]}" for key in sorted(words & defines.keys()))]
    places = [("defines", i + 1) for i in range(len(head))]
    return Source("\n".join([*head, *body]) + "\n", (*places, *lines), words)


def _list_folder(folder: str, search: Iterable[Path]) -> list[str]:
    """Return the files of a folder, "lib/.../", in alphabetical order."""
    return sorted({f"{folder}{path.name}" for root in search for path in (root / folder).glob("*.glsl")})


class Program:
    """A linked program. name: of its first file. arrays: the vertex arrays made for it, by what they draw.

    computes: whether it is a compute shader, which is dispatched instead of drawn.
    """

    def __init__(self, gpu: Gpu, name: str, glsl: Any, sources: Mapping[str, Source]) -> None:
        self.gpu, self.name, self.glsl = gpu, name, glsl
        self.arrays: dict[Any, Any] = {}
        members = {member: glsl[member] for member in glsl}
        self.computes = COMPUTE in sources
        self.text = "".join(source.text for source in sources.values())
        self._words = _words(sources)
        self._uniforms = {key: m for key, m in members.items() if type(m).__name__ == "Uniform"}
        self.attributes = [
            key for key, m in members.items() if type(m).__name__ == "Attribute" and not key.startswith("gl_")
        ]
        self.samplers = frozenset(key for key, m in self._uniforms.items() if m.gl_type in raw.SAMPLERS)

    def set(self, **values: Any) -> None:
        """Set uniforms. Those that this variant of the shader does not use are ignored; an unknown one is an error."""
        for key, value in values.items():
            uniform = self._uniforms.get(key)
            if uniform is not None:
                uniform.value = value
            elif key not in self._words:
                raise ShaderError(f"{self.name}: no uniform '{key}'{did_you_mean(key, self._uniforms)}")

    def has(self, name: str) -> bool:
        """Whether the linked program reads the uniform `name`."""
        return name in self._uniforms

    def draw_fullscreen(self) -> None:
        """Draw one triangle over the whole target; fullscreen.vert computes its corners."""
        if None not in self.arrays:
            self.arrays[None] = self.gpu.ctx.vertex_array(self.glsl, [])
        self.arrays[None].render(self.gpu.ctx.TRIANGLES, vertices=3)

    def dispatch(self, rectangle: tuple[int, int, int, int]) -> None:
        """Run a compute shader for each texel of a rectangle x, y, width, height (shaders/lib/compute.glsl).

        Whoever reads what it stores puts a barrier before (`Gpu.barrier`).
        """
        self.set(rectangle=rectangle)
        self.glsl.run(-(-rectangle[2] // WORK_GROUP), -(-rectangle[3] // WORK_GROUP))

    def release(self) -> None:
        """Delete the program and its vertex arrays."""
        for array in self.arrays.values():
            array.release()
        self.glsl.release()


class ShaderLibrary:
    """Programs by their files and the defines that these name. `compiled` counts the programs built so far."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.compiled = 0
        self._programs: dict[Key, Program] = {}
        self._defines: dict[Key, dict[str, Define]] = {}  # with those that the files may name once they change
        self._words: dict[Files, frozenset[str]] = {}

    def program(self, *files: str, defines: Mapping[str, Define] | None = None, folder: Path | None = None) -> Program:
        """Return the program of these files, one a stage: a .comp alone; without a .vert it covers the whole target.

        `defines` make a difference where a file names them. `folder` is searched before the package's shaders.
        """
        asked = {"WORK_GROUP": WORK_GROUP, **self.gpu.defines, **(defines or {})}
        words = self._words.get((files, folder))
        key = None if words is None else _key(files, folder, asked, words)
        if key is None or key not in self._programs:
            sources = _sources(files, asked, folder)
            program = self._build(files[0], sources)
            words = _words(sources)
            key = _key(files, folder, asked, words)
            self._words[files, folder], self._programs[key], self._defines[key] = words, program, asked
        return self._programs[key]

    def _build(self, name: str, sources: Mapping[str, Source]) -> Program:
        import moderngl

        texts: dict[str, Any] = {stage: source.text for stage, source in sources.items()}
        self.compiled += 1
        try:
            glsl = self.gpu.ctx.compute_shader(texts[COMPUTE]) if COMPUTE in texts else self.gpu.ctx.program(**texts)
        except moderngl.Error as error:
            raise ShaderError(_locate(str(error), sources, name)) from error
        return Program(self.gpu, name, glsl, sources)

    def reload(self) -> bool:
        """Build the programs again whose files have changed, all or none. Returns whether there were any.

        After a ShaderError the programs are those from before.
        """
        programs: dict[Key, Program] = {}
        defines: dict[Key, dict[str, Define]] = {}
        words: dict[Files, frozenset[str]] = {}
        before = set(self._programs.values())
        try:
            for old, program in self._programs.items():
                (files, folder, _), asked = old, self._defines[old]
                sources = _sources(files, asked, folder)
                words[files, folder] = _words(sources)
                key = _key(files, folder, asked, words[files, folder])
                if key in programs:
                    continue  # the files no longer name the defines in which the two differ
                changed = "".join(source.text for source in sources.values()) != program.text
                programs[key] = self._build(files[0], sources) if changed else program
                defines[key] = asked
        except ShaderError:
            for program in set(programs.values()) - before:
                program.release()
            raise
        fresh = set(programs.values()) - before
        for program in before - set(programs.values()):
            program.release()
        self._programs, self._defines, self._words = programs, defines, words
        return bool(fresh)

    def forget(self, key: Any) -> None:
        """Delete the vertex arrays that programs hold for `key`, which is going away."""
        for program in self._programs.values():
            if key in program.arrays:
                program.arrays.pop(key).release()

    def release(self) -> None:
        """Delete all programs."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()


def _sources(files: Iterable[str], defines: Mapping[str, Any], folder: Path | None) -> dict[str, Source]:
    """Read the flattened shader of each stage."""
    folders = [package_shaders()] if folder is None else [folder, package_shaders()]
    stages = {STAGES[Path(file).suffix]: file for file in files}
    if COMPUTE not in stages:
        stages = {"vertex_shader": FULLSCREEN, **stages}
    return {stage: flatten(file, folders, defines) for stage, file in stages.items()}


def _words(sources: Mapping[str, Source]) -> frozenset[str]:
    """Return all words in the files of a program."""
    return frozenset().union(*(source.words for source in sources.values()))


def _key(files: tuple[str, ...], folder: Path | None, defines: Mapping[str, Define], words: frozenset[str]) -> Key:
    return files, folder, tuple((name, defines[name]) for name in sorted(words & defines.keys()))


def _locate(message: str, sources: Mapping[str, Source], name: str) -> str:
    """Return the driver's first error in one line, with the file and line it is about."""
    stage = next((stage for stage in sources if f"\n{stage}\n" in message), None)
    found = [(line, text) for line, text in _MESSAGE.findall(message) if not text.startswith("warning")]
    if stage is None or not found:
        text = [line for line in message.splitlines() if line.strip() and set(line) != {"="}]
        return f"{name}: {' '.join(text[2:] or text)}"
    line, complaint = found[0]
    file, number = sources[stage].lines[min(int(line), len(sources[stage].lines)) - 1]
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{file}:{number}: {complaint}{more}"
