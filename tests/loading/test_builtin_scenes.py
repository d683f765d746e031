"""The built-in scenes: sizes, colours, depth, light, and that their scripts make the committed files."""

import numpy as np
import pytest
from PIL import Image

from deferred_ir.loading.load import builtin_scenes, load
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.scenes import atrium, colors, gallery

NAMES = ("atrium", "colors", "cornell", "gallery")
SIZE = (64, 64)


@pytest.fixture(scope="module", params=NAMES)
def scene(request: pytest.FixtureRequest) -> Scene:
    return load(request.param)


def material_of(scene: Scene, face: int) -> str:
    return scene.materials[scene.geometry.face_materials[face]].name


def first_hits(scene: Scene):
    directions = scene.camera.rays(SIZE).reshape(-1, 3)
    return Tracer(scene).closest(np.broadcast_to(scene.camera.position, directions.shape), directions)


def crossings(scene: Scene) -> np.ndarray:
    """Surfaces that each camera ray crosses on its way out of the scene."""
    tracer = Tracer(scene)
    directions = scene.camera.rays(SIZE).reshape(-1, 3)
    origins = np.tile(np.asarray(scene.camera.position), (len(directions), 1))
    counts = np.zeros(len(directions), dtype=int)
    live = np.arange(len(directions))
    while len(live):
        hits = tracer.closest(origins[live], directions[live])
        live = live[hits.hit]
        counts[live] += 1
        origins[live] = tracer.lift(hits.position[hits.hit], -hits.normal[hits.hit])
    return counts


