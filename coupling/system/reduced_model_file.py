"""Reduced models in files, as the scenes that name them take them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless, truncated, with_attachment_modes


def file_stamp(file: str) -> int:
    """Return a number that distinguishes a file from a later one of that name."""
    path = Path(file)
    return path.stat().st_mtime_ns if path.is_file() else 0


def reduced_model(structure: Rom) -> ReducedModel:
    """Return the reduced model of a structure, with its number of modes. Raises InputError for an open choice."""
    if structure.modes == "auto":
        raise InputError('structure.modes: "auto" is still open; model_order.selection.select_model_order chooses')
    return _restricted(
        structure.file, file_stamp(structure.file), structure.modes, structure.natural, structure.attached
    )


@lru_cache(maxsize=8)
def _restricted(file: str, _stamp: int, modes: int | None, natural: bool, attached: bool) -> ReducedModel:
    model = ReducedModel.load(file)
    if modes is None:
        return model
    if attached:
        return with_attachment_modes(model, modes)
    return massless(model, modes) if natural else truncated(model, modes)
