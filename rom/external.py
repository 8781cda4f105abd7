"""Reduced models of other codes: small dense M, K (and C) from npz, Matrix Market, Abaqus and Nastran files, and back.

Coordinates without mass, such as boundary points that another code's reduction left without any, are condensed: their
additional static flexibility becomes the model's residual flexibility, a massless boundary.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import symmetric_part
from vanedamp.rom import checks
from vanedamp.rom.reduced import ReducedModel

# relative to the largest entry or eigenvalue: other codes write 5 to 9 digits, the last of which are not symmetric
_ASYMMETRY = 1e-6
_INDEFINITE = 1e-6


class ExternalError(VanedampError):
    """Matrices of another code that cannot be read or are no structure's; the message names the file or the matrix."""


@dataclass(frozen=True)
class Findings:
    """Results of the checks of given matrices.

    asymmetry      largest of the matrices', relative
    definiteness   of mass and of stiffness: lowest eigenvalue relative to the highest, diagonal scaled to one
    rigid_motions  number of motions that no support holds (ReducedModel.rigid_modes)
    condensed      number of coordinates without mass
    """

    asymmetry: float
    definiteness: tuple[float, float]
    rigid_motions: int
    condensed: int


def plain_matrices(model: ReducedModel) -> dict[str, np.ndarray]:
    """Return mass, stiffness, damping (m, m), selection (k, m) and base_load (m, 3) of a model, as other codes take it.

    A residual flexibility V diag(s) V^T becomes further coordinates without mass, of stiffness 1 / s, by which the
    interface moves by V: `external_model` condenses them into the same flexibility again.
    """
    matrices = {
        name: np.array(getattr(model, name)) for name in ("mass", "stiffness", "damping", "selection", "base_load")
    }
    if model.residual_flexibility is None:
        return matrices
    values, vectors = linalg.eigh(model.residual_flexibility)
    flexible = values > np.finfo(float).eps * len(values) * values[-1]
    springs = {"mass": 0.0 * values[flexible], "damping": 0.0 * values[flexible], "stiffness": 1.0 / values[flexible]}
    matrices |= {name: linalg.block_diag(matrices[name], np.diag(added)) for name, added in springs.items()}
    matrices["selection"] = np.hstack([matrices["selection"], vectors[:, flexible]])
    matrices["base_load"] = np.vstack([matrices["base_load"], np.zeros((int(flexible.sum()), 3))])
    return matrices


def external_model(
    mass: np.ndarray,
    stiffness: np.ndarray,
    interface: Mapping[str, int | Sequence[float] | np.ndarray],
    *,
    damping: np.ndarray | None = None,
    damping_ratio: float | None = None,
    directions: Mapping[str, Sequence[float]] | None = None,
    base_load: np.ndarray | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> tuple[ReducedModel, Findings]:
    """Return a checked model of given matrices (n, n), with the findings of the checks.

    interface: label -> the coordinate's index, from 0, or a row (n,) over the coordinates. The other arguments are
    as in ReducedModel.from_matrices. Raises ExternalError for matrices that are not symmetric or not (semi)definite
    beyond the digits of a text file, and ReducedModelError for parts that do not fit together.
    """
    matrices = {"mass": mass, "stiffness": stiffness} | ({} if damping is None else {"damping": damping})
    arrays = matrices | ({} if base_load is None else {"base_load": base_load})
    for name, matrix in arrays.items():
        if np.iscomplexobj(matrix) and np.any(np.imag(matrix)):
            raise ExternalError(
                f"{name}: complex; give real matrices, and damping or damping_ratio (structural damping K (1 + i eta): "
                "eta / 2)"
            )
    matrices = {name: np.array(np.real(matrix), dtype=float) for name, matrix in matrices.items()}
    base_load = None if base_load is None else np.real(base_load)
    for name, matrix in matrices.items():
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape != matrices["mass"].shape:
            raise ExternalError(f"{name}: shape {matrix.shape}; expected square matrices of one size")
        if not np.all(np.isfinite(matrix)) or not np.any(matrix):
            raise ExternalError(f"{name}: zero, or holds entries that are not finite")
        checks.check_size(name, matrix)
    checks.check_mass(matrices["mass"])
    for name in ("mass", "stiffness"):
        index = int(np.argmin(np.diag(matrices[name])))
        if matrices[name][index, index] < 0.0:
            raise ExternalError(
                f"{name}: not positive definite: coordinate {index} has {matrices[name][index, index]:.3g} on the "
                "diagonal, which is negative; check its sign"
            )
    asymmetry, worst = max((checks.asymmetry(matrix), name) for name, matrix in matrices.items())
    if asymmetry > _ASYMMETRY:
        raise ExternalError(f"{worst}: not symmetric ({asymmetry:.1e}); if only one triangle is stored, mirror it")
    matrices = {name: symmetric_part(matrix) for name, matrix in matrices.items()}
    size = len(mass)
    rows = {label: _row(label, coordinate, size) for label, coordinate in interface.items()}
    massless = ~np.any(matrices["mass"], axis=0)
    definiteness = {}
    for name, retained in (("mass", ~massless), ("stiffness", matrices["stiffness"].any(axis=0))):
        value = definiteness[name] = checks.definiteness(matrices[name][np.ix_(retained, retained)])
        if value < -_INDEFINITE:
            raise ExternalError(f"{name}: not positive definite (lowest eigenvalue {value:.1e} of the highest)")
    residual = None
    if np.any(massless):
        matrices, rows, base_load, residual = _condensed(matrices, rows, base_load, massless)
    model = ReducedModel.from_matrices(
        matrices["mass"], matrices["stiffness"], rows, damping=matrices.get("damping"), damping_ratio=damping_ratio,
        directions=directions, base_load=base_load, residual_flexibility=residual, provenance=dict(provenance or {}),
    )  # fmt: skip
    lowest = definiteness["mass"], definiteness["stiffness"]
    return model, Findings(asymmetry, lowest, model.rigid_modes, int(massless.sum()))


def _condensed(
    matrices: dict[str, np.ndarray], rows: dict[str, np.ndarray], base_load: np.ndarray | None, massless: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray | None, np.ndarray]:
    """Condense coordinates without mass: they follow the others and the interface's forces statically."""
    stiffness = matrices["stiffness"]
    if "damping" in matrices and np.any(matrices["damping"][massless]):
        raise ExternalError("damping: acts on coordinates without mass; give damping_ratio, or condense these before")
    try:
        inner = linalg.cho_factor(stiffness[np.ix_(massless, massless)])
    except linalg.LinAlgError as error:
        raise ExternalError("stiffness: coordinates without mass are held by nothing; remove them") from error
    retained = ~massless
    basis = np.zeros((len(stiffness), int(retained.sum())))
    basis[retained] = np.eye(basis.shape[1])
    basis[massless] = -linalg.cho_solve(inner, stiffness[np.ix_(massless, retained)])
    boundary = np.array(list(rows.values()))[:, massless]
    residual = boundary @ linalg.cho_solve(inner, boundary.T)
    return (
        {name: basis.T @ matrix @ basis for name, matrix in matrices.items()},
        {label: row @ basis for label, row in rows.items()},
        None if base_load is None else basis.T @ base_load,
        symmetric_part(residual),
    )


def _row(label: str, coordinate: int | Sequence[float] | np.ndarray, size: int) -> np.ndarray:
    if isinstance(coordinate, int | np.integer):
        if not 0 <= coordinate < size:
            raise ExternalError(f"interface {label!r}: coordinate {coordinate} out of 0 to {size - 1}")
        return np.eye(size)[coordinate]
    return np.asarray(coordinate, dtype=float)
