"""Matrices of reduced models in files of other codes, and the description with which `vanedamp import` reads them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.formats.matrices.registry import read_matrices
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import InputError
from vanedamp.files.toml_output import toml
from vanedamp.rom.external import external_model, plain_matrices
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.export.export import OUTPUT, Option
from vanedamp.studies.export.record import ExportRecord

DESCRIPTION = Option(
    "description", "of a reduced model's matrices: write the file by which `vanedamp import` reads them",
    "EXTERNAL.toml", role=OUTPUT, endings=(".toml",),
)  # fmt: skip

COORDINATES = Option(
    "coordinates", "of a reduced model's matrices: own, the first of which are the interface's (default), or natural "
    "modes, which lose nothing to the digits of a text", "own|natural",
)  # fmt: skip
#: function of a format: writes matrices of a model by name to a file; returns the names in the file
Writer = Callable[[Path, ReducedModel, Mapping[str, np.ndarray]], dict[str, str]]
#: relative change of natural frequencies by rounding in a text file that is reported
_NOTABLE = 1e-9


def write_model(
    record: ExportRecord, path: Path, coordinates: str | None, description: str | None, write: Writer, *,
    text: bool = True, damping: bool = True, base_load: bool = False,
) -> tuple[str, ...]:  # fmt: skip
    """Write the matrices of a reduced model, and their description. Returns warnings; raises InputError.

    write: writes the matrices of a model to a file; returns their names there, as `vanedamp import` takes them. text:
    whether its digits are few; damping, base_load: whether the format holds these.
    """
    model = _model_in(record, coordinates)
    matrices = plain_matrices(model)
    with replacing(path) as temporary:
        names = write(temporary, model, matrices)
    if description is not None:
        describe(model, matrices, names, path, description)
    lost = _lost_digits(model, path, names) if text else ()
    return _left_out(model, damping, base_load) + lost


def _model_in(record: ExportRecord, coordinates: str | None) -> ReducedModel:
    """Return the reduced model of a record in its own coordinates or natural ones. Raises InputError."""
    if coordinates not in (None, "own", "natural"):
        raise InputError(f"--coordinates: expected own or natural, not {coordinates!r}")
    model = record.reduced_model()
    if coordinates != "natural":
        return model
    exact = {"mass": np.eye(model.size), "stiffness": np.diag(np.maximum(model.squares, 0.0))}
    return model.projected(model.natural[1], fixed_interface_modes=0, free_modes=0, blocks=(), **exact)


def _lost_digits(model: ReducedModel, file: Path, names: Mapping[str, str]) -> tuple[str, ...]:
    """Return a warning if rounding in a text file changes the natural frequencies of its model."""
    matrices = read_matrices(file)
    rows = dict(zip(model.interface, plain_matrices(model)["selection"], strict=True))
    again, _ = external_model(matrices[names["mass"]], matrices[names["stiffness"]], rows, damping_ratio=0.0)
    frequencies = model.natural_frequencies_hz[model.rigid_modes :]
    change = np.abs(again.natural_frequencies_hz[model.rigid_modes :] / frequencies - 1.0).max(initial=0.0)
    if change <= _NOTABLE:
        return ()
    return (
        f"digits: those of the text change natural frequencies by up to {change:.1e}; --coordinates natural keeps them",
    )


def _left_out(model: ReducedModel, damping: bool, base_load: bool) -> tuple[str, ...]:
    """Return warnings of properties that files of mass, stiffness and perhaps damping and base load omit."""
    lacks = []
    if not damping and model.damping_ratio is None and np.any(model.damping):
        lacks.append("the damping matrix: this format holds none, and the model has no damping ratio")
    if not base_load and np.any(model.base_load):
        lacks.append("the base load: a base acceleration needs it; .op4 and .mat hold it")
    if model.centrifugal_stiffness is not None:
        lacks.append("the centrifugal stiffness: the matrices are those at standstill")
    if model.arms is not None and np.any(model.arms > 0.0):
        lacks.append("which interface coordinates are rotations, and where: planar bodies need them")
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
        temporary.write_text(toml({"matrices": table, "interface": interface}), encoding="utf-8")
