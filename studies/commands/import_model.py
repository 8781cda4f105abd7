"""`vanedamp import`: a reduced model of another code, checked and kept as one of ours."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from functools import partial

from vanedamp.studies.case.external_model import External
from vanedamp.studies.commands.support.messages import print_warnings, write_result


def run(arguments: Namespace) -> None:
    """Check the model and write it."""
    external = External.read(arguments.input)
    arguments.outputs.keep(external.files(arguments.input))
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
