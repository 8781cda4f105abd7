"""Strength of a run's contacts: largest forces, pressures and durations of impacts."""

from __future__ import annotations

from dataclasses import dataclass

from vanedamp.coupling.response.contact_work import OfContact


@dataclass(frozen=True)
class ContactStrength(OfContact):
    """Impacts of one contact over the evaluated periods."""

    impacts: int
    """number of impacts"""
    fastest: float
    """largest speed of approach [m/s]"""
    peak_force: float
    """largest force [N]"""
    duration: float
    """duration of the impact with the largest force [s]"""
    pressure: float
    """Hertz's largest pressure under that force [Pa]"""
    utilisation: float | None
    """this pressure over the one at first yield; None without a yield strength [-]"""
    yielding: float | None
    """fraction of the impacts whose pressure is beyond first yield [-]"""

    @property
    def sentence(self) -> str:
        """The record in a line."""
        used = "" if self.utilisation is None else f", {self.utilisation:.3g} of first yield"
        return (
            f"{self.name}: up to {self.fastest:.3g} m/s, {self.peak_force:.4g} N for {1e6 * self.duration:.3g} us, "
            f"{self.pressure / 1e6:.4g} MPa{used}"
        )
