"""Reduced models in files, as the scenes that name them take them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError
from vanedamp.rom.checks import ReducedModelError
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless, truncated, with_attachment_modes


def file_stamp(file: str) -> int:
    """Return a number that distinguishes a file from a later one of that name."""
    path = Path(file)
    return path.stat().st_mtime_ns if path.is_file() else 0


def reduced_model(structure: Rom, speed: float = 0.0) -> ReducedModel:
    """Return the reduced model of a structure at a speed of rotation (rad/s), with its number of modes.

    Raises InputError for an open choice, and for a speed that the model does not have.
    """
    if structure.modes == "auto":
        raise InputError('structure.modes: "auto" is still open; model_order.selection.select_model_order chooses')
    return _restricted(
        structure.file, file_stamp(structure.file), speed, structure.modes, structure.natural, structure.attached
    )


@lru_cache(maxsize=8)
def _restricted(file: str, stamp: int, speed: float, modes: int | None, natural: bool, attached: bool) -> ReducedModel:
    try:
        model = _loaded(file, stamp).at_speed(speed)
    except ReducedModelError as error:
        raise InputError(f"rotation: {file}: {error}") from None
    if modes is None:
        return model
    if attached:
        return with_attachment_modes(model, modes)
    return massless(model, modes) if natural else truncated(model, modes)


@lru_cache(maxsize=8)
def _loaded(file: str, _stamp: int) -> ReducedModel:
    return ReducedModel.load(file)
