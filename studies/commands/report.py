"""`vanedamp report`: one HTML page of results."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_output

ORDER = 100
SUMMARY = "one HTML page of results"


def add_arguments(parser: ArgumentParser) -> None:
    """Take the page, and files and folders of results."""
    add_output(parser, "REPORT.html", required=True)
    parser.add_argument(
        "inputs", nargs="+", metavar="DIR|FILE", help="results (.h5), claims of studies (.claims.json), or folders"
    )


def run(arguments: Namespace) -> None:
    """Read the results and write the page."""
    from vanedamp.studies.commands.support.outputs import check_outputs

    outputs = check_outputs(arguments, output=(".html", ".htm"))
    from vanedamp.studies.report.page import write_report
    from vanedamp.studies.report.results import collect

    results = collect(arguments.inputs)
    outputs.keep(results.files)
    write_report(results, arguments.output)
    print(f"{arguments.output}: report")
