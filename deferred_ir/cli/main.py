"""The command line: `deferred-ir COMMAND ...`. Faults are one line and exit status 2."""

from __future__ import annotations

import argparse
import logging
import math
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from deferred_ir.base import interrupts
from deferred_ir.base.errors import Error

LATEST = 1e9

SET_HELP = "a parameter of a pass, e.g. --set shadow_maps.vpl_size=512; may be repeated"


class Parser(argparse.ArgumentParser):
    """argparse with its faults in one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where to look."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status."""
    arguments = _parser().parse_args(argv)
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


def _parser() -> Parser:
    parser = Parser(prog="deferred-ir", description="Global illumination in milliseconds, on OpenGL.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(name: str, run: Any, text: str) -> Parser:
        added = commands.add_parser(name, help=text, description=text)
        added.set_defaults(run=run)
        assert isinstance(added, Parser)
        return added

    render = command("render", _render, "Render a scene to images.")
    _add_render_options(render)

    compare = command("compare", _compare, "Measure how far an image is from its reference: relMSE, RMSE, bias, FLIP.")
    compare.add_argument("image", metavar="A", help="linear image: .npy or .exr")
    compare.add_argument(
        "reference", metavar="B", help="the reference, likewise; its record is B.json, if there is one"
    )
    compare.add_argument("--json", metavar="F", help="write all figures")
    compare.add_argument(
        "--diff", metavar="OUT.png", help="write where the image is too dark (blue) or too bright (red)"
    )

    reference = command("reference", _reference, "Trace a reference image with rays: OUT.npy, and OUT.json beside it.")
    reference.add_argument("scene", metavar="SCENE", help="a built-in scene, a scene file (.toml) or a model")
    reference.add_argument("-o", "--output", required=True, metavar="OUT.npy", help="float32 linear radiance")
    reference.add_argument("--size", metavar="WxH", help="pixels (default: 512x512)")
    kind = reference.add_mutually_exclusive_group()
    kind.add_argument("--spp", type=_positive, metavar="N", help="trace N paths a pixel (default: 64)")
    kind.add_argument("--vpls", type=_positive, metavar="N", help="instead: N VPLs with perfect visibility")
    reference.add_argument("--bounces", type=_count, metavar="N", help="of indirect light (default: 1)")
    reference.add_argument("--seed", type=_count, default=0, metavar="N", help="of the samples (default: 0)")
    reference.add_argument("--time", type=_seconds, default=0.0, metavar="T", help="of motions, seconds (default: 0)")
    reference.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="vpl.PARAM=VALUE",
        help="vpl.fov, vpl.clamp or vpl.pattern as in a render; may be repeated",
    )

    profile = command("profile", _profile, "Measure error against run time: graphs x numbers of VPLs x seeds.")
    _add_profile_options(profile)

    check = command(
        "check", _check, "Check stiff and extreme cases, or shadow maps against rays; exit status 1 if one fails."
    )
    _add_check_options(check)

    view = command("view", _view, "Open a window in which camera and light move and the picture follows.")
    _add_view_options(view)

    graph = command("graph", _graph, "Show what a render graph runs, in what order, and what it leaves out.")
    graph.add_argument("graph", metavar="NAME|FILE", help="a built-in graph or a graph file")
    graph.add_argument("--scene", metavar="SCENE", help="plan for this scene")
    graph.add_argument("--vpls", type=_count, metavar="N", help="virtual point lights")
    graph.add_argument("--set", action="append", default=[], metavar="PASS.PARAM=VALUE", help=SET_HELP)
    graph.add_argument("--dot", action="store_true", help="print Graphviz source")

    command("scenes", _scenes, "List the built-in scenes.")
    doctor = command("doctor", _doctor, "Check this machine, and say how to mend what is missing.")
    doctor.add_argument("--device", default="auto", metavar="D", help="the device to check (default: auto)")
    command("devices", _devices, "List the devices that OpenGL can run on.")
    return parser


def _add_render_options(render: Parser) -> None:
    render.add_argument("scene", metavar="SCENE", help="a built-in scene, a scene file (.toml) or a model")
    render.add_argument(
        "-o",
        "--output",
        action="append",
        default=[],
        metavar="OUT",
        help="image: .png, .exr or .npy (%%04d: the frame); may be repeated",
    )
    render.add_argument("--graph", metavar="NAME|FILE", help="render graph (default: deferred)")
    render.add_argument("--size", metavar="WxH", help="pixels (default: 512x512)")
    render.add_argument("--vpls", type=_count, metavar="N", help="virtual point lights (default: 64)")
    render.add_argument("--seed", type=_count, metavar="N", help="of the samples (default: 0)")
    render.add_argument("--device", default="auto", metavar="D", help="see `deferred-ir devices` (default: auto)")
    render.add_argument(
        "--frames",
        type=_positive,
        default=1,
        metavar="N",
        help="frame i shows time i/30 s",
    )
    render.add_argument(
        "--accumulate",
        type=_positive,
        default=1,
        metavar="K",
        help="average K frames of fresh samples in each image; Ctrl-C keeps what is done",
    )
    render.add_argument(
        "--reuse", action="store_true", help="run a pass only if something has changed that its outputs are made of"
    )
    render.add_argument(
        "--keep-all",
        action="store_true",
        help="leave nothing out that this scene does not need; the pixels are the same",
    )
    render.add_argument("--set", action="append", default=[], metavar="PASS.PARAM=VALUE", help=SET_HELP)
    render.add_argument("--json", metavar="RUN.json", help="write what was rendered, and how long it took")


