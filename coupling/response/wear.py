"""Wear of the contacts of a run: volumes, depths, work rates, and how the cavities open by them.

Sliding wears by Archard's law (J. F. Archard, J. Appl. Phys. 24, 981, 1953): the volume is K/H times the integral of
normal force times slip speed, which the engines accumulate exactly. Impacts add `impact_rate` times the sum of their
energies, each to the power n. Each partner loses its part of the volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.response.contact_work import ContactWear, ContactWork
from vanedamp.coupling.response.steady_state import mean_confidence
from vanedamp.coupling.scene.bodies import Damper
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.wear import Wear, WearRates

_HOUR = 3600.0
#: largest difference of wear and friction work in the energy balance, relative to the latter
_SAME = 1e-9
#: surfaces whose wear opens a cavity along and across
ALONG, ACROSS = ("left", "right", "body"), ("floor", "ceiling")


class WornPatch(NamedTuple):
    """Rates of a contact and its patch: sliding 1/Pa, impact m^3/J^n, part of the cavity, area m^2 (None: unknown)."""

    sliding: float
    impact: float
    share: float
    area: float | None


def contact_wear(scene: Scene, work: Sequence[ContactWork]) -> tuple[ContactWear, ...]:
    """Return the wear of contacts by their work in at least one period. The scene has a [wear] table."""
    per_hour = _HOUR * scene.frequency
    return tuple(_wear(one, patch, per_hour) for one, patch in zip(work, patches(scene, work), strict=True))


def _wear(one: ContactWork, patch: WornPatch, per_hour: float) -> ContactWear:
    """Return the wear of a contact; per_hour: periods in an hour."""
    volumes = one.course @ (patch.sliding, patch.impact)
    volume, confidence = per_hour * float(volumes.mean()), mean_confidence(volumes)
    return ContactWear(
        one.damper, one.side, one.corner, one.sliding, one.friction * one.sliding, one.impacts, one.hits,
        work_rate=one.sliding / len(volumes) * per_hour / _HOUR, volume_rate=volume,
        volume_rate_confidence=None if confidence is None else per_hour * confidence,
        depth_rate=None if patch.area is None else volume / patch.area, share=patch.share, area=patch.area,
    )  # fmt: skip


def ledger_warning(work: Sequence[ContactWork], friction: float) -> tuple[str, ...]:
    """Return the warning that wear and the friction work of the energy balance (J) differ; empty if they agree.

    The volume by sliding over K/H is the integral of normal force times slip speed: coefficients times these are the
    friction work.
    """
    total = sum(one.friction * one.sliding for one in work)
    gap = abs(total - friction) / max(abs(friction), abs(total), 1e-300)
    if gap <= _SAME:
        return ()
    return (f"wear: friction work by wear volumes and by the energy balance differ by {gap:.1e} of it",)


def patches(scene: Scene, work: Sequence[ContactWork]) -> list[WornPatch]:
    """Return the rates and patch of every contact."""
    assert scene.wear is not None
    places = [(one.damper, one.side) for one in work]
    return [_patch(scene, scene.wear, *place, places.count(place)) for place in places]


def _patch(scene: Scene, wear: Wear, damper: int, side: str, corners: int) -> WornPatch:
    tables: list[WearRates] = [
        pair for pair in reversed(wear.pair) if pair.damper in (None, damper) and pair.side in (None, side)
    ]
    tables.append(wear)

    def first(key: str, default: Any) -> Any:
        return next((value for table in tables if (value := getattr(table, key)) is not None), default)

    area, edge = first("area", None), first("edge", None)
    if area is None and side in ALONG + ACROSS and wear.width is not None:
        extent = _extent(wear, scene.damper[damper], side)
        if edge is not None and corners > 1:
            area = edge * wear.width
        elif extent:
            area = extent * wear.width / corners
    return WornPatch(first("sliding_rate", 0.0), first("impact_rate", 0.0), first("share", 0.5), area)


def _extent(wear: Wear, body: Damper, side: str) -> float | None:
    """Return the extent of a body's face, m: of a disc, which has none, None."""
    if body.form.rolls:
        return None
    length, height = (2.0 * half for half in body.half_extent)
    return (height or wear.height) if side in ALONG else (length or wear.length)


def opening(scene: Scene, places: Sequence[tuple[int, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Return how depths of wear (c,), m, of both partners, open the cavities: matrices (cavities, c) of gap and play.

    places: body and side of every contact. A face wears by the mean of its contacts, whatever its part of the cavity;
    of the floors and ceilings of several bodies in a cavity the mean counts.
    """
    along, across = (np.zeros((len(scene.cavity), len(places))) for _ in range(2))
    for contact, (damper, side) in enumerate(places):
        if side in ALONG + ACROSS:
            cavity = scene.cavity_of(scene.damper[damper])
            same = 1.0 / places.count((damper, side))
            if side in ALONG:
                along[cavity, contact] = same
            elif scene.damper[damper].form.extended:
                bodies = [n for n in scene.bodies_in(scene.cavity[cavity]) if scene.damper[n].form.extended]
                across[cavity, contact] = same / len(bodies)
    return along, across


def body_shares(scene: Scene, contacts: Sequence[Any]) -> np.ndarray:
    """Return the fractions (bodies, c) of volumes of contacts (with damper, side and share) that each body loses."""
    shares = np.zeros((len(scene.damper), len(contacts)))
    for contact, one in enumerate(contacts):
        if one.side in ALONG + ACROSS:
            shares[one.damper, contact] = 1.0 - one.share
            if one.side == "body":
                shares[one.damper + 1, contact] = one.share
    return shares


def body_volumes(scene: Scene) -> np.ndarray:
    """Return the volumes of the bodies as rectangles, m^3; nan where an extent is not known."""
    assert scene.wear is not None
    extents = [(_extent(scene.wear, body, "floor"), _extent(scene.wear, body, "left")) for body in scene.damper]
    return np.array([(a or np.nan) * (b or np.nan) * (scene.wear.width or np.nan) for a, b in extents])
