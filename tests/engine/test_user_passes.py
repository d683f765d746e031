"""Passes of the user's own, handed over as classes: their shaders, ports and parameters, and what is told of faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scenes import room

from deferred_ir.base.errors import GraphError, ShaderError
from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.fullscreen import FullscreenPass
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Input, Output, Texture

SIZE = (24, 16)
GRAPH = """
extends = "deferred"
[outputs]
own = "invert.out"
[passes.invert]
inputs = { image = "lighting.radiance" }
"""
ALONE = '[outputs]\nown = "invert.out"\n[passes.invert]\n'
SHADER = """
layout(binding = UNIT_IMAGE) uniform sampler2D image;
uniform float strength;
out vec4 color;
void main() { color = 1.0 - strength * texelFetch(image, ivec2(gl_FragCoord.xy), 0); }
"""


@dataclass(frozen=True)
class Params:
    strength: float = param(1.0, lo=0.0, hi=2.0, doc="How much.")


@pytest.fixture
def draw(renderer, tmp_path) -> Callable[..., tuple[Renderer, dict[str, np.ndarray]]]:
    """Renders `room` through a graph file with a pass `invert` of this shader; returns its outputs by name."""

    def draw(
        shader: str = SHADER, graph: str = GRAPH, kind: type[Pass] | None = None, vpls: int | None = 4, **options: Any
    ) -> tuple[Renderer, dict[str, np.ndarray]]:
        (tmp_path / "invert.frag").write_text(shader)
        (tmp_path / "own.toml").write_text(graph)
        one = renderer(SIZE, tmp_path / "own.toml", passes={"invert": kind or pass_in(tmp_path)}, **options)
        plan = one.plan(room(), vpls)
        one.draw(room(), plan)
        with one.gpu.ctx:
            return one, {name: one.executor.resource(source).read()[::-1] for name, source in plan.outputs.items()}

    return draw


def pass_in(folder: Path) -> type[FullscreenPass]:
    class Invert(FullscreenPass):
        fragment = "invert.frag"
        shader_folder = folder
        inputs = {"image": Input("image", format="rgba32f")}  # noqa: RUF012

        def outputs(self, inputs):
            return {"out": Output("inverted", Texture("rgba32f"))}

    Invert.Params = Params
    return Invert


def test_a_fullscreen_pass_is_its_ports_parameters_and_shader(draw):
    _, images = draw()
    np.testing.assert_allclose(images["own"], 1 - images["radiance"], atol=1e-6)


def test_its_parameters_can_be_set(draw):
    _, images = draw(set={"invert.strength": 2})
    np.testing.assert_allclose(images["own"], 1 - 2 * images["radiance"], atol=1e-6)
    with pytest.raises(GraphError, match=r"invert\.strength: is 3, but wants a number at least 0 and at most 2"):
        draw(set={"invert.strength": 3})


def test_its_shader_may_use_the_packages_own(draw):
    shader = '#include "lib/surface/gbuffer.glsl"\n' + SHADER.replace(
        "1.0 -", "vec4(from_octahedral(vec2(0.5)), 1.0) -"
    )
    _, images = draw(shader)
    np.testing.assert_allclose(images["own"][..., 2], 1 - images["radiance"][..., 2], atol=1e-6)
    np.testing.assert_allclose(images["own"][..., 0], -images["radiance"][..., 0], atol=1e-6)


def test_a_sampler_that_is_no_port_is_an_error(draw):
    shader = SHADER.replace("UNIT_IMAGE", "7").replace(" image", " imag").replace("(image", "(imag")
    with pytest.raises(ShaderError, match=r"^invert\.frag: sampler 'imag' is no input of pass invert$"):
        draw(shader)


def test_a_parameter_that_the_shader_does_not_know_is_an_error(draw):
    shader = SHADER.replace("strength", "strenght")
    with pytest.raises(ShaderError, match=r"^invert\.frag: no uniform 'strength'; did you mean 'strenght'\?$"):
        draw(shader)


def test_an_error_in_its_shader_names_file_and_line(draw):
    with pytest.raises(ShaderError, match=r"^invert\.frag:5: "):
        draw(SHADER.replace("1.0 -", "one -"))


def test_after_an_error_a_plan_without_the_pass_is_fine(renderer, tmp_path):
    (tmp_path / "invert.frag").write_text("broken")
    (tmp_path / "own.toml").write_text(GRAPH)
    one = renderer(SIZE, tmp_path / "own.toml", passes={"invert": pass_in(tmp_path)})
    for _ in range(2):
        with pytest.raises(ShaderError, match=r"^invert\.frag:1: "):
            one.draw(room(), one.plan(room(), 4))
    plan = one.plan(room(), 4, ["radiance"])
    one.draw(room(), plan)
    np.testing.assert_array_equal(one.read(plan).radiance, renderer(SIZE).render(room(), vpls=4).radiance)


def test_an_optional_input_tells_the_shader_whether_it_is_there(draw, tmp_path):
    kind = pass_in(tmp_path)
    kind.inputs = {**kind.inputs, "more": Input("more", optional=True)}
    shader = SHADER.replace("1.0 -", "float(HAS_MORE) + 2.0 * float(HAS_IMAGE) -")
    _, without = draw(shader, kind=kind)
    np.testing.assert_allclose(without["own"], 2 - without["radiance"], atol=1e-6)
    _, with_it = draw(shader, GRAPH.replace('radiance" }', 'radiance", more = "gbuffer.albedo" }'), kind)
    np.testing.assert_allclose(with_it["own"], 3 - with_it["radiance"], atol=1e-6)


def test_defines_of_a_writer_reach_its_readers(draw, tmp_path):
    class Writer(Pass):
        def outputs(self, inputs):
            return {"out": Output("out", Texture("rgba32f"), {"LAYOUT": 5})}

        def execute(self, frame, io):
            io.framebuffer.clear_color(0, (0, 0, 0, 0))

    (tmp_path / "invert.frag").write_text(SHADER.replace("1.0 -", "float(LAYOUT) -"))
    (tmp_path / "g.toml").write_text(
        '[outputs]\nown = "invert.out"\n[passes.writer]\n[passes.invert]\ninputs = { image = "writer.out" }\n'
    )
    with Renderer(SIZE, tmp_path / "g.toml", "software", passes={"writer": Writer, "invert": pass_in(tmp_path)}) as one:
        plan = one.plan(room())
        one.draw(room(), plan)
        with one.gpu.ctx:
            assert (one.executor.resource(("invert", "out")).read() == 5).all()


def test_targets_start_as_the_pass_clears_them_and_formats_read_back(draw, tmp_path):
    class Fill(Pass):
        def outputs(self, inputs):
            return {
                "color": Output("", Texture("rgba8")),
                "number": Output("", Texture("r32ui")),
                "half": Output("", Texture("rgba16f")),
                "depth": Output("", Texture("depth32f")),
            }

        def execute(self, frame, io):
            io.framebuffer.clear_color(0, (1.0, 0.2, 0.0, 1.0))
            io.framebuffer.clear_color(1, (4_000_000_000, 0, 0, 0))
            io.framebuffer.clear_color(2, (1000.0, 0.5, -1.0, 0.0))
            io.framebuffer.clear_depth(0.125)
            io.count("filled", 3)
            io.count("filled", 1)

    ports = ("color", "number", "half", "depth")
    outputs = "\n".join(f'{port} = "invert.{port}"' for port in ports)
    _, images = draw(graph=f"[outputs]\n{outputs}\n[passes.invert]\n", kind=Fill, vpls=None)
    assert images["color"].shape == (16, 24, 4)
    assert images["color"][3, 5].tolist() == [255, 51, 0, 255]
    assert (images["number"] == 4_000_000_000).all()
    assert images["half"][0, 0].tolist() == [1000, 0.5, -1, 0]
    assert (images["depth"] == 0.125).all()


def test_a_pass_may_publish_figures_which_start_at_zero_each_frame(draw):
    class Counts(Pass):
        def outputs(self, inputs):
            return {"out": Output("", Texture("rgba8"))}

        def execute(self, frame, io):
            io.count("things", 2)
            io.count("things", 3)

    one, _ = draw(graph=ALONE, kind=Counts, vpls=None)
    assert one.executor.counters["things"] == 5
    one.draw(room(), one.plan(room()))
    assert one.executor.counters["things"] == 5


def test_an_image_that_shaders_store_into_is_bound_and_seen_by_readers(draw, tmp_path):
    class Mirror(FullscreenPass):
        fragment = "mirror.frag"
        shader_folder = tmp_path
        inputs = {"image": Input("image", format="rgba32f")}  # noqa: RUF012

        def outputs(self, inputs):
            return {
                "target": Output("a target", Texture("rgba8")),
                "out": Output("mirrored", Texture("rgba32f"), attach=False, image=True),
            }

    (tmp_path / "mirror.frag").write_text("""
        layout(binding = UNIT_IMAGE) uniform sampler2D image;
        layout(binding = IMAGE_OUT, rgba32f) uniform writeonly image2D stored;
        void main() {
            ivec2 pixel = ivec2(gl_FragCoord.xy);
            imageStore(stored, ivec2(imageSize(stored).x - 1 - pixel.x, pixel.y), texelFetch(image, pixel, 0));
        }
    """)
    _, images = draw(kind=Mirror)
    np.testing.assert_array_equal(images["own"], images["radiance"][:, ::-1])


def test_a_pass_of_compute_shaders_alone(draw, tmp_path):
    class Mirror(Pass):
        shader_folder = tmp_path
        inputs = {"image": Input("image", format="rgba32f")}  # noqa: RUF012

        def outputs(self, inputs):
            return {"out": Output("mirrored", Texture("rgba32f"), attach=False, image=True)}

        def execute(self, frame, io):
            io.cover(io.program("mirror.comp"), [(0, 0, *frame.size)])

    (tmp_path / "mirror.comp").write_text("""
        #include "lib/compute.glsl"
        layout(binding = UNIT_IMAGE) uniform sampler2D image;
        layout(binding = IMAGE_OUT, rgba32f) uniform writeonly image2D stored;
        void main() {
            ivec2 pixel = find_texel();
            if (!is_inside(pixel)) return;
            imageStore(stored, ivec2(imageSize(stored).x - 1 - pixel.x, pixel.y), texelFetch(image, pixel, 0));
        }
    """)
    _, images = draw(kind=Mirror)
    np.testing.assert_array_equal(images["own"], images["radiance"][:, ::-1])


@dataclass
class Count:
    """How many frames a pass has run in."""

    frames: int = 0


class Counting(Pass):
    """A pass that counts its frames."""

    State = Count
    format = "rgba8"

    def outputs(self, inputs):
        return {"out": Output("", Texture(self.format))}

    def execute(self, frame, io):
        io.state.frames += 1


def test_state_stays_from_frame_to_frame_until_scene_or_outputs_are_new(draw):
    kind = type("Counting", (Counting,), {})
    one, _ = draw(graph=ALONE, kind=kind, vpls=None)
    assert one.executor.state("invert") == Count(1)
    scene = room()

    def frames(plan=None):
        one.draw(scene, plan or one.plan(scene))
        return one.executor.state("invert").frames

    assert frames() == 1  # of another scene
    assert [frames(), frames()] == [2, 3]
    one.reset()
    assert [frames(), frames()] == [1, 2]
    one.configure(size=(20, 10))
    assert [frames(), frames()] == [1, 2]
    kind.format = "rgba16f"
    one.configure(size=(20, 10), set={})
    assert [frames(), frames()] == [1, 2]


def test_what_a_writer_says_of_its_output_reaches_its_readers_with_its_type(draw, tmp_path):
    class Writer(Pass):
        def outputs(self, inputs):
            return {"out": Output("out", Texture("rgba32f"), meta=Count(7))}

        def execute(self, frame, io):
            io.framebuffer.clear_color()

    class Reader(Pass):
        inputs = {"image": Input("image")}  # noqa: RUF012

        def outputs(self, inputs):
            return {"out": Output("out", Texture("rgba8"))}

        def execute(self, frame, io):
            assert io.meta("image", Count).frames == 7
            with pytest.raises(TypeError, match=r"^invert\.image: carries Count, and Params is wanted$"):
                io.meta("image", Params)

    (tmp_path / "g.toml").write_text(
        '[outputs]\nown = "invert.out"\n[passes.writer]\n[passes.invert]\ninputs = { image = "writer.out" }\n'
    )
    with Renderer(SIZE, tmp_path / "g.toml", "software", passes={"writer": Writer, "invert": Reader}) as one:
        one.draw(room(), one.plan(room()))


def test_a_port_that_was_not_declared_is_an_error_with_those_that_were(draw):
    class Careless(Pass):
        inputs = {"image": Input("image")}  # noqa: RUF012

        def outputs(self, inputs):
            return {"out": Output("", Texture("rgba8"))}

        def execute(self, frame, io):
            io["depth"]

    with pytest.raises(KeyError, match="invert declares no port 'depth'; it has: image, out"):
        draw(kind=Careless)


def test_a_pass_without_textures_has_nothing_to_draw_into(draw):
    class Blind(Pass):
        def outputs(self, inputs):
            return {"out": Output("", Buffer("light", 1, 80))}

        def execute(self, frame, io):
            io.framebuffer.clear_color()

    with pytest.raises(ValueError, match="invert: has no output to draw into"):
        draw(graph=ALONE, kind=Blind, vpls=None)


def test_a_pass_may_find_itself_unneeded(draw, tmp_path):
    class Picky(pass_in(tmp_path)):
        def unneeded(self, facts: Facts) -> str | None:
            return "not today"

    with pytest.raises(GraphError, match="output 'own' comes from invert, which is left out: not today"):
        draw(kind=Picky)


def test_state_of_one_pass_does_not_reach_the_next(draw, tmp_path):
    """A pass that turns everything on and leaves it so."""

    class Messy(Pass):
        inputs = {"image": Input("image")}  # noqa: RUF012

        def outputs(self, inputs):
            return {"out": Output("", Texture("rgba32f"))}

        def execute(self, frame, io):
            ctx = io.gpu.ctx
            ctx.enable(ctx.BLEND | ctx.DEPTH_TEST | ctx.CULL_FACE)
            ctx.blend_func, ctx.depth_func, ctx.cull_face = (ctx.ZERO, ctx.ZERO), "<", "front"
            io.gpu.gl.DepthMask(0)
            io.gpu.gl.ColorMask(0, 0, 0, 0)

    graph = GRAPH + '[passes.gbuffer]\n[passes.tonemap]\ninputs = { radiance = "lighting.radiance" }\n'
    one, _ = draw(graph=graph, kind=Messy)
    image = one.render(room(), vpls=4, seed=9)  # another image, or what the first frame left would do
    expected = draw()[0].render(room(), vpls=4, seed=9)
    np.testing.assert_array_equal(image.radiance, expected.radiance)
    np.testing.assert_array_equal(image.display, expected.display)
