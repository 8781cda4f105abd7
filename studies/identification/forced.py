"""Forced responses: the steady motion at each measured frequency."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.model import Model, Predicted, Values
from vanedamp.studies.identification.steady import Steady, found_near, over_orbit, run, settled, shifted, slope
from vanedamp.studies.identification.study import IdentificationStudy

#: steps of differences over the range of a number: of motions that are exact, and of means of runs
_EXACT, _MEAN = 1e-5, 2e-2
#: half width of a 95 % confidence interval over the standard deviation
_NORMAL = 1.96
_TINY = float(np.finfo(float).tiny)


class Forced(Model):
    """A measured forced response."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        super().__init__(study, measured, count)
        self._names = (measured.measure, *(["phase"] if len(measured.channels) > 1 else []))
        #: the motion at each frequency, for the values of the numbers that were last predicted
        self._motions: list[Steady | None] = [None] * len(measured.at)
        #: derivatives of their states, and the values at which they hold
        self._slope: list[tuple[np.ndarray, np.ndarray] | None] = [None] * len(measured.at)

    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction by runs."""
        return self._predicted([steady for _, steady in sorted(self._runs(values))])

    def _runs(self, values: np.ndarray) -> Iterator[tuple[int, Steady | None]]:
        """Yield places and runs; those that go up or down begin with the state of their neighbour."""
        before: RestartState | None = None
        for place, linked in self._order():
            scene = self._at(values, place)
            steady = None if scene is None else run(scene, before if linked else None, self.count)
            before = None if steady is None else steady.restart
            yield place, steady

    def _order(self) -> Iterator[tuple[int, bool]]:
        """Yield places as they were measured, and whether each was reached from the one before."""
        direction, at = np.array(self.measured.direction), self.measured.at
        for way in ("", "up", "down"):
            places = np.flatnonzero(direction == way)
            places = places[np.argsort(-at[places] if way == "down" else at[places], kind="stable")]
            for number, place in enumerate(places.tolist()):
                yield place, bool(way) and number > 0

    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction by orbits near the last ones, and by runs where there are none."""
        before: RestartState | None = None
        for place, linked in self._order():
            scene, last = self._at(values, place), self._motions[place]
            moved: np.ndarray | float = 0.0
            if (known := self._slope[place]) is not None:
                moved = known[1] @ (values - known[0])
            steady = None if scene is None or last is None else found_near(scene, last, self.count, moved)
            if steady is None and scene is not None:
                found = run(scene, before if linked else None, self.count)
                steady = None if found is None else settled(found, self.count)
            before = None if steady is None else steady.restart
            self._motions[place] = steady
            self._slope[place] = None
        return self._predicted(self._motions)

    def derivative(self, values: np.ndarray) -> Values:
        """Return the derivatives: of orbits exact ones, of means of runs differences."""
        rows = [self._slopes(values, place, steady) for place, steady in enumerate(self._motions)]
        of = np.array(rows).transpose(1, 0, 2)
        return {channel.name: of[number] for number, channel in enumerate(self.measured.channels)}

    def _slopes(self, values: np.ndarray, place: int, steady: Steady | None) -> np.ndarray:
        """Return derivatives (c, P) of the channels at a place."""
        if steady is None:
            return np.zeros((len(self._names), len(values)))
        of_state = slope(steady, self.paths, self.count)
        self._slope[place] = None if of_state is None else (values, of_state)

        def figures(moved: np.ndarray) -> np.ndarray:
            scene = self._at(moved, place)
            near = None
            if scene is not None and of_state is not None:
                near = shifted(scene, steady, of_state @ (moved - values))
            elif scene is not None:
                near = found_near(scene, steady, self.count) or run(scene, steady.restart, self.count)
            return self._figures(near or steady)[0]

        return self.differences(values, figures, _MEAN if steady.orbit is None else _EXACT)

    def _at(self, values: np.ndarray, place: int) -> Scene | None:
        return self.scene(values, {FREQUENCY: float(self.measured.at[place])})

    def _figures(self, steady: Steady) -> tuple[np.ndarray, float]:
        """Return the measured quantities (c,) of a motion, and the relative error of the amplitude."""
        if steady.orbit is not None and self._names in (("amplitude_mean",), ("amplitude_max",)):
            return np.array([getattr(steady.orbit, self._names[0])]), 0.0
        response = steady.response or over_orbit(steady, self.count)
        figures = np.array([getattr(response, name) for name in self._names])
        error = response.amplitude_mean_confidence if steady.orbit is None else 0.0
        return figures, (error or 0.0) / _NORMAL / max(response.amplitude_mean, _TINY)

    def _predicted(self, motions: list[Steady | None]) -> Predicted:
        nothing = np.full(len(self._names), np.nan), 0.0
        figures, errors = zip(*(nothing if one is None else self._figures(one) for one in motions), strict=True)
        of = dict(zip((channel.name for channel in self.measured.channels), np.transpose(figures), strict=True))
        repeats = [one is not None and not error for one, error in zip(motions, errors, strict=True)]
        return Predicted(of, np.array(errors), np.array(repeats))
