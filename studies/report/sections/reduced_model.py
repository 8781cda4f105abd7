"""Reduced models: frequencies, and the mass that an impact feels."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.report.page import Page
from vanedamp.studies.report.results import Result

ORDER = 30
KIND = "reduced-model"


def load(path: Path) -> Result:
    """Read what `vanedamp reduce` or `vanedamp import` wrote."""
    return Result.of(ReducedModel.load(path))


def section(results: Mapping[str, Result], page: Page) -> list[dict[str, Any]]:
    """Return the tables of every model."""
    return [_reduction(file, result.record) for file, result in results.items()]


def _reduction(file: str, model: ReducedModel) -> dict[str, Any]:
    return {
        "file": file,
        "interface": model.interface,
        "masses": [
            (label, model.contact_mass(label))
            for label, length in zip(model.interface, model.lengths, strict=True)
            if length == 1.0
        ],
        "modes": model.modes,
        "frequencies": model.natural_frequencies_hz,
        "greatest_speed": model.greatest_speed,
        "fastest": model.at_speed(model.greatest_speed).natural_frequencies_hz,
        "rotation": model.provenance.get("rotation", {}).get("sentence"),
        "damping_ratio": model.damping_ratio,
    }