def direct_irradiance(scene: Scene, tracer: Tracer, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Irradiance from the spotlight at E = 1, shadows included."""
    way = np.asarray(scene.spotlight.position) - positions
    distance = np.linalg.norm(way, axis=1)
    towards = way / distance[:, None]
    leaving = np.maximum(-towards @ scene.spotlight.axis, 0) * scene.spotlight.cone(-towards)
    arriving = np.maximum((towards * normals).sum(axis=1), 0)
    lifted = tracer.lift(positions, normals)
    blocked = tracer.occluded(lifted, np.broadcast_to(scene.spotlight.position, lifted.shape))
    return np.where(blocked, 0, leaving * arriving / distance**2)


def test_every_scene_is_described():
    described = dict(builtin_scenes())
    assert set(described) == set(NAMES)
    assert all(len(text) > 20 for text in described.values())


def test_arrays_are_sound(scene: Scene):
    geometry = scene.geometry
    assert np.isfinite(geometry.positions).all()
    assert geometry.faces.min() >= 0
    assert geometry.faces.max() < len(geometry.positions)
    corners = geometry.positions[geometry.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(cross, axis=1).min() > 1e-10 * geometry.diagonal**2
    if geometry.normals is not None:
        length = np.linalg.norm(geometry.normals, axis=1)
        assert np.all((length == 0) | (np.abs(length - 1) < 1e-5))
    if geometry.uvs is not None:
        assert np.isfinite(geometry.uvs).all()


def test_nothing_was_chosen_or_passed_over(scene: Scene):
    assert not scene.chosen
    assert not scene.notes
    assert scene.camera.fov > 0
    assert all(0 <= value <= 0.9 for m in scene.materials if m.base_color_texture is None for value in m.base_color)


def test_no_triangle_occurs_twice(scene: Scene):
    corners = scene.geometry.positions[scene.geometry.faces].round(6)
    order = np.lexsort(np.moveaxis(corners, -1, 0)[::-1], axis=-1)
    sorted_corners = np.take_along_axis(corners, order[..., None], axis=1).reshape(-1, 9)
    assert len(np.unique(sorted_corners, axis=0)) == len(sorted_corners)


def test_shading_normals_lie_on_the_side_of_the_face(scene: Scene):
    geometry = scene.geometry
    if geometry.normals is None:
        assert scene.name == "cornell"
        return
    shading = geometry.normals[geometry.faces].astype(np.float64)
    has = np.linalg.norm(shading, axis=-1) > 0
    cosine = (shading * geometry.face_normals[:, None]).sum(axis=-1)
    assert cosine[has].min() > 0.75


def test_camera_sees_the_scene(scene: Scene):
    assert first_hits(scene).hit.mean() > 0.9


def test_light_reaches_a_good_part_of_the_picture(scene: Scene):
    hits = first_hits(scene)
    lit = direct_irradiance(scene, Tracer(scene), hits.position[hits.hit], hits.normal[hits.hit]) > 0
    assert 0.25 < lit.mean() < 0.6


def test_light_sees_the_floor(scene: Scene):
    hits = first_hits(scene)
    floor = hits.hit & (hits.normal[:, 1] > 0.99) & (hits.position[:, 1] < 0.01)
    light = direct_irradiance(scene, Tracer(scene), hits.position[floor], hits.normal[floor])
    assert floor.mean() > 0.1
    assert (light > 0).mean() > 0.3


def test_cornell_has_the_published_measurements():
    geometry = load("cornell").geometry
    assert len(geometry.faces) == 2 + 2 + 2 + 2 + 2 + 2 * 10
    np.testing.assert_allclose(geometry.bounds, [[0, 0, 0], [0.556, 0.5488, 0.5592]], atol=1e-12)
    corners = {tuple(point) for point in (geometry.positions * 1000).round(4)}
    for point in (
        *((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)),
        *((130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)),
        *((423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)),
    ):
        assert point in corners


def test_cornell_is_red_on_the_left_and_green_on_the_right():
    scene = load("cornell")
    face = first_hits(scene).face.reshape(SIZE)
    assert material_of(scene, face[32, 4]) == "red"
    assert material_of(scene, face[32, 60]) == "green"
    assert material_of(scene, face[4, 32]) == "white"
    albedo = {material.name: material.base_color for material in scene.materials}
    assert albedo["red"] == pytest.approx((0.612, 0.060, 0.061), abs=1e-12)
    assert albedo["green"] == pytest.approx((0.124, 0.424, 0.106), abs=1e-12)


def test_atrium_is_large_and_three_surfaces_deep():
    scene = load("atrium")
    assert 40_000 <= len(scene.geometry.faces) <= 80_000
    counts = crossings(scene)
    assert counts.mean() > 3.3
    assert np.median(counts) >= 3
    assert (counts >= 3).mean() > 0.5


def test_most_triangles_of_the_atrium_are_curved():
    geometry = load("atrium").geometry
    shading = geometry.normals[geometry.faces]
    curved = (np.ptp(shading, axis=1) > 1e-3).any(axis=1)
    assert curved.mean() > 0.75
    assert curved.sum() > 40_000


def test_arcades_of_the_atrium_are_lit_indirectly_only():
    scene = load("atrium")
    geometry = scene.geometry
    centers = geometry.positions[geometry.faces].mean(axis=1)
    vault = np.array([material_of(scene, face) == "plaster" for face in range(len(geometry.faces))])
    vault &= geometry.face_normals[:, 1] < -0.2
    light = direct_irradiance(scene, Tracer(scene), centers[vault], geometry.face_normals[vault])
    assert vault.sum() > 1000
    assert light.max() == 0


def test_built_in_scenes_are_matt_but_for_the_gallery(scene: Scene):
    assert scene.has_gloss == (scene.name == "gallery")
    assert not scene.has_cutouts


def test_atrium_colours_are_exact_in_the_file():
    scene = load("atrium")
    for material in scene.materials:
        assert material.base_color == pytest.approx(np.array(atrium.COLORS[material.name]) / 255, abs=1e-12)


@pytest.mark.slow
def test_script_makes_the_committed_atrium(tmp_path):
    made = tmp_path / "made.glb"
    atrium.write(made)
    new, old = load(made), load("atrium")
    assert [m.name for m in new.materials] == [m.name for m in old.materials]
    np.testing.assert_array_equal(new.geometry.faces, old.geometry.faces)
    np.testing.assert_array_equal(new.geometry.face_materials, old.geometry.face_materials)
    # Sines differ in their last bits from one C library to another.
    np.testing.assert_allclose(new.geometry.positions, old.geometry.positions, atol=1e-5)
    np.testing.assert_allclose(new.geometry.normals, old.geometry.normals, atol=1e-5)


def test_gallery_has_two_rows_of_balls_from_smooth_to_rough():
    scene = load("gallery")
    face = first_hits(scene).face.reshape(SIZE)
    rows = {}
    for material in scene.materials:
        kind, _, roughness = material.name.partition(" ")
        if roughness:
            number = scene.materials.index(material)
            height, across = np.nonzero(scene.geometry.face_materials[face] == number)
            rows.setdefault(kind, []).append((float(roughness), across.mean(), height.mean()))
            assert (scene.geometry.face_materials == number).sum() <= 2500
            assert material.roughness == float(roughness)
            assert (material.metallic, material.specular) == (float(kind == "gold"), 1.0)
        else:
            assert not material.is_glossy
    assert {kind: len(balls) for kind, balls in rows.items()} == {"gold": 6, "plastic": 6}
    for balls in rows.values():
        order = np.array(sorted(balls))
        assert (np.diff(order[:, 1]) > 3).all()
    assert np.mean(rows["gold"], axis=0)[2] < np.mean(rows["plastic"], axis=0)[2] - 5
    assert sum(material.emits for material in scene.materials) == 1


def test_script_makes_the_committed_gallery(tmp_path):
    made = tmp_path / "gallery.glb"
    gallery.write(made)
    new, old = load(made), load("gallery")
    assert new.materials == old.materials
    np.testing.assert_array_equal(new.textures[0].pixels, old.textures[0].pixels)
    np.testing.assert_array_equal(new.textures[0].pixels, gallery.paint_tiles())
    np.testing.assert_array_equal(new.geometry.faces, old.geometry.faces)
    # Sines differ in their last bits from one C library to another.
    np.testing.assert_allclose(new.geometry.positions, old.geometry.positions, atol=1e-5)
    np.testing.assert_allclose(new.geometry.normals, old.geometry.normals, atol=1e-5)
    assert old.path.with_name("gallery.glb").stat().st_size < 100_000


def test_script_makes_the_committed_colors(tmp_path):
    colors.main(tmp_path)
    committed = load("colors").path.parent
    np.testing.assert_array_equal(np.asarray(Image.open(committed / "colors.png")), colors.texture())
    new = (tmp_path / "colors.obj").read_text().split()
    old = (committed / "colors.obj").read_text().split()
    assert len(new) == len(old)
    for a, b in zip(new, old, strict=True):
        assert a == b or float(a) == pytest.approx(float(b), abs=2e-5)


def test_floor_of_colors_repeats_its_texture():
    scene = load("colors")
    floor = next(i for i, material in enumerate(scene.materials) if material.base_color_texture is not None)
    assert scene.textures[scene.materials[floor].base_color_texture.number].pixels.shape == (512, 512, 3)
    corners = scene.geometry.faces[scene.geometry.face_materials == floor]
    assert np.ptp(scene.geometry.uvs[corners].reshape(-1, 2), axis=0) == pytest.approx([1, 1.5])


def test_walls_of_colors_take_colour_from_the_floor():
    """Seen from low on the side walls, the floor's mean albedo is reddish on the left and bluish on the right."""
    scene = load("colors")
    tracer = Tracer(scene)
    rng = np.random.default_rng(0)
    means = []
    for side in (-1, 1):
        down = np.column_stack([-side * rng.random(400), -rng.random(400), rng.normal(0, 0.3, 400)])
        hits = tracer.closest(np.tile((side * 2.45, 0.6, 0.0), (400, 1)), down)
        lit = direct_irradiance(scene, tracer, hits.position, hits.normal)
        means.append((hits.albedo * lit[:, None]).sum(axis=0))
    assert means[0][0] > 2 * means[0][2]
    assert means[1][2] > 1.5 * means[1][0]
