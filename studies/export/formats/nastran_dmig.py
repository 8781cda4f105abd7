"""Nastran: a reduced model as DMIG entries over scalar points, text with ten digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

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

SUMMARY = "a reduced model's matrices MAA, KAA, BAA as DMIG entries over scalar points: Nastran"
ENDINGS = (".pch", ".dmig")
OPTIONS = (DESCRIPTION, COORDINATES)
_NAMES = {"mass": "MAA", "stiffness": "KAA", "damping": "BAA"}


def write(
    record: Record, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write mass, stiffness and damping over the scalar points 1 to n; description: as for OP4."""
    from pandas import DataFrame, MultiIndex
    from pyyeti.nastran import wtdmig, wtspoints

    model = model_in(record, coordinates)
    matrices = plain_matrices(model)
    size = len(matrices["mass"])
    points = MultiIndex.from_product([range(1, size + 1), [0]], names=["id", "dof"])
    held = {name: np.any(matrices[key]) for key, name in _NAMES.items()}
    frames = {
        name: DataFrame(matrices[key], index=points, columns=points) for key, name in _NAMES.items() if held[name]
    }
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as stream:
        stream.write("$ reduced model of vanedamp\n")
        wtspoints(stream, np.arange(1, size + 1))
        wtdmig(stream, frames)
    names = {key: name.lower() for key, name in _NAMES.items() if held[name]}
    if description is not None:
        describe(model, matrices, names, path, description)
    return left_out(model) + lost_digits(model, path, names)


WRITERS = {"reduced-model": write}
