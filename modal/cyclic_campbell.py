"""Campbell diagram of a ring: frequencies of every nodal diameter over the speed, and engine orders that excite them.

In the rotating frame, where a load at rest loads sector j by cos(k (W t + j alpha)), the order k = i N + h excites the
wave exp(i (omega t + h j alpha)), against the turn, and k = i N - h the one with it. Waves of one sign and diameter
keep their order: their curves do not cross.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.modal.campbell import CampbellError, checked_speeds, neglected_notes
from vanedamp.modal.cyclic import CyclicSector, aliased
from vanedamp.modal.cyclic_rotation import rotating_diameter
from vanedamp.modal.kept_solutions import Arrays, Keep, not_kept
from vanedamp.modal.records.campbell import Campbell, OrderCrossing
from vanedamp.modal.rotating import RotatingMatrices
from vanedamp.modal.speed_range import SmallMatrices, SpeedRange, meetings, ritz_modes


def ring_campbell(
    sector: CyclicSector,
    rotating: RotatingMatrices,
    speeds: Sequence[float] | np.ndarray,
    orders: Sequence[float] = (),
    count: int = 6,
    gyroscopic: bool = False,
    tolerance: float = 1e-8,
    report: Callable[[int, int], None] | None = None,
    keep: Keep = not_kept,
) -> Campbell:
    """Return the lowest `count` frequencies of every nodal diameter over speeds, and their crossings.

    sector  for the ring's geometry; the rest and the errors as in modal.campbell.campbell. Engine orders are whole
    report  called with the number of diameters done, and of all

    With gyroscopic coupling both waves of a diameter are there, otherwise their common frequency.
    """
    wanted = checked_speeds(speeds, orders, count, rotating.standing.free.size, tolerance)
    if any(order != int(order) for order in orders):
        raise CampbellError("orders: expected whole engine orders of a ring")
    curves: list[_DiameterCurve] = []
    crossings: list[OrderCrossing] = []
    errors, solved, neglected = [], set(), 0.0
    for diameter in sector.diameters:
        if report is not None:
            report(diameter, len(sector.diameters))
        travels = sector.travels(diameter)
        turning = rotating_diameter(sector, rotating, diameter)
        asked = min((2 if travels else 1) * count, turning.standing.free.size)
        alike = [(float(order), aliased(int(order), sector.sectors)) for order in orders]
        exciting = [(order, sense) for order, (excited, sense) in alike if excited == diameter]
        source_class = _Waves if travels else SpeedRange
        with source_class(turning, float(wanted[0]), float(wanted[-1]), asked, gyroscopic, keep) as source:
            for sense, frequencies, met in _waves(source, exciting, wanted, count, tolerance):
                crossings += [
                    OrderCrossing(len(curves) + family, order, speed, order * speed / (2.0 * np.pi))
                    for order, family, speed in met
                ]
                curves += [_DiameterCurve(sense * diameter, family, curve) for family, curve in enumerate(frequencies)]
            errors.append(_errors(source, wanted))
            neglected = max(neglected, source.neglected_error())
            solved |= set(source.solved)
    worst = np.max(errors, axis=0)
    warnings = [] if worst.max() <= tolerance else [f"frequencies are estimated to be wrong by up to {worst.max():.2g}"]
    warnings += neglected_notes(neglected)
    return Campbell(
        speeds=wanted,
        asked=np.ones(wanted.size, dtype=bool),
        modes=np.arange(len(curves)),
        frequencies_hz=np.array([curve.frequencies for curve in curves]) / (2.0 * np.pi),
        errors=worst,
        solved=np.sort(list(solved)),
        orders=tuple(float(order) for order in orders),
        crossings=tuple(sorted(crossings, key=lambda crossing: (crossing.speed, crossing.mode))),
        approaches=(),
        gyroscopic=gyroscopic,
        warnings=tuple(warnings),
        provenance=rotating.standing.provenance,
        neglected=neglected or None,
        diameters=np.array([curve.diameter for curve in curves]),
        families=np.array([curve.family for curve in curves]),
    )


class _DiameterCurve(NamedTuple):
    diameter: int
    family: int
    frequencies: np.ndarray


class _Wave(NamedTuple):
    """Frequencies (k, s), rad/s, of the waves of one sense, and where orders meet them: order, family, speed."""

    sense: int
    frequencies: np.ndarray
    met: list[tuple[float, int, float]]


def _waves(
    source: SpeedRange, exciting: Sequence[tuple[float, int]], speeds: np.ndarray, count: int, tolerance: float
) -> list[_Wave]:
    """Return the waves of a diameter, of either sense with gyroscopic coupling, from a basis that is refined.

    exciting: orders that excite the diameter, each with its sense.
    """
    senses = (1, -1) if isinstance(source, _Waves) and source.gyroscopic else (1,)
    refined = speeds
    for _ in range(2):  # then with the speeds of the crossings, to which the first ones are near enough
        _refine(source, refined, tolerance)
        waves = [_of_sense(source, sense, exciting, speeds, count, len(senses) > 1) for sense in senses]
        refined = np.union1d(speeds, [speed for wave in waves for _, _, speed in wave.met])
    return waves


def _of_sense(
    source: SpeedRange, sense: int, exciting: Sequence[tuple[float, int]], speeds: np.ndarray, count: int, split: bool
) -> _Wave:
    """Return the `count` lowest waves of one sense; split: whether orders of the other one do not excite them."""
    small = source.of_sense(sense) if isinstance(source, _Waves) else source.small
    frequencies = np.array([ritz_modes(small, float(speed))[0][:count] for speed in speeds]).T
    # of the waves of one sense, some may lie above all that the basis is for
    highest = np.array([source.modes(float(speed)).frequencies[-1] for speed in speeds]) * (1.0 + 1e-9)
    met = [
        (order, family, speed)
        for order, excited in exciting
        if excited == sense or not split
        for family, speed in meetings(small, order)
        if family < count and speeds[0] <= speed <= speeds[-1]
    ]
    return _Wave(sense, np.where(frequencies <= highest, frequencies, np.nan), met)


def _errors(source: SpeedRange, speeds: np.ndarray) -> np.ndarray:
    return np.array([source.errors(float(speed)).max() for speed in speeds])


def _refine(source: SpeedRange, speeds: np.ndarray, tolerance: float) -> None:
    """Solve the full problem at more speeds until the errors at all of them meet a tolerance."""
    while True:
        errors = _errors(source, speeds)
        worst = float(speeds[np.argmax(errors)])
        if errors.max() <= tolerance or worst in source.solved:
            return
        source.add(worst)


class _Waves(SpeedRange):
    """A basis for the real form of a diameter, with i times every field, to separate its two waves."""

    def of_sense(self, sense: int) -> SmallMatrices:
        """Return the small matrices of the waves exp(i (omega t + h j alpha)), omega > 0, or of the waves with -h."""
        basis = self.basis
        turned = basis.T @ (self.rotating.standing.of_free(self.rotating.standing.mass) @ _turned(basis.T).T)
        values, vectors = np.linalg.eigh(-1j * sense * turned)
        return self.small.within(vectors[:, values > 0.5])

    def _join(self, speed: float, modes: Arrays) -> None:
        super()._join(speed, {**modes, "shape": np.vstack([modes["shape"], _turned(modes["shape"])])})


def _turned(rows: np.ndarray) -> np.ndarray:
    """Return i times fields (k, 2 n) in real form."""
    real, imaginary = np.split(rows, 2, axis=1)
    return np.hstack([-imaginary, real])
