"""`deferred-ir doctor`: what this machine has of what deferred-ir needs (cli/machine.py looks at it)."""

from __future__ import annotations

import argparse

HELP = "Check this machine, and say how to mend what is missing."
ORDER = 90


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir doctor`."""
    parser.add_argument("--device", default="auto", metavar="D", help="the device to check (default: auto)")
    calibrate = (
        "measure anew what frames cost here, which render --within starts from, and which passes run faster in compute "
        "shaders; takes about half a minute"
    )
    parser.add_argument("--calibrate", action="store_true", help=calibrate)


def run(arguments: argparse.Namespace) -> int:
    """Print all checks. Returns 1 if something that is required is missing."""
    from deferred_ir.cli import machine

    if arguments.calibrate:
        from deferred_ir.engine.renderer import Renderer
        from deferred_ir.engine.within import measure_machine
        from deferred_ir.profiling.checks.stages import keep_trials

        with Renderer(device=arguments.device) as renderer:
            measure_machine(renderer)
        keep_trials(arguments.device)
    results = machine.run_checks(arguments.device)
    print(machine.format_report(results))
    return 0 if machine.is_healthy(results) else 1
