"""The result of a study of a device: the one to build, what it holds, and why the others lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.files.record import Array, Record
from vanedamp.studies.design.scenes import UNCERTAIN, Device, words_of
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.design.verdict import AMBER, GREEN, RED, HeldValue, text_of

_Curve = Annotated[np.ndarray, Array(("frequency",), "m")]
#: names of what is uncertain, by their paths
NAMES = {path: name.removesuffix("_deg") for name, path in UNCERTAIN.items()}


@dataclass(frozen=True, eq=False, repr=False)
class DesignRecord(Record):
    """The device of a study, over f frequencies."""

    KIND: ClassVar[str] = "design"
    study: Mapping[str, Any]
    """the study file, as plain data"""
    device: Mapping[str, Any]
    """number of bodies, mass of each [kg], gap [m]"""
    cavities: tuple[str, ...]
    """names of the cavities that hold them, one for each body"""
    grade: str
    """"green": all that must hold does, over the whole intervals; "amber": an interval does not decide; "red": not"""
    values: tuple[Mapping[str, Any], ...]
    """results with intervals, limits, grades and sources (verdict.HeldValue)"""
    others: tuple[Mapping[str, Any], ...]
    """other devices that were confirmed, best first: device, ratio of amplitudes, and why they lost"""
    levels: tuple[Mapping[str, Any], ...]
    """of the model hierarchy, cheapest first: natural modes, None: the whole model; amplitude at the worst draw [m]"""
    level: int | None
    """the one that decides"""
    at: Mapping[str, Any]
    """frequency [Hz], start, and numbers of the largest amplitude"""
    by_number: Mapping[str, float]
    """what the range of each uncertain number adds to the largest amplitude, by its path [m], largest first"""
    frequency: Annotated[np.ndarray, Array(("frequency",), "Hz")]
    """of the band"""
    undamped: _Curve
    """amplitude without bodies"""
    fixed: _Curve
    """amplitude with the bodies fixed"""
    worst: _Curve
    """largest amplitude over all draws, from rest, going up and going down"""
    reference: float
    """maximum without bodies [m]"""
    runs: int
    """number of runs of all confirmed devices"""
    failed: int
    """of these, without a result"""
    unsure: int
    """of these, not steady at their end"""
    assumed: tuple[str, ...]
    """what was assumed"""
    neglected: tuple[str, ...]
    """what was not modelled"""
    measure: str
    """which measurement would narrow the result most"""
    hashes: Mapping[str, str]
    """SHA-256 of the user's files, by their names"""
    sentence: str
    """the answer in words"""
    modes: str
    """file of the modes, in the same folder"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def chosen(self) -> Device:
        """The device."""
        return Device(**self.device)

    @property
    def held(self) -> list[HeldValue]:
        """Its results."""
        names = HeldValue.__dataclass_fields__
        return [HeldValue(**{key: value[key] for key in names}) for value in self.values]


def sentence_of(device: Device, grade: str, ratio: float, at: Mapping[str, Any], failing: Sequence[HeldValue]) -> str:
    """Return the answer in words."""
    text = (
        f"{words_of(device)}: at worst {ratio:.0%} of the amplitude without bodies is left, "
        f"at {at['frequency']:.5g} Hz, {at['start']}"
    )
    said = {GREEN: "all that must hold does", RED: "it does not hold", AMBER: "not decided"}[grade]
    return f"{text}; {said}" + (f": {', '.join(_short(value) for value in failing)}" if failing else "")


def _short(value: HeldValue) -> str:
    unit = "" if value.unit == "1" else f" {value.unit}"
    assert value.limit is not None
    return f"{value.name} {text_of(value.value)}{unit}, limit {text_of(value.limit)}{unit}"


def measurement(by_number: Mapping[str, float], amplitude: float, study: DesignFile) -> str:
    """Return which measurement would narrow the largest amplitude most."""
    known = {path: added for path, added in by_number.items() if NAMES[path] in ("friction", "restitution")}
    if not known or amplitude <= 0.0:
        return "none: friction and restitution are single numbers"
    path = max(known, key=lambda one: known[one])
    low, high = study.envelope.uncertain[NAMES[path]]
    return (
        f"{NAMES[path]} of the pair, {low:g} to {high:g} so far: its range changes the largest amplitude by "
        f"{known[path] / amplitude:.0%} (docs/howto/identify.md)"
    )
