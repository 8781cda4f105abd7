"""The record of a reduced model: HDF5 that xarray opens."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from modal import store

if TYPE_CHECKING:
    from rom.reduced import ReducedModel

_KIND = "reduced-model"


def save(model: ReducedModel, path: str | os.PathLike[str]) -> None:
    """Write the record."""
    square = ("row", "column")
    variables = {
        "mass": store.Variable(model.mass, square, "kg"),
        "damping": store.Variable(model.damping, square, "N s/m"),
        "stiffness": store.Variable(model.stiffness, square, "N/m"),
        "interface": store.Variable(np.array(model.interface, dtype=object), ("interface",)),
        "axis": store.Variable(np.array(["x", "y", "z"], dtype=object), ("axis",)),
        "selection": store.Variable(model.selection, ("interface", "column")),
        "directions": store.Variable(model.directions, ("interface", "axis")),
        "base_load": store.Variable(model.base_load, ("row", "axis"), "kg"),
        "natural_frequency": store.Variable(model.natural_frequencies_hz, ("mode",), "Hz"),
    }
    if model.normals is not None:
        variables["normals"] = store.Variable(model.normals, ("interface", "axis"))
    if model.recovery is not None and model.coordinates is not None:
        variables["recovery"] = store.Variable(model.recovery, ("dof", "column"))
        variables["coordinates"] = store.Variable(model.coordinates, ("node", "axis"), "m")
    if model.residual_flexibility is not None:
        variables["residual_flexibility"] = store.Variable(model.residual_flexibility, ("interface", "force"), "m/N")
    if model.outputs:
        variables["output"] = store.Variable(np.array(model.outputs, dtype=object), ("output",))
        variables["output_rows"] = store.Variable(model.output_rows, ("output", "column"))
        if model.output_residual is not None:
            variables["output_residual"] = store.Variable(model.output_residual, ("output", "force"))
    if model.residual_recovery is not None:
        variables["residual_recovery"] = store.Variable(model.residual_recovery, ("dof", "force"), "m/N")
    if model.blocks:
        variables["blocks"] = store.Variable(np.array(model.blocks, np.int64), ("block",))
    attributes = {
        "fixed_interface_modes": model.fixed_interface_modes,
        "free_modes": model.free_modes,
        "provenance": dict(model.provenance),
    }
    if model.damping_ratio is not None:
        attributes["damping_ratio"] = model.damping_ratio
    store.save(path, _KIND, variables, attributes)


def load(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The fields of the model whose record `save` wrote. Raises modal.store.StoreError."""
    values, attributes = store.load(path, _KIND)
    fields = {name: values[name] for name in ("mass", "damping", "stiffness", "selection", "directions", "base_load")}
    for name, field in fields.items():
        if np.iscomplexobj(field):
            raise store.StoreError(f"{path}: {name}: expected real numbers, not complex ones")
        if not np.all(np.isfinite(field)):
            raise store.StoreError(f"{path}: {name}: holds entries that are not finite")
    return dict(
        **fields,
        interface=tuple(values["interface"]),
        damping_ratio=attributes.get("damping_ratio"),
        fixed_interface_modes=attributes["fixed_interface_modes"],
        free_modes=attributes.get("free_modes", 0),
        blocks=tuple(values.get("blocks", ())),
        residual_flexibility=values.get("residual_flexibility"),
        outputs=tuple(values.get("output", ())),
        output_rows=values.get("output_rows"),
        output_residual=values.get("output_residual"),
        residual_recovery=values.get("residual_recovery"),
        normals=values.get("normals"),
        provenance=json.loads(attributes["provenance"]),
        recovery=values.get("recovery"),
        coordinates=values.get("coordinates"),
    )
