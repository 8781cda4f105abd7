"""Nastran: a reduced model as matrices in an OUTPUT4 file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.export.record import ExportRecord
from vanedamp.studies.export.reduced_matrices import COORDINATES, DESCRIPTION, write_model

SUMMARY = "a reduced model's matrices MAA, KAA, BAA, SELECT, BASE in binary: Nastran, pyyeti"
ENDINGS = (".op4",)
OPTIONS = (DESCRIPTION, COORDINATES)
#: names in the file
_NAMES = {"mass": "MAA", "stiffness": "KAA", "damping": "BAA", "selection": "SELECT", "base_load": "BASE"}


def write(
    record: ExportRecord, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write mass, stiffness and damping (n, n), the interface's rows SELECT (k, n) and the base load BASE (n, 3).

    description: the file by which `vanedamp import` reads them back.
    """
    return write_model(record, path, coordinates, description, _write, text=False, base_load=True)


def _write(path: Path, model: ReducedModel, matrices: Mapping[str, np.ndarray]) -> dict[str, str]:
    from pyyeti.nastran import op4

    square, rectangular = 6, 2  # forms: symmetric, and any other
    entries = {
        name: (matrices[key], square if key in ("mass", "stiffness", "damping") else rectangular)
        for key, name in _NAMES.items()
    }
    op4.write(str(path), entries, sparse="dense")
    return {key: name.lower() for key, name in _NAMES.items() if key != "selection"}


WRITERS = {"reduced-model": write}
