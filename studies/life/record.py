"""The result of a life: wear, gaps and reduction over hours, and how long the damper damps."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.response.contact_work import contact_name
from vanedamp.files.store import Variable, frozen, load, reader, save
from vanedamp.studies.life.study import Contact, Life
from vanedamp.studies.worst_start import worst_words

_KIND = "life"
_PLAIN = ("reference", "hours", "runs", "trouble", "sentence")
_ARRAYS = {
    "frequency": (("frequency",), "Hz"), "time": (("time",), "h"),
    "depth": (("time", "contact"), "m"), "depth_band": (("time", "contact"), "m"),
    "depth_error": (("time", "contact"), "m"), "depth_rate": (("time", "contact"), "m/h"),
    "depth_rate_confidence": (("time", "contact"), "m/h"),
    "gap": (("time", "cavity"), "m"), "gap_band": (("time", "cavity"), "m"), "play": (("time", "cavity"), "m"),
    "lost": (("time", "damper"), "1"), "reduction": (("time",), "1"), "reduction_band": (("time",), "1"),
    "amplitude": (("time", "frequency"), "1"),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class LifeRecord:
    """Result of a life over n moments, c contacts and f frequencies.

    study              the [life] table and the scene, as plain data
    reference          m, amplitude without bodies in the band: its maximum, or its mean
    contacts           that wear, as in Contact
    time               (n,) h
    depth, depth_rate  (n, c) m and m/h of both partners of a contact; nan where its patch is not known
    depth_band, depth_rate_confidence  (n, c) half widths of 95 % intervals; depth_error: (n, c) m, of the steps
    gap, play          (n, cavities) m; play nan without; gap_band: (n, cavities) m, by confidence and steps
    lost               (n, bodies) fraction of each body that is worn away; nan where its size is not known
    reduction          (n,) of what counts of the band; reduction_band: (n,) half widths
    amplitude          (n, f) over the reference; nan where a run failed
    hours              when the reduction is lost: of its curve, of the lower and of the upper bound; None: not within
                       the hours; 0: never reached
    runs, trouble      number of runs, and of those with another status than ok
    sentence           the answer in words
    worn_away          h after which a body is worn away, which ends the life; None: none is
    starts             worst of the damper over starts (worst_start.worst_start), as "new" and at the "end"
    """

    study: Mapping[str, Any]
    reference: float
    contacts: tuple[Contact, ...]
    frequency: np.ndarray
    time: np.ndarray
    depth: np.ndarray
    depth_band: np.ndarray
    depth_error: np.ndarray
    depth_rate: np.ndarray
    depth_rate_confidence: np.ndarray
    gap: np.ndarray
    gap_band: np.ndarray
    play: np.ndarray
    lost: np.ndarray
    reduction: np.ndarray
    reduction_band: np.ndarray
    amplitude: np.ndarray
    hours: tuple[float | None, float | None, float | None]
    runs: int
    trouble: int
    sentence: str
    starts: Mapping[str, Any] = field(default_factory=dict)
    worn_away: float | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return plain data, arrays as nested lists."""
        data = {name: getattr(self, name) for name in (*_PLAIN, "worn_away")}
        data |= {
            "study": dict(self.study),
            "starts": dict(self.starts),
            "contacts": [one._asdict() for one in self.contacts],
        }
        return data | {name: getattr(self, name).tolist() for name in _ARRAYS}

    @property
    def faces(self) -> dict[str, list[int]]:
        """Contacts of each face with a known patch, by its name: a face wears by the mean of its contacts."""
        found: dict[str, list[int]] = {}
        for place, one in enumerate(self.contacts):
            if np.isfinite(one.area):
                found.setdefault(contact_name(one.damper, one.side), []).append(place)
        return found

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Yield the table over hours: time, gaps with band, reduction with band."""
        for number, hours in enumerate(self.time):
            gaps = zip(self.gap[number], self.gap_band[number], strict=True)
            opened = ", ".join(f"{1e6 * gap:.3f} +- {1e6 * band:.3f}" for gap, band in gaps)
            yield (
                f"{hours:.0f}", opened,
                f"{100 * self.reduction[number]:.1f} +- {100 * self.reduction_band[number]:.1f}",
            )  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write HDF5 that xarray opens. Raises files.store.StoreError."""
        variables = {name: Variable(getattr(self, name), dims, unit) for name, (dims, unit) in _ARRAYS.items()}
        variables["contact"] = Variable(np.array([one.name for one in self.contacts], object), ("contact",))
        attributes = {name: getattr(self, name) for name in _PLAIN} | {
            "hours": json.dumps(self.hours), "study": dict(self.study), "provenance": dict(self.provenance),
            "starts": dict(self.starts),
            "contacts": json.dumps([list(one) for one in self.contacts]), "worn_away": json.dumps(self.worn_away),
        }  # fmt: skip
        save(path, _KIND, variables, attributes)

    @classmethod
    @reader
    def load(cls, path: str | Path) -> LifeRecord:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = load(path, _KIND)
        given: dict[str, Any] = {name: attributes[name] for name in _PLAIN}
        given |= {name: json.loads(attributes.get(name, "{}")) for name in ("study", "starts", "provenance")}
        given["worn_away"] = json.loads(attributes.get("worn_away", "null"))
        given["hours"] = tuple(json.loads(attributes["hours"]))
        given["contacts"] = tuple(Contact(*one) for one in json.loads(attributes["contacts"]))
        given |= {name: frozen(values[name]) for name in _ARRAYS}
        return cls(**given)


def sentence_of(
    hours: tuple[float | None, float | None, float | None], table: Life, values: Mapping[str, np.ndarray],
    starts: Mapping[str, Any], worn: tuple[float, int] | None = None,
) -> str:  # fmt: skip
    """Return how long the damper damps, in words: at rest at first, and what is left from the worst start.

    worn: hours after which a body is worn away, and its number.
    """
    worst = [f"{word}, {worst_words(starts[name])}" for name, word in (("new", "as new"), ("end", "at the end"))]
    if starts["new"]["starts"] == 1:
        worst = [worst_words(starts["new"])]
    return "; ".join([_hours_of(hours, table, values, worn), *worst])


def _hours_of(
    hours: tuple[float | None, float | None, float | None], table: Life, values: Mapping[str, np.ndarray],
    worn: tuple[float, int] | None,
) -> str:  # fmt: skip
    """Return how long the damper damps, by runs that begin as the scene."""
    lost, early, late = hours
    reduction, first, last = f"{table.threshold:.0%}", values["reduction"][0], values["reduction"][-1]
    if worn is not None:
        doubt = "" if lost is None else f", and does not damp by {reduction} before"
        return (
            f"Body {worn[1]} is worn away after {worn[0]:.0f} h{doubt}: the reduction is {first:.0%} as new and "
            f"{last:.0%} at the end"
        )
    if lost == 0.0:
        return (
            f"Does not damp by {reduction} at any time in {table.hours:g} h: {first:.0%} as new, {last:.0%} at the end"
        )
    if lost is None:
        doubt = "" if early is None else f", from {early:.0f} h on without certainty"
        return f"Damps for all {table.hours:g} h{doubt}: the reduction is {first:.0%} as new and {last:.0%} at the end"
    until = f"more than {values['time'][-1]:.0f}" if late is None else f"{late:.0f}"
    begin = "" if first >= table.threshold else f" once worn in (as new {first:.0%})"
    return (
        f"Damps for {lost:.0f} h ({early or 0.0:.0f} to {until} h){begin}: then the reduction falls below {reduction}"
    )
