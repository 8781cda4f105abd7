"""Pulse of one collision of a body with a wall of the structure, and its error due to omitted modes.

The modes are at rest, and the body arrives at unit speed. During contact, body, contact and modes are one linear
system, and the pulse is a sum of exponentials until the contact force vanishes. The excited motion responds to its
Fourier transform at the excitation frequency, which gives the impulse and, by its phase, the instant of action.

Needs numpy and scipy only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

# half periods of body and wall on the contact after which it counts as ended, and samples of its force in each
_LONGEST, _LOOKS = 6, 300


@dataclass(frozen=True)
class WallContact:
    """Contact of a body with a wall of the structure.

    label      interface coordinate of the wall
    mass       kg, of the body
    stiffness  N/m, of the contact
    dashpot    N s/m, of the contact
    """

    label: str
    mass: float
    stiffness: float
    dashpot: float = 0.0


class Pulse(NamedTuple):
    """Force of a collision: its Fourier transform (N s for a unit speed of approach) and its duration, s."""

    transform: complex
    duration: float


def pulse(squares: np.ndarray, row: np.ndarray, collision: WallContact, frequency_hz: float) -> Pulse:
    """Return the pulse at a wall with modes of squared angular frequencies (n,) and mass-normalised functional (n,).

    The transform is taken at `frequency_hz`, from the moment of touching; damping of the modes is left out.
    """
    count = len(row) + 1
    pull = np.append(row, -1.0 / math.sqrt(collision.mass))  # rate of penetration
    stiffness = np.diag(np.append(squares, 0.0)) + collision.stiffness * np.outer(pull, pull)
    damping = collision.dashpot * np.outer(pull, pull)
    rates, shapes = np.linalg.eig(np.block([[np.zeros((count, count)), np.eye(count)], [-stiffness, -damping]]))
    start = np.zeros(2 * count)
    start[-1] = -math.sqrt(collision.mass)
    force = np.append(collision.stiffness * pull, collision.dashpot * pull) @ shapes * np.linalg.solve(shapes, start)

    def at(time: float | np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(np.multiply.outer(time, rates)) @ force).real

    half = math.pi / math.sqrt(collision.stiffness * (float(row[0]) ** 2 + 1.0 / collision.mass))
    times = np.linspace(0.0, _LONGEST * half, _LONGEST * _LOOKS)
    ended = np.flatnonzero(at(times)[1:] < 0.0)
    end = float(times[-1])
    if ended.size:
        first = int(ended[0])
        from scipy.optimize import brentq

        end = float(times[1]) if first == 0 else float(brentq(at, times[first], times[first + 1]))
    turned = rates - 2j * math.pi * frequency_hz
    # (exp(z end) - 1) / z, which is end where z vanishes
    spans = np.where(turned == 0.0, end, np.expm1(turned * end) / np.where(turned == 0.0, 1.0, turned))
    return Pulse(complex(force @ spans), end)


def pulse_spectrum(ratio: np.ndarray | float) -> np.ndarray:
    """Return |Fourier transform| of a half sine of unit impulse at r = omega / omega_c: cos(pi r / 2) / (1 - r^2)."""
    r = np.asarray(ratio, dtype=float)
    near = np.abs(r - 1.0) < 1e-6
    safe = np.where(near, 0.0, r)
    return np.where(near, math.pi / 4.0, np.abs(np.cos(math.pi * safe / 2.0) / (1.0 - safe**2)))


def share_above(squares: np.ndarray, row: np.ndarray, modes: int, collision: WallContact) -> float:
    """Return the fraction of an elastic collision's energy that modes beyond the first `modes` of a wall would take.

    A half sine of force at the contact frequency leaves mode j the energy (row_j p S(omega_j))^2 / 2, p the impulse at
    the mass of the first mode and S the pulse's spectrum; relative to the energy of the approach and of all modes
    but the first.
    """
    reduced = 1.0 / (float(row[0]) ** 2 + 1.0 / collision.mass)
    spectrum = pulse_spectrum(np.sqrt(np.maximum(squares, 0.0) * reduced / collision.stiffness))
    energy = 0.5 * (2.0 * reduced * row * spectrum) ** 2
    return float(energy[modes:].sum() / (0.5 * reduced + energy[1:].sum()))
