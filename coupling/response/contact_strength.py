"""Strength of a run's contacts: largest forces, pressures and durations of impacts."""

from __future__ import annotations

from dataclasses import dataclass

from vanedamp.coupling.response.contact_work import contact_name


@dataclass(frozen=True)
class ContactStrength:
    """Impacts of one contact over the evaluated periods; damper, side, corner as of an Event."""

    damper: int
    """number of the body, or of a stop its own"""
    side: str
    """what it meets"""
    corner: int
    """corner of a body; -1: none"""
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
    def name(self) -> str:
        """Name for people."""
        return contact_name(self.damper, self.side, self.corner)

    @property
    def sentence(self) -> str:
        """What the record says, in a line."""
        used = "" if self.utilisation is None else f", {self.utilisation:.3g} of first yield"
        return (
            f"{self.name}: up to {self.fastest:.3g} m/s, {self.peak_force:.4g} N for {1e6 * self.duration:.3g} us, "
            f"{self.pressure / 1e6:.4g} MPa{used}"
        )
