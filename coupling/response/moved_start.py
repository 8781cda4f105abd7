"""Effects of the start: bodies that begin as one, and results that hang on the last bits of positions."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.quantities.amplitude import amplitude_mean_confidence, amplitude_mean_dynamic
from vanedamp.coupling.quantities.impacts import impacts_per_period
from vanedamp.coupling.scene.scene import Scene

#: by this part of the way to others a second run begins elsewhere: of the order of 1e-9 of the free travel
_MOVED = 4e-9
#: where the first of these n is in the free travel, over 1/n: not symmetric
_ASIDE = 0.618
#: distances of neighbours over their free travel that count as contact: at time zero, and in sections
_TOUCHING, _TOGETHER = 1e-12, 1e-9
#: quantities of a second run that are kept: those of its Mean first
KEPT = tuple(one.name for one in (amplitude_mean_dynamic, amplitude_mean_confidence, impacts_per_period))
#: what must agree of neighbours that touch without speed
_RATES = ("velocity", "tilt", "tilt_rate")


class Mean(NamedTuple):
    """How a run ended, its mean amplitude, m, and half the 95 % confidence interval of that, m; nan: not known."""

    status: str
    amplitude: float
    confidence: float

    @classmethod
    def of(cls, status: str, quantities: Mapping[str, Any]) -> Mean:
        """Return that of a run with some quantities."""
        return cls(status, *(np.nan if quantities[name] is None else quantities[name] for name in KEPT[:2]))

    def compared(self, second: Mean, tolerance: float) -> tuple[dict[str, Any], tuple[str, ...]]:
        """Return how a run from a moved start compares, and a warning if they differ; tolerance: of a steady mean."""
        agrees = self.agrees(second, 2 * tolerance)
        return {"agrees": agrees, "status": second.status}, () if agrees else (self.sentence(second),)

    def agrees(self, other: Mean, tolerance: float) -> bool:
        """Return whether another run has the same mean within both intervals, and a tolerance relative to it."""
        within = tolerance * max(self.amplitude, other.amplitude) + np.nansum([self.confidence, other.confidence])
        return self.status == other.status and bool(abs(self.amplitude - other.amplitude) <= within)

    def sentence(self, other: Mean) -> str:
        """Return how the mean of a run from a moved start differs."""
        amplitude = f"{other.amplitude:.4g} m" if other.status == self.status else f'"{other.status}"'
        return (
            f"the mean amplitude hangs on the last bits of the start: {self.amplitude:.4g} m, but {amplitude} if "
            f"bodies begin about 1e-9 of their gap aside; damper.N.position as an axis of a sweep shows the states"
        )


def moved(scene: Scene, positions: Sequence[float]) -> list[float]:
    """Return positions of the bodies, m, moved a little, in order and within the free travel: none touches another."""
    shifted = list(positions)
    for cavity in scene.cavity:
        row = scene.bodies_in(cavity)
        for index, number in enumerate(row):
            aim = cavity.gap * ((index + _ASIDE) / len(row) - 0.5)
            shifted[number] += _MOVED * (aim - shifted[number])
    return shifted


def touching(scene: Scene) -> tuple[str, ...]:
    """Return a warning of neighbours that touch without speed at time zero, where restitution has no effect."""
    bodies, places = scene.damper, scene.positions
    touched = [
        right
        for left, right, gap in neighbours(scene)
        if places[right] - places[left] <= _TOUCHING * gap
        and all(getattr(bodies[left], rate) == getattr(bodies[right], rate) for rate in _RATES)
    ]
    reason = "touches the body before it at time zero, without relative speed"
    return _warning(touched, reason, "can move as one; leave positions out, and the bodies begin apart")


def as_one(scene: Scene, slip: np.ndarray, velocity: np.ndarray) -> tuple[str, ...]:
    """Return a warning of neighbours that move, and never part, by their sections (p, b), m and m/s."""
    bodies = [
        right
        for left, right, gap in neighbours(scene)
        if np.all(np.abs(slip[:, right] - slip[:, left]) <= _TOGETHER * gap) and np.any(velocity[:, [left, right]])
    ]
    return _warning(bodies, "never parts from the body before it in the periods evaluated", "move as one")


def neighbours(scene: Scene) -> Iterator[tuple[int, int, float]]:
    """Yield the neighbours in cavities under a rigid law, left and right, with their cavity's free travel, m."""
    for cavity in scene.cavity if scene.contact.rigid else ():
        for left, right in itertools.pairwise(scene.bodies_in(cavity)):
            yield left, right, cavity.gap


def _warning(bodies: Sequence[int], reason: str, effect: str) -> tuple[str, ...]:
    """Return a warning of some bodies, of which the first are named."""
    if not bodies:
        return ()
    named = ", ".join(f"damper[{number}]" for number in bodies[:4]) + (", ..." if bodies[4:] else "")
    why = 'a contact that is closed has no restitution under rigid impacts (law = "compliant" gives it one)'
    return (f"{named}: {reason}: {why}, and they {effect}",)
