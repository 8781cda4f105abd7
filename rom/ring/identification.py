"""Deviations of a ring's sectors from its measured modes, or from measured responses to an engine order.

In the waves of the tuned ring, deviations d_j of the stiffness act on a motion beta at omega by

    sum of d_j K_j beta = load - (Lambda - omega^2 + 2 i zeta omega sqrt(Lambda)) beta,

linear in the deviations, with load and damping left out for natural modes: the fundamental mistuning model (Feiner and
Griffin 2004, J. Turbomach. 126(1)) with the sectors' own stiffness. The displacement of one coordinate in every
sector gives the N waves of one family; the other waves follow from the deviations, in a few iterations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.record import Array, Coded, Record
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.forced import load_of, place_of
from vanedamp.rom.ring.ring_model import RingModel

_ROUNDS = 30
_CONVERGED = 1e-10
# relative to the largest singular value: the deviation of a sector that is never strained cannot be identified
_UNSEEN = 1e-8


def _encode_force(force: complex) -> list[float] | None:
    return [force.real, force.imag] if force else None


_Force = Annotated[complex, Coded(_encode_force, lambda parts, _: complex(*parts))]


@dataclass(frozen=True, eq=False, repr=False)
class Identified(Record):
    """Deviations of the stiffness of a ring's sectors from measurements."""

    KIND: ClassVar[str] = "deviations"
    stiffness: Annotated[np.ndarray, Array(("sector",), name="deviation")]
    """relative deviations of the part that deviates"""
    errors: Annotated[np.ndarray, Array(("sector",), name="error")]
    """their standard deviations, from the misfit; nan without more equations than deviations"""
    misfit: float
    """root mean square residual of the equations, relative to omega^2 beta"""
    force: _Force = 0j
    """per unit of the responses' load as given, complex; 0 for natural modes [N]"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def labels(self) -> dict[str, Any]:
        """Return the numbers of the sectors."""
        return {"sector": np.arange(len(self.stiffness))}

    @property
    def deviations(self) -> Deviations:
        """The same as deviations of the stiffness."""
        return Deviations(stiffness=self.stiffness)


def deviations_of_modes(
    ring: RingModel, frequencies_hz: np.ndarray, shapes: np.ndarray, label: str, family: int = 0
) -> Identified:
    """Return deviations from measured natural frequencies (m,) and shapes (m, N) over the sectors, of any scale.

    label   interface label of a sector where the shapes were measured
    family  of the tuned ring to which the modes belong, from 0

    Raises RingError for shapes that do not fit, an unknown label, and motions that leave a sector at rest.
    """
    return _identified(ring, np.asarray(frequencies_hz, float), np.asarray(shapes, complex), label, family, None)


def deviations_of_responses(
    ring: RingModel, frequencies_hz: np.ndarray, responses: np.ndarray, label: str, order: int, family: int = 0
) -> Identified:
    """Return deviations from measured complex responses (f, N) to an engine order at a label, of unknown amplitude.

    The force is the same at all frequencies. Other arguments and errors: see `deviations_of_modes`.
    """
    return _identified(ring, np.asarray(frequencies_hz, float), np.asarray(responses, complex), label, family, order)


def _identified(
    ring: RingModel, frequencies_hz: np.ndarray, motions: np.ndarray, label: str, family: int, order: int | None
) -> Identified:
    if motions.shape != (len(frequencies_hz), ring.sectors):
        raise RingError(f"shapes: expected {(len(frequencies_hz), ring.sectors)} values, not {motions.shape}")
    members, rows = _family(ring, family), ring.rows[:, place_of(ring.interface, label)]
    others = np.setdiff1d(np.arange(len(ring.squares)), members)
    squares = (2.0 * np.pi * frequencies_hz) ** 2
    deviations, other_waves = np.zeros(ring.sectors), np.zeros((len(squares), len(others)), complex)
    for _ in range(_ROUNDS):
        betas = np.zeros((len(squares), len(ring.squares)), complex)
        betas[:, members] = np.linalg.solve(rows[:, members], (motions - other_waves @ rows[:, others].T).T).T
        betas[:, others] = other_waves
        equations, right = _equations(ring, squares, betas, members, label, order)
        solution, errors, misfit = _least_squares(equations, right, ring.sectors)
        before, deviations = deviations, solution[: ring.sectors]
        force = complex(*solution[ring.sectors :]) if order is not None else 0j
        load = force * load_of(ring, order or 0, label)[others]
        other_waves = _others(ring, deviations, squares, betas[:, members], members, others, load)
        if np.abs(deviations - before).max() <= _CONVERGED:
            break
    return Identified(deviations, errors, misfit, force)


def _family(ring: RingModel, family: int) -> np.ndarray:
    """Return the indices (N,) of a family's waves among the coordinates of a ring."""
    diameters = ring.diameters[: ring.modes]
    pairs = [1 + (0 < 2 * number < ring.sectors) for number in range(ring.sectors // 2 + 1)]
    members = [np.flatnonzero(diameters == number)[family * size :][:size] for number, size in enumerate(pairs)]
    if any(len(waves) < size for waves, size in zip(members, pairs, strict=True)):
        raise RingError(f"family: the ring has no family {family} of all nodal diameters; keep more, or name another")
    return np.concatenate(members)


def _equations(
    ring: RingModel, squares: np.ndarray, betas: np.ndarray, members: np.ndarray, label: str, order: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix and right-hand side of the real equations of the family's waves, relative to omega^2 beta."""
    scale = 1.0 / (squares * np.linalg.norm(betas[:, members], axis=1))
    waves, forces = ring.waves, np.empty((len(squares), len(members), ring.sectors), complex)
    for sector in range(ring.sectors):  # K_j beta: to the sector's fields and back
        strained = waves.at_sector(betas, -sector) @ ring.stiffness
        forces[:, :, sector] = waves.at_sector(strained, sector)[:, members]
    tuned = ring.squares[members] - squares[:, None]
    columns = [forces]
    if order is not None:
        tuned = tuned + 2j * ring.damping_ratio * np.sqrt(squares[:, None] * ring.squares[members])
        load = load_of(ring, order, label)[members]
        columns.append(-np.broadcast_to(np.stack([load, 1j * load], axis=-1), (len(squares), len(members), 2)))
    matrix = scale[:, None, None] * np.concatenate(columns, axis=2)
    right = -scale[:, None] * tuned * betas[:, members]
    matrix, right = matrix.reshape(-1, matrix.shape[2]), right.ravel()
    return np.vstack([matrix.real, matrix.imag]), np.concatenate([right.real, right.imag])


def _least_squares(matrix: np.ndarray, right: np.ndarray, sectors: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the solution, standard deviations (N,) of the deviations, and the misfit."""
    size = np.linalg.norm(matrix, axis=0)
    if not np.all(size > 0.0):
        raise RingError(f"shapes: sector {int(np.argmin(size))} is at rest in all of them; measure more modes")
    u, values, v = np.linalg.svd(matrix / size, full_matrices=False)
    if values[-1] <= _UNSEEN * values[0]:
        raise RingError("shapes: they do not determine all deviations; measure more modes or frequencies")
    solution = v.T @ ((u.T @ right) / values) / size
    residual = matrix @ solution - right
    active = int(np.count_nonzero(np.abs(matrix).max(axis=1) > 0.0))
    spread = np.linalg.norm(v.T / values, axis=1) / size * np.linalg.norm(residual)
    freedom = active - matrix.shape[1]
    errors = spread / np.sqrt(freedom) if freedom > 0 else np.full(len(spread), np.nan)
    return solution, errors[:sectors], float(np.linalg.norm(residual) / np.sqrt(max(active, 1)))


def _others(
    ring: RingModel, deviations: np.ndarray, squares: np.ndarray, betas: np.ndarray, members: np.ndarray,
    others: np.ndarray, load: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return the other waves (m, r), complex, due to a load (r,) and to the deviations' forces on a family (m, N)."""
    added = ring.around("stiffness", deviations)
    rigid = np.diag(ring.squares[others]) + added[np.ix_(others, others)]
    forces = load - betas @ added[np.ix_(members, others)]
    solved = [
        np.linalg.solve(rigid - square * np.eye(len(others)), force)
        for square, force in zip(squares, forces, strict=True)
    ]
    return np.array(solved).reshape(len(squares), len(others))
