"""The measurement of parameters of graphs runs and says what it found."""

import re
import sys
from importlib import import_module

import pytest

parameters = import_module("deferred_ir.profiling.studies.parameters")


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["parameters", *arguments])
    parameters.main()


def test_it_prints_a_row_for_each_setting(monkeypatch, capsys):
    monkeypatch.setattr(parameters, "SAMPLES", (1.0, 4.0))
    few = "--vpls", "8", "--size", "24x24", "--seeds", "2", "--spp", "16"
    run(monkeypatch, "colors", "--tables", "samples", *few)
    out = capsys.readouterr().out
    assert "| scene | samples | relMSE | near_field, ms | frame, ms |" in out
    rows = re.findall(r"\| colors \| (\S+) \| ([\d.]+) \(([\d.]+) to ([\d.]+)\) \|", out)
    assert [name for name, *_ in rows] == ["1", "4"]
    assert all(0 < float(least) <= float(mean) <= float(most) for _, mean, least, most in rows)


def test_it_measures_resampled_as_well(monkeypatch, capsys):
    monkeypatch.setitem(parameters.RESAMPLED, "rays", ("choose_vpls.rays", (1, 4)))
    few = "--vpls", "4", "--size", "24x24", "--seeds", "2", "--spp", "16"
    run(monkeypatch, "colors", "--tables", "rays", *few)
    out = capsys.readouterr().out
    assert "| scene | rays | relMSE | trace_choices, ms | frame, ms |" in out
    assert re.findall(r"\| colors \| (\d) \|", out) == ["1", "4"]


def test_a_fault_is_one_line(monkeypatch):
    with pytest.raises(SystemExit, match="did you mean"):
        run(monkeypatch, "cornel")
    with pytest.raises(SystemExit, match="no 'sample'; there are samples, clamp"):
        run(monkeypatch, "cornell", "--tables", "sample")
