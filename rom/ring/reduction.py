"""Reduction of a cyclic sector to a RingModel, or sector by sector to a SectorRing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from scipy import linalg, sparse

from vanedamp.modal.cyclic import CyclicSector
from vanedamp.rom.bases.projection import Factorize, superlu
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.ring.deviation_error import SIZES, deviation_errors
from vanedamp.rom.ring.deviations import RingError
from vanedamp.rom.ring.diameters import DeviatingPart, DiameterWaves, ring_waves
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_basis import sector_ring
from vanedamp.rom.ring.sector_ring import SectorRing

#: the values of `basis`
BASES = ("modes", "sectors")


def reduce_ring(
    sector: CyclicSector,
    interface: Interface | Sequence[InterfaceCoordinate],
    families: int = 3,
    max_frequency: float | None = None,
    part: DeviatingPart | None = None,
    centrifugal: sparse.csr_array | None = None,
    greatest_speed: float = 0.0,
    factorize: Factorize = superlu,
    report: Callable[[int, int], None] | None = None,
    basis: str = "modes",
    higher: Sequence[sparse.csr_array] = (),
) -> RingModel | SectorRing:
    """Reduce a ring to its modes of every nodal diameter and the interface of every sector.

    sector         at standstill
    interface      of one sector, of kinds "average" and "node"
    families       modes of every diameter; or all up to max_frequency, Hz
    part           the deviating part (default: the whole sector)
    centrifugal    (n, n) kg, the sector's added stiffness per squared speed, with the greatest_speed, rad/s
    report         called with the number of diameters done, and of all
    basis          "modes": waves of the tuned ring, a RingModel; "sectors": a SectorRing, where each sector has motions
                   of its own, for large deviations and many sectors, at standstill
    higher         (n, n) N/m each, added stiffness per 4th, 6th, ... power of a speed over the greatest

    The estimate of the error is `estimate` of the provenance: `receptance` of the interface, up to 1.5 times the first
    family's frequencies or the last family's lowest; `deviation`, of squared frequencies per squared deviation;
    `one_sector`, of frequencies where the stiffness of one sector's part changes much. Raises RingError for an
    interface of rigid or full patches, an unknown basis, one of sectors that rotates, and what ring_modes and the
    factorisation raise.
    """
    if basis not in BASES or (basis == "sectors" and centrifugal is not None):
        raise RingError(f'basis: expected one of {", ".join(BASES)}, "modes" of a ring that rotates; not {basis!r}')
    if not isinstance(interface, Interface):
        interface = Interface.on_patches(sector.matrices, interface)
    if any(item.kind not in ("average", "node") for item in interface.coordinates):
        raise RingError('interface: patches of a ring are of kind "average" or "node"')
    by_speed = () if centrifugal is None else (centrifugal, *higher)
    part = part or DeviatingPart(sector.matrices.stiffness, sector.matrices.mass)
    waves, estimate = ring_waves(
        sector, interface.vectors.T, families, max_frequency, part, by_speed, greatest_speed, factorize, report
    )
    provenance = {
        "matrices": dict(sector.matrices.provenance), "basis": basis, "estimate": estimate,
        "versions": {"numpy": np.__version__, "scipy": scipy.__version__},
    }  # fmt: skip
    reduced: tuple[RingModel | SectorRing, np.ndarray] = (
        sector_ring(sector, interface, part, waves, factorize, provenance)
        if basis == "sectors"
        else _model(sector, interface, part, waves, by_speed, greatest_speed, provenance)
    )
    ring, fields = reduced
    errors = deviation_errors(ring, sector, fields, part, factorize)
    listed = ", ".join(f"{100 * error:.1g} % at {size:+.0%}" for size, error in zip(SIZES, errors, strict=True))
    estimate |= {
        "one_sector": [{"stiffness": size, "frequency": error} for size, error in zip(SIZES, errors, strict=True)],
        "sentence": f"{estimate['sentence']}; of frequencies, if one sector's stiffness changes, {listed}",
    }
    if basis == "sectors":  # the sectors' own motions include what the waves omit
        estimate["deviation"] = 2.0 * errors[0] / SIZES[0] ** 2
    return replace(ring, provenance=provenance | {"estimate": estimate})


def _model(
    sector: CyclicSector, interface: Interface, part: DeviatingPart, waves: Sequence[DiameterWaves],
    by_speed: Sequence[sparse.csr_array], greatest_speed: float, provenance: dict[str, Any],
) -> tuple[RingModel, np.ndarray]:  # fmt: skip
    """Return the reduced ring of the waves of all diameters, natural modes first, and their fields (c, n)."""
    fields = np.vstack([wave.real_fields for wave in waves])
    squares = np.concatenate([np.repeat(wave.squares, 1 + wave.problem.travels) for wave in waves])
    diameters = np.repeat(
        [wave.problem.number for wave in waves], [len(wave.squares) * (1 + wave.problem.travels) for wave in waves]
    )
    lead = np.concatenate(
        [np.arange(len(wave.squares)).repeat(1 + wave.problem.travels) < wave.modes for wave in waves]
    )
    order = np.lexsort([np.where(lead, squares, 0.0), ~lead])  # stable: pairs stay adjacent
    spinning = []
    for matrix in by_speed:
        blocks = [_hermitian(wave.factor * wave.fields.conj() @ (matrix @ wave.fields.T), wave) for wave in waves]
        spinning.append(linalg.block_diag(*blocks)[np.ix_(order, order)])
    fields, matrices = fields[order], sector.matrices
    translations = matrices.rigid_translations()
    ring = RingModel(
        sectors=sector.sectors, axis=sector.axis, point=sector.point, diameters=diameters[order],
        squares=squares[order], modes=int(lead.sum()), interface=interface.labels,
        selection=(fields @ interface.vectors).T,
        directions=interface.directions, normals=interface.normals, positions=interface.positions, arms=interface.arms,
        base_load=fields @ (matrices.mass @ translations), part_load=fields @ (part.mass @ translations),
        stiffness=fields @ (part.stiffness @ fields.T), mass=fields @ (part.mass @ fields.T),
        damping_ratio=matrices.damping_ratio, greatest_speed=greatest_speed,
        centrifugal_stiffness=spinning[0] if spinning else None,
        higher_stiffness=np.array(spinning[1:]) if spinning[1:] else None,
        provenance=provenance,
    )  # fmt: skip
    return ring, fields


def _hermitian(matrix: np.ndarray, wave: DiameterWaves) -> np.ndarray:
    """Return the real form of a Hermitian matrix (b, b) in the pairs of a diameter's waves."""
    if not wave.problem.travels:
        return np.asarray(matrix.real)
    block = np.array([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]])
    return np.asarray(block.transpose(2, 0, 3, 1).reshape(2 * len(matrix), -1))
