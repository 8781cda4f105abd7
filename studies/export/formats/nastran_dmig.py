"""Nastran: a reduced model as DMIG entries over scalar points, text with ten digits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.export.record import ExportRecord
from vanedamp.studies.export.reduced_matrices import COORDINATES, DESCRIPTION, write_model

SUMMARY = "a reduced model's matrices MAA, KAA, BAA as DMIG entries over scalar points: Nastran"
ENDINGS = (".pch", ".dmig")
OPTIONS = (DESCRIPTION, COORDINATES)
_NAMES = {"mass": "MAA", "stiffness": "KAA", "damping": "BAA"}


def write(
    record: ExportRecord, path: Path, description: str | None = None, coordinates: str | None = None
) -> tuple[str, ...]:
    """Write mass, stiffness and damping over the scalar points 1 to n; description: as for OP4."""
    return write_model(record, path, coordinates, description, _write)


def _write(path: Path, model: ReducedModel, matrices: Mapping[str, np.ndarray]) -> dict[str, str]:
    from pandas import DataFrame, MultiIndex
    from pyyeti.nastran import wtdmig, wtspoints

    size = len(matrices["mass"])
    points = MultiIndex.from_product([range(1, size + 1), [0]], names=["id", "dof"])
    nonzero = {key: name for key, name in _NAMES.items() if np.any(matrices[key])}
    frames = {name: DataFrame(matrices[key], index=points, columns=points) for key, name in nonzero.items()}
    with path.open("w", encoding="ascii", newline="\n") as stream:
        stream.write("$ reduced model of vanedamp\n")
        wtspoints(stream, np.arange(1, size + 1))
        wtdmig(stream, frames)
    return {key: name.lower() for key, name in nonzero.items()}


WRITERS = {"reduced-model": write}
