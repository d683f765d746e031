"""The measurement of averaged frames runs and says what it found."""

import json
import sys
from importlib import import_module

import pytest

convergence = import_module("deferred_ir.profiling.studies.convergence")


def test_it_writes_a_table_a_plot_and_the_figures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(convergence, "FRAMES", (1, 4))
    arguments = ["colors", "-o", str(tmp_path), "--graphs", "interleaved", "--vpls", "8", "--size", "32x32"]
    monkeypatch.setattr(sys, "argv", ["convergence", *arguments, "--peers", "none"])
    convergence.main()
    out = capsys.readouterr().out
    assert "| graph | 1 frames | 4 frames |" in out
    assert "| relMSE | interleaved |" in out
    (one, _, error), (four, _, less) = json.loads((tmp_path / "convergence.json").read_text())["lines"]["interleaved"]
    assert (one, four) == (1, 4)
    assert 0 < less < error
    assert "<svg" in (tmp_path / "convergence-colors.svg").read_text()


def test_an_unknown_scene_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["convergence", "cornel", "-o", str(tmp_path)])
    with pytest.raises(SystemExit, match="did you mean"):
        convergence.main()
