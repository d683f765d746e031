"""Model files of several formats as world-space arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from deferred_ir.base.errors import SceneError
from deferred_ir.loading import merge, models
from deferred_ir.loading.model_data import ModelData
from deferred_ir.scene.scene import Geometry

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def write(folder: Path, text: str, name: str = "model.obj") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def geometry(*data: ModelData) -> Geometry:
    return merge.merge([(model, None) for model in data], "scene.toml")[0]


def read(folder: Path, text: str) -> Geometry:
    return geometry(models.read(write(folder, text)))


def corners(mesh: Geometry) -> np.ndarray:
    """Corner positions of all faces, (F, 3, 3)."""
    return mesh.positions[mesh.faces]


def scene_with(mesh: trimesh.Trimesh, *transforms: np.ndarray) -> trimesh.Scene:
    scene = trimesh.Scene()
    for number, transform in enumerate(transforms):
        scene.add_geometry(mesh, node_name=f"node{number}", geom_name="mesh", transform=transform)
    return scene


def test_scale_then_translate(tmp_path: Path) -> None:
    path = write(tmp_path, TRIANGLE + "f 1 2 3\n")
    mesh = geometry(models.read(path, scale=2.0, translate=(10.0, 0.0, -1.0)))
    assert corners(mesh)[0] == pytest.approx(np.array([[10, 0, -1], [12, 0, -1], [10, 2, -1]]))


def test_coordinates_stay_in_double_precision(tmp_path: Path) -> None:
    mesh = read(tmp_path, "v 0.123456789012 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert mesh.positions.dtype == np.float64
    assert corners(mesh)[0, 0, 0] == 0.123456789012


def test_duplicate_and_degenerate_faces_stay(tmp_path: Path) -> None:
    mesh = read(tmp_path, TRIANGLE + "v 0 0 0\nf 1 2 3\nf 1 2 3\nf 4 2 3\nf 1 1 2\n")
    assert len(mesh.faces) == 4
    assert (corners(mesh)[0] == corners(mesh)[1]).all()
    assert (corners(mesh)[0] == corners(mesh)[2]).all()


def test_polygons_become_triangles(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 3 0\nv 0 2 0\n"
    for faces, count in (("f 1 2 3 5\n", 2), ("f 1 2 3 4 5\n", 3), ("f 1 2 3\nf 1 2 3 5\nf 1 2 3 4 5\n", 6)):
        mesh = read(tmp_path, text + faces)
        assert len(mesh.faces) == count
        assert mesh.face_normals == pytest.approx(np.tile([0, 0, 1], (count, 1)))


def test_negative_obj_indices_count_from_the_vertex_before(tmp_path: Path) -> None:
    near = TRIANGLE + "vn 0 0 1\nf -3//-1 -2//-1 -1//-1\n"
    far = near.replace("v 0", "v 5").replace("vn 5", "vn 0")
    plain = TRIANGLE + "v 5 0 0\nv 1 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n"
    assert corners(read(tmp_path, near + far)) == pytest.approx(corners(read(tmp_path, plain)))


@pytest.mark.parametrize("face", ["f 0 1 2", "f 1 2 -4"])
def test_obj_indices_before_the_first_vertex(tmp_path: Path, face: str) -> None:
    with pytest.raises(SceneError, match="index 0, or one before the first vertex"):
        models.read(write(tmp_path, f"{TRIANGLE}{face}\n"))


def test_obj_in_another_encoding_and_with_crlf(tmp_path: Path) -> None:
    path = tmp_path / "model.obj"
    path.write_bytes(("# Stra\xdfe\n" + TRIANGLE + "f 1 2 3\n").replace("\n", "\r\n").encode("latin-1"))
    assert len(geometry(models.read(path)).faces) == 1


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb", "gltf"])
def test_normals_of_the_file(tmp_path: Path, suffix: str) -> None:
    slanted = np.tile([0.6, 0.0, 0.8], (3, 1))
    plain = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    smooth = trimesh.Trimesh(plain.vertices, plain.faces, vertex_normals=slanted, process=False)
    for mesh, normals in ((plain, None), (smooth, slanted)):
        path = tmp_path / f"model.{suffix}"
        if suffix == "gltf":
            for name, data in mesh.scene().export(file_type="gltf", include_normals=normals is not None).items():
                (tmp_path / (path.name if name.endswith(".gltf") else name)).write_bytes(data)
        elif suffix == "ply":
            mesh.export(path, vertex_normal=normals is not None)
        else:
            mesh.export(path, include_normals=normals is not None)
        result = geometry(models.read(path))
        assert (result.normals is None) == (normals is None)
        if result.normals is not None:
            assert result.normals == pytest.approx(slanted, abs=1e-6)


def test_stl_has_no_vertex_normals(tmp_path: Path) -> None:
    trimesh.creation.box().export(tmp_path / "box.stl")
    mesh = geometry(models.read(tmp_path / "box.stl"))
    assert mesh.normals is None
    assert len(mesh.faces) == 12


def test_zero_and_broken_normals_count_as_none(tmp_path: Path) -> None:
    text = TRIANGLE + "vn 0 0 0\nvn nan 0 1\nvn 0 0 5\nf 1//1 2//2 3//3\n"
    mesh = read(tmp_path, text)
    assert mesh.normals is not None
    by_position = {tuple(p): n for p, n in zip(mesh.positions.tolist(), mesh.normals.tolist(), strict=True)}
    assert by_position[0, 0, 0] == [0, 0, 0]
    assert by_position[1, 0, 0] == [0, 0, 0]
    assert by_position[0, 1, 0] == [0, 0, 1]


def test_instances_become_copies(tmp_path: Path) -> None:
    mesh = trimesh.creation.box()
    there = trimesh.transformations.translation_matrix([5, 0, 0])
    path = tmp_path / "two.glb"
    scene_with(mesh, np.eye(4), there).export(path)
    result = geometry(models.read(path))
    assert len(result.faces) == 24
    assert result.bounds == pytest.approx(np.array([[-0.5, -0.5, -0.5], [5.5, 0.5, 0.5]]))


@pytest.mark.parametrize("scale", [(2, 1, 1), (-1, 1, 1), (1, 3, -0.5), (-1, -1, -1), (1e-9, -2e-9, 3e-9)])
def test_normals_stand_upright_after_any_transform(tmp_path: Path, scale: tuple[float, float, float]) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.vertices[:, 0] *= 2
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    mirror = np.diag([*scale, 1.0])
    path = tmp_path / "ball.glb"
    # A flat facet per triangle, so that the file's normals and those by winding must agree.
    facets = trimesh.Trimesh(
        ball.triangles.reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3), process=False
    )
    facets.vertex_normals = np.repeat(ball.face_normals, 3, axis=0)
    scene_with(facets, turn @ mirror).export(path, include_normals=True)
    result = geometry(models.read(path))
    assert result.normals is not None
    assert result.normals[result.faces[:, 0]] == pytest.approx(result.face_normals, abs=2e-3)
    outwards = corners(result).mean(axis=1) - result.positions.mean(axis=0)
    assert ((outwards * result.face_normals).sum(axis=1) > 0).all()


def test_a_flattened_model_keeps_its_normals(tmp_path: Path) -> None:
    path = tmp_path / "flat.glb"
    scene_with(trimesh.creation.box(), np.diag([1.0, 0.0, 1.0, 1.0])).export(path, include_normals=True)
    result = geometry(models.read(path))
    assert result.normals is not None
    assert np.linalg.norm(result.normals, axis=1).max() == pytest.approx(1, abs=1e-6)


def test_faces_are_sorted_by_texture_and_vertices_by_model(tmp_path: Path) -> None:
    from PIL import Image

    for name, color in (("red.png", (255, 0, 0)), ("blue.png", (0, 0, 255))):
        Image.new("RGB", (2, 2), color).save(tmp_path / name)
    write(tmp_path, "newmtl r\nmap_Kd red.png\nnewmtl b\nmap_Kd blue.png\nnewmtl k\nKd 0.5 0.5 0.5\n", "m.mtl")
    uv = "vt 0 0\nvt 1 0\nvt 0 1\n"
    face = "f 1/1 2/2 3/3\n"
    first = write(tmp_path, f"mtllib m.mtl\n{TRIANGLE}{uv}usemtl r\n{face}usemtl k\n{face}usemtl b\n{face}", "1.obj")
    second = write(tmp_path, f"mtllib m.mtl\n{TRIANGLE}{uv}usemtl b\n{face}usemtl k\n{face}", "2.obj")
    data = [(models.read(path), None) for path in (first, second)]
    mesh, materials, textures, ranges = merge.merge(data, "scene.toml")
    refs = [materials[index].base_color_texture for index in mesh.face_materials]
    order = [-1 if ref is None else ref.number for ref in refs]  # index in mesh.face_materials]
    assert order == sorted(order)
    assert order.count(-1) == 2
    assert len(textures) == 2  # the same image in two files is one texture
    assert len(materials) == 3
    assert [(model.name, model.first_vertex, model.vertex_count) for model in ranges] == [("1", 0, 9), ("2", 9, 6)]


def test_results_do_not_change_from_run_to_run(tmp_path: Path) -> None:
    path = tmp_path / "two.glb"
    scene_with(trimesh.creation.box(), np.eye(4), np.diag([2.0, 1, 1, 1])).export(path)
    first, second = geometry(models.read(path)), geometry(models.read(path))
    assert (first.positions == second.positions).all()
    assert (first.faces == second.faces).all()


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none\.obj: cannot be read: No such file or directory; check"):
        models.read(tmp_path / "none.obj")
    with pytest.raises(SceneError, match="is a folder"):
        models.read(tmp_path)
    with pytest.raises(SceneError, match="cannot be read"):
        models.read(tmp_path / "a\0b.obj")


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb", "gltf", "off", "3mf", "zip", "unknown"])
@pytest.mark.parametrize(
    "content", [b"", b"garbage \x00\xff", b"ply\nformat ascii 1.0\n", b"glTF\x02\0\0\0", b"v 1 x 3"]
)
def test_broken_files(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"model.{suffix}"
    path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        models.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_unknown_format(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"no reader for files of type 'blend'; use \.obj"):
        models.read(write(tmp_path, "BLENDER", "model.blend"))


def test_no_triangles(tmp_path: Path) -> None:
    for text in (TRIANGLE, TRIANGLE + "f 1 2\n"):
        with pytest.raises(SceneError, match=r"model\.obj: no triangles"):
            models.read(write(tmp_path, text))


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_vertices_that_are_no_numbers(tmp_path: Path, number: str) -> None:
    text = f"v 0 0 0\nv 1 {number} 0\nv 0 1 {number}\nf 1 2 3\n"
    with pytest.raises(SceneError, match=r"model\.obj: 2 of 3 vertices are NaN or infinite"):
        models.read(write(tmp_path, text))


def test_vertices_too_far_out(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="farther out than 1e\\+18"):
        models.read(write(tmp_path, "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n"))


def test_a_face_without_its_vertex(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    for face in ("3 0 1 7\n", "3 0 1 -1\n"):
        with pytest.raises(SceneError, match=r"model\.ply: "):
            models.read(write(tmp_path, header + face, "model.ply"))


def test_everything_in_one_point(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"scene\.toml: all vertices lie in one point"):
        read(tmp_path, "v 3 1 2\nv 3 1 2\nv 3 1 2\nf 1 2 3\n")
