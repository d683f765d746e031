"""The command line: `deferred-ir COMMAND ...`. Finds the commands; a fault is one line and exit status 2."""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import pkgutil
import shlex
import sys
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn, Protocol, cast

from deferred_ir.base import interrupts
from deferred_ir.base.errors import Error, did_you_mean
from deferred_ir.cli import commands

DISTRIBUTION = "deferred-ir"


class Command(Protocol):
    """A module of cli/commands; the command has the module's name.

    HELP: what the command does, in a sentence. ORDER: its place in the list of commands, small numbers first.
    It is imported whenever the parser is built, so it imports its libraries inside `run`.
    """

    HELP: str
    ORDER: int

    def add_options(self, parser: argparse.ArgumentParser, /) -> None:
        """Add the command's options to its parser."""

    def run(self, arguments: argparse.Namespace, /) -> int:
        """Do the work. Returns the exit status; raises Error for whatever the user has to mend."""


class Parser(argparse.ArgumentParser):
    """argparse with faults of one line, and without abbreviations, whose meaning a new option could change."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where to look."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


class PrintVersion(argparse.Action):
    """Prints the version and ends. It is looked up only when asked for: that takes longer than parsing."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        """Print `deferred-ir` and the installed version."""
        from importlib import metadata

        print(DISTRIBUTION, metadata.version(DISTRIBUTION))
        parser.exit()


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    _open_closed_streams()
    arguments = _parse(sys.argv[1:] if argv is None else argv)
    if logging.lastResort:  # what writes warnings where no program has set up logging
        logging.lastResort.setFormatter(logging.Formatter("note: %(message)s"))
    try:
        with interrupts.patient():
            status: int = arguments.run(arguments)
            sys.stdout.flush()
        return status
    except Error as error:
        print(f"deferred-ir: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("deferred-ir: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # Whoever read the output has gone; keep Python from complaining about it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _open_closed_streams() -> None:
    """Send what is printed nowhere where the caller has closed standard output or standard error."""
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            if nowhere != number:  # else the next file to be opened would take the number, and get what C code prints
                os.dup2(nowhere, number)
            setattr(sys, name, open(number, "w", encoding="utf-8"))  # noqa: SIM115 - open as long as the process


def find_commands() -> Iterator[tuple[str, Command]]:
    """Yield name and module of each file in cli/commands, by their ORDER."""
    names = [module.name for module in pkgutil.iter_modules(commands.__path__)]
    modules = {name: cast(Command, importlib.import_module(f"{commands.__name__}.{name}")) for name in names}
    yield from sorted(modules.items(), key=lambda item: item[1].ORDER)


def _parse(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the command line; `run` of the result is the command's, `command_line` what a shell reads."""
    parser = Parser(prog="deferred-ir", description="Global illumination in milliseconds, on OpenGL.")
    parser.add_argument("--version", action=PrintVersion, nargs=0, help="show the version and exit")
    group = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    names = []
    for name, command in find_commands():
        inner = group.add_parser(name, help=command.HELP, description=command.HELP)
        command.add_options(inner)
        inner.set_defaults(run=command.run)
        names.append(name)
    word = next((text for text in argv if not text.startswith("-")), None)
    if word is not None and word not in names:
        parser.error(f"no command '{word}'{did_you_mean(word, names)}")
    arguments = parser.parse_args(argv)
    arguments.command_line = shlex.join([DISTRIBUTION, *argv])
    return arguments
