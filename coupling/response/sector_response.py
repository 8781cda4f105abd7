"""Response of a ring by sector over a run: the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.files.store import Variable, frozen
from vanedamp.modal.algebra import first_largest

#: results of each sector and their units, (N,) each
BY_SECTOR = {
    "amplitude_mean": "m", "amplitude_max": "m", "amplitude_undamped": "m", "amplitude_fixed": "m",
    "impacts_per_period": "1",
}  # fmt: skip
#: results of the whole ring and their units
OF_RING = {"amplification": "1", "localisation": "1"}


@dataclass(frozen=True, eq=False)
class SectorResponse:
    """Response of N sectors of a ring over the evaluated periods of a run: amplitudes of `excitation.at` in each.

    amplitude_mean, amplitude_max           (N,) m, mean and largest of the periods' largest distances from the static
                                            deflection
    amplitude_undamped, amplitude_fixed     (N,) m, of the linear ring without bodies, and with every body fixed to its
                                            floor; nan for an excitation that is no sum of sines
    impacts_per_period                      (N,) of the sector's bodies; nan for a method that does not count them
    sampling_error                          0: amplitudes come from no samples
    tuned                                   m, of the tuned ring without bodies at its resonance near the excitation,
                                            at `excitation.at`; None: not known
    """

    amplitude_mean: np.ndarray
    amplitude_max: np.ndarray
    amplitude_undamped: np.ndarray
    amplitude_fixed: np.ndarray
    impacts_per_period: np.ndarray
    sampling_error: float = 0.0
    tuned: float | None = None

    def __post_init__(self) -> None:
        for name in BY_SECTOR:
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def of(cls, values: Mapping[str, Any], data: Mapping[str, Any]) -> SectorResponse:
        """Return the record in the variables of a file, and in what `to_json` gives."""
        arrays = {name: values[f"sector_{name}"] for name in BY_SECTOR}
        return cls(**arrays, sampling_error=data.get("sampling_error", 0.0), tuned=data["tuned"])

    @property
    def largest(self) -> int:
        """Number of the sector with the largest mean amplitude; of equal ones the first."""
        return first_largest(self.amplitude_mean)

    @property
    def amplification(self) -> float | None:
        """Largest mean amplitude over that of the tuned ring without bodies in resonance; None: not known."""
        return None if self.tuned is None else float(self.amplitude_mean.max()) / self.tuned

    @property
    def localisation(self) -> float | None:
        """Largest mean amplitude over the root mean square of all sectors, 1 to the root of N; None at rest."""
        square = float(np.sqrt((self.amplitude_mean**2).mean()))
        return float(self.amplitude_mean.max()) / square if square > 0.0 else None

    @property
    def sentence(self) -> str:
        """What the record says, in a line."""
        number, count = self.largest, len(self.amplitude_mean)
        text = f"largest amplitude {1e6 * self.amplitude_mean[number]:.4g} um in sector {number} of {count}"
        if self.amplification is not None:
            text += f", {self.amplification:.4g} of the tuned ring without bodies in resonance"
        if self.localisation is not None:
            text += f"; localisation {self.localisation:.4g}"
        hits = self.impacts_per_period
        if np.isfinite(hits).all() and hits.any():
            text += f"; impacts per period {hits.min():.3g} to {hits.max():.3g}"
        return text

    def to_json(self) -> dict[str, Any]:
        """Return plain data, None for nan."""
        data: dict[str, Any] = {
            name: [None if np.isnan(value) else float(value) for value in getattr(self, name)] for name in BY_SECTOR
        }
        return data | {name: getattr(self, name) for name in ("largest", "tuned", "sampling_error", *OF_RING)}

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file."""
        return {f"sector_{name}": Variable(getattr(self, name), ("sector",), unit) for name, unit in BY_SECTOR.items()}
