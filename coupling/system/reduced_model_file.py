"""Reduced models in files, as the scenes that name them take them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError
from vanedamp.rom.checks import ReducedModelError
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless, truncated, with_attachment_modes


def file_stamp(file: str) -> int:
    """Return a number that distinguishes a file from a later one of that name."""
    path = Path(file)
    return path.stat().st_mtime_ns if path.is_file() else 0


def reduced_model(structure: Rom, speed: float) -> ReducedModel:
    """Return the reduced model of a structure at a speed of rotation (rad/s), with its number of modes.

    Raises InputError for an open choice, and for a speed that the model does not have.
    """
    if structure.modes == "auto":
        raise InputError('structure.modes: "auto" is still open; model_order.selection.select_model_order chooses')
    return _restricted(structure, speed, file_stamp(structure.file))


def coordinates_in_file(structure: Rom, speed: float) -> np.ndarray:
    """Return the coordinates (N, n) of `reduced_model` in those of the model's file, q of the file = these @ q."""
    whole = _loaded(structure.file, file_stamp(structure.file))
    # outputs are functionals of the coordinates, which follow these through every change: so do the coordinates
    own = tuple(str(index) for index in range(whole.size))
    marked = replace(whole, outputs=own, output_rows=np.eye(whole.size), output_residual=None)
    rows = _cut(marked.at_speed(speed), structure).output_rows
    assert rows is not None
    return rows


def greatest_speed(structure: Rom) -> float:
    """Return the speed of rotation, rad/s, up to which the model of a file holds; 0 for one that does not rotate."""
    return _loaded(structure.file, file_stamp(structure.file)).greatest_speed


def mass_in_file(structure: Rom) -> np.ndarray:
    """Return the mass matrix (N, N) in the coordinates of the model's file, kg."""
    return _loaded(structure.file, file_stamp(structure.file)).mass


@lru_cache(maxsize=8)
def _restricted(structure: Rom, speed: float, stamp: int) -> ReducedModel:
    try:
        model = _loaded(structure.file, stamp).at_speed(speed)
    except ReducedModelError as error:
        raise InputError(f"rotation: {structure.file}: {error}") from None
    return _cut(model, structure)


def _cut(model: ReducedModel, structure: Rom) -> ReducedModel:
    """Return a model at its speed with the structure's number of modes."""
    modes = structure.modes
    if modes is None:
        return model
    assert isinstance(modes, int)
    if structure.attached:
        return with_attachment_modes(model, modes)
    return massless(model, modes) if structure.natural else truncated(model, modes)


@lru_cache(maxsize=8)
def _loaded(file: str, _stamp: int) -> ReducedModel:
    return ReducedModel.load(file)
