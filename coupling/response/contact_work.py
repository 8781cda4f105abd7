"""Work of contacts: what Archard's law and laws of impact wear take from a run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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
