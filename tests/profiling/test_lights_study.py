"""The study of lights: what it says of images whose difference is known, and that its scenes are what they say."""

from importlib import import_module

import numpy as np
import pytest

from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.kinds import find_kinds

light_scenes = import_module("deferred_ir.profiling.light_scenes")
material_scenes = import_module("deferred_ir.profiling.material_scenes")
study = import_module("deferred_ir.profiling.studies.lights")


def images(level, seed, count=16, size=(32, 32)):
    rng = np.random.default_rng(seed)
    return [level * (1 + 0.1 * rng.standard_normal((*size, 3))) for _ in range(count)]


def test_images_of_one_truth_agree_and_of_another_do_not():
    same = study.compare(images(2.0, 1), images(2.0, 2))
    assert same.within > 0.9
    assert same.ratio == pytest.approx(1, abs=4 * same.error)
    assert same.error == pytest.approx(0.1 * np.sqrt(2 / (16 * 32 * 32 * 3)), rel=0.5)
    other = study.compare(images(2.04, 1), images(2.0, 2))
    assert other.within < 0.5
    assert other.ratio == pytest.approx(1.02, abs=4 * other.error)


def test_jittered_rays_stay_in_their_pixels():
    camera = Camera((0.1, 0.2, 0.3), (1.0, 0.5, -2.0))
    jittered = study.JitteredCamera(camera.position, camera.look_at, seed=3)
    # In view depths, one pixel apart.
    off = (jittered.rays((8, 6)) - camera.rays((8, 6))) @ camera.axes.T
    step = np.tan(np.radians(30.0)) * 2 / 6
    assert np.abs(off[..., :2]).max() <= step / 2 + 1e-9
    assert np.abs(off[..., :2]).max() > 0.4 * step
    np.testing.assert_allclose(off[..., 2], 0, atol=1e-12)
    np.testing.assert_array_equal(jittered.rays((8, 6)), jittered.rays((8, 6)))


def test_every_kind_has_a_scene_and_the_mixture_has_all():
    kinds = {name: {light.kind for light in make().lights} for name, make in light_scenes.SCENES.items()}
    assert kinds["mixture"] == set(find_kinds()) == set().union(*(kinds[name] for name in kinds if name != "mixture"))
    assert light_scenes.SCENES["mixture"]().surface_light
    assert light_scenes.SCENES["panels"]().surface_light
    assert not kinds["panels"]


@pytest.mark.parametrize("name", light_scenes.SCENES)
def test_lights_with_an_area_are_out_of_the_cameras_sight(name):
    scene = light_scenes.SCENES[name]()
    hit = Tracer(scene).closest(*_rays(scene.camera)).hit
    assert hit.mean() > 0.9
    right, up, forward = scene.camera.axes
    reach = np.tan(np.radians(scene.camera.fov) / 2)
    for light in scene.lights:
        if light.kind in ("rect", "disc", "sphere"):
            across, rise, depth = (
                np.subtract(light.position, scene.camera.position) @ axis for axis in (right, up, forward)
            )
            size = np.hypot(*light.size) / 2 if light.kind == "rect" else light.radius
            assert depth < size or max(abs(across), abs(rise)) - 1.2 * size > reach * depth


def _rays(camera):
    directions = camera.rays((32, 32)).reshape(-1, 3)
    return np.broadcast_to(np.asarray(camera.position), directions.shape), directions


def test_an_unknown_scene_is_one_line():
    with pytest.raises(SystemExit, match=r"^--kinds: no scene 'ponit'; did you mean 'point'"):
        study.main(["--kinds", "ponit"])


def test_scenes_of_materials_are_of_one_material_and_what_shines():
    for name, make in material_scenes.SCENES.items():
        scene = make()
        assert scene.has_gloss
        assert scene.emits
        if "metal" in name:
            assert all(material.metallic == 1 or any(material.emission) for material in scene.materials)
    room = material_scenes.build_mixed_room()
    assert {material.metallic for material in room.materials} == {0.0, 1.0}
