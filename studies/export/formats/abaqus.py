"""Abaqus: a reduced model as a substructure, a linear user element with stiffness and mass."""

from __future__ import annotations

from pathlib import Path

from vanedamp.files.store import replacing
from vanedamp.rom.abaqus_matrices import write_substructure
from vanedamp.rom.external import plain_matrices
from vanedamp.studies.export.record import Record
from vanedamp.studies.export.reduced_matrices import DESCRIPTION, describe, left_out

SUMMARY = "a reduced model as a substructure (*USER ELEMENT, *MATRIX): Abaqus"
ENDINGS = (".mtx",)
OPTIONS = (DESCRIPTION,)


def write(record: Record, path: Path, description: str | None = None) -> tuple[str, ...]:
    """Write stiffness and mass; description: the file by which `vanedamp import` reads them back."""
    model = record.reduced_model()
    matrices = plain_matrices(model)
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        title = f"reduced model, interface {', '.join(model.interface)}".encode("ascii", "replace").decode()[:76]
        write_substructure(stream, title, {name: matrices[name] for name in ("stiffness", "mass")})
    if description is not None:
        describe(model, matrices, {"mass": "mass", "stiffness": "stiffness"}, path, description)
    return left_out(model, damping=False)


WRITERS = {"reduced-model": write}
