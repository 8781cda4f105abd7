"""Nastran: a reduced model as matrices in an OUTPUT4 file."""

from __future__ import annotations

from pathlib import Path

from vanedamp.files.store import replacing
from vanedamp.rom.external import plain_matrices
from vanedamp.studies.export.record import Record
from vanedamp.studies.export.reduced_matrices import COORDINATES, DESCRIPTION, describe, left_out, model_in

SUMMARY = "a reduced model's matrices MAA, KAA, BAA, SELECT, BASE in binary: Nastran, pyyeti"
ENDINGS = (".op4",)
OPTIONS = (DESCRIPTION, COORDINATES)
#: names in the file
_NAMES = {"mass": "MAA", "stiffness": "KAA", "damping": "BAA", "selection": "SELECT", "base_load": "BASE"}


def write(
    record: Record, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write mass, stiffness and damping (n, n), the interface's rows SELECT (k, n) and the base load BASE (n, 3).

    description: the file by which `vanedamp import` reads them back.
    """
    from pyyeti.nastran import op4

    model = model_in(record, coordinates)
    matrices = plain_matrices(model)
    square, rectangular = 6, 2  # forms: symmetric, and any other
    entries = {
        name: (matrices[key], square if key in ("mass", "stiffness", "damping") else rectangular)
        for key, name in _NAMES.items()
    }
    with replacing(path) as temporary:
        op4.write(str(temporary), entries, sparse="dense")
    if description is not None:
        names = {key: _NAMES[key].lower() for key in ("mass", "stiffness", "damping", "base_load")}
        describe(model, matrices, names, path, description)
    return left_out(model, base_load=True)


WRITERS = {"reduced-model": write}
