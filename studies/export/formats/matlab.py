"""MATLAB: every result as a .mat file of version 5, which Octave and scipy read as well."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from keyword import iskeyword
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import replacing
from vanedamp.files.toml_input import InputError
from vanedamp.rom.external import plain_matrices
from vanedamp.studies.export.export import ANY
from vanedamp.studies.export.record import ExportRecord
from vanedamp.studies.export.reduced_matrices import DESCRIPTION, describe

SUMMARY = "all variables with units, dimensions and the scene: MATLAB, Octave"
ENDINGS = (".mat",)
OPTIONS = (DESCRIPTION,)
#: bytes of a variable, and letters of a name, that version 5 holds
_MOST_BYTES, _MOST_LETTERS = 2**31 - 1, 63
#: largest number of texts written as cells; more would take minutes and are written as indices in a list of words
_MOST_CELLS = 10_000
_RESERVED = {"case", "catch", "end", "function", "otherwise", "parfor", "persistent", "spmd", "switch"}


def write(record: ExportRecord, path: Path) -> None:
    """Write variables under their names, `units` and `dimensions` of each, and the attributes with the scene."""
    from scipy.io import savemat

    for name, variable in record.variables.items():
        size = np.asarray(variable.values).nbytes
        if size > _MOST_BYTES:
            raise InputError(
                f"{record.file}: {name} has {size / 1e9:.3g} GB, a .mat file holds 2 GB a variable; read it by "
                "MATLAB's h5read"
            )
    dimensions = {name: _cells(list(item.dims)) for name, item in record.variables.items()}
    data: dict[str, Any] = {}
    for name, item in record.variables.items():
        values = np.asarray(item.values)
        if values.dtype.kind not in "UO":
            data[name] = values
        elif values.size <= _MOST_CELLS:
            data[name] = _texts(values)
        else:
            words, codes = np.unique(values.astype(str), return_inverse=True)
            data[name] = 1.0 + codes.reshape(values.shape)
            data[f"{name}_names"] = _texts(words)
    data |= {
        "units": _struct({name: item.units for name, item in record.variables.items()}),
        "dimensions": {_name(name): cells for name, cells in dimensions.items()},
    }
    scene = record.attributes.get("scene") or _scene_of(record.attributes.get("provenance"))
    attributes = {_name(name): value for name, value in _unique(record.attributes.items())}
    data["about"] = _struct({name: value for name, value in attributes.items() if name != "scene"})
    if scene is not None:
        data["scene"] = _struct(scene)
    with replacing(path) as temporary:
        savemat(temporary, dict(_unique(data.items())), long_field_names=True, oned_as="column", do_compression=True)


def reduced_model(record: ExportRecord, path: Path, description: str | None = None) -> None:
    """Write a reduced model; description: the file by which `vanedamp import` reads it back."""
    model = record.reduced_model()
    if description is not None and model.residual_flexibility is not None:
        raise InputError(
            "--description: the matrices of a .mat have no massless boundary, whose flexibility stands beside them; "
            "take .op4"
        )
    write(record, path)
    if description is not None:
        names = {name: name for name in ("mass", "stiffness", "damping", "base_load")}
        describe(model, plain_matrices(model), names, path, description)


WRITERS = {ANY: write, "reduced-model": reduced_model}


def _scene_of(provenance: Any) -> Any:
    return provenance.get("scene") if isinstance(provenance, Mapping) else None


def _texts(values: np.ndarray) -> np.ndarray:
    """Return texts as MATLAB has them: cells."""
    cells = np.empty(values.shape, dtype=object)
    for index, text in np.ndenumerate(values):
        cells[index] = str(text)
    return cells


def _struct(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain data as a struct; an empty one gets a field, since scipy writes no empty structs."""
    return dict(_unique((name, _value(value)) for name, value in data.items())) or {"none": np.zeros((0, 0))}


def _value(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _struct(value)
    if isinstance(value, list | tuple):
        numbers = all(isinstance(item, int | float) and not isinstance(item, bool) for item in value)
        return np.array(value, dtype=float) if numbers and value else _cells([_value(item) for item in value])
    if value is None:
        return np.zeros((0, 0))
    # whole numbers would be integers, whose division rounds in MATLAB
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _cells(items: list[Any]) -> np.ndarray:
    cells = np.empty(len(items), dtype=object)
    cells[:] = items
    return cells


def _unique(items: Iterable[tuple[str, Any]]) -> Iterable[tuple[str, Any]]:
    """Yield items under valid and unique MATLAB names."""
    used: set[str] = set()
    for name, value in items:
        short = unique = _name(name)
        number = 2
        while unique in used:
            unique = f"{short[: _MOST_LETTERS - 4]}_{number}"
            number += 1
        used.add(unique)
        yield unique, value


def _name(text: str) -> str:
    """Return a valid MATLAB name: letters, digits and underscores, a letter first, no keyword."""
    name = re.sub(r"[^0-9A-Za-z_]", "_", text)
    if not name or not name[0].isalpha() or iskeyword(name) or name in _RESERVED:
        name = f"x_{name.lstrip('_')}"
    return name[:_MOST_LETTERS]
