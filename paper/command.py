"""What `vanedamp paper` takes and does."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import output_file, workers


def add_arguments(parser: ArgumentParser) -> None:
    """Take the folder, and which studies to run."""
    output_file("DIR", required=True)(parser)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="fig9, campbell ... (default: all; docs/paper.md)")
    workers(parser)
    parser.add_argument("--resume", action="store_true", help="take over what the folder has of the same scenes")


def run(arguments: Namespace) -> None:
    """Run the studies."""
    from paper.runner import run_paper
    from vanedamp.studies.commands.support.outputs import output_folder

    run_paper(output_folder(arguments), arguments.studies, arguments.workers, arguments.resume)
