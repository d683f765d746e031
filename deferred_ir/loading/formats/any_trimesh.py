"""Every format that needs little besides trimesh, such as PLY, STL and DAE."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.formats.model_format import FileImage, FileMaterial, ModelFormat, choose_plain_albedo
from deferred_ir.loading.model_data import check_albedo
from deferred_ir.scene.surfaces.materials import Material


class TrimeshFormat(ModelFormat):
    """A model file in any format that trimesh reads well by itself."""

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        super().__init__(path, data, path.name.lower().rpartition(".")[2], Assets([path.parent], root=root))

    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Read a material of trimesh, which keeps 8 bits of a base colour."""
        plain = choose_plain_albedo(colored)
        if material is None:
            return FileMaterial(Material("default", plain))
        if hasattr(material, "baseColorFactor"):  # formats that trimesh turns into PBR materials
            factor, where = material.baseColorFactor, self.locate(material)
            albedo = plain if factor is None else check_albedo(np.divide(factor[:3], 255), where, self.notes)
            image, name = material.baseColorTexture, f"texture of {material.name}"
        else:
            wanted, image, albedo = self._find_ply_image(), self.find_image(material), plain
            self.require_image(material, image, wanted)
            name = wanted or f"texture of {material.name}"
        images = {} if image is None else {"base_color": FileImage(image, name)}
        return FileMaterial(Material(material.name, albedo), images)

    def _find_ply_image(self) -> str:
        """Return the image that a PLY file's header names, "" for none."""
        if self.file_type != "ply":
            return ""
        header = self.data.partition(b"end_header")[0].decode("latin-1")
        for line in header.splitlines():
            words = line.split(maxsplit=2)
            if len(words) == 3 and words[0] == "comment" and words[1].lower() == "texturefile":
                return words[2].strip()
        return ""
