"""RUN.json's keys whatever the graph, and what is said beside it."""

from __future__ import annotations

import json

from deferred_ir.cli.main import main
from deferred_ir.graph.figures import Figure
from deferred_ir.report import run_json

SMALL = ["--size", "16x16", "--device", "software"]
WITHOUT_MAPS = """
extends = "deferred"
[passes]
shadow_maps = false
[passes.lighting]
inputs = { shadows = false, blockers = false }
"""


def test_figures_of_passes_that_a_graph_lacks_are_there_all_the_same(tmp_path):
    (tmp_path / "plain.toml").write_text(WITHOUT_MAPS)
    run = tmp_path / "run.json"
    graph = ["--graph", str(tmp_path / "plain.toml"), "--vpls", "2", "--frames", "2"]
    assert main(["render", "cornell", *SMALL, *graph, "--json", str(run)]) == 0
    found = json.loads(run.read_text())
    assert (found["maps_drawn"], found["stand_in"], found["vpls"]) == ([0, 0], None, 2)
    assert found["bias"]["clamp"] < 0


def test_vpls_that_no_frame_had_time_for_are_noted_beside_a_record_too(tmp_path, capsys):
    """Measuring what was left out draws frames of its own, in which no VPL waits."""
    files = ["-o", str(tmp_path / "o.npy"), "--json", str(tmp_path / "run.json")]
    arguments = ["render", "cornell", *SMALL, "--graph", "incremental", "--vpls", "16", *files]
    assert main(arguments) == 0
    assert "note: 8 of 16 rays for VPLs so far: 2 frames fill the set" in capsys.readouterr().err


def test_a_table_is_null_unless_one_of_its_figures_was_published():
    figures = [Figure("mesh_bytes", "", ("mesh", "bytes")), Figure("mesh_faces", "", ("mesh", "faces"))]
    own = Figure("own", ""), Figure("all", "", ("all",), each_frame=True), Figure("last", "", ("last",))
    assert run_json._read_figures([*figures, *own], [{"own": 1}]) == {"mesh": None, "all": [0], "last": 0}
    frames = [{"mesh_bytes": 1, "all": 2, "last": 3}, {"mesh_bytes": 4, "mesh_faces": 5, "last": 6}]
    wanted = {"mesh": {"bytes": 4, "faces": 5}, "all": [2, 0], "last": 6}
    assert run_json._read_figures([*figures, *own], frames) == wanted
