"""Passes that can run in fragment and in compute shaders: both give the same image, and what was measured decides."""

import json

import numpy as np
import pytest
from distance import same_pixels
from small_scenes import room, smooth_scene

from deferred_ir.cli.main import main
from deferred_ir.graph.file import load_graph
from deferred_ir.loading.load import load
from deferred_ir.tuning import stage_costs
from deferred_ir.tuning.cache import name_machine
from deferred_ir.tuning.stage_costs import Trial

PASSES = "list_vpls", "choose_vpls", "light_samples", "filter_samples"
MANY = {"sample_pixels.scale": 1, "vpl.clamp": 0.0, "choose_vpls.draws": 64, "choose_vpls.rays": 16}
UNWRITTEN = 1 << 24
"""A number that no pass writes."""
MODULES = {name: f"deferred_ir.passes.{name}" for name in PASSES}


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "cache"))


def stages(stage, names=PASSES):
    return {f"{name}.stage": stage for name in names}


def run_alone(one, scene, name, stage, settings):
    """What a pass writes when it alone runs again, each output in full; UNWRITTEN where it writes nothing."""
    one.configure(set={**settings, **stages("fragment"), f"{name}.stage": stage})
    plan = one.plan(scene, 8)
    ports = next(step for step in plan.steps if step.name == name).outputs
    for port in ports:
        one.write_texture((name, port), np.full_like(one.read_texture((name, port)), UNWRITTEN))
    one.draw(scene, plan, seed=5, steps={name})
    assert one.executor.stages()[name] == stage
    return {port: one.read_texture((name, port)) for port in ports}


def assert_equal(image, other):
    """Equal to 1e-6, or where a rounding flips a choice: in the mean, 0.2 %, and in all but 1 % of the values."""
    image, other = np.asarray(image, float), np.asarray(other, float)
    scale = 1e-6 * (np.abs(other) + np.abs(other).mean())
    assert (np.abs(image - other) > scale).mean() <= 0.01
    assert image.mean() == pytest.approx(other.mean(), rel=2e-3)


def test_each_pass_with_a_choice_of_stage_is_tested_here():
    nodes = load_graph("resampled").nodes.values()
    assert {node.name for node in nodes if hasattr(node.work.params, "stage")} == set(PASSES)


@pytest.mark.parametrize("settings", [{}, MANY], ids=["few", "many"])
@pytest.mark.parametrize("size", [(65, 47), (64, 64), (3, 1)], ids="{0[0]}x{0[1]}".format)
@pytest.mark.parametrize("name", PASSES)
def test_a_pass_writes_the_same_from_the_same(renderer, name, size, settings):
    """keep_all, so that no other pass has written over its inputs."""
    one, scene = renderer(size, "resampled", set=settings, keep_all=True), smooth_scene()
    one.draw(scene, one.plan(scene, 8), seed=5)
    drawn, computed = (run_alone(one, scene, name, stage, settings) for stage in ("fragment", "compute"))
    for port, texels in drawn.items():
        np.testing.assert_array_equal(texels == UNWRITTEN, computed[port] == UNWRITTEN)
        assert (texels != UNWRITTEN).any()
        assert_equal(computed[port], texels)


@pytest.mark.parametrize("size", [(65, 47), (96, 64)], ids="{0[0]}x{0[1]}".format)
@pytest.mark.parametrize(("graph", "vpls"), [("resampled", 16), ("accurate", 128)])
@pytest.mark.parametrize("name", ["cornell", "atrium"])
def test_the_image_is_the_same(renderer, name, graph, vpls, size):
    scene = load(name)
    drawn, computed = (renderer(size, graph, set=stages(stage)) for stage in ("fragment", "compute"))
    for seed in range(2):
        images = [one.render(scene, vpls=vpls, seed=seed).radiance for one in (drawn, computed)]
        assert_equal(*images)
        assert images[0].max() > 0
    assert drawn.executor.counters == computed.executor.counters


def test_averaged_frames_and_reused_ones_are_the_same(renderer):
    scene, size = room(), (33, 25)
    drawn, computed = (renderer(size, "resampled", set=stages(stage)) for stage in ("fragment", "compute"))
    assert_equal(*(one.render(scene, vpls=8, accumulate=3).radiance for one in (drawn, computed)))
    kept = renderer(size, "resampled", set=stages("compute"), reuse=True)
    for seed in (0, 0, 1, 0):
        assert same_pixels(kept.render(scene, vpls=8, seed=seed), computed.render(scene, vpls=8, seed=seed))


# What was measured


def test_by_itself_a_pass_runs_in_fragment_shaders(renderer, cache):
    one = renderer((16, 12), "resampled")
    one.render(room(), vpls=4)
    assert one.executor.stages() == dict.fromkeys(PASSES, "fragment")


@pytest.mark.parametrize(
    ("trial", "stage"),
    [
        (Trial(2.0, 1.0, equal=True), "compute"),
        (Trial(1.0, 2.0, equal=True), "fragment"),
        (Trial(2.0, 1.0, equal=False), "fragment"),
    ],
    ids=["faster", "slower", "other pixels"],
)
def test_what_was_measured_decides(renderer, cache, trial, stage):
    one = renderer((16, 12), "resampled", set={"list_vpls.stage": "fragment"})
    stage_costs.keep(name_machine(one.gpu.device.name, one.gpu.driver), dict.fromkeys(MODULES.values(), trial))
    one.render(room(), vpls=4)
    assert one.executor.stages() == {**dict.fromkeys(PASSES, stage), "list_vpls": "fragment"}


def test_the_record_tells_the_stage_of_each_pass(cache, tmp_path):
    run = tmp_path / "run.json"
    words = ["--graph", "resampled", "--size", "16x12", "--vpls", "4", "--device", "software"]
    words += ["--set", "light_samples.stage=compute", "-o", str(tmp_path / "o.npy"), "--json", str(run)]
    assert main(["render", "cornell", *words]) == 0
    told = {entry["name"]: entry["stage"] for entry in json.loads(run.read_text())["passes"] if "stage" in entry}
    assert told == {**dict.fromkeys(PASSES, "fragment"), "light_samples": "compute"}
