"""The format glTF: what trimesh reads of a prepared document, and the appearance of its meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SceneError
from deferred_ir.loading.formats.gltf_document import NORMALIZED, read_content, read_document, tell_malformed
from deferred_ir.loading.formats.gltf_materials import UNLIT, ImageUse, MaterialReader
from deferred_ir.loading.formats.model_format import FileImage, FileMaterial, ModelFormat
from deferred_ir.loading.textures import open_image


class GltfFormat(ModelFormat):
    """A glTF file. Base colours and vertex colours are linear, and textures multiply them."""

    image_replaces_color = False

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        file = read_document(path, data, root)
        super().__init__(path, file.text, "gltf", file.assets)
        self.notes += file.notes
        self._tables, self._packed = file.tables, file.images
        self._reader = MaterialReader(file.tables, str(path), self.notes)
        self._images: dict[int, Any] = {}

    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Return the file's material, whose index is the name of trimesh's."""
        del colored
        with tell_malformed(f"{self.path}: "):
            found, uses = self._reader.read(int(material.name))
            images = {slot: self._open_image(use, found.name) for slot, use in uses.items()}
        return FileMaterial(found, images)

    def _open_image(self, wanted: ImageUse, material: str) -> FileImage:
        """Open an image, once. Raises SceneError where it is missing or broken."""
        source, image = wanted.source, None
        if source is not None:
            if source not in self._images:
                self._images[source] = self._read_image(source)
            image = self._images[source]
        if image is None:
            where = f"{self.path}: material {material}"
            raise SceneError(f"{where}: image {wanted.name} is missing or not readable; put it next to the model")
        return FileImage(image, wanted.name, wanted.use)

    def _read_image(self, source: int) -> Any | None:
        if source in self._packed:
            return open_image(self._packed[source])
        try:
            uri = self._tables["images"][source].get("uri")
            return open_image(read_content(f"{self.path}: images[{source}].uri", uri, self.assets))
        except FileNotFoundError:
            return None

    def read_uvs(self, mesh: Any) -> tuple[Array | None, Array | None]:
        """Read both sets of texture coordinates, (n, 2), v upwards; None for one that is not there."""
        first, second = (self._read_attribute(mesh, f"TEXCOORD_{number}", 2) for number in (0, 1))
        return _turn_up(first), _turn_up(second)

    def read_tangents(self, mesh: Any) -> Array | None:
        """Read tangents, (n, 4); None if there are none."""
        return self._read_attribute(mesh, "TANGENT", 4)

    def _read_attribute(self, mesh: Any, name: str, width: int) -> Array | None:
        """Return the rows of an attribute that `read_document` renamed; None where they do not fit the vertices."""
        stored = mesh.vertex_attributes.get(f"_{name}")
        scaled = mesh.vertex_attributes.get(f"_{name}{NORMALIZED}")
        if stored is None and scaled is None:
            return None
        rows = np.array(stored if scaled is None else scaled)
        if rows.shape != (len(mesh.vertices), width):
            self.notes.append(f"{self.path.name}: {name} does not fit the vertices and is ignored")
            return None
        top = 1.0 if scaled is None or rows.dtype.kind == "f" else float(np.iinfo(rows.dtype).max)
        values: Array = np.maximum(rows.astype(np.float64) / top, -1.0) if scaled is not None else rows.astype(float)
        return values

    def read_colors(self, mesh: Any) -> Array | None:
        """Read linear colours of a mesh's vertices; their coverage is not read, with a note where it would count."""
        stored = getattr(mesh.visual, "vertex_attributes", {}).get("color")
        table = self._tables["materials"][int(mesh.visual.material.name)]
        if stored is not None and table.get("alphaMode", "OPAQUE") != "OPAQUE" and np.shape(stored)[1] == 4:
            full = 1 if stored.dtype.kind == "f" else np.iinfo(stored.dtype).max
            if (stored[:, 3] < full).any():
                self.notes.append(f"{self.path.name}: the alpha of vertex colours is ignored")
        if stored is not None and UNLIT in table.get("extensions", {}):
            self.notes.append(f"{self.path.name}: vertex colours of unlit materials are ignored")
        return super().read_colors(mesh)

    def decode_colors(self, values: Array) -> Array:
        """Return stored colours, which are linear, cut to 1."""
        return np.clip(values, 0, 1)


def _turn_up(uvs: Array | None) -> Array | None:
    return None if uvs is None else uvs * (1.0, -1.0) + (0.0, 1.0)
