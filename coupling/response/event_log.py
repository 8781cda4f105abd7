"""The log of a run: the meaning of its rows, and the events in its entries.

An entry has time, kind, row, relative speed before and after, impulse; of planar bodies also the impulse of
friction and the energy taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.response.records import DETACHES, IMPACT, KINDS, WIDTH
from vanedamp.coupling.response.response import Event
from vanedamp.coupling.system.system import FLOOR, SURFACES, System


class Rows(NamedTuple):
    """Meaning of the rows (r,) of a log.

    places: number of body, stop or friction damper; side; corner (-1: none). without_body: (r,)
    whether it is the latter. other: (r,) number of the body to the right, -1: none. sign: (r,) of the gap's speed in
    the sign of the body's speed relative to its counterpart.
    spring: (r,) stiffness of a contact, N/m; inf: rigid. restitution: (r,). mass: (r,) largest mass of a collision, kg:
    that of the bodies, on a structure that does not give way; without bodies that of the mode that gives way most.
    """

    places: Sequence[tuple[int, str, int]]
    without_body: np.ndarray
    other: np.ndarray
    sign: np.ndarray
    spring: np.ndarray
    restitution: np.ndarray
    mass: np.ndarray


def rows_of_units(system: System) -> Rows:
    """Return the rows of a log by units: speeds refer to gaps in the plane, and to bodies along their line."""
    places = [
        (int(body), SURFACES[surface], int(corner))
        for body, surface, corner in zip(system.body, system.surface, system.corner, strict=True)
    ]
    on_body, sign = np.flatnonzero(~system.without_body[: system.contacts]), np.ones(len(places))
    if not system.in_plane:  # gaps that close as their body moves on to the right
        sign[on_body] = np.sign(system.J[on_body, system.along[system.body[on_body]]])
    return Rows(
        places, system.without_body, system.other, sign, system.spring, system.restitution, _largest_masses(system)
    )


def _largest_masses(system: System) -> np.ndarray:
    """Return the largest mass (u,) of a collision at the gap of each unit, kg; inf where nothing moves.

    A corner has its own, or a part of the body's where the whole face hits.
    """
    mobility = system.J[: len(system.rest)] ** 2 / system.mass
    bodies = mobility[:, system.modes :].sum(axis=1)
    turning = mobility[:, system.tilt[system.tilt >= 0]].sum(axis=1)
    faces = list(zip(system.body.tolist(), system.surface.tolist(), strict=True))
    whole = [faces.count(face) for face in faces] * (bodies - turning)
    of_modes = mobility[:, : system.modes].max(axis=1, initial=0.0)
    with np.errstate(divide="ignore"):
        masses: np.ndarray = 1.0 / np.where(bodies > 0.0, np.minimum(bodies, whole), of_modes)
    return masses


def rows_of_line(system: System) -> Rows:
    """Return the rows of a log of sliders (system.line_system): floors, friction dampers, then the contacts."""
    units, c = rows_of_units(system), system.contacts
    floors = [(body, SURFACES[FLOOR], -1) for body in range(system.bodies)]
    dampers = [(number, "casing", -1) for number in range(system.dampers)]
    first = len(floors) + len(dampers)
    return Rows(
        [*floors, *dampers, *units.places[:c]],
        np.r_[np.zeros(len(floors), bool), np.ones(len(dampers), bool), system.without_body[:c]],
        np.r_[np.full(first, -1), system.other[:c]],
        np.r_[np.ones(first), units.sign[:c]], np.r_[np.full(first, np.inf), system.spring[:c]],
        np.r_[np.zeros(first), units.restitution[:c]], np.r_[np.full(first, np.inf), units.mass[:c]],
    )  # fmt: skip


def events_of(rows: Rows, chunks: Sequence[np.ndarray]) -> list[Event]:
    """Return the events of a log, from its chunks of entries (k, LINE_WIDTH or WIDTH)."""
    events = []
    for moment, kind, row, before, after, *impulses in entries_of(rows, chunks).tolist():
        (body, side, corner), sign = rows.places[int(row)], float(rows.sign[int(row)])
        normal, *others = impulses
        speeds = sign * before + 0.0, sign * after + 0.0
        events.append(Event(moment, KINDS[int(kind)], body, side, *speeds, normal, corner, *others))
    return events


def named_bodies(rows: Rows, chunks: Sequence[np.ndarray], bodies: int) -> np.ndarray:
    """Return whether an event after time zero names each body (bodies,): states at rest are logged as a run begins."""
    named = np.zeros(bodies + 1, bool)
    for row in {int(row) for chunk in chunks for row in chunk[chunk[:, 0] > 0.0, 2]}:
        body, _, _ = rows.places[row]
        if not rows.without_body[row]:
            named[[body, rows.other[row]]] = True  # the last index stands for no body
    return named[:bodies]


def impact_energies(rows: Rows, chunks: Sequence[np.ndarray], period: float) -> tuple[np.ndarray, ...]:
    """Return period, row and energy, J, of the impacts (k,) of a log on contacts that yield.

    The energy is that of the relative motion. The impulse m v (1 + e) of the contact has the mass m of its collision,
    the same for every number of modes; 1/Delassus is that of a rigid impact, and falls with each. A contact that is
    pressed for long, or has not ended, has the bodies' mass.
    """
    entries = entries_of(rows, chunks)
    row = entries[:, 2].astype(int)
    entries = entries[(entries[:, 1] == IMPACT) & np.isfinite(rows.spring[row])]
    row, speed, impulse = entries[:, 2].astype(int), np.abs(entries[:, 3]), np.abs(entries[:, 5])
    mass = impulse / (speed * (1.0 + rows.restitution[row]))
    mass = np.minimum(np.where(impulse > 0.0, mass, np.inf), rows.mass[row])
    return (entries[:, 0] / period).astype(int), row, 0.5 * mass * speed**2


def entries_of(rows: Rows, chunks: Sequence[np.ndarray]) -> np.ndarray:
    """Return the entries (k, LINE_WIDTH or WIDTH) of a log.

    Impacts on compliant contacts, logged as they begin, have the speed and the impulse that their end has brought.
    """
    entries: np.ndarray = np.concatenate(chunks) if chunks else np.zeros((0, WIDTH))
    kind, row = entries[:, 1], entries[:, 2].astype(int)
    of_springs = np.flatnonzero(np.isfinite(rows.spring[row]) & ((kind == IMPACT) | (kind == DETACHES)))
    of_springs = of_springs[np.argsort(row[of_springs], kind="stable")]
    hits = kind[of_springs] == IMPACT
    begun = np.maximum.accumulate(np.where(hits, np.arange(len(hits)), 0))
    begin, end = of_springs[begun[~hits]], of_springs[~hits]
    known = (kind[begin] == IMPACT) & (row[begin] == row[end])
    entries[begin[known], 4:] = entries[end[known], 4:]
    return entries
