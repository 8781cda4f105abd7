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
from vanedamp.studies.export.export import ANY
from vanedamp.studies.export.options import Option
from vanedamp.studies.export.record import Record

SUMMARY = "all variables with units, dimensions and the scene: MATLAB, Octave"
ENDINGS = (".mat",)
OPTIONS: tuple[Option, ...] = ()
#: bytes of a variable, and letters of a name, that version 5 holds
_MOST_BYTES, _MOST_LETTERS = 2**31 - 1, 63
_RESERVED = {"case", "catch", "end", "function", "otherwise", "parfor", "persistent", "spmd", "switch"}


def write(record: Record, path: Path) -> None:
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
    data = {name: _array(np.asarray(item.values)) for name, item in record.variables.items()}
    data |= {
        "units": _struct({name: item.units for name, item in record.variables.items()}),
        "dimensions": {_name(name): cells for name, cells in dimensions.items()},
    }
    scene = record.attributes.get("scene") or _scene_of(record.attributes.get("provenance"))
    taken = {_name(name): value for name, value in _unique(record.attributes.items())}
    data["about"] = _struct({name: value for name, value in taken.items() if name != "scene"})
    if scene is not None:
        data["scene"] = _struct(scene)
    with replacing(path) as temporary:
        savemat(temporary, dict(_unique(data.items())), long_field_names=True, oned_as="column", do_compression=True)


WRITERS = {ANY: write}


def _scene_of(provenance: Any) -> Any:
    return provenance.get("scene") if isinstance(provenance, Mapping) else None


def _array(values: np.ndarray) -> Any:
    """Return an array as MATLAB has it: texts as cells, numbers as they are."""
    if values.dtype.kind in "UO":
        cells = np.empty(values.shape, dtype=object)
        for place, text in np.ndenumerate(values):
            cells[place] = str(text)
        return cells
    return values


def _struct(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain data as a struct; one without fields has one, since scipy writes none."""
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
    """Yield items under names that MATLAB takes, each once."""
    seen: set[str] = set()
    for name, value in items:
        short = own = _name(name)
        number = 2
        while own in seen:
            own = f"{short[: _MOST_LETTERS - 4]}_{number}"
            number += 1
        seen.add(own)
        yield own, value


def _name(text: str) -> str:
    """Return a name as MATLAB takes it: letters, digits and underscores, a letter first, no keyword."""
    name = re.sub(r"[^0-9A-Za-z_]", "_", text)
    if not name or not name[0].isalpha() or iskeyword(name) or name in _RESERVED:
        name = f"x_{name.lstrip('_')}"
    return name[:_MOST_LETTERS]
