"""Rings whose solution is known: chains of one mass a sector, on springs to ground and to their neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

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
