"""Outputs of a reduced model: displacements and stresses at named points as functionals of its coordinates.

Displacements and the six components of a stress are linear in the displacements, so each is a row over the reduced
coordinates: made once from the basis, and the full model is not needed again. Von Mises stress is not linear: it is
taken of the components' histories.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vanedamp.modal.algebra import first_largest
from vanedamp.rom.reduced import ReducedModel, ReducedModelError

#: components of a symmetric stress, in the order of the outputs "<name>.xx" ...
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
#: fraction of a mode's largest stress over strength from which hot spots show it
SHOWN = 0.9


def with_outputs(
    model: ReducedModel, rows: Mapping[str, np.ndarray], residual: Mapping[str, np.ndarray] | None = None
) -> ReducedModel:
    """Return the model with more outputs: name -> row (n,) over its coordinates.

    residual: name -> row (k,) over the interface's forces, of a massless boundary. Raises ReducedModelError for a name
    that exists already or a row of the wrong length.
    """
    twice = sorted(set(rows) & set(model.outputs))
    if twice:
        raise ReducedModelError(f"outputs: there is an output {twice[0]!r} already; take another name")
    none = np.zeros(len(model.interface))
    before = () if model.output_rows is None else tuple(model.output_rows)
    static = None
    if residual or model.output_residual is not None:
        existing = np.zeros((len(before), len(none))) if model.output_residual is None else model.output_residual
        static = np.vstack([existing, *((residual or {}).get(name, none) for name in rows)])
    return replace(
        model, outputs=(*model.outputs, *rows), output_rows=np.vstack([*before, *rows.values()]), output_residual=static
    )


def with_displacements(model: ReducedModel, points: Mapping[str, Sequence[float] | np.ndarray]) -> ReducedModel:
    """Add outputs "<name>.x", "<name>.y", "<name>.z", m: displacements of the nodes nearest to named points (3,).

    Raises ReducedModelError for a model without recovery.
    """
    if model.recovery is None or model.coordinates is None:
        raise ReducedModelError("recovery: this model was reduced without its basis; reduce with keep_recovery=True")
    rows, residual = {}, {}
    for name, point in points.items():
        node = first_largest(-np.linalg.norm(model.coordinates - np.asarray(point, dtype=float), axis=1))
        for index, axis in enumerate("xyz"):
            rows[f"{name}.{axis}"] = model.recovery[3 * node + index]
            if model.residual_recovery is not None:
                residual[f"{name}.{axis}"] = model.residual_recovery[3 * node + index]
    return with_outputs(model, rows, residual)


def with_stresses(
    model: ReducedModel, stresses: Mapping[str, np.ndarray], residual: Mapping[str, np.ndarray] | None = None
) -> ReducedModel:
    """Add outputs "<name>.xx" ... "<name>.zx", Pa, from the stresses (6, n) of the basis at named points.

    residual: the same (6, k) of the residual fields of a massless boundary.
    """
    return with_outputs(
        model, _rows(stresses, model.size), None if residual is None else _rows(residual, len(model.interface))
    )


def hot_spots(model: ReducedModel) -> dict[str, dict[str, Any]]:
    """Return the data in the provenance on places with outputs of all six components: name -> facts.

    coordinates (m), group (of the mesh's volumes), mode (that has its hot spot there: "number", from 1,
    "frequency_hz", and the next), per_amplitude ("at", "von_mises": Pa/m of the first mode, "error": estimated,
    relative), error (of the mode's stress), static (by cause, six components: "rotation" per squared speed in rad/s,
    "temperature"), static_error (by cause, of von Mises stress in the same unit), singular (the singular point of
    elasticity that it is at), fatigue (data of the material); each where it is known.
    """
    recorded, names = model.provenance.get("hot_spots", {}), [name.rpartition(".") for name in model.outputs]
    spots = dict.fromkeys(spot for spot, _, component in names if component == COMPONENTS[0])
    facts_of = {}
    for spot in spots:
        if {f"{spot}.{component}" for component in COMPONENTS} <= set(model.outputs):
            facts = recorded.get(spot, {})
            # files before version 0.3 have only coordinates
            facts_of[spot] = dict(facts) if isinstance(facts, Mapping) else {"coordinates": list(facts)}
    return facts_of


def shown_modes(provenance: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Return the frequency, Hz, of every mode that strains a model, and the fraction of its largest stress over
    strength that the hot spots show; empty for models without either.
    """
    modes = provenance.get("hot_spot_modes", {})
    return list(zip(modes.get("frequency_hz", ()), modes.get("shown", ()), strict=True))


def _rows(stresses: Mapping[str, np.ndarray], size: int) -> dict[str, np.ndarray]:
    for name, values in stresses.items():
        if np.shape(values) != (6, size):
            raise ReducedModelError(f"stress {name!r}: expected shape (6, {size}), not {np.shape(values)}")
    return {
        f"{name}.{component}": np.asarray(values)[index]
        for name, values in stresses.items()
        for index, component in enumerate(COMPONENTS)
    }
