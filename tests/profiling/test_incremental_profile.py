"""The measurement of VPLs that stay runs and says what it found."""

import sys
from importlib import import_module

measured = import_module("deferred_ir.profiling.studies.incremental")


def test_it_prints_its_tables(monkeypatch, capsys):
    for name, value in {"VPLS": 8, "WARM": 2, "MOVING": 3, "SEEDS": 1, "PATHS": 4, "FRESH": 2}.items():
        monkeypatch.setattr(measured, name, value)
    monkeypatch.setattr(measured, "Sizes", lambda: type("Sizes", (), {"timed": (32, 32), "compared": (32, 32)}))
    monkeypatch.setattr(sys, "argv", ["incremental", "colors"])
    measured.main()
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("| colors")]
    times, lag, errors = rows
    assert len(lag) == len(measured.LAG)
    assert len(times) == len(measured.TIMES)
    assert len(errors) == len(measured.ERRORS)
    assert int(times[-1].strip("| ")) <= 9
    maps = times[-2:]  # none where the light is traced and few VPLs come and go
    assert all(float(cell.strip("| ")) >= 0 for cell in maps)
    assert all(float(cell.strip("| ")) > 0 for row in (times[:-2], lag, errors) for cell in row[1:])
