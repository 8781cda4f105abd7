"""Abaqus: a reduced model as a substructure, a linear user element with stiffness and mass."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vanedamp.files.formats.matrices.abaqus import write_substructure
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.export.record import ExportRecord
from vanedamp.studies.export.reduced_matrices import COORDINATES, DESCRIPTION, write_model

SUMMARY = "a reduced model as a substructure (*USER ELEMENT, *MATRIX): Abaqus"
ENDINGS = (".mtx",)
OPTIONS = (DESCRIPTION, COORDINATES)


def write(
    record: ExportRecord, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write stiffness and mass; description: the file by which `vanedamp import` reads them back."""
    return write_model(record, path, coordinates, description, _write, damping=False)


def _write(path: Path, model: ReducedModel, matrices: Mapping[str, np.ndarray]) -> dict[str, str]:
    title = f"reduced model, interface {', '.join(model.interface)}".encode("ascii", "replace").decode()[:76]
    with path.open("w", encoding="ascii", newline="\n") as stream:
        write_substructure(stream, title, {name: matrices[name] for name in ("stiffness", "mass")})
    return {"mass": "mass", "stiffness": "stiffness"}


WRITERS = {"reduced-model": write}
