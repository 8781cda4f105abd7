"""The fields of a reduced model, checked: shapes, symmetry, finiteness, and what belongs together."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modal import store

if TYPE_CHECKING:
    from rom.reduced import ReducedModel

_ASYMMETRY = 1e-9
# negative eigenvalues of a semidefinite K, relative to the largest: round-off of the rigid motions of a free structure
_INDEFINITE = 1e-9


class ReducedModelError(ValueError):
    """A reduced model that does not fit together, or a question it cannot answer; the message names the field."""


def checked(model: ReducedModel) -> dict[str, Any]:
    """The fields of a model as they should be: arrays frozen and symmetric, names as text. Raises ReducedModelError."""
    if not model.interface:
        raise ReducedModelError("interface: empty; a reduced model needs a coordinate that loads can act on")
    size, count = len(np.atleast_1d(model.mass)), len(model.interface)
    values: dict[str, Any] = {
        name: symmetric(name, getattr(model, name), size) for name in ("mass", "damping", "stiffness")
    }
    for name, shape in {"selection": (count, size), "directions": (count, 3), "base_load": (size, 3)}.items():
        values[name] = shaped(name, getattr(model, name), shape)
    values["directions"] = _unit(values["directions"])
    if model.normals is not None:
        values["normals"] = shaped("normals", model.normals, (count, 3))
    if model.residual_flexibility is not None:
        values["residual_flexibility"] = symmetric("residual_flexibility", model.residual_flexibility, count)
    if model.outputs:
        values["outputs"] = tuple(str(name) for name in model.outputs)
        values["output_rows"] = shaped("output_rows", model.output_rows, (len(model.outputs), size))
        if model.output_residual is not None:
            values["output_residual"] = shaped("output_residual", model.output_residual, (len(model.outputs), count))
    values["blocks"] = tuple(int(block) for block in model.blocks)
    if model.recovery is not None:
        nodes = len(model.recovery) // 3
        values["recovery"] = shaped("recovery", model.recovery, (3 * nodes, size))
        values["coordinates"] = shaped("coordinates", model.coordinates, (nodes, 3))
        if model.residual_recovery is not None:
            values["residual_recovery"] = shaped("residual_recovery", model.residual_recovery, (3 * nodes, count))
    values["interface"] = tuple(str(label) for label in model.interface)
    values["provenance"] = dict(model.provenance)
    return values


def check_interface(model: ReducedModel) -> None:
    """Raise ReducedModelError unless labels, selection, modes and blocks of a model belong together."""
    twice = sorted({label for label in model.interface if model.interface.count(label) > 1})
    if twice:
        raise ReducedModelError(f"interface: the label {twice[0]!r} occurs twice; labels must be unique")
    residual = model.residual_flexibility
    for index, (label, row) in enumerate(zip(model.interface, model.selection, strict=True)):
        if not np.any(row) and (residual is None or residual[index, index] <= 0):
            raise ReducedModelError(f"selection: the row of {label!r} is zero, so nothing can move it")
    if not 0 <= model.fixed_interface_modes <= model.size:
        raise ReducedModelError(f"fixed_interface_modes: expected 0 to {model.size}, not {model.fixed_interface_modes}")
    if not 0 <= model.free_modes <= model.size or (model.free_modes and model.fixed_interface_modes):
        raise ReducedModelError(f"free_modes: expected 0 to {model.size} and no fixed-interface modes beside them")
    if sum(model.blocks) + model.modes > model.size:
        raise ReducedModelError(f"blocks: {model.blocks} and {model.modes} modes exceed the {model.size} coordinates")
    if np.any(model.selection[:, model.size - model.fixed_interface_modes :]):
        raise ReducedModelError("selection: the last coordinates are fixed-interface modes and must not move it")


def check_definite(squares: np.ndarray) -> None:
    """Raise ReducedModelError for squared angular frequencies, ascending, of a stiffness that is not semidefinite."""
    lowest, highest = squares[[0, -1]]
    if lowest < -_INDEFINITE * highest:
        raise ReducedModelError(
            f"stiffness: not positive semidefinite, the lowest squared angular frequency is {lowest:.3g}"
        )


def _unit(directions: np.ndarray) -> np.ndarray:
    """Directions (k, 3) scaled to length one, to round-off; zeros stay."""
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    return store.frozen(directions / np.where((lengths == 0.0) | np.isclose(lengths, 1.0, rtol=1e-12), 1.0, lengths))


def shaped(name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """A frozen array of that shape, all finite. Raises ReducedModelError."""
    array = store.frozen(values)
    if array.shape != shape:
        raise ReducedModelError(f"{name}: expected shape {shape}, not {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ReducedModelError(f"{name}: holds entries that are not finite")
    return array


def symmetric(name: str, values: Any, size: int) -> np.ndarray:
    """A frozen symmetric matrix (size, size). Raises ReducedModelError."""
    array = shaped(name, values, (size, size))
    if np.abs(array - array.T).max(initial=0.0) > _ASYMMETRY * np.abs(array).max(initial=0.0):
        raise ReducedModelError(f"{name}: not symmetric; if only one triangle is stored, mirror it")
    return store.frozen(0.5 * (array + array.T))
