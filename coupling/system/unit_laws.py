"""The laws of units between, at and in events: states, the events that end them, and the linear map of an impact.

A unit is a contact, with friction or without, or a friction element. A contact is open; or closed, with a force of its
own (its state says what its friction does) or while others carry its force; or it leaves: its spring has ended at zero
force, before its gap is open. Plain data and plain functions, for uncompiled code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    CLOSED,
    CLOSES,
    FORCE,
    LEAVING,
    OPEN,
    OPENS,
    PARTS,
    POSITION,
    RECLOSES,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
    STOPS,
    VELOCITY,
)
from vanedamp.coupling.system.system import System

#: singular values, times the largest, below which rows or wrenches depend on each other
SINGULAR = 1e-9


def presses(state: Any) -> Any:
    """Return whether contacts in states (u,) are closed with a force of their own."""
    return (state < OPEN) | (state == CLOSED)


def slips(state: Any) -> Any:
    """Return whether units in states (u,) slip; the state is the direction then, as a factor."""
    return (state == SLIP_LEFT) | (state == SLIP_RIGHT)


def slip_towards(speed: float) -> int:
    """Return the state of a unit that slips with a speed."""
    return SLIP_RIGHT if speed > 0.0 else SLIP_LEFT


def slip_after(bound: int) -> int:
    """Return the state of a unit whose friction has reached a bound: AT_LOW, friction opposes motion to the right."""
    return SLIP_RIGHT if bound == AT_LOW else SLIP_LEFT


def ways(state: np.ndarray) -> np.ndarray:
    """Return the directions (u,) in which units in states (u,) slip, or 0."""
    return np.asarray(slips(state) * 1.0 * state)


def contacts_of(system: System) -> np.ndarray:
    """Return whether units (u,) are contacts."""
    return np.asarray(np.arange(len(system.rest)) < system.contacts)


def rubs(system: System) -> np.ndarray:
    """Return whether units (u,) have friction."""
    return np.asarray(~contacts_of(system) | (system.friction > 0.0))


def sharing(system: System) -> np.ndarray:
    """Return by how many a contact's normal force is shared (u,): two of a joint with two directions; others 1."""
    u = len(system.rest)
    second = contacts_of(system) & (system.corner == 1)
    second[1:] &= (system.J[1:u] == system.J[: u - 1]).all(axis=1)
    second[:1] = False
    return np.asarray(1 + second + np.r_[second[1:], np.zeros(min(u, 1), bool)])


