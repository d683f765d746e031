"""What `make bench` measures: that the limits do what they say, and the figures of its table."""

from __future__ import annotations

import re
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.limits import bench
from deferred_ir.profiling.limits.allocations import count_allocations, measure_allocations
from deferred_ir.profiling.limits.host_costs import cold_start, python_time, seconds, stopwatch
from deferred_ir.profiling.limits.passes import LIMITS
from deferred_ir.profiling.limits.ray_rates import PASSES, join, measure_ray_rates, recorder

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import bench as tool

OPTIONS = {"vpls": 4, "size": (64, 64), "turns": 2, "device": "software"}


def drawn(renderer, graph, vpls, source, outputs, **options):
    one = renderer((64, 64), bench.GRAPHS[graph], passes=LIMITS, keep_all=True, **options)
    plan = one.plan(load("cornell"), vpls, outputs)
    one.draw(load("cornell"), plan)
    with one.gpu.ctx:
        return one.executor.resource(source).read()


@pytest.mark.parametrize("vpls", [16, VPLS_PER_BLOCK + 8])
def test_the_limit_of_lighting_counts_the_lights_that_arrive(renderer, vpls):
    limit = drawn(renderer, "limit_lighting", vpls, ("lighting", "radiance"), ["radiance"])[..., 0]
    lit = drawn(renderer, "deferred", vpls, ("lighting", "radiance"), ["radiance"])[..., :3].max(axis=-1)
    depth = drawn(renderer, "deferred", vpls, ("gbuffer", "depth"), ["radiance"])[..., 0]
    assert limit.max() <= vpls + 1.001
    assert (limit[depth == 0] == 0).all()
    assert limit[depth > 0].mean() > 0.3 * vpls
    # Light without a comparison that passes is none. A point that is not lifted off its face may be dark by mistake.
    assert (limit[lit > 0] > 0).mean() > 0.99


@pytest.mark.parametrize("vpls", [6, VPLS_PER_BLOCK + 8])
def test_the_limit_of_shadow_maps_draws_the_atlas(renderer, vpls):
    sizes = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32}
    atlas = drawn(renderer, "deferred", vpls, ("shadow_maps", "atlas"), ["radiance"], set=sizes)[..., 0]
    plain = drawn(renderer, "limit_maps", vpls, ("shadow_maps", "atlas"), ["depth", "maps"], set=sizes)[..., 0]
    assert plain.shape == (atlas.shape[0] * 128, 128)
    assert (plain > 0).mean() > 0.3
    # Triangles are clipped in another place, which rounds edges differently.
    same = np.isclose(plain.reshape(atlas.shape), atlas, rtol=1e-4)
    assert same.mean() > 0.998


def test_times_are_taken_from_frames_and_passes():
    laps = [{"shadow_maps": (2.0, 9.0), "lighting": (3.0, 9.0)}, {"shadow_maps": (1.0, 9.0), "lighting": (4.0, 9.0)}]
    measurement = Measurement([10.0, 20.0], laps)
    assert bench.times(measurement, "frame") == [10, 20]
    assert bench.times(measurement, "shading") == [8, 19]
    assert bench.times(measurement, "lighting") == [3, 4]


def test_the_spread_of_ratios_is_their_median_and_quartiles():
    assert bench.spread([1.0, 2.0, 3.0, 4.0, 5.0]) == "3.00 (2.00 to 4.00)"
    assert bench.spread([1.234, 1.234]) == "1.23 (1.23 to 1.23)"


@pytest.mark.parametrize(
    ("value", "text"), [(0.01234, "0.0123"), (1.0, "1.00"), (12.34, "12.3"), (99.96, "100"), (1234.5, "1234")]
)
def test_figures_have_three_digits(value, text):
    assert bench.digits(value) == text


def test_a_table_is_markdown():
    assert markdown(["", "a"], [["x", "1"]]) == "|  | a |\n| --- | --- |\n| x | 1 |"


