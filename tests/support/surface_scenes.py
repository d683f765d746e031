"""Small scenes with surfaces other than plain matt ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from small_scenes import box, build, plane, quad, sphere

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, Sampler, Texture, TextureRef, Wrap

LATTICE = np.indices((8, 8)).sum(axis=0) % 2 * 255
"""Alpha of an image like a chess board."""


def lattice(wrap: Wrap = "repeat", cutoff: float | None = 0.5) -> Scene:
    """A lattice below the light of a closed room, its image repeated one and a half times as `wrap` says."""
    bare = build(
        box((-1, -1, -1), (1, 1, 1), (0.75, 0.75, 0.75)),  # no rounding in half floats
        quad((-0.5, -0.2, 0.6), (0.6, -0.2, 0.6), (0.6, 0.1, -0.6), (0.25, 0.75, 0.25)),
        camera=Camera((0.1, 0.5, 0.95), (0.0, -0.4, -0.3), fov=75.0),
        spotlight=Spotlight((-0.2, 0.9, 0.2), (0.1, -1.0, -0.1), 110.0, (3.0, 2.5, 2.0)),
    )
    alpha = LATTICE.copy()
    alpha[3:5, 2:6] = 0
    pixels = np.concatenate([np.full((8, 8, 3), 230), alpha[..., None]], axis=2).astype(np.uint8)
    uvs = np.zeros((len(bare.geometry.positions), 2), np.float32)
    uvs[-4:] = [[0, 0], [1.5, 0], [1.5, 1.5], [0, 1.5]]
    texture = TextureRef(0, sampler=Sampler(wrap=(wrap, wrap)))
    holes = replace(bare.materials[1], base_color_texture=texture, alpha_cutoff=cutoff)
    return replace(
        bare,
        geometry=replace(bare.geometry, uvs=uvs),
        materials=(bare.materials[0], holes),
        textures=(Texture("lattice", pixels),),
    )


def glossy_room(**changes: Any) -> Scene:
    """A closed room with a smooth ball of gold, a plastic floor, and a half metallic box."""
    ball = sphere(0.35, 3)
    scene = build(
        box((-1, -1, -1), (1, 1, 1), (0.7, 0.7, 0.7)),
        replace(ball, positions=ball.positions + np.array([0.35, -0.55, 0.1])),
        plane(0.99, -0.95, (0.5, 0.4, 0.3)),
        box((-0.7, -0.95, -0.5), (-0.2, -0.2, 0.0), (0.3, 0.5, 0.7)),
        camera=Camera((0.1, 0.2, 0.95), (0.0, -0.4, -0.5), fov=75.0),
        spotlight=Spotlight((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 100.0, (3.0, 2.5, 2.0)),
    )
    walls, gold, floor, block = scene.materials
    gold = replace(gold, base_color=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.3)
    floor = replace(floor, specular=1.0, roughness=0.4)
    block = replace(block, specular=0.8, specular_color=(1.0, 0.8, 0.6), ior=1.8, metallic=0.5, roughness=0.2)
    return replace(scene, materials=(walls, replace(gold, **changes), floor, block))


def mapped_plane(materials: tuple[Material, ...] = ()) -> Scene:
    """A floor whose roughness, metallic, base colour and normal come from images, by two sets of coordinates."""
    bare = build(
        plane(1.0, 0.0, (0.9, 0.8, 0.7)),
        camera=Camera((0.0, 1.4, 1.2), (0.0, 0.0, 0.0), fov=60.0),
        spotlight=Spotlight((0.3, 1.5, -0.6), (0.0, 0.0, 0.0), 90.0, (3.0, 3.0, 3.0)),
    )
    rng = np.random.default_rng(5)
    uvs = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], np.float32)
    images = rng.integers(60, 256, (3, 8, 8, 3)).astype(np.uint8)
    images[2] = (128, 128, 255)
    images[2, 2:6, 2:6] = (200, 90, 220)
    shear = (0.5, 0.2, 0.1, -0.3, 0.7, 0.4)
    material = replace(
        bare.materials[0],
        base_color_texture=TextureRef(0, sampler=Sampler(wrap=("mirror", "clamp"))),
        metallic_roughness_texture=TextureRef(1, uv_set=1, transform=shear),
        normal_texture=TextureRef(2, sampler=Sampler(magnify="nearest")),
        metallic=0.8,
        roughness=0.7,
        specular=1.0,
        normal_scale=0.8,
    )
    tangents = np.tile(np.float32([1, 0, 0, 1]), (4, 1))
    geometry = replace(bare.geometry, uvs=uvs, second_uvs=uvs[::-1] * 0.5, tangents=tangents)
    textures = tuple(Texture(f"image {number}", image) for number, image in enumerate(images))
    return replace(bare, geometry=geometry, materials=materials or (material,), textures=textures)
