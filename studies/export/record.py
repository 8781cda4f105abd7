"""Records of any kind with their dimensions and units, the input of formats."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from vanedamp.files import store
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import InputError

if TYPE_CHECKING:
    from vanedamp.rom.reduced import ReducedModel


class Saved(Protocol):
    """A result that can be saved: Sweep, Response, ReducedModel, ..."""

    def save(self, path: str | Path) -> None:
        """Write the result's HDF5 file."""


class ExportRecord(NamedTuple):
    """A record: its file or object, file name, kind, variables by name, and attributes as plain data."""

    source: Any
    file: str
    kind: str
    variables: dict[str, Variable]
    attributes: dict[str, Any]

    def values(self, name: str) -> np.ndarray:
        """Return the values of a variable. Raises StoreError where the record has none."""
        if name not in self.variables:
            raise store.StoreError(f"{self.file}: holds no {name!r}; the record is not whole, write it again")
        return np.asarray(self.variables[name].values)

    def reduced_model(self) -> ReducedModel:
        """Return the reduced model of a record of one. Raises StoreError."""
        from vanedamp.rom.reduced import ReducedModel

        return self.source if isinstance(self.source, ReducedModel) else ReducedModel.load(self.source)


def read_record(result: str | os.PathLike[str] | Saved) -> ExportRecord:
    """Return the record of a result, in a file or in memory. Raises StoreError."""
    if isinstance(result, str | os.PathLike):
        kind, variables, attributes = store.load_any(result)
        return ExportRecord(
            result, str(result), kind, variables, {name: _decoded(value) for name, value in attributes.items()}
        )
    if not hasattr(result, "save"):
        raise InputError(f"result: expected a result or its file, not {type(result).__name__}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "result.h5"
        result.save(file)
        return read_record(file)._replace(source=result, file=type(result).__name__)


def _decoded(value: Any) -> Any:
    """Return plain data of an attribute that is JSON text."""
    if isinstance(value, str) and value[:1] in ("{", "["):
        try:
            return json.loads(value)
        except (json.JSONDecodeError, RecursionError):
            return value
    return value
