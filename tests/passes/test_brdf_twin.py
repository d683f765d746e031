"""The BRDF of shaders is that of brdf.py, and what a G-buffer holds is what SurfacePoints look up."""

from __future__ import annotations

import numpy as np
import pytest
from surface_scenes import glossy_room, mapped_plane

from deferred_ir.gl.shaders import ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.surfaces import brdf
from deferred_ir.truth.path_tracer import PathTracer

PAIRS = (1000, 1000)
SHADER = """
#include "lib/surface/brdf.glsl"
layout(binding = 0) uniform sampler2DArray vectors;
layout(location = 0) out vec4 found;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 n = texelFetch(vectors, ivec3(at, 0), 0), v = texelFetch(vectors, ivec3(at, 1), 0);
    vec4 l = texelFetch(vectors, ivec3(at, 2), 0), f0 = texelFetch(vectors, ivec3(at, 3), 0);
    Gloss gloss;
    gloss.f0 = f0.rgb;
    gloss.f90 = f0.a;
    gloss.taken = vec2(v.a, l.a);
    gloss.alpha = n.a;
    float kept;
    vec3 glossy = glossy_brdf(gloss, gloss.alpha, n.xyz, v.xyz, l.xyz, kept);
    found = vec4(glossy.rg, kept, mean_kept(gloss, abs(dot(n.xyz, v.xyz))));
}
"""


def draw_directions(rng, count):
    """Unit vectors on a hemisphere about each normal, none within 3 degrees of its plane."""
    normals, out = rng.normal(size=(3, count, 3)), []
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    n = normals[0]
    for drawn in normals[1:]:
        way = drawn - np.einsum("ij,ij->i", n, drawn)[:, None] * n
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        height = rng.uniform(0.05, 1, count)
        out.append(height[:, None] * n + np.sqrt(1 - height**2)[:, None] * way)
    return n, *out


def test_the_shader_computes_the_same_brdf_over_a_million_pairs(gpu, tmp_path):
    rng, count = np.random.default_rng(7), PAIRS[0] * PAIRS[1]
    n, v, to_light = draw_directions(rng, count)
    alpha = np.maximum(rng.uniform(0, 1, count) ** 2, brdf.MIN_ALPHA)
    f0, f90 = rng.uniform(0, 1, (count, 3)), rng.uniform(0, 1, count)
    taken = np.sort(rng.uniform(0, 1, (count, 2)), axis=1)
    layers = np.stack(
        [np.column_stack(part) for part in ((n, alpha), (v, taken[:, 0]), (to_light, taken[:, 1]), (f0, f90))]
    ).astype(np.float32)
    texture = GpuTexture(gpu, Texture("rgba32f", PAIRS, layers=4), PAIRS)
    texture.upload(layers.reshape(4, PAIRS[1], PAIRS[0], 4))
    target = GpuTexture(gpu, Texture("rgba32f"), PAIRS)
    library = ShaderLibrary(gpu)
    (tmp_path / "twin.frag").write_text(SHADER)
    gpu.reset()
    target.framebuffer.bind()
    texture.bind(0, gpu.sampler(linear=False))
    library.program("twin.frag", folder=tmp_path).draw_fullscreen()
    found = target.read().reshape(-1, 4)
    library.release()
    target.release()
    texture.release()
    n, v, to_light, f0 = (layer[:, :3].astype(np.float64) for layer in layers)
    alpha, first, last, f90 = (layer[:, 3].astype(np.float64) for layer in layers)
    gloss = brdf.Gloss(f0, f90, np.column_stack([first, last]), alpha)
    kept, glossy = brdf.eval(gloss, n, v, to_light)
    # In a narrow lobe the last bit of a direction decides: one of n x h is 1 / alpha of its sine there.
    bound = 1e-5 * np.maximum(0.03 / alpha, 1)[:, None]
    off = np.abs(found[:, :2] / glossy[:, :2] - 1)
    assert (off < bound).all()
    assert (off < 1e-5).mean() > 0.99999
    np.testing.assert_allclose(found[:, 2], kept, rtol=0, atol=1e-6)
    cosines = np.abs(np.einsum("ij,ij->i", n, v))
    np.testing.assert_allclose(found[:, 3], brdf.find_mean_kept(gloss, cosines), rtol=0, atol=1e-6)


def read_gbuffer(one, scene, ports):
    one.draw(scene, one.plan(scene, 4))
    with one.gpu.ctx:
        return {port: one.executor.resource(("gbuffer", port)).read() for port in ports}


@pytest.mark.parametrize("make", [glossy_room, mapped_plane])
def test_a_gbuffer_holds_what_rays_look_up(renderer, make):
    scene, size = make(), (64, 64)
    found = read_gbuffer(renderer(size, "deferred"), scene, ("albedo", "material", "normals", "depth"))
    seen = PathTracer(scene, Tracer(scene)).trace_camera_rays(size)

    def flip(image):
        return image.reshape(64, 64, -1)[::-1]

    hit = flip(seen.hit)[..., 0] & (found["depth"][..., 0] > 0)
    alpha, metallic = found["material"][..., 0] ** 2, found["material"][..., 1]
    base = found["albedo"][..., :3]
    expected = {
        "alpha": (np.maximum(alpha, brdf.MIN_ALPHA), flip(seen.gloss.alpha)[..., 0]),
        "albedo": (base * (1 - metallic)[..., None], flip(seen.albedo)),
    }
    for name, (ours, theirs) in expected.items():
        off = np.abs(ours - theirs)[hit]
        assert (off > 0.01).mean() < 0.01, name  # but at edges of texels and of triangles
    number = np.round(found["material"][..., 2] * 65535)
    same = number == flip(scene.geometry.face_materials[seen.face])[..., 0]
    assert same[hit].mean() > 0.99
