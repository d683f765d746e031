"""The frame around all commands: how they are found, listed and misspelt, and what closed streams do."""

import os
import re
import subprocess
import sys
from importlib import metadata

import pytest

from deferred_ir.cli import commands
from deferred_ir.cli.main import find_commands, main


def test_every_file_in_the_folder_is_a_command(capsys):
    files = {name.removesuffix(".py") for name in os.listdir(commands.__path__[0]) if name.endswith(".py")}
    names = [name for name, _ in find_commands()]
    assert set(names) == files - {"__init__"}
    with pytest.raises(SystemExit):
        main(["--help"])
    assert re.findall(r"^    (\w+)", capsys.readouterr().out, re.MULTILINE) == names


def test_the_place_in_the_list_of_commands_is_not_taken_twice():
    orders = [command.ORDER for _, command in find_commands()]
    assert orders == sorted(set(orders))


def test_version(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"deferred-ir {metadata.version('deferred-ir')}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rendr", "cornell"], "no command 'rendr'; did you mean 'render'?"),
        (["zzz"], "no command 'zzz'; known: check, compare, devices"),
        (["render", "cornell", "--vpl", "4"], "unrecognized arguments: --vpl 4"),
    ],
)
def test_a_misspelt_word_is_one_line(arguments, message, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("deferred-ir: ")
    assert message in line


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("scene", ["cornell", "nowhere"])
def test_a_closed_stream_costs_neither_picture_nor_status(closed, scene, tmp_path):
    command = f'exec "{sys.executable}" -m deferred_ir render {scene} --size 16x16 --vpls 2 --device software -o o.png'
    done = subprocess.run(
        ["sh", "-c", f"{command} {closed}"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert done.returncode == (0 if scene == "cornell" else 2)
    assert [path.name for path in tmp_path.iterdir()] == (["o.png"] if scene == "cornell" else [])
    assert "Traceback" not in done.stderr
    assert not done.stdout
