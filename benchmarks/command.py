"""What `vanedamp bench` takes and does."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from benchmarks import BENCHMARKS
from vanedamp.studies.commands.support.arguments import output_file


def add_arguments(parser: ArgumentParser) -> None:
    """Take the folder, a benchmark and its extent."""
    benchmarks = BENCHMARKS.all()
    output_file("DIR", required=True)(parser)
    parser.add_argument(
        "study", choices=tuple(benchmarks), help="; ".join(f"{name}: {b.SUMMARY}" for name, b in benchmarks.items())
    )
    parser.add_argument("--quick", action="store_true", help="seconds instead of minutes, and rougher figures")
    parser.set_defaults(benchmarks=benchmarks)


def run(arguments: Namespace) -> None:
    """Run the benchmark."""
    from vanedamp.studies.commands.support.outputs import output_folder

    folder = output_folder(arguments)
    arguments.benchmarks[arguments.study].run(folder, arguments.quick)
    print(f"{folder}: results and figures")
