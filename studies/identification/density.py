"""The probability of a scene's numbers by measurements, as samplers of Bayesian statistics take it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.fit import Fit
from vanedamp.studies.identification.study import IdentificationStudy


class LogDensity:
    """Logarithm of the posterior density of P numbers, up to a constant, with its gradient.

    Errors of measurements are normal, of ratios lognormal; priors are those of the study, uniform between the bounds
    without. Motions are those to which the scene's own start leads, or at measured directions the neighbour's state: a
    value depends on no call before. Where a motion does not repeat, the confidence of its mean widens the error, and
    the normal density is lower by that; the gradient takes it as constant.
    """

    def __init__(self, study: IdentificationStudy | str | Path, deviations: Sequence[float] | None = None) -> None:
        """Take a study or its file, and standard deviations of its channels (Identification.deviation).

        Raises InputError if a channel has no deviation in the study, and none are given.
        """
        self.study = study if isinstance(study, IdentificationStudy) else IdentificationStudy.load(study)
        self._fit = Fit(self.study, deviations)
        if deviations is None and any(self._fit.estimated):
            raise InputError("deviations: the study leaves some open; give noise there, or those of its identification")

    def __call__(self, values: Sequence[float] | np.ndarray) -> float:
        """Return the logarithm at values (P,) of the numbers; -inf outside of their bounds."""
        z = self._inside(values)
        if z is None:
            return -np.inf
        self._fit.forget()
        residual = self._fit.residual(z)
        return -0.5 * float(residual @ residual) - self._fit.widening(z)

    def gradient(self, values: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return its derivatives (P,) by the numbers; nan outside of their bounds."""
        z = self._inside(values)
        if z is None:
            return np.full(len(self.study.numbers), np.nan)
        self._fit.forget()
        slope = -self._fit.residual(z) @ self._fit.jacobian(z)
        return np.asarray(slope / self.study.slope(self.study.values(z)))

    def _inside(self, values: Sequence[float] | np.ndarray) -> np.ndarray | None:
        """Return coordinates (P,); None outside of the bounds."""
        bounds = np.array([(number.min, number.max) for number in self.study.numbers.values()]).T
        if not (np.all(np.asarray(values) >= bounds[0]) and np.all(np.asarray(values) <= bounds[1])):
            return None
        return self.study.coordinates(np.asarray(values, float))
