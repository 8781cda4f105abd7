"""Modes tracked from speed to speed, by the MAC of neighbours, with further speeds where this is ambiguous.

Two modes whose frequencies approach each other either cross, each keeping its shape, or veer: they turn away from each
other and exchange their shapes on the way (Leissa 1974; Perkins and Mote 1986, J. Sound Vib. 106). Between coarse
speeds both look the same. So the closest approach itself is sought, as the root of the difference of the slopes.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy import linalg, optimize

from vanedamp.modal.correlation import Pairing, modal_assurance, pair_modes
from vanedamp.modal.records.campbell import Approach
from vanedamp.modal.speed_range import SpeedModes, SpeedRange

#: MAC of one mode at neighbouring speeds, at least
CLEAR_MAC = 0.9
#: least fraction of its shape that a mode takes over from another mode in a veering
LEAST_EXCHANGE = 0.25
#: speeds closer than this fraction of the range are no longer divided
_CLOSEST = 1e-8


class Tracks:
    """Modes followed over a range of speeds.

    source  the modes at any speed; count: modes that are among so many lowest somewhere are kept
    same    relative distance of frequencies that are one frequency: shapes of one frequency are any mixture of them

    speeds  rad/s, those given and those put in between; number[j][i]: the mode that is the i-th lowest at speeds[j],
            counted from 0 as they stand at the lowest speed, further ones as they appear
    notes   where no step was small enough
    """

    def __init__(self, source: SpeedRange, speeds: np.ndarray, count: int, same: float) -> None:
        self.source, self.count, self.same = source, count, same
        self._least = _CLOSEST * float(speeds[-1] - speeds[0])
        self.notes: list[str] = []
        first = source.modes(float(speeds[0]))
        # its multiple modes are oriented as they separate
        self.states = [self._aligned(first, source.modes(float(speeds[0]) + 100.0 * self._least))]
        self.number = [np.arange(first.frequencies.size)]
        for speed in speeds[1:]:
            self._reach(float(speed))

    @property
    def speeds(self) -> np.ndarray:
        """(s,) rad/s."""
        return np.array([state.speed for state in self.states])

    @property
    def kept(self) -> np.ndarray:
        """The modes that are among the `count` lowest somewhere, ascending."""
        return np.unique([number[: self.count] for number in self.number])

    def frequencies(self, mode: int) -> np.ndarray:
        """Return the frequencies (s,) of a mode, rad/s; nan where it is not among the modes of the source."""
        per_speed = (state.frequencies[number == mode] for state, number in zip(self.states, self.number, strict=True))
        return np.array([frequency[0] if frequency.size else np.nan for frequency in per_speed])

    def number_at(self, speed: float, index: int) -> int:
        """Return the mode that is the index-th lowest at a speed of the range, by its shapes at the neighbours."""
        right = min(max(int(np.searchsorted(self.speeds, speed)), 1), len(self.states) - 1)
        modes = self._aligned(self.source.modes(speed), self.states[right - 1])
        alike = np.zeros(1 + max(number.max() for number in self.number))
        for j in (right - 1, right):
            alike[self.number[j]] += modal_assurance(modes.shapes[:, index : index + 1].T, self.states[j].shapes.T)[0]
        return int(np.argmax(alike))

    def approaches(self) -> list[Approach]:
        """Return all crossings and veerings of the modes that are kept, by their speed."""
        approaches = []
        for interval, (left, right) in enumerate(itertools.pairwise(self.states)):
            for index in range(left.frequencies.size - 1):
                met = self._closest(index, left, right)
                if met is not None:
                    approaches.append(self._approach(interval, index, met))
        followed = [
            approach
            for approach in approaches
            if (approach.kind == "crossing" or approach.exchange >= LEAST_EXCHANGE)
            and np.isin([approach.first, approach.second], self.kept).any()
        ]
        return sorted(followed, key=lambda approach: approach.speed)

    def _reach(self, speed: float) -> None:
        """Continue from the last state to a speed, over speeds between them as far as the shapes need."""
        ahead = [speed]
        while ahead:
            left = self.states[-1]
            right = self._aligned(self.source.modes(ahead[-1]), left)
            pairs = pair_modes(modal_assurance(left.shapes.T, right.shapes.T), CLEAR_MAC)
            between = self._between(left, right, pairs)
            if between is not None:
                ahead.append(between)
                continue
            ahead.pop()
            number = np.full(right.frequencies.size, -1)
            number[pairs.second] = self.number[-1][pairs.first]
            unknown = np.flatnonzero(number < 0)
            number[unknown] = 1 + max(numbers.max() for numbers in self.number) + np.arange(unknown.size)
            self.states.append(right)
            self.number.append(number)

    def _between(self, left: SpeedModes, right: SpeedModes, pairs: Pairing) -> float | None:
        """Return a speed needed between two; None where the pairs are clear."""
        # the highest may be crossed by one that is not computed
        complete = np.arange(left.frequencies.size - (not self.source.whole))
        clear = np.isin(complete, pairs.first).all() and np.isin(complete, pairs.second).all()
        moved = pairs.first != pairs.second
        if clear and not moved.any():
            return None
        low, high = left.speed, right.speed
        if high - low < self._least:
            if not clear:
                self.notes.append(f"modes cannot be followed over {high:.9g} rad/s: their shapes jump there")
            return None
        swapped = {(int(a), int(b)) for a, b in zip(pairs.first[moved], pairs.second[moved], strict=True)}
        for index in sorted({min(pair) for pair in swapped}):
            met = self._closest(index, left, right) if (index, index + 1) in swapped else None
            if met is not None and low < met.speed < high and not self._coincide(met, index):
                return met.speed  # a veering so narrow that the shapes seem to go straight on
            if met is not None and (index + 1, index) in swapped:
                swapped -= {(index, index + 1), (index + 1, index)}
        return None if clear and not swapped else 0.5 * (low + high)

    def _closest(self, index: int, left: SpeedModes, right: SpeedModes) -> SpeedModes | None:
        """Return the modes where the index-th and the next frequency are closest between two speeds.

        None where they do not come closer there, or are one frequency all along.
        """
        if right.frequencies.size <= index + 1 or (self._coincide(left, index) and self._coincide(right, index)):
            return None

        def parting(speed: float, modes: SpeedModes | None = None) -> float:
            slopes = self.source.slopes(self.source.modes(speed) if modes is None else modes)
            return float(slopes[index + 1] - slopes[index])

        if not (parting(left.speed, left) < 0.0 <= parting(right.speed, right)):
            return None
        low, high = left.speed, right.speed
        if parting(low) < 0.0 <= parting(high):  # at one frequency, the shapes may be mixed otherwise than in the state
            low = optimize.brentq(parting, low, high, xtol=1e-14 * high, rtol=1e-14)
        elif self._coincide(right, index):
            low = high
        return self.source.modes(low)

    def _coincide(self, modes: SpeedModes, index: int) -> bool:
        """Whether the index-th and the next frequency coincide."""
        low, high = modes.frequencies[index : index + 2]
        return bool(high - low <= self.same * high)

    def _approach(self, interval: int, index: int, met: SpeedModes) -> Approach:
        """Return the approach of the index-th and the next mode in an interval of the speeds."""
        low, high = (float(omega) / (2.0 * np.pi) for omega in met.frequencies[index : index + 2])
        first, second = self.number[interval][index : index + 2].tolist()
        if [second, first] == self.number[interval + 1][index : index + 2].tolist():
            return Approach("crossing", first, second, met.speed, 0.5 * (low + high), 0.0, 0.0)
        # a third mode may cross one of them on the way
        first, second = (self.number_at(met.speed, at) for at in (index, index + 1))
        exchange = self._exchange(first, second, interval)
        return Approach("veering", first, second, met.speed, 0.5 * (low + high), high - low, exchange)

    def _exchange(self, first: int, second: int, interval: int) -> float:
        """Return the largest MAC of the first mode after an interval with the second one before it.

        As far as the two part on either side: beyond, they may approach each other once more.
        """
        gap = np.abs(self.frequencies(second) - self.frequencies(first))
        before = _rising(gap[interval::-1])
        after = _rising(gap[interval + 1 :])
        shapes = [
            np.vstack([self.states[j].shapes[:, self.number[j] == mode].T for j in states])
            for mode, states in (
                (second, range(interval, interval - before, -1)),
                (first, range(interval + 1, interval + 1 + after)),
            )
        ]
        return float(modal_assurance(*shapes).max(initial=0.0))

    def _aligned(self, modes: SpeedModes, reference: SpeedModes) -> SpeedModes:
        """Return modes whose multiple ones are turned, within their span, to shapes like a reference's."""
        shapes = modes.shapes.copy()
        apart = np.flatnonzero(np.diff(modes.frequencies) > self.same * modes.frequencies[1:]) + 1
        for group in np.split(np.arange(modes.frequencies.size), apart):
            if group.size > 1:
                overlap = shapes[:, group].conj().T @ reference.shapes
                nearest = np.sort(np.argsort(-np.linalg.norm(overlap, axis=0))[: group.size])
                rotation, _ = linalg.polar(overlap[:, nearest])  # the nearest rotation (Procrustes)
                shapes[:, group] = shapes[:, group] @ rotation
        return modes._replace(shapes=shapes)


def _rising(values: np.ndarray) -> int:
    """Return the number of values up to the first that is less than the one before it, or nan."""
    falls = np.flatnonzero(~(np.diff(values) >= 0.0))
    return int(falls[0]) + 1 if falls.size else len(values)
