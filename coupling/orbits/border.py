"""The record of a border: special points of branches over a second number of the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.files.store import Variable, frozen

#: arrays over the points of a border, with their units ("": of its number), and their types
_MEASURES = {"amplitude_mean": "m", "amplitude_max": "m", "impacts_per_period": "1"}


@dataclass(frozen=True, eq=False)
class BorderPoint:
    """A named point of a border: of codimension two, a change of the event sequence, an extremum.

    index: of the border's point before it; parameter, second: the two numbers; kind, note: what happens there; state:
    (k,) at the start of the period.
    """

    index: int
    parameter: float
    second: float
    kind: str
    note: str
    state: np.ndarray


@dataclass(frozen=True, eq=False)
class Border:
    """A border of m points, in order, over the branches' number and a second one.

    kind                of the special points that it consists of, or "peak"
    source              the branch, and its special point, from which it was followed; for a peak -1 less the
                        number of the branch's orbit next to it
    periods             of the excitation that its orbits take
    parameter, second   (m,) the two numbers
    state               (m, k) at the start of a period
    multipliers         (m, k) complex, the largest first
    amplitude_mean      (m,) m; amplitude_max: (m,) m; impacts_per_period: (m,)
    orbits              (m, 2) orbits that meet there, at a smaller and at a larger parameter: of a doubling, those of
                        twice the period too; of a grazing border, those without the impact only; of a Neimark-Sacker
                        border, the orbit without its torus
    stable_orbits       (m, 2) how many of them are stable
    special             its named points
    ends                why it was not followed further, at its first and its last point
    """

    kind: str
    source: tuple[int, int]
    periods: int
    parameter: np.ndarray
    second: np.ndarray
    state: np.ndarray
    multipliers: np.ndarray
    amplitude_mean: np.ndarray
    amplitude_max: np.ndarray
    impacts_per_period: np.ndarray
    orbits: np.ndarray
    stable_orbits: np.ndarray
    special: tuple[BorderPoint, ...]
    ends: tuple[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return a summary as plain data."""
        return {
            "kind": self.kind, "from": {"branch": self.source[0], "special_point": self.source[1]},
            "periods": self.periods, "points": len(self.parameter), "ends": list(self.ends),
            "parameter": self.parameter.tolist(), "second": self.second.tolist(),
            "special_points": [
                {name: getattr(point, name) for name in ("index", "parameter", "second", "kind", "note")}
                for point in self.special
            ],
        }  # fmt: skip


def variables(borders: Sequence[Border], units: tuple[str, str], coordinates: int) -> dict[str, Variable]:
    """Return the variables of a file: points of all borders one after the other, their named points, the borders.

    units: of the two numbers; coordinates: of a state.
    """
    if not borders:
        return {}
    joined = {name: np.concatenate([getattr(border, name) for border in borders]) for name in _arrays()}
    special = [(number, point) for number, border in enumerate(borders) for point in border.special]
    states = np.reshape([point.state for _, point in special], (len(special), coordinates))
    of_points = dict(zip(("parameter", "second"), units, strict=True)) | _MEASURES
    sides = ("border_point", "side")
    return {
        **{f"border_{name}": Variable(joined[name], ("border_point",), unit) for name, unit in of_points.items()},
        "border_of_point": Variable(
            np.repeat(np.arange(len(borders)), [len(border.parameter) for border in borders]), ("border_point",)
        ),
        "border_state": Variable(joined["state"], ("border_point", "coordinate")),
        "border_multiplier_real": Variable(joined["multipliers"].real, ("border_point", "multiplier")),
        "border_multiplier_imag": Variable(joined["multipliers"].imag, ("border_point", "multiplier")),
        "border_orbits": Variable(joined["orbits"], sides),
        "border_stable_orbits": Variable(joined["stable_orbits"], sides),
        "border_kind": Variable(np.array([border.kind for border in borders], object), ("border",)),
        "border_periods": Variable(np.array([border.periods for border in borders], int), ("border",)),
        "border_source": Variable(np.array([border.source for border in borders], int), ("border", "branch_and_point")),
        "border_end": Variable(np.array([border.ends for border in borders], object), ("border", "border_side")),
        "border_special_border": Variable(np.array([number for number, _ in special], int), ("border_special",)),
        "border_special_index": Variable(np.array([point.index for _, point in special], int), ("border_special",)),
        "border_special_parameter": Variable([point.parameter for _, point in special], ("border_special",), units[0]),
        "border_special_second": Variable([point.second for _, point in special], ("border_special",), units[1]),
        "border_special_kind": Variable(np.array([point.kind for _, point in special], object), ("border_special",)),
        "border_special_note": Variable(np.array([point.note for _, point in special], object), ("border_special",)),
        "border_special_state": Variable(states, ("border_special", "coordinate")),
    }  # fmt: skip


def borders_of(values: Mapping[str, Any]) -> tuple[Border, ...]:
    """Return the borders in the variables of a file."""
    found = []
    for number, kind in enumerate(values.get("border_kind", ())):
        own = values["border_of_point"] == number
        multipliers = values["border_multiplier_real"] + 1j * values["border_multiplier_imag"]
        arrays = {
            name: frozen((multipliers if name == "multipliers" else values[f"border_{name}"])[own], dtype)
            for name, dtype in _arrays().items()
        }
        special = [
            BorderPoint(
                int(values["border_special_index"][s]), float(values["border_special_parameter"][s]),
                float(values["border_special_second"][s]), values["border_special_kind"][s],
                values["border_special_note"][s], frozen(values["border_special_state"][s]),
            )
            for s in np.flatnonzero(values["border_special_border"] == number)
        ]  # fmt: skip
        branch, point = values["border_source"][number]
        first, last = values["border_end"][number]
        periods = int(values["border_periods"][number])
        found.append(
            Border(kind, (int(branch), int(point)), periods, special=tuple(special), ends=(first, last), **arrays)
        )
    return tuple(found)


def _arrays() -> dict[str, type]:
    """Return the names of arrays over the points of a border, and their types."""
    named = ("parameter", "second", "state", *_MEASURES)
    return dict.fromkeys(named, float) | {"multipliers": complex, "orbits": int, "stable_orbits": int}
