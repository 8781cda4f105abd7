"""Structures that the trials of the model order run on."""

from __future__ import annotations

import math

import numpy as np

from benchmarks import CLUSTER_CASE
from vanedamp.files.toml_input import read_toml, validate
from vanedamp.rom.reduced import ReducedModel


def cluster_model(degree: int, modes: int) -> ReducedModel:
    """Return the shipped cluster with the given number of fixed-interface modes."""
    from vanedamp.meshes.vane_cluster import SHIPPED
    from vanedamp.studies.case.stages import assemble, reduction
    from vanedamp.studies.case.tables import Case

    data = read_toml(CLUSTER_CASE)
    data["mesh"] = {"file": str(SHIPPED), "degree": degree}
    return reduction(assemble(validate(Case, data, CLUSTER_CASE.name)), modes)


_ROD_MODES, _BEAM_ELEMENTS, _CLUSTER_MODES = 40, 8, 12


def rod_model(modes: int = _ROD_MODES, per_stiffness: float | None = None) -> ReducedModel:
    """Return a clamped unit rod in Craig-Bampton form: constraint mode x, fixed-interface modes sqrt(2) sin(j pi x).

    per_stiffness: s, damping in proportion to the stiffness; left out: the damping ratio 0.01 of every mode.
    """
    order = np.arange(1, modes + 1)
    mass, stiffness = np.eye(modes + 1), np.diag(np.append(1.0, (order * np.pi) ** 2))
    mass[0, 0] = 1.0 / 3.0
    mass[0, 1:] = mass[1:, 0] = -math.sqrt(2.0) * (-1.0) ** order / (order * np.pi)
    return ReducedModel.from_matrices(
        mass, stiffness, {"tip": np.eye(modes + 1)[0]},
        damping=None if per_stiffness is None else per_stiffness * stiffness,
        damping_ratio=0.01 if per_stiffness is None else None,
        fixed_interface_modes=modes,
    )  # fmt: skip


def beam_model(*others: int) -> ReducedModel:
    """Return a clamped unit beam in bending, of cubic elements (Euler and Bernoulli); "tip", and "node <k>"."""
    h = 1.0 / _BEAM_ELEMENTS
    stiffness = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]) / h**3
    mass = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420.0
    size = 2 * _BEAM_ELEMENTS + 2
    whole = np.zeros((2, size, size))
    turn = np.array([1.0, h, 1.0, h])
    for element in range(_BEAM_ELEMENTS):
        place = slice(2 * element, 2 * element + 4)
        whole[:, place, place] += np.array([mass, stiffness]) * np.outer(turn, turn)
    rows = {"tip": np.eye(size - 2)[size - 4]} | {f"node {k}": np.eye(size - 2)[2 * k - 2] for k in others}
    return ReducedModel.from_matrices(whole[0, 2:, 2:], whole[1, 2:, 2:], rows, damping_ratio=0.005)
