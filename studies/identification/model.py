"""What a scene with given numbers predicts of a measurement, with derivatives by the numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.sweep.runs import Runs
from vanedamp.studies.identification.data import Measured
from vanedamp.studies.identification.steady import Followers
from vanedamp.studies.identification.study import IdentificationStudy

#: arrays by the names of a measurement's channels
Values = dict[str, np.ndarray]


class Predicted(NamedTuple):
    """What a model says of a measurement at n places.

    values: (n,) by channel, nan where the model says nothing; errors: (n,) standard deviations, relative or of angles,
    where they are means of runs; repeats: (n,) whether the motion repeats, or is one run.
    """

    values: Values
    errors: np.ndarray
    repeats: np.ndarray


class Model(ABC):
    """What scenes say of one measurement. followers: of its steady motions; count: of engine runs, to which it adds."""

    def __init__(self, study: IdentificationStudy, measured: Measured, count: Counter[str]) -> None:
        self.measured, self.paths, self.count = measured, study.paths, count
        self._bounds = np.array([(number.min, number.max) for number in study.numbers.values()]).T
        further = (*measured.levels, FREQUENCY) if measured.kind == "forced" else ()
        self.runs = Runs(study.base.replace(measured.changes), (*study.paths, *further))
        self.followers = Followers(self.runs, study.paths, count, ())

    def numbers(self, values: np.ndarray) -> dict[str, float]:
        """Return values (P,) of the numbers by their paths."""
        return dict(zip(self.paths, map(float, values), strict=True))

    @abstractmethod
    def quick(self, values: np.ndarray) -> Predicted:
        """Return the prediction of values (P,) of the numbers by runs from the scene's own start."""

    @abstractmethod
    def predict(self, values: np.ndarray) -> Predicted:
        """Return the prediction of values (P,) of the numbers, from the last motions found where that is faster."""

    @abstractmethod
    def derivative(self, values: np.ndarray) -> Values:
        """Return derivatives (n, P) of the channels at values of the numbers that `predict` was called with last."""

    def rough_derivative(self, values: np.ndarray) -> Values:
        """Return derivatives that lead a search: these, or some that are faster and less exact."""
        return self.derivative(values)

    def differences(
        self, values: np.ndarray, of: Callable[[np.ndarray], np.ndarray], step: float, here: np.ndarray | None = None
    ) -> np.ndarray:
        """Return differences (..., P) of a function (...,) of the numbers, by steps relative to their ranges.

        here: its values at these numbers, for differences to one side.
        """
        low, high = self._bounds
        columns = []
        for place, size in enumerate(step * (high - low)):
            ends = np.array([values, values])
            one = size if values[place] + size <= high[place] else -size
            sides = [-size, size] if here is None else [0.0, one]
            ends[:, place] = np.clip(values[place] + sides, low[place], high[place])
            first = of(ends[0]) if here is None else here
            columns.append((of(ends[1]) - first) / (ends[1, place] - ends[0, place]))
        return np.stack(columns, axis=-1)
