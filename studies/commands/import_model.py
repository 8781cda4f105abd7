"""`vanedamp import`: check a reduced model of another code and save it as a reduced model."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict

from vanedamp.rom.external import Findings
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.external_model import External
from vanedamp.studies.commands.support.messages import write_result


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
    write_result(arguments, result, _summary(model, findings), warnings, output=model.save)


def _summary(model: ReducedModel, findings: Findings) -> Iterator[str]:
    yield f"{model.size} coordinates; interface: {', '.join(model.interface)}"
    yield "frequencies, Hz: " + ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8])
    yield (
        f"checks: asymmetry {findings.asymmetry:.1e}, {findings.rigid_motions} rigid motions, "
        f"{findings.condensed} coordinates without mass condensed"
    )
