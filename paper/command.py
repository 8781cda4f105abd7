"""What `vanedamp paper` takes and does."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_output, add_workers


def add_arguments(parser: ArgumentParser) -> None:
    """Take the folder, and which studies to run."""
    add_output(parser, "DIR", required=True)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="fig9, campbell ... (default: all; docs/paper.md)")
    add_workers(parser)
    parser.add_argument("--resume", action="store_true", help="take over what the folder has of the same scenes")


def run(arguments: Namespace) -> None:
    """Run the studies."""
    from paper.runner import run_paper
    from vanedamp.studies.commands.support.outputs import output_folder

    run_paper(output_folder(arguments), arguments.studies, arguments.workers, arguments.resume)
