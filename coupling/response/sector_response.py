"""Response of a ring by sector over a run: the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, family
from vanedamp.coupling.quantities.sectors import OF_SECTORS
from vanedamp.files.store import frozen
from vanedamp.modal.algebra import first_largest

#: values of each sector, by the names of a run's
BY_SECTOR = tuple(one.name for one in OF_SECTORS)


@dataclass(frozen=True, eq=False)
class SectorResponse(QuantityRecord):
    """Response of N sectors of a ring over the evaluated periods of a run.

    quantities      (N,) by BY_SECTOR, attributes as well: mean and largest of the periods' largest distances of
                    `excitation.at` from the static deflection, m; amplitudes of the linear ring without bodies, and
                    with bodies fixed, nan for an excitation that is no sum of sines; impacts per
                    period of the sector's bodies, nan for a method that does not count them
    sampling_error  0: amplitudes come from no samples
    tuned           m, of the tuned ring without bodies at its resonance near the excitation, at `excitation.at`; None:
                    not known
    """

    quantities: Mapping[str, np.ndarray]
    sampling_error: float = 0.0
    tuned: float | None = None

    @classmethod
    def of(cls, values: Mapping[str, Any], data: Mapping[str, Any]) -> SectorResponse:
        """Return the record for a file, and for `to_json`."""
        arrays = {name: frozen(values[f"sector_{name}"]) for name in BY_SECTOR}
        return cls(arrays, sampling_error=data.get("sampling_error", 0.0), tuned=data["tuned"])

    @property
    def largest(self) -> int:
        """Number of the sector with the largest mean amplitude; of equal ones the first."""
        return first_largest(self.amplitude_mean)

    def __getattr__(self, name: str) -> Any:
        """Return the sectors' values, or the ring's by them."""
        ring = _of_ring()
        return ring[name].formula(self) if name in ring else super().__getattr__(name)

    @property
    def sentence(self) -> str:
        """The record in a line."""
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
        return data | {name: getattr(self, name) for name in ("largest", "tuned", "sampling_error", *_of_ring())}


def _of_ring() -> dict[str, Quantity]:
    """Return the quantities of the whole ring, by those of its sectors."""
    return {one.name: one for one in family("sectors") if not one.dims}