def test_graphs_take_turns_and_each_row_gets_its_cells(capsys):
    rows = [*bench.COMPARISONS]
    cells = bench.column("cornell", rows, **OPTIONS)
    assert cells[0] == "cornell"
    assert all(re.fullmatch(r"[\d.]+ \([\d.]+ to [\d.]+\)", cell) for cell in cells[1:])
    assert len(cells) == 1 + len(rows)
    told = capsys.readouterr().err
    assert all(re.search(rf"^cornell: {row}: [\d.]+ / [\d.]+ ms$", told, re.MULTILINE) for row in rows)


def test_only_picks_rows_and_refuses_a_word_in_none(capsys):
    arguments = ["cornell", "--vpls", "4", "--size", "32x32", "--turns", "2", "--device", "software", "--only"]
    head, rule, row, empty, made = bench.report([*arguments, "lighting"]).splitlines()
    assert (head, rule, empty) == ("|  | cornell |", "| --- | --- |", "")
    assert row.startswith("| lighting / projecting and comparing alone | ")
    assert "llvmpipe" in made
    assert made.endswith(" 2 turns with 4 VPLs at 32x32; median (quartiles).")
    with pytest.raises(SystemExit):
        bench.report([*arguments, "lightning"])
    assert "--only lightning: in none of: lighting / " in capsys.readouterr().err


def test_pythons_own_time_is_part_of_a_frame():
    for graph in ("deferred", "resampled"):
        assert all(0 < time < 1000 for time in python_time("cornell", graph=graph, **OPTIONS))


def test_tasks_on_other_threads_count_as_pythons_own_time():
    def work(seconds):
        start = time.thread_time()
        while time.thread_time() < start + seconds:
            pass

    with stopwatch() as own, ThreadPoolExecutor(2) as pool:
        start = own()
        list(pool.map(work, [0.05, 0.05]))
        assert 0.1 <= own() - start < 0.2


def test_embree_alone_traces_the_rays_of_each_pass():
    with recorder() as calls, Renderer((64, 64), "resampled", "software") as one:
        one.draw(load("cornell"), one.plan(load("cornell"), 4, ["radiance"]))
        traced = one.executor.counters["direct_rays"], one.executor.counters["choice_rays"]
    rays = join(calls)
    assert set(rays) == set(PASSES)
    assert [len(part.arguments[0]) for name in PASSES[:2] for part in rays[name]] == [*traced]
    assert {part.query for part in rays["near_field"]} == {"closest", "occluded"}
    rates = measure_ray_rates("cornell", **OPTIONS)
    assert set(rates) == {*PASSES, "all three"}
    assert all(0 < ratio < 10 for ratios, _ in rates.values() for ratio in ratios)


def test_every_array_that_numpy_allocates_is_counted():
    with count_allocations() as count:
        both = np.ones(1000) + np.zeros(1000)
        both += 1
        both[:500].sum()
        assert 3 * 8000 <= count[0] < 3 * 8000 + 200  # and a few scalars
    total = count[0]
    assert len(np.concatenate([both, both])) == 2000
    assert count == [total]


def test_what_a_frame_allocates_is_the_same_each_time():
    options = {name: OPTIONS[name] for name in ("vpls", "size", "device")}
    one, other = (measure_allocations("cornell", "resampled", **options) for _ in range(2))
    assert one == other
    assert one["trace_choices"] > 0


def test_a_cold_start_takes_longer_than_an_empty_context():
    assert min(cold_start("cornell", **OPTIONS)) > 1


def test_a_process_that_fails_ends_the_measurement_with_its_words():
    with pytest.raises(SystemExit, match="exit status 3\nno way"):
        seconds([sys.executable, "-c", "import sys; sys.stderr.write('no way'); sys.exit(3)"])


def test_the_page_has_the_rows_that_are_measured():
    page = tool.PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+) \|", page.partition(tool.BEGIN)[2].partition(tool.END)[0], re.MULTILINE)
    assert rows == ["---", *bench.ROWS]
