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
    """Temperature of the structure, in K throughout or in degrees Celsius throughout."""

    reference: Real
    """temperature without thermal stress, at which `young` is the modulus [K or degree C]"""
    uniform: Real | None = None
    """temperature of the whole structure; or give `file` [K or degree C]"""
    file: str | None = None
    """CSV file of temperatures, with the columns x, y, z (m) and temperature"""

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
