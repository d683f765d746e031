"""`deferred-ir graph`: the plan of a render graph, as text or for Graphviz. Needs no OpenGL."""

from __future__ import annotations

import argparse

from deferred_ir.cli.options import add_set, add_vpls

HELP = "Show which passes a render graph runs, in what order, and which it leaves out."
ORDER = 70


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir graph`."""
    parser.add_argument("graph", metavar="NAME|FILE", help="a built-in graph or a graph file")
    parser.add_argument("--scene", metavar="SCENE", help="plan for this scene")
    add_vpls(parser)
    add_set(parser)
    parser.add_argument("--dot", action="store_true", help="print Graphviz source")


def run(arguments: argparse.Namespace) -> int:
    """Print the plan of all outputs of the graph, for a scene if one is named."""
    from deferred_ir.engine.settings import choose_settings, parse_settings
    from deferred_ir.graph.compile import compile
    from deferred_ir.graph.facts import NOTHING_KNOWN
    from deferred_ir.graph.file import load_graph
    from deferred_ir.report import plan_text
    from deferred_ir.scene.scene import RenderDefaults

    defaults, facts, scene = RenderDefaults(), NOTHING_KNOWN, None
    if arguments.scene is not None:
        from deferred_ir.frame.facts import collect_facts
        from deferred_ir.loading.load import load

        scene = load(arguments.scene)
        defaults, facts = scene.render, collect_facts(scene)
    settings = choose_settings(arguments.graph, defaults, parse_settings(arguments.set), arguments.vpls)
    graph = load_graph(arguments.graph, settings)
    plan = compile(graph, list(graph.outputs), facts)
    print(plan_text.dot(graph, plan) if arguments.dot else plan_text.summary(plan, scene))
    return 0
