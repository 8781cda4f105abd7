"""What the contacts of a run do: work of normal forces, energies of impacts, and the wear by these."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class ContactWork:
    """Work of one contact over the evaluated periods.

    damper, side, corner: as of an Event. friction: its coefficient; sliding: integral of normal force times slip speed,
    N m; impacts: sum of the energies of its impacts to the power n, J^n; count: their number. *_confidence: half widths
    of their 95 % confidence intervals, None where there are too few periods.
    """

    damper: int
    side: str
    corner: int
    friction: float
    sliding: float
    impacts: float
    count: int
    sliding_confidence: float | None = None
    impacts_confidence: float | None = None


@dataclass(frozen=True)
class ContactWear:
    """Wear of one contact, at the mean rates of the evaluated periods.

    damper, side, corner: as of an Event. sliding: integral of normal force times slip speed, N m; friction: its
    coefficient times that, J; impacts: sum of their energies to the power n, J^n; count: their number. work_rate:
    sliding per time, W. volume_rate: m^3/h of both partners, of which the cavity (of neighbours the right body) loses
    `share`; depth_rate: m/h, None where the patch is not known. *_confidence: half widths of 95 % confidence intervals,
    None where there are too few periods.
    """

    damper: int
    side: str
    corner: int
    sliding: float
    friction: float
    impacts: float
    count: int
    work_rate: float
    volume_rate: float
    volume_rate_confidence: float | None
    depth_rate: float | None
    share: float
    area: float | None

    @property
    def name(self) -> str:
        """Name for people."""
        return f"{self.side} of {self.damper}" + (f", corner {self.corner}" if self.corner >= 0 else "")

    def hours_to(self, depth: float) -> float | None:
        """Return the hours to a depth of both partners together, m, at this rate; None if it is not known or 0."""
        return depth / self.depth_rate if self.depth_rate else None

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)
