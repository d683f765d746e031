"""Corrects OBJ and MTL files before trimesh reads them, for what it passes over.

trimesh knows one `mtllib`, finds the word even in a comment, counts negative indices from the end of the whole file,
skips missing materials and images without a word, rounds Kd to 8 bits, and knows no other keys.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SceneError
from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.formats.model_format import FileImage, FileMaterial, ModelFormat, choose_plain_albedo
from deferred_ir.loading.formats.mtl import MtlMaterial, describe_losses, read_materials
from deferred_ir.loading.model_data import check_albedo, check_emission, check_factor
from deferred_ir.loading.textures import decode_texture, join_greys, open_image
from deferred_ir.scene.surfaces.materials import WHITE, Material

MATERIALS = "materials.mtl"
"""Name under which all materials of a model are handed to trimesh."""
NOTHING = MtlMaterial({})
"""A material of which no MTL file says anything."""


@dataclass(frozen=True)
class ObjFile:
    """An OBJ file prepared for trimesh: its text, assets, materials by name, and notes."""

    text: bytes
    assets: Assets
    materials: dict[str, MtlMaterial]
    notes: tuple[str, ...]


class ObjFormat(ModelFormat):
    """An OBJ file with its MTL files. Images replace the numbers beside them, except that map_Ke multiplies Ke."""

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        file = read(path, data, root)
        super().__init__(path, file.text, "obj", file.assets)
        self.notes += file.notes
        self._materials = file.materials
        self._images: dict[str, Any] = {}

    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Return what the file's material of that name says, its numbers unrounded."""
        plain = choose_plain_albedo(colored)
        if material is None:
            return FileMaterial(Material("default", plain))
        image = self.find_image(material)
        fills_in = image is None and getattr(material, "image", None) is not None
        known = self._materials.get(material.name, NOTHING)
        kd, wanted = ((), None) if fills_in else (known.read_numbers("kd"), known.find_file("map_kd"))
        self.require_image(material, image, wanted)
        if material.name in self._materials and not kd and image is None:
            self.notes.append(f"{self.path.name}: material {material.name} has no Kd that can be read; it is grey")
        albedo = check_albedo(kd, self.locate(material), self.notes) if kd else plain
        images = {}
        if image is not None:
            images["base_color"] = FileImage(image, wanted or f"texture of {material.name}", known.read_use("map_kd"))
        found = self._add_emission(Material(material.name, albedo), known, material, images)
        return FileMaterial(self._add_gloss(found, known, material, images), images)

    def _add_emission(
        self, found: Material, known: MtlMaterial, material: Any, images: dict[str, FileImage]
    ) -> Material:
        """Return the material with Ke, and add the image map_Ke, which counts as it is where there is no Ke."""
        ke, wanted = known.read_numbers("ke"), known.find_file("map_ke")
        if not ke and wanted is None:
            return found
        radiance = check_emission(ke or WHITE, self.locate(material))
        if any(radiance) and wanted is not None:
            images["emission"] = FileImage(self._open_image(material, wanted), wanted, known.read_use("map_ke"))
        return replace(found, emission=radiance, emits_both_sides=True)

    def _add_gloss(self, found: Material, known: MtlMaterial, material: Any, images: dict[str, FileImage]) -> Material:
        """Return the material with Pr and Pm, which images replace, and add these and `norm`."""
        if (wanted := known.find_file("norm")) is not None:
            images["normal"] = FileImage(self._open_image(material, wanted), wanted, known.read_use("norm"))
        if not known.is_glossy:
            return found
        where = self.locate(material)
        maps: dict[str, str] = {}
        values: dict[str, Any] = {}
        for key, field, missing in (("pr", "roughness", 1.0), ("pm", "metallic", 0.0)):
            given = known.read_number(key)
            values[field] = check_factor(missing if given is None else given, key.title(), where, self.notes, most=1.0)
            if (wanted := known.find_file(f"map_{key}")) is not None:
                maps[key], values[field] = wanted, 1.0
        if maps:
            name = " and ".join(dict.fromkeys(maps.values()))
            use = known.read_use(f"map_{next(iter(maps))}")
            images["metallic_roughness"] = FileImage(self._join_images(material, maps), name, use)
        return replace(found, specular=1.0, **values)

    def _join_images(self, material: Any, maps: Mapping[str, str]) -> Any:
        """Return one image, with roughness (pr) in green and metallic (pm) in blue, of the two, once."""
        key = "\n".join([maps.get("pr", ""), maps.get("pm", "")])
        if key not in self._images:
            greys = {each: decode_texture(self._open_image(material, name), name) for each, name in maps.items()}
            self._images[key] = join_greys([None, greys.get("pr"), greys.get("pm")])
        return self._images[key]

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
    materials = read_materials("\n".join(libraries))
    # trimesh drops all materials over one value that it does not expect, so it gets names and images only.
    images = {name: material.find_file("map_kd") for name, material in materials.items()}
    lines = ((f"newmtl {name}", f"map_Kd {image}" if image else "") for name, image in images.items())
    assets.blobs[MATERIALS] = "\n".join(line for pair in lines for line in pair).encode()
    used = {" ".join(name.split()) for name in re.findall(r"^usemtl[ \t]+(.*)", text, re.MULTILINE)}
    if missing := sorted(used - materials.keys()):
        notes.append(f"{path.name}: no material {', '.join(missing)}; its surfaces are grey")
    losses = describe_losses(material for name, material in materials.items() if name in used)
    notes += [f"{path.name}: {loss}" for loss in losses]
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
