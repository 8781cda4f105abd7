"""Component modes of a sector: motions of its faces, and inner motions that leave these at rest.

The waves of the ring (rom.ring.diameters) give the faces' motions, their static continuation into the sector, and the
remaining inner motions with the faces at rest, so that the basis contains the waves. Modes of a sector with its faces
at rest and a much softer or stiffer part add the effect of large deviations. As in Craig-Bampton's method, sectors are
joined at their faces, where inner motions are zero, so that no reduced frequency is below the true one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.cyclic import CyclicSector
from vanedamp.rom.bases.projection import Factorize, lowest_modes
from vanedamp.rom.interface import Interface
from vanedamp.rom.ring.deviations import RingError
from vanedamp.rom.ring.diameters import DeviatingPart, DiameterWaves
from vanedamp.rom.ring.sector_ring import SectorRing

# fraction of the strain energy of the waves that motions of a sector may leave out
_LEFT_OUT = 1e-10
# deviations of the part's stiffness whose modes are inner motions
_SIZES = (-0.9, -0.5, 1.0)


def sector_ring(
    sector: CyclicSector, interface: Interface, part: DeviatingPart, waves: Sequence[DiameterWaves],
    factorize: Factorize, provenance: dict[str, Any],
) -> tuple[SectorRing, np.ndarray]:  # fmt: skip
    """Return the ring of component modes, and their fields (s, n). Raises RingError for nodes on the axis."""
    if np.any(sector.low == sector.high):
        raise RingError('basis: nodes on the axis belong to all sectors; take basis = "modes"')
    faces, inner = _component_modes(sector, part, waves, factorize)
    fields, matrices = np.vstack([*faces, inner]), sector.matrices
    translations = matrices.rigid_translations()
    couplers = sector.couplers()
    spring = [
        np.vstack([item[side] for item in couplers]) if couplers else np.zeros((0, matrices.size)) for side in (0, 1)
    ]

    def projected(matrix: sparse.csr_array) -> np.ndarray:
        return np.asarray(fields @ (matrix @ fields.T))

    ring = SectorRing(
        sectors=sector.sectors, axis=sector.axis, point=sector.point, faces=len(faces[0]),
        modes=sum(wave.modes * (1 + wave.problem.travels) for wave in waves),
        stiffness=projected(matrices.stiffness), mass=projected(matrices.mass),
        part_stiffness=projected(part.stiffness), part_mass=projected(part.mass),
        spring_high=spring[0] @ fields.T, spring_low=spring[1] @ fields.T,
        spring_stiffness=np.concatenate([item[2] for item in couplers]) if couplers else np.zeros(0),
        interface=interface.labels, selection=(fields @ interface.vectors).T,
        directions=interface.directions, normals=interface.normals, positions=interface.positions, arms=interface.arms,
        base_load=fields @ (matrices.mass @ translations), part_load=fields @ (part.mass @ translations),
        damping_ratio=matrices.damping_ratio, provenance=provenance,
    )  # fmt: skip
    return ring, fields


def _component_modes(
    sector: CyclicSector, part: DeviatingPart, waves: Sequence[DiameterWaves], factorize: Factorize
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return motions (f, n) of the low face, the same of the high face, and inner motions (i, n)."""
    stiffness = sector.matrices.stiffness
    # of unit strain energy over the ring
    fields = np.vstack([
        wave.real_fields / np.repeat(np.sqrt(wave.squares), 1 + wave.problem.travels)[:, None]
        for wave in waves
    ])  # fmt: skip
    low, high = ((3 * nodes[:, None] + np.arange(3)).ravel() for nodes in (sector.low, sector.high))
    inside = np.setdiff1d(sector.matrices.free, np.concatenate([low, high]))
    factors = factorize(stiffness[inside][:, inside])

    def continued(face_dofs: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return the fields (f, n) of motions (f, p) of DOFs of a face; all other DOFs of the faces are at rest."""
        extended = np.zeros((len(motions), stiffness.shape[0]))
        extended[:, face_dofs] = motions
        extended[:, inside] = -factors.solve(np.asarray(stiffness[inside] @ extended.T)).T
        return extended

    least = _LEFT_OUT / sector.sectors
    leading = continued(low, fields[:, low])
    shapes = _independent(leading, stiffness, least) @ fields[:, low]
    turned = (shapes.reshape(len(shapes), len(sector.low), 3) @ sector.turn().T).reshape(shapes.shape)
    # without any motion of the faces, even beyond their shapes: otherwise neighbouring faces would separate
    rest = fields - leading - continued(high, fields[:, high])
    rest[:, np.concatenate([low, high])] = 0.0
    motions = [rest, *(_fixed_modes(sector, part, size, inside, max(wave.modes for wave in waves) + 1, factorize)
                       for size in _SIZES)]  # fmt: skip
    inner = np.vstack(motions)
    return (continued(low, shapes), continued(high, turned)), _independent(inner, stiffness, least) @ inner


def _fixed_modes(
    sector: CyclicSector, part: DeviatingPart, size: float, inside: np.ndarray, count: int, factorize: Factorize
) -> np.ndarray:
    """Return the lowest modes (m, n) of a sector that deviates, its faces at rest, of unit strain energy."""
    stiffness, mass = (
        matrix[inside][:, inside]
        for matrix in (sector.matrices.stiffness + size * part.stiffness, sector.matrices.mass)
    )
    count = min(count, len(inside))
    squares, shapes = lowest_modes(
        mass, count, factorize(stiffness).solve, len(inside), 0.0,
        lambda: linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, count - 1]),
    )  # fmt: skip
    fields = np.zeros((count, sector.matrices.size))
    fields[:, inside] = shapes.T / np.sqrt(squares)[:, None]
    return fields


def _independent(fields: np.ndarray, stiffness: sparse.csr_array, least: float) -> np.ndarray:
    """Return the combinations (q, p) of fields (p, n) of more strain energy than the least, of unit energy."""
    energies, vectors = linalg.eigh(fields @ (stiffness @ fields.T))
    independent = energies > least
    return np.asarray((vectors[:, independent] / np.sqrt(energies[independent])).T)
