"""Samples of bodies for a drawing in the plane: of a file, or of sliders; impacts by body, surface and corner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble

#: sides of events as a chart names them, and the corners of each counterclockwise
_SURFACES = {
    "floor": ("floor", {-1: "", 0: "left corner", 1: "right corner"}),
    "right": ("right wall", {-1: "", 1: "lower corner", 2: "upper corner"}),
    "ceiling": ("ceiling", {-1: "", 2: "right corner", 3: "left corner"}),
    "left": ("left wall", {-1: "", 3: "upper corner", 0: "lower corner"}),
    "body": ("next body", {-1: ""}),
    "stop": ("stop", {-1: ""}),
}
#: fraction of its free travel within which a body touches
_TOUCHES = 1e-9


@dataclass(frozen=True)
class ImpactsAtPlace:
    """The impacts of one contact in the evaluated periods.

    body counts from 0 (of a stop: its number); four: whether it has a block's corners; impulses (N s) are sums,
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
    """Return the position of a contact in a counterclockwise walk through the cavity."""
    corners = list(_SURFACES.get(side, ("", {}))[1])
    return [*_SURFACES, side].index(side), corners.index(corner) if corner in corners else len(corners) + corner


def places_in_order(impacts: Sequence[ImpactsAtPlace]) -> list[str]:
    """Return the places of impacts, in the order of a counterclockwise walk through the cavity."""
    return list(dict.fromkeys(each.place for each in sorted(impacts, key=lambda each: _walk(each.side, each.corner))))


def hits_in(values: Mapping[str, Any]) -> list[tuple[float, tuple[int, str, int]]]:
    """Return time (s) and place, as of an event, of all impacts; sliders have no corner (-1)."""
    if "event_kind" not in values:
        return []
    columns = [values[f"event_{name}"] for name in ("kind", "time", "damper", "side")]
    columns.append(values.get("event_corner", np.full(len(columns[0]), -1)))
    entries = zip(*(np.asarray(column).tolist() for column in columns), strict=True)
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


def slider_samples(scene: Scene, displacement: np.ndarray, along: np.ndarray) -> PlanarSamples:
    """Return the samples of sliders between walls that keep their places on the floor.

    scene: without open choices; displacement: (n,) m at excitation.at; along: (n, b) m in the cavities. A floor that
    is another point of a reduced model moves as in the mode nearest to the excitation.
    """
    unknown = np.full(along.shape, np.nan)
    gaps, closed, contacts = [], [], []
    for cavity in scene.cavity:
        row = [k for k, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        if not row:
            continue
        places = np.column_stack(
            [np.full(len(along), -cavity.gap / 2), along[:, row], np.full(len(along), cavity.gap / 2)]
        )
        sides = [(row[0], "left", -1), *((k, "body", -1) for k in row[:-1]), (row[-1], "right", -1)]
        gaps.append(np.diff(places, axis=1))
        closed.append(gaps[-1] <= _TOUCHES * cavity.gap)
        contacts += sides
    return PlanarSamples(
        body_lift=unknown, body_tilt=unknown, floor_along=np.multiply.outer(displacement, _floor_shares(scene)),
        floor_across=unknown, floor_rotation=np.zeros(along.shape), contact_gap=np.hstack(gaps),
        contact_closed=np.hstack(closed), contacts=tuple(contacts),
    )  # fmt: skip


def _floor_shares(scene: Scene) -> np.ndarray:
    """Return by how much the floor under each body (b,) moves when the response moves by one."""
    system = assemble(scene)
    if not system.modes:  # the base moves, and all on it
        return np.ones(system.bodies)
    nearest = int(np.argmin(np.abs(np.sqrt(system.of_structure.stiffness) - system.omega)))
    at = system.of_structure.response[nearest]
    return np.asarray(system.floor[:, nearest]) / at if at else np.zeros(system.bodies)