def _add_profile_options(profile: Parser) -> None:
    profile.add_argument("scene", nargs="?", metavar="SCENE", help="a built-in scene, a scene file (.toml) or a model")
    profile.add_argument("--merge", nargs="+", metavar="DIR", help="instead: join the points of these folders")
    profile.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for points, tables and report")
    profile.add_argument("--graphs", metavar="A,B", help="names or files (default: all built-in graphs)")
    profile.add_argument("--vpls", metavar="N,N", help="numbers of virtual point lights (default: 16,64,256)")
    profile.add_argument("--seeds", type=_count, metavar="K", help="seeds 0 to K-1 (default: 3)")
    profile.add_argument("--size", metavar="WxH", help="pixels (default: 512x512)")
    profile.add_argument("--reference", metavar="R.npy", help="with R.json beside it (default: one is traced)")
    profile.add_argument(
        "--time",
        type=_seconds,
        metavar="T",
        help="where something moves: the frames end at T seconds, where the reference is (default: 1)",
    )
    profile.add_argument("--shard", metavar="I/N", help="measure the I-th of N parts only")
    profile.add_argument(
        "--peers",
        metavar="A,B|none",
        help="other renderers to compare: mitsuba, cycles (default: all that are installed)",
    )
    profile.add_argument("--device", default="auto", metavar="D", help="see `deferred-ir devices` (default: auto)")


def _add_check_options(check: Parser) -> None:
    scene_help = "a built-in scene, a scene file (.toml) or a model (default: all built-in scenes)"
    check.add_argument("scene", nargs="?", metavar="SCENE", help=scene_help)
    check.add_argument(
        "--visibility", action="store_true", help="instead: shadow maps against rays, with the options that follow"
    )
    check.add_argument("--sizes", metavar="N,N", help="of VPLs' maps, texels (default: 256,512)")
    check.add_argument("--pairs", type=_positive, metavar="N", help="of pixel and light, a row (default: 200000)")
    check.add_argument("--size", metavar="WxH", help="pixels of a frame (default: 256x256)")
    check.add_argument("--vpls", type=_count, metavar="N", help="virtual point lights of a frame (default: 64)")
    check.add_argument("--seed", type=_count, metavar="N", help="of the samples (default: 0)")
    check.add_argument("--device", default="auto", metavar="D", help="see `deferred-ir devices` (default: auto)")
    check.add_argument("--set", action="append", default=[], metavar="PASS.PARAM=VALUE", help=SET_HELP)
    check.add_argument("--json", metavar="F", help="write all figures")


def _add_view_options(view: Parser) -> None:
    scene_help = "a built-in scene, a scene file (.toml) or a model (default: cornell)"
    view.add_argument("scene", nargs="?", default="cornell", metavar="SCENE", help=scene_help)
    view.add_argument("--graph", metavar="NAME|FILE", help="render graph (default: deferred)")
    view.add_argument("--size", metavar="WxH", help="pixels of the picture, without the panel (default: 512x512)")
    view.add_argument("--vpls", type=_count, metavar="N", help="virtual point lights (default: 64)")
    view.add_argument("--seed", type=_count, metavar="N", help="of the samples (default: 0)")
    view.add_argument("--set", action="append", default=[], metavar="PASS.PARAM=VALUE", help=SET_HELP)
    view.add_argument("--frames", type=_positive, metavar="N", help="end after N frames")
    view.add_argument("--screenshot", metavar="OUT.png", help="with --frames: write the window as it is then")


def _count(text: str) -> int:
    return _whole(text, 0)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not abs(seconds) <= LATEST:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of seconds, such as 1.5")
    return seconds


def _positive(text: str) -> int:
    return _whole(text, 1)


def _whole(text: str, least: int) -> int:
    if not text.isascii() or not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number from {least} up")
    return int(text)


def _render(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.render import render
    from deferred_ir.engine.settings import parse_settings

    return render(arguments, parse_settings(arguments.set))


def _compare(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.compare import run

    return run(arguments)


def _reference(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.reference import reference
    from deferred_ir.engine.settings import parse_settings

    return reference(arguments, parse_settings(arguments.set))


def _profile(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.profile import run

    return run(arguments)


def _view(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.view import run
    from deferred_ir.engine.settings import parse_settings

    return run(arguments, parse_settings(arguments.set))


def _check(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli.check import run
    from deferred_ir.engine.settings import parse_settings

    return run(arguments, parse_settings(arguments.set))


def _graph(arguments: argparse.Namespace) -> int:
    from deferred_ir.engine.settings import chosen_settings, parse_settings
    from deferred_ir.graph import file
    from deferred_ir.graph.compile import compile
    from deferred_ir.graph.pass_base import Facts
    from deferred_ir.report import plan_text
    from deferred_ir.scene.scene import RenderDefaults

    defaults, facts, scene = RenderDefaults(), Facts(), None
    if arguments.scene is not None:
        from deferred_ir.loading.load import load

        scene = load(arguments.scene)
        facts = scene.facts
        defaults = scene.render
    graph = file.load_graph(arguments.graph, chosen_settings(defaults, parse_settings(arguments.set), arguments.vpls))
    plan = compile(graph, list(graph.outputs), facts)
    print(plan_text.dot(graph, plan) if arguments.dot else plan_text.summary(plan, scene))
    return 0


def _scenes(arguments: argparse.Namespace) -> int:
    del arguments
    from deferred_ir.loading.load import builtin_scenes

    scenes = builtin_scenes()
    width = max(len(name) for name, _ in scenes)
    for name, text in scenes:
        print(f"{name:<{width}}  {text}")
    return 0


def _doctor(arguments: argparse.Namespace) -> int:
    from deferred_ir.cli import doctor

    results = doctor.checks(arguments.device)
    print(doctor.report(results))
    return 0 if doctor.healthy(results) else 1


def _devices(arguments: argparse.Namespace) -> int:
    del arguments
    from deferred_ir.cli.doctor import devices_table

    print(devices_table())
    return 0
