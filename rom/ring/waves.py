"""Real waves around a ring of equal sectors, and a sector's matrices in them.

A field of nodal diameter h moves sector j, in its own frame, by Re(z exp(i h j alpha)), alpha = 2 pi / N. For 0 < h <
N/2, its real and imaginary part are two waves: sector j sees the coordinates (c, s) of the pair turned by theta = h j
alpha, (c cos + s sin, s cos - c sin), which multiply the fields (Re z, Im z) of sector 0. As travelling waves, (c -+ i
s) / sqrt(2), they are only multiplied by exp(+-i theta): a sum over sectors is then a discrete Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from vanedamp.files import store


@dataclass(frozen=True, eq=False)
class Waves:
    """n real coordinates of waves around a ring.

    sectors    N
    diameters  (n,) nodal diameters; those between 0 and N/2 stand in adjacent pairs, cosine and sine wave
    """

    sectors: int
    diameters: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "diameters", store.frozen(self.diameters, np.int64))

    @cached_property
    def _second(self) -> np.ndarray:
        """(n,) 0 of a wave without a partner, 1 of the first of a pair, 2 of the second."""
        paired = (self.diameters > 0) & (2 * self.diameters < self.sectors)
        return np.where(paired, 1 + (np.cumsum(paired) - 1) % 2, 0)

    @cached_property
    def wavenumbers(self) -> np.ndarray:
        """(n,) of the travelling waves in place of the coordinates: h and -h of a pair."""
        return np.where(self._second == 2, -self.diameters, self.diameters)

    @cached_property
    def _travelling(self) -> sparse.csr_array:
        """(n, n) unitary: the coordinates of the travelling waves."""
        index, second = np.arange(len(self.diameters)), self._second
        first, pair = np.flatnonzero(second == 1), np.flatnonzero(second == 2)
        rows = np.concatenate([index, pair, first])
        columns = np.concatenate([index, first, pair])
        diagonal = np.where(second == 0, 1.0 + 0j, np.where(second == 1, 1.0, -1j) * np.sqrt(0.5))
        values = np.concatenate([diagonal, np.full(len(pair), 1j), np.full(len(first), 1.0)])
        values[len(index) :] *= np.sqrt(0.5)
        return sparse.csr_array((values, (rows, columns)), (len(index),) * 2)

    def at_sector(self, rows: np.ndarray, sector: int) -> np.ndarray:
        """Return functionals (k, n) of the fields of another sector, from those of a sector.

        For sector -j, rows of coordinates become the coordinates seen from sector j.
        """
        phases = np.exp(2j * np.pi / self.sectors * (sector * self.wavenumbers % self.sectors))
        turned = self._travelling @ sparse.csr_array(sparse.diags(phases)) @ self._travelling.conj().T
        return np.asarray(rows @ turned.real)

    def in_sectors(self, rows: np.ndarray) -> np.ndarray:
        """Return functionals (N, k, n) of the fields of every sector, from those (k, n) of a sector."""
        return np.stack([self.at_sector(rows, sector) for sector in range(self.sectors)])

    def travelling(self, matrix: np.ndarray) -> np.ndarray:
        """Return a matrix (n, n) of a sector's fields in travelling waves, which `summed` takes."""
        return np.asarray(self._travelling.conj().T @ (matrix @ self._travelling))

    def summed(self, travelling: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the sum over sectors (n, n) of a symmetric matrix of `travelling`, with weights (N,)."""
        transform = np.conj(np.fft.fft(weights))
        steps = (self.wavenumbers[None, :] - self.wavenumbers[:, None]) % self.sectors
        matrix = (self._travelling @ (travelling * transform[steps]) @ self._travelling.conj().T).real
        return np.asarray(0.5 * (matrix + matrix.T))