class UnitEvent(NamedTuple):
    """An event that ends a state of a unit, as its function falls through zero.

    code, order: of the event and of its function (numerics.codes); name: of the event where it could happen; contact:
    whether contacts have it, otherwise units with friction; states: in which it can happen; terms: the function, by
    signals of the unit (signals_of) and their factors: numbers, fields of System, or "way", the direction of slip;
    scale: fields whose product the function is relative to, none for forces and speeds without a size of their own;
    after: the state that follows; the friction of a contact that begins to press is decided with it
    """

    code: int
    order: int
    name: str
    contact: bool
    states: tuple[int, ...]
    terms: tuple[tuple[str, float | str], ...]
    scale: tuple[str, ...]
    after: int

    def factors(self, system: System, unit: int, way: float) -> list[float]:
        """Return the factors of the signals of a unit that slips in a direction, or 0."""
        return [
            way if factor == "way" else getattr(system, factor)[unit] if isinstance(factor, str) else factor
            for _, factor in self.terms
        ]

    def function(self, factors: Sequence[float], signals: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the function: the sum of a unit's signals by their factors."""
        parts = [factor * signals[name] for factor, (name, _) in zip(factors, self.terms, strict=True)]
        return np.asarray(sum(parts))

    def size(self, system: System, unit: int) -> float:
        """Return the scale of the function of a unit, inf without."""
        return float(np.prod([getattr(system, name)[unit] for name in self.scale] or [np.inf])) or np.inf


def signals_of(
    unit: int, gap: np.ndarray, speed: np.ndarray, force: np.ndarray, one: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the signals of event functions of a unit: gap, its rate, slip speed, forces across and along, and one.

    gap (..., u, K), speed and force (..., 2u, K), one (K,): functionals of a state. Signals: (..., K).
    """
    u = gap.shape[-2]
    return {
        "gap": gap[..., unit, :], "rate": speed[..., unit, :], "slip": speed[..., u + unit, :],
        "push": force[..., unit, :], "drag": force[..., u + unit, :], "one": one,
    }  # fmt: skip


def _where(holds: Callable[[Any], Any]) -> tuple[int, ...]:
    return tuple(state for state in _STATES if holds(state))


_STATES = range(int(SLIP_LEFT), int(LEAVING) + 1)
_ROOM = (("push", "friction"), ("one", "limit"))
#: the events by their codes
EVENTS = {int(event.code): event for event in (
    UnitEvent(CLOSES, POSITION, "impact", True, (OPEN,), (("gap", 1.0),), ("play",), STICK),
    UnitEvent(OPENS, POSITION, "leaves", True, (LEAVING,), (("gap", -1.0),), ("play",), OPEN),
    UnitEvent(RECLOSES, POSITION, "presses", True, (LEAVING,), (("gap", "spring"), ("rate", "dashpot")),
              ("spring", "play"), STICK),
    UnitEvent(PARTS, FORCE, "leaves", True, _where(presses), (("push", 1.0),), (), OPEN),
    UnitEvent(AT_HIGH, FORCE, "slips", False, (STICK,), (*_ROOM, ("drag", -1.0)), ("limit",), slip_after(AT_HIGH)),
    UnitEvent(AT_LOW, FORCE, "slips", False, (STICK,), (*_ROOM, ("drag", 1.0)), ("limit",), slip_after(AT_LOW)),
    UnitEvent(STOPS, VELOCITY, "sticks", False, _where(slips), (("slip", "way"),), (), STICK),
)}  # fmt: skip
_IN_STATE = {state: [each for each in EVENTS.values() if state in each.states] for state in _STATES}


def possible_events(system: System, state: np.ndarray) -> list[tuple[int, UnitEvent]]:
    """Return the events that can end states (u,), by units."""
    contact, friction = contacts_of(system), rubs(system)
    units = enumerate(zip(contact.tolist(), friction.tolist(), state.tolist(), strict=True))
    return [(r, event) for r, (touches, slides, now) in units for event in _IN_STATE[now]
            if (touches if event.contact else slides)]  # fmt: skip


def wrenches(J: np.ndarray, contacts: np.ndarray, drag: np.ndarray, slips: np.ndarray) -> np.ndarray:
    """Return the directions (..., N, m + n) of forces on contacts (m,) and, apart from these, on slips (n,) of units.

    J: (..., 2u, N); drag: (m,) friction that goes with each contact's force, against the direction of its slip.
    """
    u = J.shape[-2] // 2
    across = J[..., contacts, :] - drag[:, None] * J[..., u + contacts, :]
    return np.concatenate([across, J[..., u + slips, :]], axis=-2).swapaxes(-2, -1)


class Grip(NamedTuple):
    """The linear map of forces, or impulses, on contacts that push (m,) and slips that stick (n,).

    An impact is this map: by Newton's law contacts that push leave at k times their speed of approach; by Poisson's
    they stop, and push again, k times as much or more. Slips that stick stop.

    rows: (m + n, N) of J; lever: (N, m + n) speeds by forces; solve: (m + n, m + n) forces by what
    the rows are to gain, the least where rows depend on each other
    """

    rows: np.ndarray
    lever: np.ndarray
    solve: np.ndarray

    @classmethod
    def of(cls, system: System, contacts: np.ndarray, drag: np.ndarray, slips: np.ndarray) -> Grip:
        """Return the map of contacts (m,), with friction `drag` (m,) of each, and slips (n,) of units."""
        rows = system.J[np.concatenate([contacts, len(system.rest) + slips])]
        lever = wrenches(system.J, contacts, drag, slips) / system.mass[:, None]
        mobility = (rows**2 / system.mass).sum(axis=1)
        scale = 1.0 / np.sqrt(np.where(mobility > 0.0, mobility, 1.0))
        both = np.multiply.outer(scale, scale)
        return cls(rows, lever, np.linalg.pinv(rows @ lever * both, rcond=SINGULAR) * both)
