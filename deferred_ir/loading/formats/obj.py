"""Corrects OBJ and MTL files before trimesh reads them, for what it passes over.

trimesh knows one `mtllib`, finds the word even in a comment, counts negative indices from the end of the whole file,
skips missing materials and images without a word, and rounds Kd to 8 bits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SceneError
from deferred_ir.loading.asset_paths import Assets, strip_options
from deferred_ir.loading.formats.model_format import FileImage, FileMaterial, ModelFormat, choose_plain_albedo
from deferred_ir.loading.model_data import check_albedo, check_emission
from deferred_ir.loading.textures import open_image
from deferred_ir.scene.surfaces.materials import WHITE, Material

MATERIALS = "materials.mtl"
"""Name under which all materials of a model are handed to trimesh."""


@dataclass(frozen=True)
class MtlMaterial:
    """An MTL material: the numbers of Kd and Ke (unrounded, none if it has none), and their images."""

    kd: tuple[float, ...] = ()
    image: str | None = None
    ke: tuple[float, ...] = ()
    glow: str | None = None


@dataclass(frozen=True)
class ObjFile:
    """An OBJ file prepared for trimesh: its text, assets, materials by name, and notes."""

    text: bytes
    assets: Assets
    materials: dict[str, MtlMaterial]
    notes: tuple[str, ...]


class ObjFormat(ModelFormat):
    """An OBJ file with its MTL files. An image (map_Kd) replaces the colour (Kd)."""

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        file = read(path, data, root)
        super().__init__(path, file.text, "obj", file.assets)
        self.notes += file.notes
        self._materials = file.materials
        self._images: dict[str, Any] = {}

    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Return Kd, unrounded, Ke and the images map_Kd and map_Ke of the file's material of that name."""
        plain = choose_plain_albedo(colored)
        if material is None:
            return FileMaterial(Material("default", plain))
        image = self.find_image(material)
        fills_in = image is None and getattr(material, "image", None) is not None
        known = MtlMaterial() if fills_in else self._materials.get(material.name, MtlMaterial())
        self.require_image(material, image, known.image)
        if material.name in self._materials and not known.kd and image is None:
            self.notes.append(f"{self.path.name}: material {material.name} has no Kd that can be read; it is grey")
        albedo = check_albedo(known.kd, self.locate(material), self.notes) if known.kd else plain
        found = Material(material.name, albedo)
        images = {}
        if image is not None:
            images["base_color"] = FileImage(image, known.image or f"texture of {material.name}")
        known = self._materials.get(material.name, MtlMaterial())
        if known.ke or known.glow:
            # An image alone counts as it is.
            radiance = check_emission(known.ke or WHITE, self.locate(material))
            found = replace(found, emission=radiance, emits_both_sides=True)
            if any(radiance) and known.glow is not None:
                images["emission"] = FileImage(self._open_image(material, known.glow), known.glow)
        return FileMaterial(found, images)

    def _open_image(self, material: Any, name: str) -> Any:
        if name not in self._images:
            self._images[name] = open_image(self.assets[name]) if self.assets.path(name) else None
        self.require_image(material, self._images[name], name)
        return self._images[name]


def read(path: Path, data: bytes, root: Path | None = None) -> ObjFile:
    """Make the OBJ file `data` at `path` ready for trimesh; all its material libraries become one.

    root: see Assets.
    """
    text = _decode(data)
    assets = Assets([path.parent], root=root)
    libraries, notes = [], []
    for names in re.findall(r"^[ \t]*mtllib[ \t]+(.*)", text, re.MULTILINE):
        for name in _split_library_names(names.strip(), assets):
            found = assets.path(name)
            if found is None:
                notes.append(f"{path.name}: its material file {name} is missing")
                continue
            libraries.append(_decode(found.read_bytes()))
            if found.parent not in assets.folders:
                assets.folders.append(found.parent)
    materials = _read_materials("\n".join(libraries))
    # trimesh drops all materials over one value that it does not expect, so it gets names and images only.
    lines = ((f"newmtl {name}", f"map_Kd {m.image}" if m.image else "") for name, m in materials.items())
    assets.blobs[MATERIALS] = "\n".join(line for pair in lines for line in pair).encode()
    used = {" ".join(name.split()) for name in re.findall(r"^usemtl[ \t]+(.*)", text, re.MULTILINE)}
    if missing := sorted(used - materials.keys()):
        notes.append(f"{path.name}: no material {', '.join(missing)}; its surfaces are grey")
    text = re.sub(r"^.*\bmtllib\b.*$", "", text, flags=re.MULTILINE)
    text = f"mtllib {MATERIALS}\n{_make_indices_absolute(text)}"
    if re.search(r"^f[^\n#]*[ \t/](0+|-\d+)(?![\d.])", text, re.MULTILINE):
        raise SceneError(
            f"{path}: a face has index 0, or one before the first vertex; export it again, counting from 1"
        )
    return ObjFile(text.encode(), assets, materials, tuple(notes))


def _decode(data: bytes) -> str:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _split_library_names(names: str, assets: Assets) -> list[str]:
    """Return the files of one `mtllib` line: one name with spaces, or several names."""
    return [names] if assets.path(names) or " " not in names else names.split()


def _read_materials(mtl: str) -> dict[str, MtlMaterial]:
    """Read the materials of an MTL text by name; of two with the same name the later counts."""
    materials: dict[str, MtlMaterial] = {}
    name = ""
    for line in mtl.splitlines():
        key, *rest = line.split(maxsplit=1) or [""]
        key, value = key.lower(), rest[0] if rest else ""
        if key == "newmtl":
            name = " ".join(value.split())
            materials[name] = MtlMaterial()
        elif name and key == "kd":
            materials[name] = replace(materials[name], kd=_parse_numbers(value))
        elif name and key == "map_kd" and value.strip():
            materials[name] = replace(materials[name], image=strip_options(value).strip())
        elif name and key == "ke":
            materials[name] = replace(materials[name], ke=_parse_numbers(value))
        elif name and key == "map_ke" and value.strip():
            materials[name] = replace(materials[name], glow=strip_options(value).strip())
    return materials


def _parse_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a line before its comment; none for anything else, such as `spectral file.rfl`."""
    try:
        return tuple(float(word) for word in text.partition("#")[0].split())
    except ValueError:
        return ()


def _make_indices_absolute(text: str) -> str:
    """Replace negative face indices, which count back from the latest vertex, by positive ones."""
    if not re.search(r"^[ \t]*f[^\n#]*[ \t/]-\d", text, re.MULTILINE):
        return text
    counts = {"v": 0, "vt": 0, "vn": 0}
    lines = text.split("\n")
    for number, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        if words[0] in counts:
            counts[words[0]] += 1
        elif words[0] == "f":
            totals = tuple(counts.values())
            lines[number] = " ".join(["f", *(_make_absolute(word, totals) for word in words[1:])])
    return "\n".join(lines)


def _make_absolute(reference: str, totals: tuple[int, ...]) -> str:
    """Return one vertex of a face, such as `-4/-4/-1`, counted from 1. totals: vertices, uvs, normals so far."""
    parts = reference.split("/")
    for place, (part, total) in enumerate(zip(parts, totals, strict=False)):
        if re.fullmatch(r"-\d+", part):
            parts[place] = str(total + 1 + int(part))
    return "/".join(parts)
