"""The error that frames tell of their mean: against known noise and filters, and against traced truth."""

import json
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from command_line import find_fault
from small_scenes import room

from deferred_ir.base.errors import SettingError
from deferred_ir.cli.main import main
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.error_estimate import Estimate, Spread
from deferred_ir.graph.file import graph_names
from deferred_ir.loading.load import load
from deferred_ir.report.shared_errors import list_shared_errors
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference

SIZE = (64, 64)
SMALL = ("--size", "32x32", "--device", "software")
TRUTH = np.linspace(0.5, 1.5, 128 * 128 * 4, dtype=np.float32).reshape(128, 128, 4)


def spread(frames, unfiltered=()):
    """The sums of frames, and of the same frames without the filter if they are given."""
    found = Spread()
    for number, frame in enumerate(frames):
        found = found.add(frame, *unfiltered[number : number + 1])
    return found


def noisy(count, sigma):
    """TRUTH with independent noise."""
    rng = np.random.default_rng(0)
    return [(TRUTH + rng.normal(0, sigma, TRUTH.shape)).astype(np.float32) for _ in range(count)]


def error(image):
    """True relMSE (trimmed) of an array like TRUTH."""
    return relmse(image[..., :3].astype(np.float32), TRUTH[..., :3])[0]


# Known noise


@pytest.mark.parametrize("count", [4, 7, 16])
def test_it_is_the_error_of_independent_noise(count):
    found = spread(noisy(count, 0.1))
    assert found.estimate().error == pytest.approx(error(found.mean()), rel=0.04)
    assert (found.estimate().frames, found.estimate().share, found.estimate().filter) == (count, 1.0, 0.0)


@pytest.mark.parametrize("count", [4, 8])
def test_noise_is_the_mean_over_all_ways_of_halving_four_groups(count):
    frames = noisy(count, 1e-3)  # too little to matter in the weights
    groups = [np.mean(frames[number::4], axis=0)[..., :3] for number in range(4)]
    halvings = []
    for half in combinations(range(4), 2):
        first, second = (np.mean([groups[k] for k in part], axis=0) for part in (half, {0, 1, 2, 3} - {*half}))
        halvings.append((first - second) ** 2 / 4)
    image = np.mean(frames, axis=0)[..., :3]
    errors = (np.mean(halvings, axis=0) / (image**2 + 0.01 * image.mean() ** 2)).mean(axis=-1)
    kept = np.sort(errors, axis=None)[: int(errors.size * 0.999)]
    assert spread(frames).estimate().error == pytest.approx(kept.mean(), rel=1e-2)


def test_pixels_that_are_too_bright_do_not_hide_their_error():
    """In one frame of ten a pixel is five times as bright as in the others, since samples rarely find its light."""
    rng = np.random.default_rng(3)
    truth = np.full((128, 128, 4), 0.1, np.float32)
    frames = [(truth * np.where(rng.random((128, 128, 1)) < 0.1, 3.7, 0.7)).astype(np.float32) for _ in range(16)]
    found = spread(frames)
    weights = 0.1**2 + 0.01 * 0.1**2
    true = np.sort(((found.mean()[..., 0] - 0.1) ** 2 / weights), axis=None)[: int(128**2 * 0.999)].mean()
    assert found.estimate().error == pytest.approx(true, rel=0.25)


def test_one_frame_tells_nothing_and_black_frames_have_no_error():
    assert spread(noisy(1, 0.1)).estimate() is None
    assert spread(2 * [np.zeros((8, 8, 4), np.float32)]).estimate() == Estimate(2, 0.0)


# Known filters: one that takes the noise and shifts the light


def filtered(frames, shift, left=0.1):
    """Frames of `left` times the noise, whose light is shifted up and down in stripes."""
    stripes = np.where(np.arange(128) // 8 % 2, shift, -shift)[:, None, None]
    return [(TRUTH + left * (frame - TRUTH) + stripes).astype(np.float32) for frame in frames]


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.1])
@pytest.mark.parametrize("count", [4, 8, 32])
def test_it_sees_what_a_filter_shifts(count, shift):
    frames = noisy(count, 0.2)
    found = spread(filtered(frames, shift), frames)
    told = found.estimate()
    truth = error(found.mean(told.share))
    # Of the mean product of two frames' errors, over frames and values.
    deviation = 0.2**2 * np.sqrt(2 / (count * (count - 1)) / (3 * 128**2))
    assert told.error == pytest.approx(truth, rel=0.15, abs=2 * deviation)
    others = [error(found.mean(share)) for share in np.linspace(0, 1, 21)]
    assert truth < 1.02 * min(others), "no other blend would be better"


def test_a_mean_of_many_frames_is_unfiltered_in_the_end():
    frames = noisy(64, 0.02)
    assert spread(filtered(frames, 0.3), frames).estimate().share < 0.01


def test_the_number_of_frames_needed_is_predicted():
    assert Estimate(4, 0.02).count_frames(0.01) == pytest.approx(8)
    told = Estimate(4, 0.002, filter=0.006, unfiltered_noise=0.04)
    assert told.count_frames(0.01) == pytest.approx(2)
    assert told.count_frames(0.005) == pytest.approx(32), "the filter's error alone is larger"


# Rendered images


@pytest.mark.parametrize(("target", "seed"), [(0.02, 0), (0.02, 1), (0.005, 2)])
def test_images_have_the_error_that_is_asked_for(renderer, target, seed):
    scene = load("cornell")
    truth = trace_reference(scene, SIZE, spp=1024)
    image = renderer(SIZE, None).render(scene, seed=seed, error=target)
    assert image.error_estimate <= target
    assert image.frames >= 2
    found = relmse(image.radiance, truth.radiance, truth.hit)[0] - truth.meta["noise"]
    assert 1 / 1.5 < image.error_estimate / found < 1.5


