"""SectorRing: a ring sector by sector, each with inner motions of its own, for large deviations and many sectors."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from scipy import linalg, sparse

from vanedamp.files import store
from vanedamp.files.record import Array
from vanedamp.modal.algebra import sector_rotations, symmetric_part
from vanedamp.rom.bases.projection import lowest_modes, superlu
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.deviations import Deviations, RingError
from vanedamp.rom.ring.families import Families
from vanedamp.rom.ring.placement import SQUARE, ReducedRing
from vanedamp.rom.ring.ring_model import RingModel

_Stiffness = Annotated[np.ndarray, Array(SQUARE, "N/m")]
_Mass = Annotated[np.ndarray, Array(SQUARE, "kg")]
_Stretch = Annotated[np.ndarray, Array(("spring", "coordinate"))]


@dataclass(frozen=True, eq=False, repr=False)
class SectorRing(ReducedRing):
    """A ring of N equal sectors by component modes of one; matrices of the whole ring are sparse.

    The s coordinates of a sector are f motions of its face low, the same f of its face high, which are the next
    sector's first, and inner motions. Raises RingError or rom.checks.ReducedModelError.
    """

    KIND: ClassVar[str] = "ring-sectors"
    faces: int
    """f"""
    stiffness: _Stiffness
    """of a sector"""
    mass: _Mass
    """of a sector"""
    part_stiffness: _Stiffness
    """of the part that deviates"""
    part_mass: _Mass
    """of the part that deviates"""
    spring_high: _Stretch
    """with the next: stretch of springs between neighbours, spring_high q_j - spring_low q_(j+1)"""
    spring_low: _Stretch
    """same for the face low"""
    spring_stiffness: Annotated[np.ndarray, Array(("spring",), "N/m")]
    """stiffness of these springs"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= 2 * self.faces <= len(self.mass) or not 0 < self.modes <= self.size:
            raise RingError(f"faces: {self.faces} motions of a face and {self.modes} modes do not fit the sector")

    def _lengths(self) -> dict[str, int]:
        return {"coordinate": len(self.mass), "spring": len(self.spring_stiffness)}

    @property
    def size(self) -> int:
        """Number of coordinates of the whole ring."""
        return self.sectors * (len(self.mass) - self.faces)

    @cached_property
    def frequencies_hz(self) -> np.ndarray:
        """(modes,) natural frequencies of the tuned ring, ascending."""
        return self.model().natural_frequencies_hz

    def model(
        self, deviations: Deviations | None = None, speed: float | None = None, modes: int | None = None
    ) -> ReducedModel:
        """Return the reduced model of the whole ring with deviations of its sectors, as RingModel.model.

        In its own lowest natural modes, so many or `modes` of the ring, with residual flexibility. Raises RingError,
        also for a speed.
        """
        return self.natural(deviations, speed, modes)[0]

    def natural(
        self, deviations: Deviations | None = None, speed: float | None = None, modes: int | None = None
    ) -> tuple[ReducedModel, np.ndarray]:
        """Return that model, and the shapes (size, m) of its modes in the coordinates of the ring. Raises RingError."""
        count = self.modes if modes is None else modes
        if speed:
            raise RingError('speed: the ring is reduced sector by sector, at standstill; take basis = "modes"')
        deviations = deviations or Deviations()
        stiffness, mass = self.matrices(deviations)
        factors = superlu(stiffness)
        squares, shapes = lowest_modes(
            mass, count, factors.solve, self.size, 0.0,
            lambda: linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, count - 1]),
        )  # fmt: skip
        rows = self._joined(np.broadcast_to(self.selection, (self.sectors, *self.selection.shape))).toarray()
        extra, added = deviations.of("damping", self.sectors), None
        if extra.any():
            share = np.sqrt(2.0 * self.damping_ratio) * squares**-0.25
            moved = shapes.T @ (self._summed(extra[:, None, None] * self.part_stiffness) @ shapes)
            added = symmetric_part(share[:, None] * moved * share)
        load = self._load(deviations.of("mass", self.sectors))
        return self.natural_model(squares, shapes, rows, factors.solve(rows.T), load, added), shapes

    def tuned_families(self, speed: float = 0.0) -> Families:
        """Return the natural modes of the tuned ring by diameter, and a family above the families of `model`.

        Raises RingError for a speed.
        """
        if speed:
            raise RingError('speed: the ring is reduced sector by sector, at standstill; take basis = "modes"')
        per_sector = len(self.mass) - self.faces
        count = min(-(-self.modes // self.sectors) + 1, per_sector)
        mass = self.matrices(Deviations())[1]
        numbers, squares, shapes, diameters = [], [], [], []
        for diameter in range(self.sectors // 2 + 1):
            eigenvalues, waves = linalg.eigh(*self.of_diameter(diameter), subset_by_index=[0, count - 1])
            around = np.exp(2j * np.pi / self.sectors * (diameter * np.arange(self.sectors) % self.sectors))
            fields = np.einsum("j,sm->mjs", around, waves).reshape(count, self.size)
            paired = 0 < 2 * diameter < self.sectors
            components = [fields.real, fields.imag] if paired else [fields.real]
            shapes.append(np.concatenate(components) * np.sqrt(len(components) / self.sectors))
            numbers.append(np.tile(np.arange(count), len(components)))
            squares.append(np.tile(eigenvalues, len(components)))
            diameters.append(np.full(len(numbers[-1]), diameter))
        return Families(
            np.concatenate(numbers), np.concatenate(diameters), np.concatenate(squares),
            np.asarray((mass @ np.concatenate(shapes).T).T),
        )  # fmt: skip

    def of_diameter(self, diameter: int) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness and mass of a sector of the tuned ring in a wave of a nodal diameter, Hermitian.

        Of s - f complex coordinates: the face low and the inner motions; real for diameters 0 and N/2.
        """
        phase = np.exp(2j * np.pi * diameter / self.sectors)
        if 2 * diameter % self.sectors == 0:
            phase = phase.real.round()
        face, inner = np.eye(self.faces), np.eye(len(self.mass) - 2 * self.faces)
        wave = linalg.block_diag(np.vstack([face, phase * face]), inner)
        stretch = (self.spring_high - phase * self.spring_low) @ wave
        stiffness = wave.conj().T @ self.stiffness @ wave
        stiffness = stiffness + stretch.conj().T @ (self.spring_stiffness[:, None] * stretch)
        return stiffness, wave.conj().T @ self.mass @ wave

    def matrices(self, deviations: Deviations) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Return stiffness and mass of the whole ring, sparse."""
        softer, lighter = (deviations.of(name, self.sectors)[:, None, None] for name in ("stiffness", "mass"))
        stiffness = self._summed(self.stiffness + softer * self.part_stiffness)
        if len(self.spring_stiffness):
            stretch = self._joined(np.broadcast_to(self.spring_high, (self.sectors, *self.spring_high.shape)))
            low = np.broadcast_to(self.spring_low, (self.sectors, *self.spring_low.shape))
            stretch = sparse.csr_array(stretch - self._joined(low, 1))
            scaled = stretch * np.tile(self.spring_stiffness, self.sectors)[:, None]
            stiffness = sparse.csr_array(stiffness + stretch.T @ scaled)
        return stiffness, self._summed(self.mass + lighter * self.part_mass)

    def places(self) -> np.ndarray:
        """Return the indices (N, s) of the coordinates of every sector among the ring's coordinates."""
        per_sector = len(self.mass) - self.faces
        first = per_sector * np.arange(self.sectors)[:, None]
        face = np.arange(self.faces)
        return np.hstack([first + face, np.roll(first, -1, axis=0) + face, first + np.arange(self.faces, per_sector)])

    def _summed(self, blocks: np.ndarray) -> sparse.csr_array:
        """Return the matrix of the ring from the sectors' matrices (N, s, s)."""
        coordinates = self.places()
        rows, columns = (
            np.broadcast_to(indices, blocks.shape) for indices in (coordinates[:, :, None], coordinates[:, None, :])
        )
        return sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), (self.size, self.size))

    def _joined(self, rows: np.ndarray, ahead: int = 0) -> sparse.csr_array:
        """Return functionals (N k, size) of the ring from those (N, k, s) of its sectors, or of the sectors ahead."""
        coordinates = np.roll(self.places(), -ahead, axis=0)
        numbers = np.arange(rows.shape[0] * rows.shape[1]).reshape(rows.shape[:2])
        at, columns = (
            np.broadcast_to(indices, rows.shape) for indices in (numbers[:, :, None], coordinates[:, None, :])
        )
        return sparse.csr_array((rows.ravel(), (at.ravel(), columns.ravel())), (numbers.size, self.size))

    def _load(self, lighter: np.ndarray) -> np.ndarray:
        """Return the load (size, 3) of the ring by an acceleration of the base along x, y, z."""
        sector_loads = self.base_load + lighter[:, None, None] * self.part_load
        turned = np.einsum("nsa,nba->nsb", sector_loads, sector_rotations(self.axis, self.sectors))
        load = np.zeros((self.size, 3))
        np.add.at(load, self.places(), turned)
        return load


def load_ring(path: str | os.PathLike[str]) -> RingModel | SectorRing:
    """Read a reduced ring of either basis. Raises files.store.StoreError."""
    return SectorRing.load(path) if store.kind_of(path) == SectorRing.KIND else RingModel.load(path)
