"""Abaqus: a reduced model as a substructure, a linear user element with stiffness and mass."""

from __future__ import annotations

from pathlib import Path

from vanedamp.files.formats.matrices.abaqus import write_substructure
from vanedamp.files.store import replacing
from vanedamp.rom.external import plain_matrices
from vanedamp.studies.export.record import Record
from vanedamp.studies.export.reduced_matrices import (
    COORDINATES,
    DESCRIPTION,
    describe,
    left_out,
    lost_digits,
    model_in,
)

SUMMARY = "a reduced model as a substructure (*USER ELEMENT, *MATRIX): Abaqus"
ENDINGS = (".mtx",)
OPTIONS = (DESCRIPTION, COORDINATES)


def write(
    record: Record, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write stiffness and mass; description: the file by which `vanedamp import` reads them back."""
    model = model_in(record, coordinates)
    matrices = plain_matrices(model)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        title = f"reduced model, interface {', '.join(model.interface)}".encode("ascii", "replace").decode()[:76]
        write_substructure(stream, title, {name: matrices[name] for name in ("stiffness", "mass")})
    names = {"mass": "mass", "stiffness": "stiffness"}
    if description is not None:
        describe(model, matrices, names, path, description)
    return left_out(model, damping=False) + lost_digits(model, path, names)


WRITERS = {"reduced-model": write}
