"""Error that a reduced ring makes of the frequencies of a ring of which one sector deviates, by its residual.

A mode x of the reduced ring with the squared frequency q is a mode of the full ring, except for the force
r = K x - q M x, which is orthogonal to all motions of the reduced ring. Its frequency is too high by about
r^T K^-1 r / (2 q), where K^-1 is at most the tuned ring's over 1 + d if a part is softer by d. In waves around the
ring, this takes one sector per diameter.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from vanedamp.modal.cyclic import CyclicSector
from vanedamp.rom.bases.projection import Factorize
from vanedamp.rom.ring.deviations import Deviations
from vanedamp.rom.ring.diameters import DeviatingPart, DiameterStatics
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing

#: deviations of the stiffness of one sector's part, whose errors are estimated
SIZES = (-0.3, -0.5, -0.9, 1.0)


def deviation_errors(
    ring: RingModel | SectorRing, sector: CyclicSector, fields: np.ndarray, part: DeviatingPart, factorize: Factorize
) -> list[float]:
    """Return the largest relative error of the natural frequencies that a ring keeps, for every deviation of SIZES.

    fields (c, n): of a sector, multiplied by the ring's coordinates there.
    """
    modes = [_modes(ring, size) for size in SIZES]
    errors = [np.zeros(len(squares)) for squares, _ in modes]
    around = np.fft.fft(np.eye(sector.sectors))  # the waves are its columns
    for number in sector.diameters:
        statics = DiameterStatics(sector, number, factorize)
        for size, error, (squares, coordinates) in zip(SIZES, errors, modes, strict=True):
            waves = np.einsum("j,jcm->mc", around[:, number], coordinates) @ fields
            forces = (size * (part.stiffness @ (fields.T @ coordinates[0]))).T
            error += statics.residual_energies(statics.of_diameter(waves), squares, forces) / squares
    return [float(0.5 * error.max() / (1.0 + min(size, 0.0))) for size, error in zip(SIZES, errors, strict=True)]


def _modes(ring: RingModel | SectorRing, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the modes of a ring whose sector 0 deviates: squares (m,), and coordinates (N, c, m) of its sectors."""
    softer = np.zeros(ring.sectors)
    softer[0] = size
    deviations = Deviations(softer)
    if isinstance(ring, RingModel):
        mass, stiffness = ring.matrices(deviations)
        squares, shapes = linalg.eigh(stiffness, mass, subset_by_index=[0, ring.modes - 1])
        return squares, ring.waves.in_sectors(np.eye(ring.size)) @ shapes
    model, shapes = ring.natural(deviations)
    return model.squares, shapes[ring.places()]
