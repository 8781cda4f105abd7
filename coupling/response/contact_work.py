"""Work of contacts for Archard's law and laws of impact wear, and the wear by it; friction by contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.registration import meets_body


class ContactWork(NamedTuple):
    """Work of a contact of a body, or of a friction damper, over the evaluated periods (p of them).

    damper, side, corner: as of an Event; friction: coefficient; hits: impacts; course: (p, 2) of each period, integral
    of normal force times slip speed (N m) and sum of the energies of impacts (J) to the power of [wear] impact_exponent
    """

    damper: int
    side: str
    corner: int
    friction: float
    hits: int
    course: np.ndarray

    @property
    def sliding(self) -> float:
        """Integral of normal force times slip speed, N m: the work of friction over the coefficient."""
        return float(self.course[:, 0].sum())

    @property
    def impacts(self) -> float:
        """Sum of the energies of impacts to a power, J^exponent: half the contact's mass times speed squared."""
        return float(self.course[:, 1].sum())


def contact_name(damper: int, side: str, corner: int = -1) -> str:
    """Return the name of a contact, or of a face without corner, for people."""
    if side == "body":
        return f"bodies {damper} and {damper + 1}"
    owner = "friction damper" if side == "casing" else f"{side} of body" if meets_body(side) else side
    where = f", {('along', 'sideways')[corner]}" if side == "joint" else f", corner {corner}"
    return f"{owner} {damper}" + (where if corner >= 0 else "")


@dataclass(frozen=True)
class OfContact:
    """A result of one contact; damper, side, corner as of an Event."""

    damper: int
    """number of the body; of a friction damper, a stop or a joint its own"""
    side: str
    """what it meets"""
    corner: int
    """corner of a body; of a joint with two directions along 0, sideways 1; -1: none"""

    @property
    def name(self) -> str:
        """Name for people."""
        return contact_name(self.damper, self.side, self.corner)


@dataclass(frozen=True)
class ContactWear(OfContact):
    """Wear of one contact, at the mean rates of the evaluated periods.

    sliding: integral of normal force times slip speed, N m; friction: its
    coefficient times that, J; impacts: sum of their energies to the power n, J^n; hits: their number. work_rate:
    sliding per time, W. volume_rate: m^3/h of both partners, of which the cavity (of neighbours the right body) loses
    `share`; depth_rate: m/h, None where the patch is not known. *_confidence: half widths of 95 % confidence intervals,
    None where there are too few periods.
    """

    sliding: float
    friction: float
    impacts: float
    hits: int
    work_rate: float
    volume_rate: float
    volume_rate_confidence: float | None
    depth_rate: float | None
    share: float
    area: float | None

    def hours_to(self, depth: float) -> float | None:
        """Return the hours to a depth of both partners together, m, at this rate; None if it is not known or 0."""
        return depth / self.depth_rate if self.depth_rate else None


@dataclass(frozen=True)
class ContactFriction(OfContact):
    """Friction of a contact over the evaluated periods, without that of impacts on rigid walls."""

    energy: float
    """mean energy that friction takes in a period [J]"""
    power: float
    """mean power of friction [W]"""
    stick: float
    """fraction of the time in which the contact sticks [-]"""
    slip: float
    """fraction of the time in which it slips [-]"""
    open: float
    """fraction of the time in which it is open [-]"""

    @property
    def sentence(self) -> str:
        """The record in a line."""
        fractions = f"sticks {self.stick:.1%}, slips {self.slip:.1%}, open {self.open:.1%} of the time"
        return f"{self.name}: {self.power:.4g} W, {self.energy:.4g} J per period; {fractions}"
