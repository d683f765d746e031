"""Reads model files, of any format that trimesh reads, into world-space arrays without merging or dropping anything."""

from __future__ import annotations

import io
import warnings
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.errors import SceneError
from deferred_ir.base.toml_tables import LARGEST
from deferred_ir.loading.formats.any_trimesh import TrimeshFormat
from deferred_ir.loading.formats.gltf import GltfFormat
from deferred_ir.loading.formats.model_format import FileImage, ModelFormat
from deferred_ir.loading.formats.obj import ObjFormat
from deferred_ir.loading.model_data import ModelData, Part
from deferred_ir.loading.tangents import add_tangents, place_tangents
from deferred_ir.loading.textures import decode_texture
from deferred_ir.scene.surfaces.materials import WHITE, Material, Texture, TextureRef

ARCHIVES = ("zip", "gz", "bz2")
"""Archives are refused: trimesh unpacks them without a bound and reads their files without our corrections."""

MOST_TEXELS = 1 << 28
"""Most pixels of all images of a file together."""

FAR_UVS = 16.0
"""A mesh whose texture coordinates centre on a point farther out than this has them moved towards 0."""


def read(
    path: Path,
    scale: float = 1.0,
    translate: Vec3 = (0.0, 0.0, 0.0),
    root: Path | None = None,
    covering: Collection[str] = (),
) -> ModelData:
    """Read a model file and place it: the file's own transforms, then `scale`, then `translate`.

    covering: names of materials whose images keep their alpha, whatever the file asks for. Files that it names are read
    only from its own folder and from `root`. Raises SceneError, one line with the file's name, where it is missing,
    broken, without triangles, or has vertices that are no numbers.
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
            return _Reader(_open_format(path, data, root), covering).read(scale, translate)
    except MemoryError as error:
        raise SceneError(f"{path}: takes more memory than there is; give a smaller model") from error


def _open_format(path: Path, data: bytes, root: Path | None) -> ModelFormat:
    """Choose the format by the file's suffix and let it read its materials."""
    suffix = path.name.lower().rpartition(".")[2]
    if suffix in ARCHIVES:
        raise SceneError(f"{path}: is an archive; unpack it and give the model in it")
    if suffix in ("gltf", "glb"):
        return GltfFormat(path, data, root)
    return ObjFormat(path, data, root) if suffix == "obj" else TrimeshFormat(path, data, root)


class _Reader:
    """Reads the meshes of one file and places them in the world."""

    def __init__(self, format: ModelFormat, covering: Collection[str]) -> None:
        self.covering = covering
        self.format, self.path, self.notes = format, format.path, format.notes
        self.textures: list[Texture] = []
        self.images: dict[tuple[int, bool], tuple[int, Any]] = {}
        self.texels = 0

    def read(self, scale: float, translate: Vec3) -> ModelData:
        scene = self._load()
        place = np.diag([scale, scale, scale, 1.0])
        place[:3, 3] = translate
        parts = []
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            mesh = scene.geometry[name]
            if len(getattr(mesh, "faces", ())):  # point clouds and curves have none
                parts.append(self._read_part(mesh, place @ matrix))
        if not parts:
            raise SceneError(f"{self.path}: no triangles; give a model with a surface")
        return ModelData(self.path.stem, tuple(parts), tuple(dict.fromkeys(self.notes)), tuple(self.textures))

    def _load(self) -> Any:
        import trimesh

        with warnings.catch_warnings():
            # numpy 2.3 and older only warn where the text of an OBJ holds something other than numbers.
            warnings.filterwarnings("error", "string or file could not be read", DeprecationWarning)
            try:
                return trimesh.load_scene(
                    io.BytesIO(self.format.data),
                    file_type=self.format.file_type,
                    resolver=self.format.assets,
                    process=False,
                )
            except MemoryError:
                raise
            except Exception as error:  # what a broken file makes trimesh raise depends on where it breaks
                raise SceneError(f"{self.path}: {self._explain(error)}") from error

    def _explain(self, error: Exception) -> str:
        """Say what is wrong with a file that trimesh refused, and how to mend it."""
        import trimesh

        if self.format.file_type not in trimesh.available_formats():
            return f"no reader for files of type '{self.format.file_type}'; use .obj, .glb, .gltf, .ply or .stl"
        if isinstance(error, FileNotFoundError):
            return f"{error}; put it next to the model"
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return f"broken, or no {self.path.suffix} file ({what}); export it again"

    def _read_part(self, mesh: Any, matrix: Array) -> Part:
        # This comes first: trimesh makes normals up once anything asks for them.
        normals = np.array(mesh.vertex_normals) if "vertex_normals" in mesh._cache else None
        vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise SceneError(f"{self.path}: vertices are not three numbers each; export it again")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise SceneError(f"{self.path}: a face uses a vertex that does not exist; export it again")
        colors = self._read_colors(mesh, len(vertices), len(faces))
        uv_sets = tuple(self._read_uvs(uvs, len(vertices)) for uvs in self.format.read_uvs(mesh))
        material = self._read_material(mesh, colored=colors is not None, uv_sets=uv_sets)
        uvs, second_uvs = (_pick_uvs(each, number, material) for number, each in enumerate(uv_sets))
        positions = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        self._check_positions(positions)
        linear = matrix[:3, :3] / max(float(np.abs(matrix[:3, :3]).max()), 1e-300)
        if np.linalg.det(linear) < 0:
            faces = faces[:, ::-1]
        if normals is not None:
            normals = _transform_normals(normals, linear)
        part = Part(positions, faces, material, normals, uvs, second_uvs=second_uvs)
        if material.normal_texture is not None and normals is not None:
            tangents = self.format.read_tangents(mesh)
            part = part if tangents is None else replace(part, tangents=place_tangents(tangents, normals, linear))
        if colors is not None and len(colors) == len(faces) and len(colors) != len(vertices):
            # Colours per face: give each face vertices of its own.
            part = part.pick(faces.ravel(), np.arange(faces.size).reshape(-1, 3))
            colors = np.repeat(colors, 3, axis=0)
        part = replace(part, colors=colors)
        return add_tangents(part) if material.normal_texture is not None and part.tangents is None else part

    def _check_positions(self, positions: Array) -> None:
        bad = int((~np.isfinite(positions).all(axis=1)).sum())
        if bad:
            raise SceneError(f"{self.path}: {bad} of {len(positions)} vertices are NaN or infinite; export it again")
        if np.abs(positions).max() > LARGEST:
            raise SceneError(f"{self.path}: vertices farther out than {LARGEST:g}; scale the model down")

    def _read_colors(self, mesh: Any, vertices: int, faces: int) -> Array | None:
        """Return linear colours of vertices or faces."""
        colors = self.format.read_colors(mesh)
        if colors is not None and len(colors) not in (vertices, faces):
            self.notes.append(f"{self.path.name}: colours do not fit the vertices and are ignored")
            return None
        return colors

    def _read_uvs(self, uvs: Any, vertices: int) -> Array | None:
        """Return texture coordinates that fit, finite."""
        if uvs is None or len(uvs) != vertices:
            return None
        found = np.array(uvs, dtype=np.float64)
        if not np.isfinite(found).all():
            self.notes.append(f"{self.path.name}: texture coordinates that are NaN or infinite are taken as 0")
            found[~np.isfinite(found)] = 0
        return found

    def _read_material(self, mesh: Any, *, colored: bool, uv_sets: Sequence[Array | None]) -> Material:
        """Return a mesh's material; its textures are those read so far."""
        material, images = self.format.read_material(getattr(mesh.visual, "material", None), colored=colored)
        found: dict[str, TextureRef | None] = {}
        covers = (material.is_cut or material.name in self.covering) and "base_color" in images
        covering = images["base_color"].image if covers else None
        for slot, image in images.items():
            if image.use.uv_set < len(uv_sets) and uv_sets[image.use.uv_set] is not None:
                found[slot] = replace(image.use, number=self._read_texture(image, alpha=image.image is covering))
            else:
                self.notes.append(f"{self.path.name}: no texture coordinates for {image.name}; it is not used")
        if "base_color" in found and self.format.image_replaces_color:
            material = replace(material, base_color=WHITE)
        return material.with_textures(found)

    def _read_texture(self, found: FileImage, *, alpha: bool) -> int:
        """Return the number of the texture of a PIL image, which is decoded once. alpha: with its coverage."""
        image = found.image
        if (id(image), alpha) not in self.images:
            self.texels += image.width * image.height
            if self.texels > MOST_TEXELS:
                raise SceneError(f"{self.path}: its images have more than {MOST_TEXELS} pixels; scale them down")
            self.images[id(image), alpha] = len(self.textures), image  # which must live: its id must stay its own
            self.textures.append(decode_texture(image, found.name, alpha=alpha))
        return self.images[id(image), alpha][0]


