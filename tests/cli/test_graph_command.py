"""`deferred-ir graph` and `deferred-ir scenes`."""

import subprocess
import sys

from deferred_ir.cli.main import main


def test_graph_shows_order_and_what_was_left_out(capsys, box):
    assert main(["graph", "deferred", "--scene", box(("emission = [1, 1, 1]", "emission = [0, 0, 0]"))]) == 0
    output = capsys.readouterr().out
    assert output.index(". gbuffer") < output.index(". lighting") < output.index(". tonemap")
    assert "left out: shadow_maps: no light needs one" in output
    assert "left out: soft shadows: the spotlight's radius is 0" in output
    assert main(["graph", "forward", "--dot"]) == 0
    assert capsys.readouterr().out.startswith("digraph")


def test_graph_and_its_errors_need_no_gl():
    code = (
        "import sys; from deferred_ir.cli.main import main\n"
        "status = main(['graph', 'deferred', '--scene', 'cornell'])\n"
        "sys.exit(status or int('moderngl' in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def test_scenes_lists_the_built_in_ones(capsys):
    assert main(["scenes"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert listed == ["atrium", "colors", "cornell", "gallery"]
