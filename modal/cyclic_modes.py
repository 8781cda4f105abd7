"""Modes of a ring of equal sectors: frequencies over nodal diameters, and shapes on one sector."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.algebra import first_largest
from vanedamp.modal.cyclic import CyclicSector, Diameter
from vanedamp.modal.eigen import NoModesError, solve_modes
from vanedamp.modal.iterative import chosen
from vanedamp.modal.petsc import one_analysis
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.records.ring_modes import RingModes

# fraction of a field's squared length: smaller ones are round-off of dependent fields
_DEPENDENT = 1e-12


class Family(NamedTuple):
    """Modes of one diameter: frequencies (k,), Hz, residuals (k,) and complex shapes (k, n)."""

    diameter: int
    frequencies_hz: np.ndarray
    residuals: np.ndarray
    shapes: np.ndarray


def ring_modes(
    sector: CyclicSector,
    count: int = 10,
    max_frequency: float | None = None,
    diameters: Iterable[int] | None = None,
    report: Callable[[int, int], None] | None = None,
    solver: str = "auto",
) -> RingModes:
    """Return the lowest `count` modes of every nodal diameter, or all up to `max_frequency` (Hz).

    diameters  the ones wanted (default: all)
    report     called with the number of diameters done, and of all
    solver     as in modal.eigen.solve_modes, whose counts prove that no mode of a diameter is missed

    Raises CyclicError for a diameter that the ring does not have, and SolverError.
    """
    wanted = list(sector.diameters if diameters is None else diameters)
    families: list[Family] = []
    # two factors are kept: where the memory may not hold them, each diameter is analysed by itself
    roomy = chosen("auto", 2 * 2 * sector.matrices.size)["name"] == "factor"
    with one_analysis() if roomy else contextlib.nullcontext():
        for done, number in enumerate(wanted):
            if report is not None:
                report(done, len(wanted))
            problem = sector.at(number)
            most = min((2 if problem.travels else 1) * count, problem.matrices.free.size)
            try:
                modes = solve_modes(problem.matrices, most, max_frequency, solver=solver)
            except NoModesError:
                continue
            families.append(_of_diameter(sector, problem, modes))
            provenance = modes.provenance
    if not families:
        raise NoModesError(f"max_frequency: the ring has no mode up to {max_frequency} Hz; raise it")
    return gathered(sector, families, dict(sector.matrices.provenance) | {"solver": provenance["solver"]})


def gathered(sector: CyclicSector, families: Sequence[Family], provenance: Mapping[str, Any]) -> RingModes:
    """Return the record of modes by diameter."""
    numbers, frequencies, residuals, shapes = zip(*families, strict=True)
    counts = [len(values) for values in frequencies]
    return RingModes(
        sector.sectors,
        sector.axis,
        sector.point,
        np.repeat(numbers, counts),
        np.concatenate([np.arange(size) for size in counts]),
        np.concatenate(frequencies),
        np.concatenate(residuals),
        np.concatenate(shapes),
        provenance,
    )


def _of_diameter(sector: CyclicSector, problem: Diameter, modes: Modes) -> Family:
    """Return the modes of one diameter, each pair once."""
    fields, frequencies, residuals = problem.fields(modes.shapes), modes.frequencies_hz, modes.residuals
    if problem.travels:
        # both vectors of a pair lead to one complex field times some factor; Ritz vectors separate the families
        residuals = residuals.reshape(-1, 2).max(axis=1)
        basis = independent(fields, sector.matrices.mass)
        _, vectors = linalg.eigh(basis.conj() @ (sector.stiffness(problem.number) @ basis.T))
        fields = vectors.T[: residuals.size] @ basis
        frequencies = np.sqrt(np.mean(frequencies.reshape(-1, 2) ** 2, axis=1))
    return Family(problem.number, frequencies, residuals, scaled(sector, fields, problem.travels))


def independent(fields: np.ndarray, mass: sparse.csr_array) -> np.ndarray:
    """Return mass-orthonormal combinations (r, n) of complex fields (k, n), r of which are independent."""
    for _ in range(2):  # once more, as the smallest have few digits at first
        values, vectors = linalg.eigh(fields.conj() @ (mass @ fields.T))
        retained = values > _DEPENDENT * values[-1]
        fields = (vectors[:, retained] / np.sqrt(values[retained])).T @ fields
    return fields


def scaled(sector: CyclicSector, fields: np.ndarray, travels: bool) -> np.ndarray:
    """Return complex fields (k, n) of a sector with modal mass 1 over the ring, the largest component positive."""
    masses = np.einsum("ij,ij->i", fields.conj(), (sector.matrices.mass @ fields.T).T).real
    masses = masses * sector.sectors * (0.5 if travels else 1.0)
    largest = np.array([field[first_largest(np.abs(field))] for field in fields])
    return np.asarray(fields * (np.abs(largest) / largest / np.sqrt(masses))[:, None])
