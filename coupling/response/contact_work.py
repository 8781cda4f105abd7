"""Work of contacts, what Archard's law and laws of impact wear take from a run, and the wear by it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene

if TYPE_CHECKING:
    from vanedamp.coupling.response.evaluation import Outcome


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


def contact_name(damper: int, side: str, corner: int) -> str:
    """Return the name of a contact for people."""
    what = {"casing": "friction damper", "stop": "stop"}.get(side, f"{side} of body")
    return f"{what} {damper}" + (f", corner {corner}" if corner >= 0 else "")


@dataclass(frozen=True)
class ContactWear:
    """Wear of one contact, at the mean rates of the evaluated periods.

    damper, side, corner: as of an Event. sliding: integral of normal force times slip speed, N m; friction: its
    coefficient times that, J; impacts: sum of their energies to the power n, J^n; hits: their number. work_rate:
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
    hits: int
    work_rate: float
    volume_rate: float
    volume_rate_confidence: float | None
    depth_rate: float | None
    share: float
    area: float | None

    @property
    def name(self) -> str:
        """Name for people."""
        return contact_name(self.damper, self.side, self.corner)

    def hours_to(self, depth: float) -> float | None:
        """Return the hours to a depth of both partners together, m, at this rate; None if it is not known or 0."""
        return depth / self.depth_rate if self.depth_rate else None

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)


def contact_work(scene: Scene, run: Outcome, first: int) -> tuple[ContactWork, ...]:
    """Return the work of each contact of a run, exact engine, over its periods from `first` on."""
    records, rows, window = run.records, run.rows, slice(first, run.periods)
    found = []
    for row, (number, side, corner) in enumerate(rows.places):
        friction = _friction(scene, run, row)
        sliding = records.worn[window, row] / friction if friction > 0.0 else np.zeros(run.periods - first)
        course = np.stack([sliding, records.struck[window, row]], axis=1)
        found.append(ContactWork(number, side, corner, friction, int(records.hits[window, row].sum()), course))
    return tuple(found)


def _friction(scene: Scene, run: Outcome, row: int) -> float:
    """Return the coefficient of friction of a row of the log; 0: none, and no work of it."""
    number, side, _ = run.rows.places[row]
    if run.rows.without_body[row]:
        return scene.friction_damper[number].friction if side == "casing" else 0.0
    if run.system.in_plane and row < run.system.contacts:
        return float(run.system.friction[row])
    return scene.damper[number].friction if side == "floor" else 0.0