def _pick_uvs(uvs: Array | None, number: int, material: Material) -> Array | None:
    """Return the texture coordinates of set `number` as they are stored; None if no texture is read by them."""
    used = [texture for texture in material.textures.values() if texture is not None and texture.uv_set == number]
    return move_uvs_home(uvs, used) if uvs is not None and used and len(uvs) else None


def move_uvs_home(uvs: Array, used: Sequence[TextureRef]) -> Array:
    """Move texture coordinates (n, 2), by which textures are `used`, towards 0 where they lie far out.

    They move by whole numbers, by which textures repeat, or are mirrored twice: 32-bit floats resolve small coordinates
    better. Textures that are clamped, or scaled, hold them where they are.
    """
    shift = np.zeros(2)
    for axis in (0, 1):
        wraps = {texture.sampler.wrap[axis] for texture in used}
        if "clamp" not in wraps and all(_keeps_steps(texture) for texture in used):
            step = 2 if "mirror" in wraps else 1
            shift[axis] = np.round((uvs[:, axis].min() + uvs[:, axis].max()) / 2 / step) * step
    moved: Array = uvs - np.where(np.abs(shift) >= FAR_UVS, shift, 0)
    return moved


def _keeps_steps(texture: TextureRef) -> bool:
    """Return whether where a texture is read moves as its coordinates do."""
    a, b, _, c, d, _ = texture.transform
    return (a, b, c, d) == (1, 0, 0, 1)


def _transform_normals(normals: Array, linear: Array) -> Array:
    """Transform normals (n, 3) by the inverse transpose of `linear` and normalise them; zero rows stay."""
    # The cofactor matrix is the inverse transpose times the determinant, and also serves flattened models.
    a, b, c = linear
    cofactor = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    finite = np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0.0)
    transformed = _scale_rows(finite) @ cofactor.T * (np.sign(np.linalg.det(linear)) or 1.0)
    transformed = _scale_rows(transformed)
    length = np.linalg.norm(transformed, axis=1, keepdims=True)
    unit: Array = np.divide(transformed, length, out=np.zeros_like(transformed), where=length > 0)
    return unit


def _scale_rows(rows: Array) -> Array:
    """Divide rows (n, 3) by their largest component, so that squares neither overflow nor vanish; zero rows stay."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    scaled: Array = np.divide(rows, size, out=np.zeros_like(rows), where=size > 0)
    return scaled
