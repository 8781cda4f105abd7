"""The result of an identification, in memory and on disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Coded, Record
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import validate
from vanedamp.files.toml_output import write_commented

#: chance of a misfit below which it is none, and noise, relative, that no measurement has
CHANCE, ROUGHEST = 0.01, 0.2


class IdentificationStatus(StrEnum):
    """How an identification ended."""

    OK = "ok"
    """every number has an interval within its bounds, and the misfit is no larger than the noise"""
    FLAT = "flat"
    """the measurements do not tell some of the numbers between their bounds"""
    AMBIGUOUS = "ambiguous"
    """other numbers fit as well: the intervals are those of one of several minima"""
    MISFIT = "misfit"
    """the model misses the measurements by more than their noise: its numbers and intervals are not to be trusted"""
    NOT_CONVERGED = "not_converged"
    """the search has not reached a minimum"""
    BUDGET = "budget"
    """its budget of time has ended the search: the best numbers so far, with intervals by derivatives where there is no
    profile"""


class Misfit(NamedTuple):
    """Whether a model misses measurements by more than their noise.

    squares, freedom: sum of squares over channels with given deviations, and its degrees of freedom; chance: that noise
    makes it as large or larger; runs: chance of as few changes of sign of the residuals, of channels with estimated
    deviations; nan where neither can be told; noise: the largest estimated deviation over the values, nan without.
    """

    squares: float
    freedom: int
    chance: float
    runs: float
    noise: float = float("nan")

    @property
    def larger(self) -> bool:
        """Whether the misfit is larger than the noise."""
        return self.chance < CHANCE or self.runs < CHANCE or self.noise > ROUGHEST


class Proposal(NamedTuple):
    """What a further measurement of a forced response would tell.

    axes: (a,) dotted paths; points: (c, a) their values; shrink: (c, P) standard deviation of each number with the
    measurement over that without; worst: the number whose deviation is the largest over its range now.
    """

    axes: tuple[str, ...]
    points: np.ndarray
    shrink: np.ndarray
    worst: int

    @property
    def best(self) -> int:
        """Number of the point that tells most of the worst number."""
        return int(np.argmin(self.shrink[:, self.worst]))


def _encode_proposal(proposal: Proposal | None) -> dict[str, Any] | None:
    if proposal is None:
        return None
    return proposal._asdict() | {"points": proposal.points.tolist(), "shrink": proposal.shrink.tolist()}


def _decode_proposal(data: Mapping[str, Any], _path: str) -> Proposal:
    return Proposal(tuple(data["axes"]), frozen(data["points"]), frozen(data["shrink"]), data["worst"])


_Misfit = Annotated[Misfit, Coded(Misfit._asdict, lambda data, _: Misfit(**data))]
_Proposal = Annotated[Proposal | None, Coded(_encode_proposal, _decode_proposal)]
_Scene = Annotated[Scene, Coded(Scene.to_dict, lambda data, path: validate(Scene, data, path))]
_OfNumbers = Annotated[np.ndarray, Array(("number",))]
_ProfilePoints = Annotated[np.ndarray, Array(("profile_point",))]
_Data = Annotated[np.ndarray, Array(("datum",))]


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Record, Plotted):
    """Numbers of a scene that measurements tell."""

    KIND: ClassVar[str] = "identification"
    study: Mapping[str, Any]
    """the numbers sought and the measurements, as plain data"""
    status: IdentificationStatus
    """how it ended"""
    notes: tuple[str, ...]
    """to be read before results are used"""
    sentence: str
    """the answer in words"""
    paths: tuple[str, ...]
    """of the numbers"""
    best: _OfNumbers
    """values with the least misfit"""
    covariance: Annotated[np.ndarray, Array(("number", "other_number"))]
    """by Gauss and Newton; infinite for an undetermined parameter"""
    interval: Annotated[np.ndarray, Array(("number", "end"))]
    """95 % intervals by profile likelihood"""
    open: Annotated[np.ndarray, Array(("number", "end"), dtype=bool)]
    """where an end is a bound of the number"""
    profile_number: Annotated[np.ndarray, Array(("profile_point",), dtype=np.int64)]
    """to whose profile a point belongs"""
    profile_value: _ProfilePoints
    """of that number"""
    profile_rise: _ProfilePoints
    """of the misfit with the other numbers at their best"""
    threshold: float
    """the rise at the ends of an interval"""
    misfit: float
    """sum of squared residuals in standard deviations, with priors"""
    test: _Misfit
    """test of the model by the misfit"""
    minima: Annotated[np.ndarray, Array(("minimum", "number"))]
    """where the searches ended"""
    minima_misfit: Annotated[np.ndarray, Array(("minimum",))]
    """their misfit"""
    channels: tuple[Mapping[str, str], ...]
    """names of what was measured"""
    deviation: Annotated[np.ndarray, Array(("channel",))]
    """standard deviations of the channels; of "ratio" relative"""
    estimated: Annotated[np.ndarray, Array(("channel",), dtype=bool)]
    """whether the deviations are estimated from the residuals"""
    data_channel: Annotated[np.ndarray, Array(("datum",), dtype=np.int64)]
    """channel of each datum, from 0"""
    data_at: _Data
    """Hz or s"""
    data_value: _Data
    """as measured"""
    data_deviation: _Data
    """standard deviation"""
    data_model: _Data
    """value of the model"""
    data_band: _Data
    """half width of the model's 95 % band"""
    data_repeats: Annotated[np.ndarray, Array(("datum",), dtype=bool)]
    """whether the model's motion repeats or is one run"""
    counts: Mapping[str, int]
    """engine runs ("runs"), evaluations of period maps ("passages")"""
    wall_time_s: float
    """time that it took [s]"""
    scene: _Scene
    """with the best numbers"""
    proposal: _Proposal = None
    """benefit of further measurements; None without a level"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def correlation(self) -> np.ndarray:
        """Correlations (P, P) of the numbers; nan of one that nothing tells."""
        deviation = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.multiply.outer(deviation, deviation))

    @property
    def flat(self) -> tuple[str, ...]:
        """Paths of the numbers that the measurements do not tell between their bounds."""
        return tuple(path for path, ends in zip(self.paths, self.open, strict=True) if ends.all())

    def labels(self) -> dict[str, Any]:
        """Return the paths of the numbers."""
        return {"number": self.paths}

    def derived(self) -> dict[str, Any]:
        """Return the correlations, the numbers that are not told, and the provenance."""
        return {
            "correlation": self.correlation.tolist(), "flat": list(self.flat), "provenance": dict(self.provenance),
        }  # fmt: skip

    def save_scene(self, path: str | Path) -> None:
        """Write the scene with the best numbers as a TOML file, with the meaning of its keys. Raises StoreError."""
        from vanedamp.studies.file_kinds import KINDS

        write_commented(path, relative(self.scene.to_dict(), path), KINDS["scene"], {"": self.sentence})
