"""Rings whose solution is known: chains of one mass a sector, on springs to ground and to their neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.cyclic import CyclicSector, SectorSpring, cyclic_sector
from vanedamp.modal.matrices import Patch, SystemMatrices
from vanedamp.rom.ring.deviations import Deviations
from vanedamp.rom.ring.ring_model import RingModel


@dataclass(frozen=True)
class Chain:
    """N masses m, kg, that move along the axis z, on ground springs k, N/m, coupled to both neighbours by c, N/m."""

    sectors: int = 6
    mass: float = 0.5
    stiffness: float = 2e6
    coupling: float = 2e5
    damping_ratio: float = 0.002
    radius: float = 0.2

    def matrices(self, deviations: Deviations | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness and mass (N, N) of the whole ring."""
        deviations = deviations or Deviations()
        stiffness, mass = (deviations.of(name, self.sectors) for name in ("stiffness", "mass"))
        first = np.zeros(self.sectors)
        for step in (1, -1):
            first[0] += self.coupling
            first[step % self.sectors] -= self.coupling
        return linalg.circulant(first) + np.diag(self.stiffness * (1 + stiffness)), np.diag(self.mass * (1 + mass))

    def squares(self, diameters: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the squared angular frequencies of nodal diameters, tuned."""
        angles = 2 * np.pi / self.sectors * np.asarray(diameters)
        return (self.stiffness + 2 * self.coupling * (1 - np.cos(angles))) / self.mass

    def saved(self, folder: Path) -> str:
        """Write the reduced ring to a folder, and return its file."""
        self.ring().save(folder / "ring.h5")
        return str(folder / "ring.h5")

    @property
    def diameters(self) -> np.ndarray:
        """The nodal diameters of the waves: pairs but for 0 and N/2."""
        return np.repeat(*np.unique(np.minimum(np.arange(self.sectors), -np.arange(self.sectors) % self.sectors),
                                    return_counts=True))  # fmt: skip

    def ring(self, label: str = "tip") -> RingModel:
        """Return the ring as a reduced model, exact: the ground spring and the mass deviate."""
        diameters = self.diameters
        single = (diameters == 0) | (2 * diameters == self.sectors)
        first = ~np.r_[False, diameters[1:] == diameters[:-1]]
        shape = np.sqrt(np.where(single, 1.0, 2.0) / (self.sectors * self.mass)) * first
        zeros = np.zeros((1, 3))
        return RingModel(
            sectors=self.sectors, axis=np.array([0.0, 0.0, 1.0]), point=np.zeros(3), diameters=diameters,
            squares=self.squares(diameters), modes=self.sectors, interface=(label,), selection=shape[None],
            directions=np.array([[0.0, 0.0, 1.0]]), normals=zeros, positions=np.array([[self.radius, 0.0, 0.0]]),
            arms=np.zeros(1), base_load=self.mass * np.outer(shape, [0.0, 0.0, 1.0]),
            part_load=self.mass * np.outer(shape, [0.0, 0.0, 1.0]),
            stiffness=self.stiffness * np.outer(shape, shape), mass=self.mass * np.outer(shape, shape),
            damping_ratio=self.damping_ratio,
        )  # fmt: skip


@dataclass(frozen=True)
class LumpedDisk:
    """A disk of N sectors with a blade each, of masses that springs of three stiffnesses join: 3 freedoms a mass.

    A sector has nodes 0 (face low), 1 (face high), 2 (rim, also on springs to ground) and 3, 4, 5 up the blade; its
    axes are x radial, y tangential, z axial. With springs, N/m, the sectors are separate and these join their nodes.
    """

    sectors: int = 6
    blade: float = 1e7
    rim: float = 3e7
    axes: tuple[float, float, float] = (2.3, 1.0, 0.6)
    springs: float = 0.0

    def _springs(self, pairs: Sequence[tuple[int, int]], stiffness: float) -> np.ndarray:
        matrix = np.zeros((18, 18))
        for one, other in pairs:
            for place, sign in (((one, one), 1), ((other, other), 1), ((one, other), -1), ((other, one), -1)):
                rows, columns = (slice(3 * node, 3 * node + 3) for node in place)
                matrix[rows, columns] += sign * stiffness * np.diag(self.axes)
        return matrix

    @property
    def part(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and mass (18, 18) of the blade."""
        masses = np.repeat([0.0, 0.0, 0.0, 0.2, 0.15, 0.1], 3)
        return self._springs([(2, 3), (3, 4), (4, 5)], self.blade), np.diag(masses)

    def matrices(self, damping_ratio: float = 0.002) -> SystemMatrices:
        """Return the matrices of a sector with both faces free, and patches of one node each."""
        blade, mass = self.part
        stiffness = blade + self._springs([(0, 2), (2, 1)], self.rim)
        stiffness[6:9, 6:9] += self.rim * np.eye(3)
        mass = mass + np.diag(np.repeat([0.3, 0.3, 1.0, 0.0, 0.0, 0.0], 3))
        angle = np.pi / self.sectors
        ends = [[np.cos(angle), side * np.sin(angle), 0.0] for side in (-1, 1)]
        coordinates = 0.2 * np.array([*ends, *[[radius, 0.0, 0.0] for radius in (1.0, 1.1, 1.2, 1.3)]])
        names = ("low", "high", "rim", "root", "middle", "tip")
        patches = {name: Patch(np.array([node]), np.ones(1)) for node, name in enumerate(names)}
        sparse_ones = (sparse.csr_array(matrix) for matrix in (stiffness, mass))
        return SystemMatrices(*sparse_ones, coordinates, np.empty(0, int), patches, damping_ratio)

    def sector(self) -> CyclicSector:
        """Return the cyclic sector about the axis z."""
        if self.springs:
            springs = (SectorSpring("low", "high", (self.springs, 0.5 * self.springs, 2.0 * self.springs)),)
            return cyclic_sector(self.matrices(), None, None, self.sectors, couplings=springs)
        return cyclic_sector(self.matrices(), "low", "high", self.sectors)

    def whole(self, deviations: Deviations | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return stiffness and mass (15 N, 15 N) of the whole ring, and the motion of every sector (N, 18, 15 N)."""
        part = tuple(map(sparse.csr_array, self.part))
        stiffness, mass, place = whole_ring(self.sector(), part, deviations)
        return stiffness.toarray(), mass.toarray(), np.array([one.toarray() for one in place])


def whole_ring(
    sector: CyclicSector, part: tuple[sparse.csr_array, sparse.csr_array], deviations: Deviations | None = None
) -> tuple[sparse.csr_array, sparse.csr_array, list[sparse.csr_array]]:
    """Return stiffness and mass of a whole ring, and what makes the motion of each sector of its coordinates.

    These are the free displacements of the nodes of every sector but its face high, in the sector's axes.
    """
    matrices, count = sector.matrices, len(sector.matrices.coordinates)
    kept = np.setdiff1d(np.arange(count), sector.high)
    places, size = np.full(count, -1), 3 * len(kept)
    places[kept] = np.arange(len(kept))
    own = sparse.csr_array((np.ones(len(kept)), (kept, np.arange(len(kept)))), (count, len(kept)))
    shared = (np.ones(len(sector.high)), (sector.high, places[sector.low]))
    next_one = sparse.kron(sparse.csr_array(shared, (count, len(kept))), sector.turn(), format="csr")
    held = np.zeros((count, 3), bool)
    held.ravel()[matrices.fixed] = True
    free = np.flatnonzero(~np.tile(held[kept].ravel(), sector.sectors))
    found = []
    for j in range(sector.sectors):
        blocks = [sparse.csr_array((3 * count, size)) for _ in range(sector.sectors)]
        blocks[j] = sparse.kron(own, np.eye(3), format="csr")
        blocks[(j + 1) % sector.sectors] = blocks[(j + 1) % sector.sectors] + next_one
        found.append(sparse.csr_array(sparse.hstack(blocks, format="csr")[:, free]))
    deviations, totals = deviations or Deviations(), []
    for name, whole, one in zip(("stiffness", "mass"), (matrices.stiffness, matrices.mass), part, strict=True):
        values = deviations.of(name, sector.sectors)
        totals.append(sum(t.T @ (whole + d * one) @ t for t, d in zip(found, values, strict=True)))
    for high, low, values in sector.couplers():
        for j, motion in enumerate(found):
            stretch = high @ motion - low @ found[(j + 1) % sector.sectors]
            totals[0] = totals[0] + sparse.csr_array(stretch.T @ (values[:, None] * stretch))
    return totals[0], totals[1], found
