"""The energies of a motion of the reference, by quadrature of its dense response."""

from __future__ import annotations

import numpy as np

from tests.reference.integrator import Event, Reference, quadrature
from tests.reference.system import System


def ledger(result: Reference) -> dict[str, float]:
    """Energies in J: excitation, viscous, friction, impact, contact, stored (the change) and the largest stored.

    A compliant contact stores stiffness * opening^2 / 2 as long as it pushes; what it holds beyond that is lost.
    """
    system, unit = result.system, result.system.length**2 * result.system.omega**2
    t, weights = quadrature(result.solution, 0.0, result.solution.ts[-1])
    y = result.solution(t)
    _, _, qd, rd = system.split(y)
    bodies = rd + system.W.T @ qd
    load = ((system.force @ qd) * system.phasor(system.shares, t)).imag
    load -= ((system.m * system.base) @ bodies) * system.wave(system.base_shares, t)
    terms = {
        "excitation": load,
        "viscous": np.einsum("nt,nm,mt->t", qd, system.C, qd),
        "friction": system.friction @ np.abs(rd) + _slider_loss(result, t, qd),
        "contact": _contact_loss(system, y),
    }
    energies = {name: float(weights @ term) * unit for name, term in terms.items()}
    energies["impact"] = sum(
        _impact_loss(system, event) for event in result.events if event.kind == "impact" and not system.compliant
    )
    ends = result.solution(result.solution.ts[[0, -1]]).T
    stored = [_stored(system, y) * unit for y in ends]
    energies["contact"] += (_forsaken(system, ends[1]) - _forsaken(system, ends[0])) * unit
    return energies | {"stored": stored[1] - stored[0], "largest": max(map(abs, stored))}


def imbalance(energies: dict[str, float]) -> float:
    """What is left of the ledger, relative to its largest term."""
    losses = sum(energies[name] for name in ("viscous", "friction", "impact", "contact", "stored"))
    return abs(energies["excitation"] - losses) / max(map(abs, energies.values()))


def _slider_loss(result: Reference, t: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Power lost in the Jenkins elements: the spring's force on what does not elongate it, from slip to stick.

    The elongation would not tell: a spring that turns a hair before its bound has it, too.
    """
    system = result.system
    slips = np.array([_sliding(result, element, t) for element in range(len(system.spring))]).reshape(-1, len(t))
    return (system.spring * system.limit) @ (np.abs(system.V @ qd) * slips)


def _sliding(result: Reference, element: int, t: np.ndarray) -> np.ndarray:
    """Whether an element slides at scaled times t: since a slip, or from the start if its first event is a stick."""
    events = [event for event in result.events if event.side == "casing" and event.damper == element]
    times = np.array([event.time * result.system.omega for event in events])
    slides = np.array([bool(events) and events[0].kind == "stick", *(event.kind == "slip" for event in events)])
    return slides[np.searchsorted(times, t, side="right")]


def _contact_loss(system: System, y: np.ndarray) -> np.ndarray:
    """Power lost in the compliant contacts: what goes in and is not held by a compressed spring, pushing or not."""
    if not system.compliant:
        return np.zeros(y.shape[1])
    opening, speed = _openings(system, y)
    inside = np.minimum(opening, 0.0)
    force = np.maximum(-inside - system.delay[:, None] * speed, 0.0) * (opening < 0)
    return system.stiffness @ (-(force + inside) * speed)


def _openings(system: System, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q, r, qd, rd = system.split(y)
    return system.G @ r + system.H @ q + system.reach[:, None], system.G @ rd + system.H @ qd


def _stored(system: System, y: np.ndarray) -> float:
    """Kinetic, elastic and potential energy in a state."""
    q, r, qd, rd = system.split(y)
    bodies = rd + system.W.T @ qd
    energy = qd @ system.M @ qd + q @ system.K @ q + system.m @ bodies**2 + system.spring @ system.elongation(y) ** 2
    if system.compliant:
        energy += system.stiffness @ np.minimum(system.opening(y), 0.0) ** 2 - 2 * _forsaken(system, y)
    return float(energy / 2 - system.m @ (system.weight * (r + system.W.T @ q)))


def _forsaken(system: System, y: np.ndarray) -> float:
    """Energy of the walls that spring back without pushing."""
    if not system.compliant:
        return 0.0
    loose = (system.opening(y) < 0) & (system.press(y) < 0)
    return float(system.stiffness @ (loose * system.opening(y) ** 2)) / 2


def _impact_loss(system: System, event: Event) -> float:
    if event.side == "neighbour":
        one, other = system.m[event.damper], system.m[event.damper + 1]
        mass = one * other / (one + other)
    else:
        w = system.W[:, event.damper]
        mass = 1 / (1 / system.m[event.damper] + w @ system.inverse @ w)
    return mass * (event.relative_velocity_before**2 - event.relative_velocity_after**2) / 2
