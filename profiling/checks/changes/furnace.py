"""A furnace: in light that is the same from all around a ball shows how much it reflects, and no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.patterns import sample_unit_square
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.materials import WHITE, Material

DIRECTIONS = 1 << 10
"""Directions of an integral over the hemisphere."""
ANGLES = 32
"""Angles at which it is known; between these it is interpolated."""


def put_ball(scene: Scene, *, metallic: float, roughness: float) -> Scene:
    """Put a white ball alone before the camera of `scene`, half as wide as the picture is high."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=4)
    camera, unit = scene.camera, np.array(ball.vertices)
    _, _, forward = camera.axes
    size = scene.geometry.diagonal
    centre = np.asarray(camera.position) + forward * (size / np.sin(np.radians(camera.fov) / 4))
    geometry = Geometry(
        positions=centre + size * unit,
        faces=np.array(ball.faces, np.int32),
        face_materials=np.zeros(len(ball.faces), np.int32),
        normals=unit.astype(np.float32),
    )
    white = Material("white", WHITE, metallic=metallic, roughness=roughness, specular=1.0)
    lights = (Environment(radiance=WHITE),)
    return replace(scene, geometry=geometry, materials=(white,), textures=(), models=(), lights=lights)


def find_error(scene: Scene, image: Array, size: tuple[int, int]) -> float:
    """Return how far the mean of `image` (H, W, 3) on the ball is from what it must be, relative to that."""
    rays = scene.camera.rays(size).reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    seen = Tracer(scene).closest(np.broadcast_to(np.asarray(scene.camera.position, float), rays.shape), rays)
    cosines = np.abs(np.einsum("ij,ij->i", seen.shading_normal, rays))[seen.hit]
    known = np.linspace(0.01, 1, ANGLES)
    levels = np.array([_integrate(scene.materials[0], cosine) for cosine in known])
    expected = float(np.interp(cosines, known, levels).mean())
    return abs(float(image.reshape(-1, 3)[seen.hit].mean()) / expected - 1)


def _integrate(material: Material, cosine: float) -> float:
    """Return what a white surface reflects towards a viewer at an angle of light that is 1 from all around."""
    points = sample_unit_square("sobol", DIRECTIONS, 0)
    numbers, ones = np.zeros(DIRECTIONS, int), np.ones(DIRECTIONS)
    albedo, gloss = brdf.make_gloss(
        [material], numbers, np.ones((DIRECTIONS, 3)), ones * material.metallic, ones * material.roughness
    )
    normal = np.tile([0.0, 0.0, 1.0], (DIRECTIONS, 1))
    viewer = np.tile([np.sqrt(1 - cosine**2), 0.0, cosine], (DIRECTIONS, 1))
    _, weights = brdf.sample(gloss, normal, viewer, points)
    kept = brdf.find_mean_kept(gloss, ones * cosine)
    return float((albedo * kept[:, None] + weights).mean())
