"""Largest forces, pressures and durations of a run's impacts, and whether its law of impact holds at their speeds.

A rigid contact has an impulse, from which the mass of the collision follows: force and duration are those of Hertz's
collision without loss, an upper bound. A compliant one has its own duration, too: its force is the mean one times the
factor of the spring's and dashpot's pulse, which is exact for isolated collisions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from vanedamp.coupling.contacts.collision import collision
from vanedamp.coupling.contacts.hertz import Contact
from vanedamp.coupling.response.contact_strength import ContactStrength
from vanedamp.coupling.response.response import Event, Response
from vanedamp.coupling.scene.contact_laws.compliant import peak_over_mean
from vanedamp.coupling.scene.scene import Scene

_Key = tuple[int, str, int]


class Impact(NamedTuple):
    """An impact: contact, speed of approach, m/s, and the energy, J, of Hertz's contact under its largest force.

    mass: kg, of the collision; duration: s, None where it is that of Hertz's collision.
    """

    key: _Key
    speed: float
    energy: float
    mass: float
    duration: float | None


def wanted(scene: Scene) -> bool:
    """Whether a scene says what touches, with a rounded contact."""
    return scene.contact.pair is not None and scene.contact.pair.radius is not None


def with_contacts(scene: Scene, response: Response, events: bool) -> Response:
    """Return the response of a scene with the strength of its contacts, and warnings. events: keep their list."""
    pair = scene.contact.pair
    assert pair is not None
    kept = response.event_list if events else ()
    try:
        strengths = contacts_of(scene, response.event_list, response.transient / response.frequency)
    except ValueError as error:
        return replace(response, event_list=kept, warnings=(*response.warnings, f"contact.pair: {error}"))
    return replace(
        response, contacts=strengths, event_list=kept,
        warnings=response.warnings + tuple(_warnings(strengths, pair.restitution_speeds)),
    )  # fmt: skip


def contacts_of(scene: Scene, events: Sequence[Event], begin: float = 0.0) -> tuple[ContactStrength, ...]:
    """Return the strength of the contacts by their impacts from a time on, s. Raises ValueError beyond Hertz' law."""
    pair = scene.contact.pair
    assert pair is not None
    contact = pair.contact
    assert contact is not None
    found: dict[_Key, list[Impact]] = {}
    for impact in impacts_of(contact, not scene.contact.rigid, events, begin):
        found.setdefault(impact.key, []).append(impact)
    return tuple(_strength(impacts, contact, pair.first_yield) for impacts in found.values())


def impacts_of(contact: Contact, compliant: bool, events: Sequence[Event], begin: float) -> Iterator[Impact]:
    """Yield the impacts from a time on, s. Springs in parallel of one contact, which close one in another, are one."""
    ends = _ends(events) if compliant else {}
    until: dict[_Key, float] = {}
    for event in events:
        key = event.damper, event.side, event.corner
        speed, after = abs(event.relative_velocity_before), abs(event.relative_velocity_after)
        if event.kind != "impact" or event.time < begin or speed == 0.0 or event.impulse == 0.0:
            continue
        if event.time < until.get(key, 0.0):
            continue
        end, impulse, single = ends.get((key, event.time), (None, abs(event.impulse), True))
        if end is not None and single:
            duration = end - event.time
            force = peak_over_mean(after / speed) * impulse / duration
            yield Impact(key, speed, contact.energy(force), 0.0, duration)
            continue
        mass = impulse / (speed + after)
        until[key] = event.time if end is None else end
        yield Impact(key, speed, 0.5 * mass * speed**2, mass, None if end is None else end - event.time)


def _ends(events: Sequence[Event]) -> dict[tuple[_Key, float], tuple[float, float, bool]]:
    """Return end, s, impulse, N s, and whether it is one spring, of compliant contacts, by their key and beginning."""
    found: dict[tuple[_Key, float], tuple[float, float, bool]] = {}
    begun: dict[_Key, list[Event]] = {}
    closed: dict[_Key, int] = {}
    for event in events:
        key = event.damper, event.side, event.corner
        if event.kind == "impact":
            begun.setdefault(key, []).append(event)
            closed[key] = closed.get(key, 0) + 1
        elif event.kind == "detach" and closed.get(key):
            closed[key] -= 1
            if not closed[key]:
                springs = begun.pop(key)
                impulse = sum(abs(one.impulse) for one in springs)
                found[key, springs[0].time] = event.time, impulse, len(springs) == 1
    return found


def _strength(impacts: list[Impact], contact: Contact, first_yield: float | None) -> ContactStrength:
    """Return the strength of one contact, from its impacts."""
    worst = max(impacts, key=lambda impact: impact.energy)
    force, duration = contact.force_of_energy(worst.energy), worst.duration
    if duration is None:
        duration = collision(contact, worst.mass, worst.speed).duration
    pressure = contact.pressure(force)
    utilisation = yielding = None
    if first_yield is not None:
        limit = contact.energy(contact.force_of_pressure(first_yield))
        utilisation = pressure / first_yield
        yielding = sum(impact.energy > limit for impact in impacts) / len(impacts)
    fastest = max(impact.speed for impact in impacts)
    return ContactStrength(*worst.key, len(impacts), fastest, force, duration, pressure, utilisation, yielding)


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
