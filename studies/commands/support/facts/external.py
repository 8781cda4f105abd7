"""Facts of the description of another code's model: files, coordinates, frequencies and checks."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.case.external_model import External
from vanedamp.studies.facts import Fact


def facts(path: str | Path) -> list[Fact]:
    """Return the facts of the model that a file describes. Raises as `vanedamp import`."""
    external = External.read(path)
    model, findings, warnings = external.model(path)
    return [
        Fact("commands", ["import"]),
        Fact("files", [str(file) for file in external.files(path) if file.is_file()]),
        Fact("coordinates", model.size),
        Fact("interface", list(model.interface)),
        Fact("natural_frequency_hz", model.natural_frequencies_hz[:10].tolist(), "Hz"),
        Fact("rigid_motions", findings.rigid_motions),
        Fact("asymmetry", findings.asymmetry, "", "of the matrices, relative"),
        Fact("warnings", list(warnings)),
    ]
