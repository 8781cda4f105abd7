"""`vanedamp report`: one HTML page of results."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect


def run(arguments: Namespace) -> None:
    """Read the results and write the page."""
    results = collect(arguments.inputs)
    arguments.outputs.keep(results.files)
    write_report(results, arguments.output, arguments.title)
    print(f"{arguments.output}: report")
