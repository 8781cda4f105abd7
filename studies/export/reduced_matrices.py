"""Matrices of reduced models for files of other codes, and the file by which `vanedamp import` reads them back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from vanedamp.files.store import replacing
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.export.options import OUTPUT, Option

DESCRIPTION = Option(
    "description", "of a reduced model's matrices: write the file by which `vanedamp import` reads them",
    "EXTERNAL.toml", role=OUTPUT, endings=(".toml",),
)  # fmt: skip


def left_out(model: ReducedModel, damping: bool = True) -> tuple[str, ...]:
    """Return what files of mass, stiffness and, perhaps, damping do not say of a model."""
    lacks = []
    if not damping and model.damping_ratio is None and np.any(model.damping):
        lacks.append("the damping matrix: this format holds none, and the model has no damping ratio")
    if model.centrifugal_stiffness is not None:
        lacks.append("the centrifugal stiffness: the matrices are those at standstill")
    if model.outputs:
        lacks.append("the outputs")
    return tuple(f"left out: {what}" for what in lacks)


def describe(
    model: ReducedModel, matrices: Mapping[str, np.ndarray], names: Mapping[str, str], file: Path, target: str | Path
) -> None:
    """Write the description of a file of matrices, with the path of that file relative to its own folder.

    names: of mass and stiffness, and perhaps of damping and base_load, in that file.
    """
    table: dict[str, Any] = {"file": os.path.relpath(file, Path(target).parent)} | dict(names)
    if "base_load" in table and not np.any(matrices["base_load"]):
        del table["base_load"]
    if model.damping_ratio is not None or not np.any(model.damping) or "damping" not in table:
        table.pop("damping", None)
        table["damping_ratio"] = model.damping_ratio or 0.0
    interface = {}
    for label, row, direction in zip(model.interface, matrices["selection"], model.directions, strict=True):
        interface[label] = {"row": row.tolist()} | ({"direction": direction.tolist()} if np.any(direction) else {})
    with replacing(target) as temporary:
        temporary.write_text(tomli_w.dumps({"matrices": table, "interface": interface}), encoding="utf-8")
