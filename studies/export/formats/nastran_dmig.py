"""Nastran: a reduced model as DMIG entries over scalar points, text with ten digits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import replacing
from vanedamp.rom.external import plain_matrices
from vanedamp.studies.export.record import Record
from vanedamp.studies.export.reduced_matrices import DESCRIPTION, describe, left_out

SUMMARY = "a reduced model's matrices MAA, KAA, BAA as DMIG entries over scalar points: Nastran"
ENDINGS = (".pch", ".dmig")
OPTIONS = (DESCRIPTION,)
_NAMES = {"mass": "MAA", "stiffness": "KAA", "damping": "BAA"}


def write(record: Record, path: Path, description: str | None = None) -> tuple[str, ...]:
    """Write mass, stiffness and damping over the scalar points 1 to n; description: as for OP4."""
    from pandas import DataFrame, MultiIndex
    from pyyeti.nastran import wtdmig, wtspoints

    model = record.reduced_model()
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
    if description is not None:
        names: dict[str, Any] = {key: name.lower() for key, name in _NAMES.items() if held[name]}
        describe(model, matrices, names, path, description)
    return left_out(model)


WRITERS = {"reduced-model": write}