def test_the_renderers_own_graph_comes_back(renderer):
    one = renderer(SIZE, None)
    before = one.render(room(), vpls=4).radiance
    one.render(room(), error=0.05)
    np.testing.assert_array_equal(one.render(room(), vpls=4).radiance, before)


def test_without_unfiltered_light_it_is_a_plain_mean(renderer):
    one = renderer(SIZE, "deferred")
    image = one.render(room(), vpls=4, error=0.02)
    plain = one.render(room(), vpls=4, accumulate=image.frames)
    np.testing.assert_array_equal(image.radiance, plain.radiance)
    assert image.error_estimate == plain.error_estimate <= 0.02


def test_it_stops_at_the_first_look_that_is_good_enough(renderer):
    one = renderer(SIZE, "deferred")
    mean = Accumulation(one, room(), one.plan(room(), 4))
    told = [estimate.error for estimate in mean.draw_until(0.02, 100) if estimate]
    assert told[-1] <= 0.02 < min(told[:-1])


@pytest.mark.parametrize("wrong", [0, -0.1, float("nan"), float("inf"), "small"])
def test_an_error_that_is_none_is_one_line(renderer, wrong):
    with pytest.raises(SettingError, match=r"^error .*: wants a relMSE above 0, such as 0\.01$"):
        renderer(SIZE).render(room(), error=wrong)


def test_one_frame_is_too_few(renderer):
    with pytest.raises(SettingError, match=r"^accumulate 1: wants a whole number of 2 or more; fewer frames do not"):
        renderer(SIZE).render(room(), error=0.1, accumulate=1)


# What frames cannot tell


@pytest.mark.parametrize("name", graph_names())
def test_what_all_frames_get_wrong_is_named(renderer, name):
    one = renderer((16, 16), name)
    shared = " ".join(list_shared_errors(one.plan(room(), 4, ["radiance"])))
    named = {"deferred": "texels", "forward": "texels", "hemisphere": "texels", "denoised": "the denoiser blurs"}
    assert named.get(name, "the filter blurs") in shared
    pools = ("resampled", "accurate", "denoised")
    assert ("2 pixels apart" in shared) == (name in (*pools, "incremental"))
    assert ("cones" in shared) == (name not in ("mapped", "hemisphere", *pools))
    assert ("clamped" in shared) == (name not in ("mapped", *pools))


def test_a_filter_is_not_named_where_unfiltered_light_shows_it(renderer):
    one = renderer((16, 16), "resampled", set={"sample_pixels.scale": 1})
    assert "the filter blurs" in " ".join(list_shared_errors(one.plan(room(), 4, ["radiance"])))
    assert list_shared_errors(one.plan(room(), 4, ["radiance", "unfiltered"])) == []


# The command


def test_the_command_tells_error_frames_and_target(tmp_path, capsys):
    image, run = tmp_path / "o.npy", tmp_path / "run.json"
    assert main(["render", "cornell", *SMALL, "--error", "0.02", "-o", str(image), "--json", str(run)]) == 0
    told = json.loads(run.read_text())
    assert (told["graph"], told["set"]) == ("resampled", {"sample_pixels.scale": 1})
    error = told["error"]
    assert error["target"] == 0.02
    assert error["estimate"] == pytest.approx(error["noise"] + error["filter"])
    assert error["estimate"] <= 0.02
    assert error["shared"] == []
    assert 2 <= told["accumulated"] < 64
    pattern = rf"note: error about [\d.e-]+ \(relMSE\) after {told['accumulated']} frames"
    assert re.search(pattern, capsys.readouterr().err)
    again = tmp_path / "again.npy"
    words = ["--graph", "resampled", "--set", "sample_pixels.scale=1", "--error", "0.02"]
    assert main(["render", "cornell", *SMALL, *words, "-o", str(again)]) == 0
    np.testing.assert_array_equal(np.load(image), np.load(again))


def test_an_error_out_of_reach_is_told_in_a_line_and_by_the_exit_status(tmp_path, capsys):
    file = tmp_path / "o.npy"
    words = ["--vpls", "4", "--graph", "deferred", "--error", "1e-7", "--accumulate", "6"]
    assert main(["render", "cornell", *SMALL, *words, "-o", str(file)]) == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")]
    assert re.match(r"note: an error of 1e-07 would take about .* frames of this graph; it ends after 6, ", lines[0])
    assert re.match(r"note: error about .* after 6 frames, not the 1e-07 asked for$", lines[1])
    assert lines[2].startswith("note: what all frames get wrong alike comes on top: vpl: VPLs shine into cones of 150")
    assert file.exists()


def test_an_averaged_image_tells_its_error_without_being_asked(tmp_path):
    run = tmp_path / "run.json"
    assert main(["render", "cornell", *SMALL, "--vpls", "4", "--accumulate", "2", "--json", str(run)]) == 0
    error = json.loads(run.read_text())["error"]
    assert error["target"] is None
    assert error["estimate"] > 0


@pytest.mark.parametrize("words", [("--error", "0"), ("--error", "x"), ("--error", "0.1", "--accumulate", "1")])
def test_what_makes_no_sense_is_one_line(tmp_path, capsys, words):
    find_fault(capsys, tmp_path, "render", "cornell", *SMALL, "-o", str(Path(tmp_path) / "o.npy"), *words)
