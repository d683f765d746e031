"""The measurement of passes in fragment and in compute shaders."""

import re
from importlib import import_module

from small_scenes import room

stages = import_module("deferred_ir.profiling.checks.stages")


def test_it_prints_a_row_for_each_scene_and_pass(capsys):
    stages.main(["colors", "--size", "33x25", "--turns", "2", "--device", "software"])
    rows = re.findall(r"\| colors \| `(\w+)` \| [\d.]+ \| [\d.]+ \| [\d.]+ \| yes \|", capsys.readouterr().out)
    assert rows == ["list_vpls", "choose_vpls", "light_samples", "filter_samples"]


def test_a_pass_that_gives_other_bits_is_found(renderer, monkeypatch):
    """What is read differs from time to time, as if compute shaders rounded otherwise."""
    one, count = renderer((32, 24), stages.GRAPH, keep_all=True), iter(range(1000))
    read = one.read_texture
    monkeypatch.setattr(one, "read_texture", lambda source: read(source) + next(count))
    assert not any(trial.equal for trial in stages.try_stages(one, room(), 1).values())
