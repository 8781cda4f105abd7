"""`vanedamp import`: a reduced model of another code, checked and kept as one of ours."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output

NAME = "import"
ORDER = 60
SUMMARY = "reduced model of another code: dense matrices with a meaning"


def add_arguments(parser: ArgumentParser) -> None:
    """Take the description of the other code's files, and the result files."""
    add_input(parser, "EXTERNAL.toml")
    add_output(parser, "ROM.h5")
    add_json(parser)


def run(arguments: Namespace) -> None:
    """Check the model and write it."""
    from dataclasses import asdict

    from vanedamp.studies.case.external_model import External
    from vanedamp.studies.commands.support.messages import print_warnings, write_result
    from vanedamp.studies.commands.support.outputs import RECORD, check_outputs

    outputs = check_outputs(arguments, output=RECORD)
    external = External.read(arguments.input)
    outputs.keep(external.files(arguments.input))
    model, findings, warnings = external.model(arguments.input)
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "interface": list(model.interface),
        "checks": asdict(findings),
        "warnings": list(warnings),
    }
    files = partial(model.save, arguments.output) if arguments.output else None
    write_result(arguments.json, result, files)
    print_warnings(arguments.input, warnings)
    if arguments.json != "-":
        print(f"{model.size} coordinates; interface: {', '.join(model.interface)}")
        print("frequencies, Hz: " + ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8]))
        print(
            f"checks: asymmetry {findings.asymmetry:.1e}, {findings.rigid_motions} rigid motions, "
            f"{findings.condensed} coordinates without mass condensed"
        )
