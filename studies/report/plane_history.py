"""Samples of bodies for a drawing in the plane, from a file or of sliders; impacts by body, surface and corner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.response.response import Event, PlanarSamples, Response
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
#: a body touches a wall within this fraction of its free travel
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


def impacts_by_place(response: Response, scene: Scene | None = None) -> list[ImpactsAtPlace]:
    """Return the impacts of the evaluated periods, by contact; empty for a run without events of bodies in the plane.

    scene: of the run; without one bodies count as blocks.
    """
    if response.tilt_max is None:
        return []
    begin, events_at = response.transient / response.frequency, dict[tuple[int, str, int], list[Event]]()
    for event in response.event_list:
        if event.kind == "impact" and event.time >= begin:
            events_at.setdefault((event.damper, event.side, event.corner), []).append(event)
    return [
        ImpactsAtPlace(
            *contact, _four(scene, contact[0]), len(events), normal_impulse=sum(event.impulse for event in events),
            tangential_impulse=sum(abs(event.tangential_impulse) for event in events),
            loss=sum(event.loss for event in events),
        )
        for contact, events in sorted(events_at.items(), key=lambda item: (item[0][0], *_walk(item[0][1], item[0][2])))
    ]  # fmt: skip


def _four(scene: Scene | None, body: int) -> bool:
    """Return whether the corners of a body have the names of a block's."""
    if scene is None or body >= len(scene.damper):
        return True
    return len(scene.damper[body].form.corners(scene.damper[body])) <= 4


def _walk(side: str, corner: int) -> tuple[int, int]:
    """Return the position of a contact in counterclockwise order through the cavity."""
    corners = list(_SURFACES.get(side, ("", {}))[1])
    return [*_SURFACES, side].index(side), corners.index(corner) if corner in corners else len(corners) + corner


def places_in_order(impacts: Sequence[ImpactsAtPlace]) -> list[str]:
    """Return the names of contacts with impacts, counterclockwise through the cavity."""
    return list(dict.fromkeys(site.place for site in sorted(impacts, key=lambda site: _walk(site.side, site.corner))))


def slider_samples(scene: Scene, displacement: np.ndarray, along: np.ndarray) -> PlanarSamples:
    """Return the samples of sliders between walls that are fixed to the floor.

    scene: without open choices; displacement: (n,) m at excitation.at; along: (n, b) m in the cavities. A floor that
    is another point of a reduced model moves as in the mode nearest to the excitation.
    """
    unknown = np.full(along.shape, np.nan)
    gaps, closed, contacts = [], [], []
    for cavity in scene.cavity:
        row = [k for k, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        if not row:
            continue
        positions = np.column_stack(
            [np.full(len(along), -cavity.gap / 2), along[:, row], np.full(len(along), cavity.gap / 2)]
        )
        sides = [(row[0], "left", -1), *((k, "body", -1) for k in row[:-1]), (row[-1], "right", -1)]
        gaps.append(np.diff(positions, axis=1))
        closed.append(gaps[-1] <= _TOUCHES * cavity.gap)
        contacts += sides
    return PlanarSamples(
        body_lift=unknown, body_tilt=unknown, floor_along=np.multiply.outer(displacement, _floor_shares(scene)),
        floor_across=unknown, floor_rotation=np.zeros(along.shape), contact_gap=np.hstack(gaps),
        contact_closed=np.hstack(closed), contacts=tuple(contacts),
    )  # fmt: skip


def _floor_shares(scene: Scene) -> np.ndarray:
    """Return the displacement of the floor under each body (b,) per unit of the response."""
    system = assemble(scene)
    if not system.modes:  # everything moves with the base
        return np.ones(system.bodies)
    nearest = int(np.argmin(np.abs(np.sqrt(system.of_structure.stiffness) - system.omega)))
    at = system.of_structure.response[nearest]
    return np.asarray(system.floor[:, nearest]) / at if at else np.zeros(system.bodies)
