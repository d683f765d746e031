"""A graph whose pass needs a package that is not installed is refused before anything is drawn; others run."""

import sys

import pytest
from small_scenes import room

from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.cli.main import main
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.file import find_obstacles, graph_names
from deferred_ir.profiling.sweep import run
from deferred_ir.profiling.sweep.sweep import Sweep

LINE = "denoised.toml: denoise_samples: mitsuba-oidn is not installed; pip install 'deferred-ir[denoise]'"


@pytest.fixture(autouse=True)
def without_the_wheel(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba_oidn", None)


def test_a_renderer_refuses_before_it_opens_a_context(monkeypatch):
    monkeypatch.setattr("deferred_ir.engine.renderer.Gpu", lambda *_: pytest.fail("opened"))
    with pytest.raises(GraphError) as raised:
        Renderer((8, 8), "denoised")
    assert str(raised.value) == LINE


def test_a_renderer_keeps_the_graph_that_it_has(renderer):
    one = renderer((8, 8), "resampled")
    with pytest.raises(GraphError, match="not installed"):
        one.configure(graph="denoised")
    assert one.render(room(), vpls=4).radiance.any()


def test_the_command_line_says_so_in_one_line_and_writes_nothing(tmp_path, capsys):
    assert main(["render", "cornell", "--graph", "denoised", "-o", str(tmp_path / "out.png")]) == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith(LINE)
    assert not list(tmp_path.iterdir())


def test_the_plan_of_such_a_graph_can_be_read(capsys):
    assert main(["graph", "denoised"]) == 0
    assert "denoise_samples" in capsys.readouterr().out


def test_no_other_graph_needs_an_extra():
    assert find_obstacles() == {"denoised": LINE}


def test_a_sweep_that_names_it_is_refused():
    with pytest.raises(GraphError) as raised:
        Sweep(room(), (8, 8), ["resampled", "denoised"], [4], 1)
    assert str(raised.value) == LINE


def test_a_sweep_of_all_graphs_leaves_it_out_and_says_so(monkeypatch, tmp_path, capsys):
    chosen = []

    def note(sweep, *rest):
        chosen.extend(sweep.graphs)
        raise SettingError("enough")

    monkeypatch.setattr(run, "run", note)
    assert main(["profile", "cornell", "-o", str(tmp_path), "--size", "8x8", "--thorough", "--peers", "none"]) == 2
    assert chosen == [name for name in graph_names() if name != "denoised"]
    assert f"note: left out: {LINE}" in capsys.readouterr().err
