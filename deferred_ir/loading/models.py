"""Model files, of any format that trimesh reads, as world-space arrays with nothing merged or dropped."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.base.errors import SceneError
from deferred_ir.base.toml_tables import LARGEST
from deferred_ir.loading import gltf, obj
from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.model_data import GREY, ModelData, Part, check_albedo
from deferred_ir.loading.textures import decode_texture
from deferred_ir.scene.scene import Material, Texture

ARCHIVES = ("zip", "gz", "bz2")
"""trimesh unpacks these without a bound, and reads what is in them without what `gltf` and `obj` mend."""

MOST_TEXELS = 1 << 28
"""Pixels of all images of a file."""

FAR_UVS = 16.0
"""Texture coordinates about a point farther out than this are moved home."""


def read(path: Path, scale: float = 1.0, translate: Vec3 = (0.0, 0.0, 0.0), root: Path | None = None) -> ModelData:
    """Read a model file and place it: the file's own transforms, then `scale`, then `translate`.

    Of the files that it names, those in its own folder and in `root` are read, and none outside. Raises SceneError,
    one line with the file's name, where it is missing, broken, without triangles, or has vertices that are no numbers.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise SceneError(f"{path}: is a device or a pipe; give a file")
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        what = "is a folder" if path.is_dir() else getattr(error, "strerror", None) or error
        raise SceneError(f"{path}: cannot be read: {what}; check the model's path") from error
    try:
        with np.errstate(all="ignore"):  # numbers that overflow on the way are found among the vertices
            return _Reader(path, data, root).read(scale, translate)
    except MemoryError as error:
        raise SceneError(f"{path}: takes more memory than there is; give a smaller model") from error


