"""The table [temperature] of a case: how hot the structure is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Real

if TYPE_CHECKING:
    from vanedamp.modal.temperature import Temperature


@dataclass(frozen=True, config=STRICT)
class TemperatureTable:
    """Temperature of the structure, in K or throughout in degrees Celsius: `uniform`, or at the points of a `file`.

    file: CSV with the columns x, y, z (m) and temperature. reference: temperature without thermal stress, at which
    `young` is the modulus.
    """

    reference: Real
    uniform: Real | None = None
    file: str | None = None

    def __post_init__(self) -> None:
        if (self.uniform is None) == (self.file is None):
            raise ValueError("give one of uniform and file")

    @property
    def temperature(self) -> Temperature:
        """Return it as the finite elements take it. Raises what modal.measurements.read_temperature raises."""
        from vanedamp.modal.measurements import read_temperature
        from vanedamp.modal.temperature import Temperature

        if self.file is not None:
            return read_temperature(self.file, self.reference)
        return Temperature(self.reference, np.array(self.uniform))
