"""Largest forces, pressures and durations of a run's impacts, and whether its law of impact holds at their speeds.

A rigid contact has an impulse, from which the mass of the collision follows: force and duration are those of Hertz's
collision without loss, an upper bound. A compliant one has its own duration, too: its force is the mean one times the
factor of the spring's and dashpot's pulse, which is exact for isolated collisions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.contacts.collision import collision
from vanedamp.coupling.contacts.hertz import Contact
from vanedamp.coupling.response.contact_strength import ContactStrength
from vanedamp.coupling.response.evaluation import Fields, Needs, Observer, Outcome
from vanedamp.coupling.response.event_log import entries_of
from vanedamp.coupling.response.records import DETACHES, IMPACT
from vanedamp.coupling.scene.contact_laws.compliant import peak_over_mean
from vanedamp.coupling.scene.scene import Scene


class ContactImpacts(NamedTuple):
    """Impacts (k,) of one contact.

    entry: place in the contact's log; speed, after: m/s, before and after; impulse: N s; duration: s, nan: not known;
    one: whether a compliant one is of one spring, not of several in parallel.
    """

    entry: np.ndarray
    speed: np.ndarray
    after: np.ndarray
    impulse: np.ndarray
    duration: np.ndarray
    one: np.ndarray


def wanted(scene: Scene) -> bool:
    """Whether a scene has materials and a rounded contact."""
    return scene.contact.pair is not None and scene.contact.pair.radius is not None


def contacts_of(scene: Scene, run: Outcome, begin: float = 0.0) -> tuple[ContactStrength, ...]:
    """Return the strength of a run's contacts by their impacts from a time on, s, in the order of the first ones.

    Raises ValueError for a contact pressed wider than its bodies.
    """
    pair, places = scene.contact.pair, run.rows.places
    assert pair is not None
    contact = pair.contact
    assert contact is not None
    entries, one_of = entries_of(run.rows, run.log), {key: row for row, key in enumerate(places)}
    entries = entries[(entries[:, 1] == IMPACT) | (entries[:, 1] == DETACHES)]
    rows = np.array([one_of[key] for key in places], int)[entries[:, 2].astype(int)]
    by_entry: dict[int, ContactStrength] = {}
    for row in np.unique(rows):
        hits = np.flatnonzero(rows == row)
        impacts = impacts_of(entries[hits], not scene.contact.rigid, begin)
        if len(impacts.entry):
            by_entry[int(hits[impacts.entry[0]])] = _strength(places[row], impacts, contact, pair.first_yield)
    return tuple(by_entry[first] for first in sorted(by_entry))


def _strengths(scene: Scene, run: Outcome, known: Fields) -> Fields:
    assert scene.contact.pair is not None
    try:
        contacts = contacts_of(scene, run, known["transient"] / scene.frequency)
    except ValueError as error:
        return {"warnings": (f"contact.pair: {error}",)}
    return {"contacts": contacts, "warnings": tuple(_warnings(contacts, scene.contact.pair.restitution_speeds))}


#: keeps the strength of rounded contacts
CONTACTS = Observer(_strengths, Needs(log=True))


def impacts_of(entries: np.ndarray, compliant: bool, begin: float) -> ContactImpacts:
    """Return the impacts from a time on, s, in the log's entries (n, .) of one contact: impacts and ends.

    Springs in parallel, which close one in another, are one impact.
    """
    time, hits = entries[:, 0], entries[:, 1] == IMPACT
    speed, after, impulse = np.abs(entries[:, 3:6]).T
    counts = hits & (time >= begin) & (speed != 0.0) & (impulse != 0.0)
    end, one = np.full(len(time), np.nan), np.zeros(len(time), bool)
    if compliant:
        closed = np.cumsum(np.where(hits, 1, -1))
        closed -= np.minimum.accumulate(np.minimum(closed, 0))  # an end without a beginning does not count
        begins = hits & (closed == 1)
        ends = ~hits & (closed == 0) & np.r_[False, closed[:-1] == 1]
        impact = np.cumsum(begins) - 1
        ended, of_spring = impact[ends], impact[hits]
        at = np.flatnonzero(begins)[ended]
        end[at], one[at] = time[ends], np.bincount(of_spring)[ended] == 1
        impulse[at] = np.bincount(of_spring, impulse[hits])[ended]
    until = np.where(counts & ~one, np.fmax(end, time), -np.inf)
    counts[1:] &= time[1:] >= np.maximum.accumulate(until)[:-1]
    columns = np.arange(len(time)), speed, after, impulse, end - time, one & (end > time)
    return ContactImpacts(*(column[counts] for column in columns))


def _strength(
    key: tuple[int, str, int], impacts: ContactImpacts, contact: Contact, first_yield: float | None
) -> ContactStrength:
    """Return the strength of one contact, from its impacts."""
    _, speed, after, impulse, durations, one = impacts
    mass = impulse / (speed + after)
    energy = 0.5 * mass * speed**2  # of Hertz's contact under the largest force
    pulses = zip(*(column[one].tolist() for column in (after / speed, impulse, durations)), strict=True)
    energy[one] = [contact.energy(peak_over_mean(left) * passed / lasts) for left, passed, lasts in pulses]
    worst = int(np.argmax(energy))
    duration, utilisation, yielding = float(durations[worst]), None, None
    force, pressure, *used = loaded(contact, first_yield, float(energy[worst]))
    if np.isnan(duration):
        duration = collision(contact, float(mass[worst]), float(speed[worst])).duration
    if first_yield is not None:
        limit = contact.energy(contact.force_of_pressure(first_yield))
        utilisation, yielding = used[0], int(np.sum(energy > limit)) / len(energy)
    return ContactStrength(
        *key, len(energy), float(speed.max()), force, duration, pressure, utilisation, yielding
    )  # fmt: skip


def loaded(contact: Contact, first_yield: float | None, energy: float) -> list[float]:
    """Return force, N, and pressure, Pa, of Hertz's contact with an energy, J, and its utilisation, if it is known."""
    force = contact.force_of_energy(energy)
    pressure = contact.pressure(force)
    return [force, pressure, *([] if first_yield is None else [pressure / first_yield])]


def _warnings(strengths: Sequence[ContactStrength], speeds: tuple[float, float] | None) -> Iterator[str]:
    """Yield where the law of impact leaves its range: the worst contact beyond yield, and speeds of the restitution."""
    beyond = [one for one in strengths if one.utilisation is not None and one.utilisation > 1.0]
    if beyond:
        worst = max(beyond, key=lambda one: one.utilisation or 0.0)
        yield (
            f"contact: impacts at the {worst.name} reach {worst.utilisation:.3g} times the pressure of first yield "
            f"({worst.yielding:.0%} of them are beyond it): the contact is not elastic, and its restitution falls "
            "with the speed (vanedamp contact)"
        )
    fastest = max((one.fastest for one in strengths), default=None)
    if fastest is not None and speeds is not None and not speeds[0] <= fastest <= speeds[1]:
        yield (
            f"contact.pair.restitution_speeds: the fastest impact has {fastest:.3g} m/s; the restitution is known from "
            f"{speeds[0]:g} to {speeds[1]:g} m/s"
        )
