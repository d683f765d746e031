"""Running commands as a user would, in this process."""

from deferred_ir.cli.main import main

SMALL = ("--size", "32x32", "--vpls", "4", "--device", "software")
"""Options of a render that takes no time."""


def find_fault(capsys, tmp_path, *arguments):
    """Run a command that must fail. Returns the one line that it complains with; no file may appear."""
    before = sorted(tmp_path.rglob("*"))
    try:
        status = main(arguments)
    except SystemExit as end:  # argparse's own
        status = end.code
    output = capsys.readouterr()
    assert status == 2, output
    lines = [line for line in output.err.splitlines() if not line.startswith(("note: ", "OpenGL on "))]
    assert len(lines) == 1, output.err
    assert lines[0].startswith("deferred-ir")
    assert output.out == ""
    assert sorted(tmp_path.rglob("*")) == before
    return lines[0]
