"""`vanedamp demo`: the whole pipeline on the shipped mesh."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_output, add_workers

ORDER = 120
SUMMARY = "the whole pipeline on the shipped mesh"


def add_arguments(parser: ArgumentParser) -> None:
    """Take the folder and a number of processes."""
    add_output(parser, "DIR")
    parser.set_defaults(output="out")
    add_workers(parser)
    parser.add_argument("--rigid", action="store_true", help="its rigid model only, without finite elements")


def run(arguments: Namespace) -> None:
    """Run the demonstration."""
    from vanedamp.studies.commands.support.outputs import output_folder
    from vanedamp.studies.demo.demo import PIPELINE, run_demo
    from vanedamp.studies.pipeline.pipeline import adopt

    folder = output_folder(arguments)
    run_demo(folder, arguments.workers, arguments.rigid)
    adopt(folder / PIPELINE)
