"""Bodies in the plane as a run's file has them: their samples, and their impacts by body, surface and corner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.scene.scene import Scene

#: sides of events as a chart names them, and the corners of each in the order against the clock
_SURFACES = {
    "floor": ("floor", {-1: "", 0: "left corner", 1: "right corner"}),
    "right": ("right wall", {-1: "", 1: "lower corner", 2: "upper corner"}),
    "ceiling": ("ceiling", {-1: "", 2: "right corner", 3: "left corner"}),
    "left": ("left wall", {-1: "", 3: "upper corner", 0: "lower corner"}),
    "body": ("next body", {-1: ""}),
    "stop": ("stop", {-1: ""}),
}


@dataclass(frozen=True)
class ImpactsAtPlace:
    """The impacts of one contact in the evaluated periods.

    body counts from 0 (of a stop: its number); four: whether its corners are those of a block; impulses (N s) are sums,
    of tangential ones of their sizes; loss: J, nan for files that have none.
    """

    body: int
    side: str
    corner: int
    four: bool
    impacts: int
    normal_impulse: float
    tangential_impulse: float
    loss: float

    @property
    def place(self) -> str:
        """Surface and corner in words, on two lines."""
        surface, corners = _SURFACES.get(self.side, (self.side, {}))
        words = "" if self.corner < 0 else f"corner {self.corner}"
        return f"{surface}<br>{corners.get(self.corner, words) if self.four else words}".removesuffix("<br>")


def impacts_by_place(values: Mapping[str, Any], begin: float, scene: Scene | None = None) -> list[ImpactsAtPlace]:
    """Return the impacts from a time (s) on, by contact; empty for a file without events of bodies in the plane.

    scene: of the run; without one bodies count as blocks.
    """
    if "event_corner" not in values:
        return []
    counted = (np.asarray(values["event_kind"]) == "impact") & (values["event_time"] >= begin)
    names = np.asarray(values["event_damper"]), np.asarray(values["event_side"]), np.asarray(values["event_corner"])
    places = set(zip(*(name[counted].tolist() for name in names), strict=True))
    found = []
    for body, side, corner in sorted(places, key=lambda place: (place[0], *_walk(place[1], place[2]))):
        here = counted & (names[0] == body) & (names[1] == side) & (names[2] == corner)
        found.append(
            ImpactsAtPlace(
                body, side, corner, _four(scene, body), int(here.sum()),
                normal_impulse=float(values["event_impulse"][here].sum()),
                tangential_impulse=float(np.abs(values["event_tangential_impulse"][here]).sum()),
                loss=float(values["event_loss"][here].sum()) if "event_loss" in values else np.nan,
            )
        )  # fmt: skip
    return found


def _four(scene: Scene | None, body: int) -> bool:
    """Return whether the corners of a body have the names of a block's."""
    if scene is None or body >= len(scene.damper):
        return True
    return len(scene.damper[body].form.corners(scene.damper[body])) <= 4


def _walk(side: str, corner: int) -> tuple[int, int]:
    """Return the place of a contact in a walk against the clock through the cavity."""
    corners = list(_SURFACES.get(side, ("", {}))[1])
    return [*_SURFACES, side].index(side), corners.index(corner) if corner in corners else len(corners) + corner


def places_in_order(impacts: Sequence[ImpactsAtPlace]) -> list[str]:
    """Return the places of impacts, in the order of a walk against the clock through the cavity."""
    return list(dict.fromkeys(each.place for each in sorted(impacts, key=lambda each: _walk(each.side, each.corner))))


def hits_in_plane(values: Mapping[str, Any]) -> list[tuple[float, tuple[int, str, int]]]:
    """Return time (s) and place, as of an event, of all impacts of bodies in the plane."""
    if "event_corner" not in values:
        return []
    names = ("event_kind", "event_time", "event_damper", "event_side", "event_corner")
    entries = zip(*(np.asarray(values[name]).tolist() for name in names), strict=True)
    return [(time, (body, side, corner)) for kind, time, body, side, corner in entries if kind == "impact"]


def samples_in_plane(values: Mapping[str, Any]) -> PlanarSamples | None:
    """Return the samples in the plane; None for a file of sliders, or of a version that kept none."""
    if "contact_gap" not in values:
        return None
    arrays = {name: np.asarray(values[name], float) for name in PlanarSamples._fields if name in values}
    arrays["contact_closed"] = values["contact_closed"].astype(bool)
    places = zip(
        values["contact_damper"].tolist(), values["contact_side"].tolist(), values["contact_corner"].tolist(),
        strict=True,
    )  # fmt: skip
    return PlanarSamples(**arrays, contacts=tuple(places))
