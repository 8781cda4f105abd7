"""The result of an identification, in memory and on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.files.display import Plotted
from vanedamp.files.store import Variable, frozen, load, reader, save
from vanedamp.files.toml_input import validate
from vanedamp.files.toml_output import write_commented

_KIND = "identification"
#: chance of a misfit below which it is none, and noise, relative, that no measurement has
CHANCE, ROUGHEST = 0.01, 0.2
_ARRAYS = {
    "best": ("number",), "covariance": ("number", "other_number"), "interval": ("number", "end"),
    "open": ("number", "end"), "profile_number": ("profile_point",), "profile_value": ("profile_point",),
    "profile_rise": ("profile_point",), "minima": ("minimum", "number"), "minima_misfit": ("minimum",),
    "deviation": ("channel",), "estimated": ("channel",), "data_channel": ("datum",), "data_at": ("datum",),
    "data_value": ("datum",), "data_deviation": ("datum",), "data_model": ("datum",), "data_band": ("datum",),
    "data_repeats": ("datum",),
}  # fmt: skip
_WHOLE = {"open": bool, "estimated": bool, "data_repeats": bool, "profile_number": int, "data_channel": int}
_PLAIN = ("status", "threshold", "misfit", "wall_time_s", "sentence")
_TABLES = ("study", "notes", "paths", "channels", "test", "counts", "provenance")


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


@dataclass(frozen=True, eq=False, repr=False)
class Identification(Plotted):
    """Numbers of a scene that measurements tell: P numbers, c channels of N values (data), q points of profiles.

    status, notes       how it ended, and what to know before the numbers are used
    paths               (P,) of the numbers
    best                (P,) values with the least misfit
    covariance          (P, P), by Gauss and Newton; infinite of a number that nothing tells
    interval            (P, 2) 95 % intervals by profile likelihood; open: (P, 2) where an end is a bound of the number
    profile_*           points (q,): number, its value, rise of the misfit with the other numbers at their best;
                        threshold: the rise at the ends of an interval
    misfit, test        sum of squared residuals in standard deviations, with priors, and what it says of the model
    minima              (s, P) where the searches ended, minima_misfit: (s,)
    channels            (c,) names of what was measured; deviation: (c,) their standard deviations, relative ones of
                        "ratio", estimated: (c,) whether they are those of the residuals
    data_*              (N,) channel, place (Hz or s), measured value with its standard deviation, value of the model
                        with the half width of its 95 % band, and whether the model's motion repeats or is one run
    proposal            what further measurements would tell; None without a level
    counts              engine runs ("runs"), evaluations of period maps ("passages")
    scene               with the best numbers
    """

    study: Mapping[str, Any]
    status: IdentificationStatus
    notes: tuple[str, ...]
    sentence: str
    paths: tuple[str, ...]
    best: np.ndarray
    covariance: np.ndarray
    interval: np.ndarray
    open: np.ndarray
    profile_number: np.ndarray
    profile_value: np.ndarray
    profile_rise: np.ndarray
    threshold: float
    misfit: float
    test: Misfit
    minima: np.ndarray
    minima_misfit: np.ndarray
    channels: tuple[Mapping[str, str], ...]
    deviation: np.ndarray
    estimated: np.ndarray
    data_channel: np.ndarray
    data_at: np.ndarray
    data_value: np.ndarray
    data_deviation: np.ndarray
    data_model: np.ndarray
    data_band: np.ndarray
    data_repeats: np.ndarray
    proposal: Proposal | None
    counts: Mapping[str, int]
    wall_time_s: float
    scene: Scene
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

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        proposal = None if self.proposal is None else _plain(self.proposal)
        return self._named() | arrays | {
            "correlation": self.correlation.tolist(), "flat": list(self.flat), "proposal": proposal,
            "scene": self.scene.to_dict(),
        }  # fmt: skip

    def _named(self) -> dict[str, Any]:
        plain: dict[str, Any] = {name: getattr(self, name) for name in _PLAIN}
        tables = {name: getattr(self, name) for name in _TABLES if name != "test"}
        return plain | {"status": self.status.value, "test": self.test._asdict()} | tables

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens. Raises files.store.StoreError."""
        variables = {name: Variable(_stored(getattr(self, name)), dims) for name, dims in _ARRAYS.items()}
        variables["number"] = Variable(np.array(self.paths, object), ("number",))
        attributes = self._named() | {"scene": self.scene.to_dict()}
        for name in ("notes", "paths", "channels"):
            attributes[name] = json.dumps(list(attributes[name]))
        if self.proposal is not None:
            attributes["proposal"] = _plain(self.proposal)
        save(path, _KIND, variables, attributes)

    @classmethod
    @reader
    def load(cls, path: str | Path) -> Identification:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = load(path, _KIND)
        tables = {name: json.loads(attributes[name]) for name in _TABLES}
        tables |= {name: tuple(tables[name]) for name in ("notes", "paths", "channels")}
        found = json.loads(attributes.get("proposal", "null"))
        proposal = None
        if found is not None:
            proposal = Proposal(tuple(found["axes"]), frozen(found["points"]), frozen(found["shrink"]), found["worst"])
        arrays: dict[str, Any] = {name: frozen(values[name], _WHOLE.get(name, float)) for name in _ARRAYS}
        plain = {name: attributes[name] for name in _PLAIN} | {"status": IdentificationStatus(attributes["status"])}
        return cls(
            **plain, **arrays, **tables | {"test": Misfit(**tables["test"])}, proposal=proposal,
            scene=validate(Scene, json.loads(attributes["scene"]), str(path)),
        )  # fmt: skip

    def save_scene(self, path: str | Path) -> None:
        """Write the scene with the best numbers as a TOML file, with the meaning of its keys. Raises StoreError."""
        from vanedamp.studies.file_kinds import KINDS

        write_commented(path, relative(self.scene.to_dict(), path), KINDS["scene"], {"": self.sentence})


def _plain(proposal: Proposal) -> dict[str, Any]:
    return {
        "axes": list(proposal.axes), "points": proposal.points.tolist(), "shrink": proposal.shrink.tolist(),
        "worst": proposal.worst,
    }  # fmt: skip


def _stored(array: np.ndarray) -> np.ndarray:
    return array.astype(np.int8) if array.dtype == bool else array
