"""Designs of sweeps, each rated by its worst curve.

The designer chooses gap and mass, but neither the start of a run nor the friction
(coupling.sweep.designs.is_choice). Curves that differ only in these are one design, rated by the worst of
them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.coupling.sweep.designs import is_choice, ranked
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.studies.report.forced_response import ForcedResponse


@dataclass(frozen=True, eq=False)
class DesignCurves:
    """The curves of a design, the one with the highest damped peak first."""

    curves: tuple[ForcedResponse, ...]

    @property
    def worst(self) -> ForcedResponse:
        """The curve with the highest mean of peaks, relative to the maximum without bodies."""
        return self.curves[0]

    @property
    def largest(self) -> ForcedResponse:
        """The curve with the largest amplitude, relative to the maximum without bodies."""
        return max(self.curves, key=lambda curve: _or_none(curve.headline.maximum_ratio))

    @property
    def starts(self) -> int:
        """Number of ways in which its runs begin."""
        along = len(self.worst.x) if is_start(self.worst.axis) else 1
        return along * len({curve.start for curve in self.curves})

    @property
    def remarks(self) -> list[str]:
        """Remarks on the curve that the results refer to, and on a single start."""
        remarks = []
        if len(self.curves) > 1:
            paths = dict.fromkeys(path for curve in self.curves for path in curve.settings if not is_choice(path))
            over = f" ({', '.join(paths)})" if paths else ""
            remarks.append(f"this is the worst of {len(self.curves)} curves of the design{over}")
        ratio, worst = (f"{curve.headline.maximum_ratio:.3f}" for curve in (self.largest, self.worst))
        if ratio != worst:
            remarks.append(f"the largest amplitude is {ratio}, of {self.largest.name}")
        return remarks if self.starts > 1 else [*remarks, "one start only"]

    @property
    def sentence(self) -> str:
        """The result of the worst curve in words."""
        return "; ".join([self.worst.sentence, *self.remarks])

    def to_json(self) -> dict[str, Any]:
        """Return plain data: the worst curve's name and headline, the names of all curves, and the number of starts."""
        of = {"curves": [curve.name for curve in self.curves], "starts": self.starts, "largest": self.largest.name}
        return self.worst.to_json() | of | {"sentence": self.sentence}


def designs(responses: Iterable[ForcedResponse]) -> list[DesignCurves]:
    """Return the designs of curves, best first: the best has the lowest damped peak of its worst curve.

    Peaks are relative to peaks without bodies. Designs whose peak may be at a failed point come last.
    """
    curves = list(responses)
    heights = np.array([curve.headline.peak_ratio for curve in curves])
    certain = np.array([curve.peak_known for curve in curves])
    judged = ranked([curve.design for curve in curves], heights, certain, certain)
    return [DesignCurves(tuple(curves[index] for index in indices)) for indices in judged]


def best_first(responses: Iterable[ForcedResponse]) -> list[ForcedResponse]:
    """Return curves sorted by designs, best first, and within each design worst first."""
    return [curve for design in designs(responses) for curve in design.curves]


def _or_none(value: float) -> float:
    return -np.inf if np.isnan(value) else value
