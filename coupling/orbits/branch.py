"""The records of branches of orbits, in memory and on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from vanedamp.coupling.orbits.border import Border, borders_of
from vanedamp.coupling.orbits.border import variables as border_variables
from vanedamp.coupling.orbits.newton import MEASURES, Orbit
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.response.spot_stress import stress_axes
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Own, Record
from vanedamp.files.store import Variable, frozen

FLAGS = ("stable", "symmetric", "undetermined")
#: types of the arrays over the points of a branch; others are floats
_TYPES = {"multipliers": complex, "neutral": int, "sequence": object} | dict.fromkeys(FLAGS, bool)


class BranchPoint(NamedTuple):
    """An orbit of a branch, as a branch keeps it: see Branch and Orbit."""

    parameter: float
    state: np.ndarray
    multipliers: np.ndarray
    neutral: int
    stable: bool
    amplitude_mean: float
    amplitude_max: float
    impacts_per_period: float
    sequence: str
    symmetric: bool
    undetermined: bool

    @classmethod
    def of(cls, orbit: Orbit) -> BranchPoint:
        """Return an orbit as a branch keeps it."""
        return cls(
            orbit.parameter, orbit.state, orbit.multipliers, orbit.neutral, orbit.stable, orbit.amplitude_mean,
            orbit.amplitude_max, orbit.impacts_per_period, "; ".join(orbit.passage.sequence), orbit.symmetric,
            orbit.undetermined,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A bifurcation, a change of the event sequence or the end of a branch.

    index: of the branch's point before it; kind: "fold", "period doubling", "neimark-sacker", "pitchfork", "grazing",
    "sequence" or "end"; note: what happens there; state: (k,) at the start of the period.
    """

    index: int
    parameter: float
    kind: str
    note: str
    state: np.ndarray


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch of m orbits with states of k coordinates, in the order in which it was followed.

    periods             of the excitation that its orbits take
    parameter           (m,)
    state               (m, k) at the start of a period, in the units of Branches.names
    multipliers         (m, k) complex, the largest first
    neutral             (m,) how many of them are 1 because the orbit may be moved, as a body at rest or in free flight
    stable              (m,) whether all others lie inside the unit circle; False where that decides nothing
    amplitude_mean      (m,) m, mean of the periods' largest displacements of the response, as a sweep's
    amplitude_max       (m,) m
    impacts_per_period  (m,)
    sequence            (m,) names of the events in order, joined by "; "
    symmetric           (m,) whether an orbit is its own mirror image half a period later
    undetermined        (m,) whether stability is open: events meet or graze, and multipliers hold on one side only
    special             bifurcations, changes of the sequence, and the end
    end                 why it was not followed further
    source              the branch, and its special point, from which this one bifurcates; None for the first
    """

    periods: int
    parameter: np.ndarray
    state: np.ndarray
    multipliers: np.ndarray
    neutral: np.ndarray
    stable: np.ndarray
    amplitude_mean: np.ndarray
    amplitude_max: np.ndarray
    impacts_per_period: np.ndarray
    sequence: np.ndarray
    symmetric: np.ndarray
    undetermined: np.ndarray
    special: tuple[SpecialPoint, ...]
    end: str
    source: tuple[int, int] | None = None

    @classmethod
    def of(
        cls, points: Sequence[BranchPoint], periods: int, special: Sequence[SpecialPoint], end: str,
        source: tuple[int, int] | None,
    ) -> Branch:  # fmt: skip
        """Return the branch of some points."""
        columns = dict(zip(BranchPoint._fields, zip(*points, strict=True), strict=True))
        arrays = {name: frozen(column, _TYPES.get(name, float)) for name, column in columns.items()}
        return cls(periods=periods, special=tuple(special), end=end, source=source, **arrays)

    @property
    def points(self) -> list[BranchPoint]:
        """Its orbits one by one."""
        columns = (getattr(self, name) for name in BranchPoint._fields)
        return [BranchPoint(*entry) for entry in zip(*columns, strict=True)]

    def to_json(self) -> dict[str, Any]:
        """Return a summary as plain data."""
        return {
            "points": len(self.parameter), "parameter_min": float(self.parameter.min()),
            "parameter_max": float(self.parameter.max()), "stable_points": int(self.stable.sum()),
            "undetermined_points": int(self.undetermined.sum()), "periods": self.periods, "end": self.end,
            "from": None if self.source is None else {"branch": self.source[0], "special_point": self.source[1]},
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Branches(Record, Plotted):
    """Branches of periodic orbits of a scene over one of its numbers.

    scene: with its [orbit] table; names, scale: (k,) of the coordinates of states; branches: in the order in which they
    were found; iterations: of Newton's method; warnings: to be read before results are used; provenance: versions and
    further data of the caller (JSON-able); borders: of special points over `second`; stress: (points, s, 8) Pa,
    amplitudes of stress at s hot spots, by response.spot_stress.MEASURES, of the points of all branches one after the
    other; None without hot spots.
    """

    KIND: ClassVar[str] = "orbits"
    IN_JSON = ("iterations", "warnings")
    scene: SceneField
    names: Annotated[tuple[str, ...], Array(("coordinate",), dtype=object, name="coordinate", json="names")]
    scale: Annotated[np.ndarray, Array(("coordinate",))]
    branches: Annotated[tuple[Branch, ...], Own()]
    iterations: int
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    borders: Annotated[tuple[Border, ...], Own()] = ()
    stress: Annotated[np.ndarray | None, Array(("point", "hot_spot", "stress_measure"), "Pa")] = None

    @property
    def second(self) -> str:
        """Dotted path of the number over which special points are followed, "" without."""
        track = None if self.scene.orbit is None else self.scene.orbit.track
        return "" if track is None else track.parameter

    @property
    def parameter(self) -> str:
        """Dotted path of the number that changes along the branches."""
        assert self.scene.orbit is not None
        return self.scene.orbit.parameter

    def derived(self) -> dict[str, Any]:
        """Return a summary of branches, special points and borders."""
        special = [
            {
                "branch": number, "index": point.index, "parameter": point.parameter, "kind": point.kind,
                "note": point.note,
            }
            for number, branch in enumerate(self.branches)
            for point in branch.special
        ]  # fmt: skip
        return {
            "parameter": self.parameter, "unit": unit_of(self.parameter),
            "branches": [branch.to_json() for branch in self.branches], "special_points": special,
            "second": self.second, "borders": [border.to_json() for border in self.borders],
        }  # fmt: skip

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file: the points of all branches one after the other, special points, branches."""
        unit, branches = unit_of(self.parameter), self.branches
        special = [(number, point) for number, branch in enumerate(branches) for point in branch.special]
        sources = [(-1, -1) if branch.source is None else branch.source for branch in branches]
        points = {name: np.concatenate([getattr(branch, name) for branch in branches]) for name in BranchPoint._fields}
        points |= {name: points[name].astype(np.int8) for name in FLAGS}
        points["branch_of_point"] = np.repeat(np.arange(len(branches)), [len(branch.parameter) for branch in branches])
        state, multipliers, units = points.pop("state"), points.pop("multipliers"), {"parameter": unit} | MEASURES
        of_special = {
            "special_branch": np.array([number for number, _ in special], int),
            "special_index": np.array([point.index for _, point in special], int),
            "special_kind": np.array([point.kind for _, point in special], object),
            "special_note": np.array([point.note for _, point in special], object),
        }
        of_branches = {
            "periods": np.array([branch.periods for branch in branches], int),
            "end": np.array([branch.end for branch in branches], object),
            "source_branch": np.array([source[0] for source in sources], int),
            "source_special": np.array([source[1] for source in sources], int),
        }
        states = np.reshape([point.state for _, point in special], (len(special), len(self.names)))
        return super().variables() | {
            "state": Variable(state, ("point", "coordinate")),
            "multiplier_real": Variable(multipliers.real, ("point", "multiplier")),
            "multiplier_imag": Variable(multipliers.imag, ("point", "multiplier")),
            **{name: Variable(values, ("point",), units.get(name, "1")) for name, values in points.items()},
            "special_parameter": Variable([point.parameter for _, point in special], ("special",), unit),
            "special_state": Variable(states, ("special", "coordinate")),
            **{name: Variable(values, ("special",)) for name, values in of_special.items()},
            **{name: Variable(values, ("branch",)) for name, values in of_branches.items()},
            **({} if self.stress is None else stress_axes(list(self.provenance["hot_spots"]))),
            **border_variables(self.borders, (unit, unit_of(self.second)), len(self.names)),
        }

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        return super().attributes() | {"parameter_path": self.parameter}

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Branches:
        """Return the record in the variables and attributes of a file."""
        values = dict(values) | {"multipliers": values["multiplier_real"] + 1j * values["multiplier_imag"]}
        branches = []
        for number, periods in enumerate(values["periods"]):
            own = values["branch_of_point"] == number
            arrays = {name: frozen(values[name][own], _TYPES.get(name, float)) for name in BranchPoint._fields}
            special = [
                SpecialPoint(
                    int(values["special_index"][s]), float(values["special_parameter"][s]), values["special_kind"][s],
                    values["special_note"][s], frozen(values["special_state"][s]),
                )
                for s in np.flatnonzero(values["special_branch"] == number)
            ]  # fmt: skip
            source = int(values["source_branch"][number]), int(values["source_special"][number])
            branches.append(
                Branch(
                    periods=int(periods), special=tuple(special), end=values["end"][number],
                    source=None if source[0] < 0 else source, **arrays,
                )
            )  # fmt: skip
        return cls(
            branches=tuple(branches), borders=borders_of(values), **cls.given(values, attributes, path),
        )  # fmt: skip
