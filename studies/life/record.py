"""The result of a life: wear, gaps and reduction over hours, and how long the damper damps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.response.contact_work import contact_name
from vanedamp.files.record import Array, Record
from vanedamp.studies.life.study import LifeStudy, WearContact
from vanedamp.studies.worst_start import worst_words

_Moments = Annotated[np.ndarray, Array(("time",))]


@dataclass(frozen=True, eq=False, repr=False)
class LifeRecord(Record):
    """Result of a life over n moments, c contacts and f frequencies. Bands are half widths of 95 % intervals."""

    KIND: ClassVar[str] = "life"
    study: Mapping[str, Any]
    """the [life] table and the scene, as plain data"""
    reference: float
    """amplitude without bodies in the band: its maximum, or its mean [m]; or the limit of the measure, in its unit"""
    contacts: tuple[WearContact, ...]
    """that wear: body, side and corner, area of the patch, fraction of the cavity"""
    frequency: Annotated[np.ndarray, Array(("frequency",), "Hz")]
    """of the band"""
    time: Annotated[np.ndarray, Array(("time",), "h")]
    """hours of operation"""
    depth: Annotated[np.ndarray, Array(("time", "contact"), "m")]
    """of both partners of a contact; nan where its patch is not known"""
    depth_band: Annotated[np.ndarray, Array(("time", "contact"), "m")]
    """half width by confidence and steps"""
    depth_error: Annotated[np.ndarray, Array(("time", "contact"), "m")]
    """of the steps"""
    depth_rate: Annotated[np.ndarray, Array(("time", "contact"), "m/h")]
    """growth of the depth"""
    depth_rate_confidence: Annotated[np.ndarray, Array(("time", "contact"), "m/h")]
    """half width of its 95 % confidence interval"""
    gap: Annotated[np.ndarray, Array(("time", "cavity"), "m")]
    """of each cavity"""
    gap_band: Annotated[np.ndarray, Array(("time", "cavity"), "m")]
    """by confidence and steps"""
    play: Annotated[np.ndarray, Array(("time", "cavity"), "m")]
    """nan without"""
    lost: Annotated[np.ndarray, Array(("time", "damper"))]
    """fraction of each body that is worn away; nan where its size is not known"""
    reduction: _Moments
    """of the measure in the band"""
    reduction_band: _Moments
    """half width of it"""
    amplitude: Annotated[np.ndarray, Array(("time", "frequency"))]
    """over the reference; nan where a run failed"""
    hours: tuple[float | None, float | None, float | None]
    """when the reduction is lost: of its curve, of the lower and of the upper bound; None: not within the hours; 0:
    never reached [h]"""
    runs: int
    """number of runs"""
    trouble: int
    """of the runs, those with another status than ok"""
    sentence: str
    """the answer in words"""
    hot_spots: tuple[str, ...] = ()
    """of the vane, whose damage counts"""
    damage_rate: Annotated[np.ndarray | None, Array(("time", "hot_spot"), "1/h")] = None
    """damage of each hot spot per hour, weighted over the band by the time spent there"""
    damage: Annotated[np.ndarray | None, Array(("time", "hot_spot"))] = None
    """damage since the beginning, by Miner's rule; 1: half of the vanes have failed"""
    vane_hours: float | None = None
    """median life of the vane while the damper wears; None: longer than the hours [h]"""
    starts: Mapping[str, Any] = field(default_factory=dict)
    """worst of the damper over starts (worst_start.worst_start), as new ("new") and at the end ("end")"""
    worn_away: float | None = None
    """after which a body is worn away, which ends the life; None: none is [h]"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def labels(self) -> dict[str, Any]:
        """Return the names of the contacts."""
        return {"contact": [contact.name for contact in self.contacts]} | (
            {"hot_spot": list(self.hot_spots)} if self.hot_spots else {}
        )

    def derived(self) -> dict[str, Any]:
        """Return the contacts by the names of their parts."""
        return {"contacts": [contact._asdict() for contact in self.contacts]}

    @property
    def faces(self) -> dict[str, list[int]]:
        """Contacts of each face with a known patch, by its name: a face wears by the mean of its contacts."""
        faces: dict[str, list[int]] = {}
        for index, contact in enumerate(self.contacts):
            if np.isfinite(contact.area):
                faces.setdefault(contact_name(contact.damper, contact.side), []).append(index)
        return faces

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Yield the table over hours: time, gaps with band, reduction with band."""
        for number, hours in enumerate(self.time):
            gaps = zip(self.gap[number], self.gap_band[number], strict=True)
            opened = ", ".join(f"{1e6 * gap:.3f} +- {1e6 * band:.3f}" for gap, band in gaps)
            yield (
                f"{hours:.0f}", opened,
                f"{100 * self.reduction[number]:.1f} +- {100 * self.reduction_band[number]:.1f}",
            )  # fmt: skip


def sentence_of(
    hours: tuple[float | None, float | None, float | None], study: LifeStudy, values: Mapping[str, np.ndarray],
    starts: Mapping[str, Any], worn: tuple[float, int] | None = None,
) -> str:  # fmt: skip
    """Return how long the damper damps, in words: at rest at first, and what is left from the worst start.

    worn: hours after which a body is worn away, and its number.
    """
    worst = [f"{word}, {worst_words(starts[name])}" for name, word in (("new", "as new"), ("end", "at the end"))]
    if starts["new"]["starts"] == 1:
        worst = [worst_words(starts["new"])]
    return "; ".join([_hours_of(hours, study, values, worn), *worst])


def _hours_of(
    hours: tuple[float | None, float | None, float | None], study: LifeStudy, values: Mapping[str, np.ndarray],
    worn: tuple[float, int] | None,
) -> str:  # fmt: skip
    """Return how long the damper damps, by runs that begin as the scene."""
    (lost, early, late), table, quantity = hours, study.table, study.measure.quantity
    first, last = values["reduction"][0], values["reduction"][-1]
    least = f"{study.threshold:.0%}"
    keeps, keep, label = "Damps", f"damp by {least}", "reduction"
    if table.limit is not None:
        limit = f"{table.measure} below {table.limit:g} {quantity.unit}".removesuffix(" 1")
        keeps, keep, label, least = f"Keeps {limit}", f"keep {limit}", "margin", "0"
    if worn is not None:
        doubt = "" if lost is None else f", and does not {keep} before"
        return (
            f"Body {worn[1]} is worn away after {worn[0]:.0f} h{doubt}: the {label} is {first:.0%} as new and "
            f"{last:.0%} at the end"
        )
    if lost == 0.0:
        return f"Does not {keep} at any time in {table.hours:g} h: {label} {first:.0%} as new, {last:.0%} at the end"
    if lost is None:
        doubt = "" if early is None else f", from {early:.0f} h on without certainty"
        return f"{keeps} for all {table.hours:g} h{doubt}: the {label} is {first:.0%} as new and {last:.0%} at the end"
    until = f"more than {values['time'][-1]:.0f}" if late is None else f"{late:.0f}"
    begin = "" if first >= study.threshold else f" once worn in (as new {first:.0%})"
    return f"{keeps} for {lost:.0f} h ({early or 0.0:.0f} to {until} h){begin}: then the {label} falls below {least}"
