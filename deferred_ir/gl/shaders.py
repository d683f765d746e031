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
from deferred_ir.gl.context import Gpu

VERSION = "#version 430 core"
STAGES = {
    ".vert": "vertex_shader",
    ".tesc": "tess_control_shader",
    ".tese": "tess_evaluation_shader",
    ".geom": "geometry_shader",
    ".frag": "fragment_shader",
}
"""moderngl's name of the stage that a file is, by its suffix."""
FULLSCREEN = "fullscreen.vert"
_SUFFIXES = {*STAGES, ".glsl"}
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_MESSAGE = re.compile(r"^(?:ERROR: )?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:\s*(.*)$", re.MULTILINE)  # Mesa, NVIDIA, AMD, Intel
# Every GL_*SAMPLER_*: float, shadow, rectangle and buffer, array, signed, unsigned, cube array, multisampled.
_SAMPLERS = {
    *(*range(0x8B5D, 0x8B65), *range(0x8DC0, 0x8DC6), *range(0x8DC9, 0x8DD9)),
    *(*range(0x900C, 0x9010), *range(0x9108, 0x910E)),
}


@dataclass(frozen=True)
class Source:
    """A flattened shader: its text, and for each line the file and line that it came from."""

    text: str
    lines: tuple[tuple[str, int], ...]


def package_shaders() -> Path:
    """The folder with the package's own shaders."""
    return Path(importlib.import_module("deferred_ir.shaders").__path__[0])


def flatten(name: str, folders: Iterable[Path], defines: Mapping[str, int | float]) -> Source:
    """The shader file `name`, looked for in `folders` in order, with its includes (each once) and defines."""
    search = tuple(folders)
    out = [VERSION, *(f"#define {key} {value}" for key, value in sorted(defines.items()))]
    lines: list[tuple[str, int]] = [("defines", i + 1) for i in range(len(out))]
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
                out.append(line)
                lines.append((file, number))
            elif include[1] not in seen:
                add(include[1], f"{file}:{number}")

    add(name, name)
    return Source("\n".join(out) + "\n", tuple(lines))


class Program:
    """A linked program. `name` is its first file's; vertex arrays that fit it are kept in `arrays`."""

    def __init__(self, gpu: Gpu, name: str, glsl: Any, sources: Iterable[Source]) -> None:
        self.gpu, self.name, self.glsl = gpu, name, glsl
        self.arrays: dict[Any, Any] = {}
        members = {member: glsl[member] for member in glsl}
        self.text = "".join(source.text for source in sources)
        self._uniforms = {key: m for key, m in members.items() if type(m).__name__ == "Uniform"}
        self.attributes = [
            key for key, m in members.items() if type(m).__name__ == "Attribute" and not key.startswith("gl_")
        ]
        self.samplers = frozenset(key for key, m in self._uniforms.items() if m.gl_type in _SAMPLERS)

    def set(self, **values: Any) -> None:
        """Set uniforms. One that this variant of the shader does not use is passed over; an unknown one is an error."""
        for key, value in values.items():
            uniform = self._uniforms.get(key)
            if uniform is not None:
                uniform.value = value
            elif not re.search(rf"\b{key}\b", self.text):
                raise ShaderError(f"{self.name}: no uniform '{key}'{did_you_mean(key, self._uniforms)}")

    def has(self, name: str) -> bool:
        """Whether the linked program reads the uniform `name`."""
        return name in self._uniforms

    def draw_fullscreen(self) -> None:
        """One triangle over the whole target; fullscreen.vert makes its corners."""
        if None not in self.arrays:
            self.arrays[None] = self.gpu.ctx.vertex_array(self.glsl, [])
        self.arrays[None].render(self.gpu.ctx.TRIANGLES, vertices=3)

    def release(self) -> None:
        """Give the program and its vertex arrays back."""
        for array in self.arrays.values():
            array.release()
        self.glsl.release()


class ShaderLibrary:
    """Programs by their files and defines. `compiled` counts the programs built so far."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.compiled = 0
        self._programs: dict[Any, Program] = {}

    def program(
        self, *files: str, defines: Mapping[str, int | float] | None = None, folder: Path | None = None
    ) -> Program:
        """The program of these files with these defines, one a stage; without a .vert it covers the whole target.

        `folder` is searched before the package's shaders.
        """
        all_defines = {**self.gpu.defines, **(defines or {})}
        key = (files, folder, tuple(sorted(all_defines.items())))
        if key not in self._programs:
            self._programs[key] = self._build(files, all_defines, folder)
        return self._programs[key]

    def _build(self, files: tuple[str, ...], defines: Mapping[str, Any], folder: Path | None) -> Program:
        import moderngl

        sources = _sources(files, defines, folder)
        texts: dict[str, Any] = {stage: source.text for stage, source in sources.items()}
        self.compiled += 1
        try:
            glsl = self.gpu.ctx.program(**texts)
        except moderngl.Error as error:
            raise ShaderError(_locate(str(error), sources, files[0])) from error
        return Program(self.gpu, files[0], glsl, sources.values())

    def reload(self) -> bool:
        """Build the programs again whose files have changed, all or none; whether there were any.

        After a ShaderError the programs are those from before.
        """
        fresh: dict[Any, Program] = {}
        try:
            for key, program in self._programs.items():
                files, folder, defines = key
                sources = _sources(files, dict(defines), folder)
                if "".join(source.text for source in sources.values()) != program.text:
                    fresh[key] = self._build(files, dict(defines), folder)
        except ShaderError:
            for program in fresh.values():
                program.release()
            raise
        for key, program in fresh.items():
            self._programs[key].release()
            self._programs[key] = program
        return bool(fresh)

    def forget(self, key: Any) -> None:
        """Give the vertex arrays back that programs keep for `key`, which is going away."""
        for program in self._programs.values():
            if key in program.arrays:
                program.arrays.pop(key).release()

    def release(self) -> None:
        """Give all programs back."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()


def _sources(files: Iterable[str], defines: Mapping[str, Any], folder: Path | None) -> dict[str, Source]:
    """The flattened shader of each stage."""
    folders = [package_shaders()] if folder is None else [folder, package_shaders()]
    stages = {"vertex_shader": FULLSCREEN, **{STAGES[Path(file).suffix]: file for file in files}}
    return {stage: flatten(file, folders, defines) for stage, file in stages.items()}


def _locate(message: str, sources: Mapping[str, Source], name: str) -> str:
    """The driver's first error in one line, with the file and line it is about."""
    stage = next((stage for stage in sources if f"\n{stage}\n" in message), None)
    found = [(line, text) for line, text in _MESSAGE.findall(message) if not text.startswith("warning")]
    if stage is None or not found:
        text = [line for line in message.splitlines() if line.strip() and set(line) != {"="}]
        return f"{name}: {' '.join(text[2:] or text)}"
    line, complaint = found[0]
    file, number = sources[stage].lines[min(int(line), len(sources[stage].lines)) - 1]
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{file}:{number}: {complaint}{more}"