class _Reader:
    """Reads one file; knows what its format needs besides trimesh."""

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        self.path = path
        self.notes: list[str] = []
        self.mtl: dict[str, obj.MtlMaterial] = {}
        self.base_colors: tuple[gltf.BaseColor, ...] | None = None
        self.textures: dict[int, Texture] = {}
        self.texels = 0
        self.format = path.name.lower().rpartition(".")[2]
        self.assets = Assets([path.parent], root=root)
        if self.format in ("gltf", "glb"):
            document = gltf.read(path, data, root)
            data, self.assets, self.base_colors = document.text, document.assets, document.materials
            self.notes += document.notes
            self.format = "gltf"
        elif self.format == "obj":
            text = obj.read(path, data, root)
            data, self.assets, self.mtl = text.text, text.assets, text.materials
            self.notes += text.notes
        self.data = data

    def read(self, scale: float, translate: Vec3) -> ModelData:
        scene = self._load()
        place = np.diag([scale, scale, scale, 1.0])
        place[:3, 3] = translate
        parts = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if len(getattr(mesh, "faces", ())):  # point clouds and curves have none
                parts.append(self._part(mesh, place @ matrix))
        if not parts:
            raise SceneError(f"{self.path}: no triangles; give a model with a surface")
        return ModelData(self.path.stem, tuple(parts), tuple(dict.fromkeys(self.notes)))

    def _load(self) -> Any:
        import trimesh

        if self.format in ARCHIVES:
            raise SceneError(f"{self.path}: is an archive; unpack it and give the model in it")
        with warnings.catch_warnings():
            # numpy 2.3 and older only warn where the text of an OBJ holds something other than numbers.
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
            try:
                return trimesh.load_scene(
                    io.BytesIO(self.data), file_type=self.format, resolver=self.assets, process=False
                )
            except MemoryError:
                raise
            except Exception as error:  # what a broken file makes trimesh raise depends on where it breaks
                raise SceneError(f"{self.path}: {self._trouble(error)}") from error

    def _trouble(self, error: Exception) -> str:
        import trimesh

        if self.format not in trimesh.available_formats():
            return f"no reader for files of type '{self.format}'; use .obj, .glb, .gltf, .ply or .stl"
        if isinstance(error, FileNotFoundError):
            return f"{error}; put it next to the model"
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return f"broken, or no {self.path.suffix} file ({what}); export it again"

    def _part(self, mesh: Any, matrix: Array) -> Part:
        # Asked for before anything else: trimesh makes normals up once something wants them.
        normals = np.array(mesh.vertex_normals) if "vertex_normals" in mesh._cache else None
        vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise SceneError(f"{self.path}: vertices are not three numbers each; export it again")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise SceneError(f"{self.path}: a face uses a vertex that does not exist; export it again")
        material, texture, colors, uvs = self._appearance(mesh, len(vertices), len(faces))
        if colors is not None and len(colors) == len(faces) and len(colors) != len(vertices):
            # One colour a face: each face gets vertices of its own.
            corners = faces.ravel()
            vertices, faces = vertices[corners], np.arange(len(corners)).reshape(-1, 3)
            normals = None if normals is None else normals[corners]
            uvs, colors = (None if uvs is None else uvs[corners]), np.repeat(colors, 3, axis=0)
        positions = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        self._check(positions)
        linear = matrix[:3, :3] / max(float(np.abs(matrix[:3, :3]).max()), 1e-300)
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        if normals is not None:
            normals = _turned_normals(normals, linear)
        return Part(positions, faces, material, texture, normals, uvs, colors)

    def _check(self, positions: Array) -> None:
        bad = int((~np.isfinite(positions).all(axis=1)).sum())
        if bad:
            raise SceneError(f"{self.path}: {bad} of {len(positions)} vertices are NaN or infinite; export it again")
        if np.abs(positions).max() > LARGEST:
            raise SceneError(f"{self.path}: vertices farther out than {LARGEST:g}; scale the model down")

    def _appearance(
        self, mesh: Any, vertices: int, faces: int
    ) -> tuple[Material, Texture | None, Array | None, Array | None]:
        """Material, texture, linear colours of vertices or faces, and texture coordinates."""
        colors, uvs = self._colors(mesh), getattr(mesh.visual, "uv", None)
        if colors is not None and len(colors) not in (vertices, faces):
            self.notes.append(f"{self.path.name}: colours do not fit the vertices and are ignored")
            colors = None
        uvs = np.array(uvs, dtype=np.float64) if uvs is not None and len(uvs) == vertices else None
        if uvs is not None and not np.isfinite(uvs).all():
            self.notes.append(f"{self.path.name}: texture coordinates that are NaN or infinite are taken as 0")
            uvs[~np.isfinite(uvs)] = 0
        if uvs is not None and len(uvs):
            uvs = homed(uvs)
        source = getattr(mesh.visual, "material", None)
        name, albedo, image, image_name = self._reflectance(source, colored=colors is not None)
        if image is not None and uvs is None:
            self.notes.append(f"{self.path.name}: no texture coordinates for {image_name}; its plain colour is taken")
            image = None
        elif image is not None and self.base_colors is None:
            albedo = (1.0, 1.0, 1.0)  # map_Kd replaces Kd; glTF multiplies
        if image is None:
            return Material(name, albedo), None, colors, None
        texture = self.textures.get(id(image))
        if texture is None:
            self.texels += image.width * image.height
            if self.texels > MOST_TEXELS:
                raise SceneError(f"{self.path}: its images have more than {MOST_TEXELS} pixels; scale them down")
            texture = decode_texture(image, image_name, self.notes)
            self.textures[id(image)] = texture
        return Material(name, albedo), texture, colors, uvs

    def _reflectance(self, source: Any, colored: bool) -> tuple[str, Vec3, Any, str]:
        """A trimesh material's name, albedo, image (or None) and the image's name."""
        if source is not None and self.base_colors is not None:
            base = self.base_colors[int(source.name)]
            where = f"{self.path}: material {base.name}"
            image = source.baseColorTexture
            if base.image is not None and image is None:
                raise SceneError(f"{where}: image {base.image} is missing or not readable; put it next to the model")
            return base.name, check_albedo(base.factor, where, self.notes), image, base.image or ""
        plain = (1.0, 1.0, 1.0) if colored else GREY
        if source is None:
            return "default", plain, None, ""
        where = f"{self.path}: material {source.name}"
        if hasattr(source, "baseColorFactor"):  # formats that trimesh turns into PBR materials: 8 bits are what it has
            factor = source.baseColorFactor
            albedo = plain if factor is None else check_albedo(np.divide(factor[:3], 255), where, self.notes)
            return source.name, albedo, source.baseColorTexture, f"texture of {source.name}"
        return self._simple_reflectance(source, where, plain)

    def _simple_reflectance(self, source: Any, where: str, plain: Vec3) -> tuple[str, Vec3, Any, str]:
        image = getattr(source, "image", None)
        material = self.mtl.get(source.name, obj.MtlMaterial())
        if image is not None and image.format is None:
            # Not from a file: trimesh's filler where there is no material.
            image, material = None, obj.MtlMaterial()
        wanted = material.image or self._ply_image()
        if wanted and image is None:
            state = "not a readable image" if self.assets.path(wanted) else "missing"
            raise SceneError(f"{where}: image {wanted} is {state}; put it next to the model or take it out")
        if source.name in self.mtl and not material.kd and image is None:
            self.notes.append(f"{self.path.name}: material {source.name} has no Kd that can be read; it is grey")
        if material.emits:
            self.notes.append(f"{self.path.name}: emission (Ke) is ignored")
        albedo = check_albedo(material.kd, where, self.notes) if material.kd else plain
        return source.name, albedo, image, wanted or f"texture of {source.name}"

    def _ply_image(self) -> str:
        """The image that a PLY file's header names."""
        if self.format != "ply":
            return ""
        header = self.data.partition(b"end_header")[0].decode("latin-1")
        for line in header.splitlines():
            words = line.split(maxsplit=2)
            if len(words) == 3 and words[0] == "comment" and words[1].lower() == "texturefile":
                return words[2].strip()
        return ""

    def _colors(self, mesh: Any) -> Array | None:
        """Linear colours of vertices, else of faces, float64 (n, 3), if the file has any."""
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
        if self.base_colors is not None:
            return np.clip(values, 0, 1)
        return linear_from_srgb(values / 255 if values.max() > 1 else values)


def homed(uvs: Array) -> Array:
    """Texture coordinates (n, 2) of a mesh, moved home by whole numbers where they lie far out.

    Textures repeat, and 32 bits keep more of what is left.
    """
    shift = np.round((uvs.min(axis=0) + uvs.max(axis=0)) / 2)
    moved: Array = uvs - np.where(np.abs(shift) >= FAR_UVS, shift, 0)
    return moved


def _turned_normals(normals: Array, linear: Array) -> Array:
    """Unit normals (n, 3), turned by the inverse transpose of `linear`; a zero row where there is none."""
    # The cofactor matrix is the inverse transpose times the determinant, and also serves flattened models.
    a, b, c = linear
    cofactor = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    finite = np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0.0)
    turned = _scaled(finite) @ cofactor.T * (np.sign(np.linalg.det(linear)) or 1.0)
    turned = _scaled(turned)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    unit: Array = np.divide(turned, length, out=np.zeros_like(turned), where=length > 0)
    return unit


def _scaled(rows: Array) -> Array:
    """Rows (n, 3) divided by their largest parts, so that squares neither overflow nor vanish; zeros stay."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    scaled: Array = np.divide(rows, size, out=np.zeros_like(rows), where=size > 0)
    return scaled
