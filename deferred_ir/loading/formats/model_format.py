"""The interface of formats of model files: what trimesh reads, and the appearance of its meshes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.base.errors import SceneError
from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.model_data import GREY
from deferred_ir.scene.surfaces.materials import WHITE, Material, TextureRef


class FileImage(NamedTuple):
    """A PIL image and its name; `use` says how the material reads it, but for its number."""

    image: Any
    name: str
    use: TextureRef = TextureRef(0)


class FileMaterial(NamedTuple):
    """A material without its textures, and the images of these by slot (`materials.SLOTS`)."""

    material: Material
    images: Mapping[str, FileImage] = {}


class ModelFormat(ABC):
    """One model file in one format: what trimesh is given, and how to read the appearance of what it returns.

    data, file_type, assets: what trimesh reads. notes: what of the file is not honoured.
    """

    image_replaces_color = True
    """Whether a texture stands for the whole base colour; else it multiplies that of the material."""

    def __init__(self, path: Path, data: bytes, file_type: str, assets: Assets) -> None:
        self.path, self.data, self.file_type, self.assets = path, data, file_type, assets
        self.notes: list[str] = []

    @abstractmethod
    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Read a material of trimesh, None for a mesh without one. colored: the mesh has colours of its own.

        Raises SceneError where an image that the file names is missing or broken.
        """

    def read_colors(self, mesh: Any) -> Array | None:
        """Read linear colours of a mesh's vertices, else of its faces, float64 (n, 3); None if it has none."""
        kind = getattr(mesh.visual, "kind", None)
        if kind in ("vertex", "face"):
            return linear_from_srgb(np.asarray(getattr(mesh.visual, f"{kind}_colors"))[:, :3] / 255)
        stored = getattr(mesh.visual, "vertex_attributes", {}).get("color")
        if stored is None:
            stored = mesh.vertex_attributes.get("color")
        if stored is None:
            return None
        raw = np.asarray(stored)
        values = raw[:, :3].astype(np.float64)
        if raw.dtype.kind in "iu":
            values /= np.iinfo(raw.dtype).max
        if not np.isfinite(values).all() or values.min() < 0:
            raise SceneError(f"{self.path}: vertex colours must be finite and 0 or more; export it again")
        return self.decode_colors(values)

    def read_uvs(self, mesh: Any) -> tuple[Array | None, Array | None]:
        """Read both sets of texture coordinates, (n, 2), v upwards; None for one that is not there."""
        return getattr(mesh.visual, "uv", None), None

    def read_tangents(self, mesh: Any) -> Array | None:
        """Read the tangents of a mesh's vertices, (n, 4), as in `Geometry`; None if it has none."""
        del mesh
        return None

    def decode_colors(self, values: Array) -> Array:
        """Decode the colours that a file stores with its vertices, (n, 3): sRGB in 0 to 1 or in 0 to 255."""
        return linear_from_srgb(values / 255 if values.max() > 1 else values)

    def locate(self, material: Any) -> str:
        """Return the file and material that an error message names."""
        return f"{self.path}: material {material.name}"

    def find_image(self, material: Any) -> Any:
        """Return a material's image if it comes from a file: trimesh fills in one of its own where there is none."""
        image = getattr(material, "image", None)
        return image if image is not None and image.format is not None else None

    def require_image(self, material: Any, image: Any, wanted: str | None) -> None:
        """Raise SceneError if the file names the image `wanted` and there is none."""
        if wanted and image is None:
            state = "not a readable image" if self.assets.path(wanted) else "missing"
            raise SceneError(
                f"{self.locate(material)}: image {wanted} is {state}; put it next to the model or take it out"
            )


def choose_plain_albedo(colored: bool) -> Vec3:
    """Return the albedo of a surface whose material states none: white under colours of its own, else grey."""
    return WHITE if colored else GREY
