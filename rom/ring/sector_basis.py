"""Component modes of a sector: motions of its faces, and inner motions that leave these at rest.

All are taken from the waves of the ring (rom.ring.diameters), so that they hold these: the faces' motions, their static
continuation into the sector, and what of the waves remains, as far as it has strain energy. As in Craig-Bampton's
method, sectors that deviate are joined at their faces, and each has inner motions of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.cyclic import CyclicSector
from vanedamp.rom.bases.projection import Factorize
from vanedamp.rom.interface import Interface
from vanedamp.rom.ring.deviations import RingError
from vanedamp.rom.ring.diameters import DiameterWaves, Part
from vanedamp.rom.ring.sector_ring import SectorRing

# fraction of the strain energy of the waves that motions of a sector may leave out
_LEFT_OUT = 1e-10


def sector_ring(
    sector: CyclicSector, interface: Interface, part: Part, waves: Sequence[DiameterWaves], factorize: Factorize,
    provenance: dict[str, Any],
) -> SectorRing:  # fmt: skip
    """Return the ring of a sector's component modes. Raises RingError for nodes on the axis."""
    if np.any(sector.low == sector.high):
        raise RingError('basis: nodes on the axis belong to all sectors; take basis = "modes"')
    faces, inner = _component_modes(sector, waves, factorize)
    fields, matrices = np.vstack([*faces, inner]), sector.matrices
    translations = matrices.rigid_translations()
    couplers = sector.couplers()
    spring = [
        np.vstack([item[side] for item in couplers]) if couplers else np.zeros((0, matrices.size)) for side in (0, 1)
    ]

    def projected(matrix: sparse.csr_array) -> np.ndarray:
        return np.asarray(fields @ (matrix @ fields.T))

    return SectorRing(
        sectors=sector.sectors, axis=sector.axis, point=sector.point, faces=len(faces[0]),
        modes=sum(one.modes * (1 + one.problem.travels) for one in waves),
        stiffness=projected(matrices.stiffness), mass=projected(matrices.mass),
        part_stiffness=projected(part.stiffness), part_mass=projected(part.mass),
        spring_high=spring[0] @ fields.T, spring_low=spring[1] @ fields.T,
        spring_stiffness=np.concatenate([item[2] for item in couplers]) if couplers else np.zeros(0),
        interface=interface.labels, selection=(fields @ interface.vectors).T,
        directions=interface.directions, normals=interface.normals, positions=interface.positions, arms=interface.arms,
        base_load=fields @ (matrices.mass @ translations), part_load=fields @ (part.mass @ translations),
        damping_ratio=matrices.damping_ratio, provenance=provenance,
    )  # fmt: skip


def _component_modes(
    sector: CyclicSector, waves: Sequence[DiameterWaves], factorize: Factorize
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return motions (f, n) of the low face, the same of the high face, and inner motions (i, n)."""
    stiffness = sector.matrices.stiffness
    # of unit strain energy over the ring
    fields = np.vstack([one.real_fields / np.repeat(np.sqrt(one.squares), 1 + one.problem.travels)[:, None]
                        for one in waves])  # fmt: skip
    low, high = ((3 * nodes[:, None] + np.arange(3)).ravel() for nodes in (sector.low, sector.high))
    inside = np.setdiff1d(sector.matrices.free, np.concatenate([low, high]))
    factors = factorize(stiffness[inside][:, inside])

    def continued(places: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Return the fields (f, n) of motions (f, p) of places, of which the others on the faces are at rest."""
        found = np.zeros((len(motions), stiffness.shape[0]))
        found[:, places] = motions
        found[:, inside] = -factors.solve(np.asarray(stiffness[inside] @ found.T)).T
        return found

    shapes = _own(fields[:, low])
    turned = (shapes.reshape(len(shapes), len(sector.low), 3) @ sector.turn().T).reshape(shapes.shape)
    faces = continued(low, shapes), continued(high, turned)
    rest = fields - (fields[:, low] @ shapes.T) @ faces[0] - (fields[:, high] @ turned.T) @ faces[1]
    energies, turns = linalg.eigh(rest @ (stiffness @ rest.T))
    own = energies > _LEFT_OUT / sector.sectors
    return faces, (turns[:, own] / np.sqrt(energies[own])).T @ rest


def _own(motions: np.ndarray) -> np.ndarray:
    """Return orthonormal motions (f, p) that span those of a face."""
    _, sizes, shapes = np.linalg.svd(motions, full_matrices=False)
    return shapes[sizes > np.sqrt(_LEFT_OUT) * sizes.max(initial=0.0)]
