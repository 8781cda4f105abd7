"""Families of a ring's natural modes: of the tuned ring by nodal diameter, of a mistuned one by their kinetic energy.

Families may overlap in frequency: the second family at few diameters may lie below the first at many. The number of a
mode within its diameter still names its family; a mode of a ring with deviations belongs to the family with most of
its kinetic energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Families:
    """The natural modes of a tuned ring, as families.

    numbers, diameters  (m,) family, from 0, and nodal diameter of every mode; those between 0 and N/2 come in pairs
    squares             (m,) squared angular frequencies
    momenta             (m, n) their shapes times the mass, in the ring's coordinates: the modes have modal mass 1
    """

    numbers: np.ndarray
    diameters: np.ndarray
    squares: np.ndarray
    momenta: np.ndarray

    @property
    def ascending(self) -> np.ndarray:
        """Nodal diameters (m,) of the modes by ascending frequency, pairs together."""
        return self.diameters[np.argsort(self.squares, kind="stable")]

    def frequency_hz(self, diameter: int, number: int) -> float:
        """Return the frequency of a family at a nodal diameter; nan if it has none there."""
        squares = self.squares[(self.diameters == diameter) & (self.numbers == number)]
        return float(np.sqrt(squares[0]) / (2.0 * np.pi)) if len(squares) else np.nan

    def of_modes(self, shapes: np.ndarray) -> np.ndarray:
        """Return the families (k,) of shapes (n, k) of modal mass 1; -1: of none of them."""
        energies = (self.momenta @ shapes) ** 2
        count = int(self.numbers.max()) + 1
        contributions = np.array([energies[self.numbers == number].sum(axis=0) for number in range(count)])
        return np.where(contributions.sum(axis=0) > 0.5, np.argmax(contributions, axis=0), -1)
