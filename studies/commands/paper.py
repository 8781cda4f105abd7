"""`vanedamp paper`: the paper's figures as studies."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_output, add_workers

ORDER = 110
SUMMARY = "the paper's figures as studies, each claim with a verdict"


def add_arguments(parser: ArgumentParser) -> None:
    """Take the folder, and which studies to run."""
    add_output(parser, "DIR", required=True)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help="fig9, campbell ... (default: all; docs/paper.md)")
    add_workers(parser)
    parser.add_argument("--resume", action="store_true", help="take over what the folder has of the same scenes")


def run(arguments: Namespace) -> None:
    """Run the studies."""
    from vanedamp.studies.commands.support.outputs import output_folder
    from vanedamp.studies.paper.runner import run_paper

    run_paper(output_folder(arguments), arguments.studies, arguments.workers, arguments.resume)
