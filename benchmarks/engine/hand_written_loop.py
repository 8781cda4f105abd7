"""One mode, one frictionless body between two walls: the loop that an expert would write by hand for just that.

The reference of the exact engine, written for speed: the closed form of the oscillator at 16 points of every
period, a sign test of the gap there, safeguarded Newton, the impact law. Unlike the engine it misses what comes and
goes between two points, such as a grazing impact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid
from vanedamp.coupling.system.resonance import excitation_force

BRACKETS = 16
_PLAIN, _LEAN, _COMPLETE = range(3)
#: a Newton step below this share of the period leaves an error of its square
_CONVERGED = 1e-9
#: columns of the complete loop's account: J, J, J, m^2 s, m s and N s^2 (real and imaginary parts)
ACCOUNT = ("excitation", "viscous", "impact", "square", "harmonic", "harmonic_i", "momentum", "momentum_i")


class ImpactOscillator(NamedTuple):
    """m x'' + d x' + c x = A sin(omega t), a body of mass `body` between two walls `gap` apart (SI units)."""

    mass: float
    damping: float
    stiffness: float
    force: float
    omega: float
    body: float
    gap: float
    restitution: float
    displacement: float
    velocity: float
    slip: float
    slip_velocity: float

    @classmethod
    def of(cls, scene: Scene) -> ImpactOscillator:
        """Return the oscillator of a scene with a rigid structure and one body without friction and gravity."""
        structure, (damper,), (cavity,) = scene.structure, scene.damper, scene.cavity
        along = scene.gravity.acceleration * scene.gravity.orientation_deg
        assert isinstance(structure, Rigid) and damper.friction == 0 and along == 0 and not scene.excitation.harmonic
        return cls(
            structure.mass, structure.viscous, structure.stiffness, excitation_force(scene),
            2 * math.pi * scene.frequency, damper.mass, cavity.gap, damper.restitution,
            scene.initial.displacement, scene.initial.velocity, scene.positions[0], damper.velocity,
        )  # fmt: skip


def plain_loop(case: ImpactOscillator, periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Return states (periods + 1, 4) x, x', r, r' at the periods' starts and largest |x| (periods,) at the brackets.

    Exponential, sine and cosine are evaluated again at every bracket.
    """
    section, peak, account = np.empty((periods + 1, 4)), np.zeros(periods), np.zeros((1, len(ACCOUNT)))
    _march(case, periods, _PLAIN, section, peak, account)
    return section, peak


def lean_loop(case: ImpactOscillator, periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Do as the plain loop, from bracket to bracket by one complex product and a table of the forced part."""
    section, peak, account = np.empty((periods + 1, 4)), np.zeros(periods), np.zeros((1, len(ACCOUNT)))
    _march(case, periods, _LEAN, section, peak, account)
    return section, peak


def complete_loop(case: ImpactOscillator, periods: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return states and refined peaks as the lean loop does, and the engine's account (periods, 8), see ACCOUNT."""
    section, peak, account = np.empty((periods + 1, 4)), np.zeros(periods), np.zeros((periods, len(ACCOUNT)))
    _march(case, periods, _COMPLETE, section, peak, account)
    return section, peak, account


@njit(cache=True, error_model="numpy")
def _march(
    case: ImpactOscillator, periods: int, style: int, section: np.ndarray, peak: np.ndarray, account: np.ndarray
) -> None:
    omega, half, period = case.omega, 0.5 * case.gap, 2.0 * math.pi / case.omega
    h = period / BRACKETS
    decay = 0.5 * case.damping / case.mass
    ring = math.sqrt(case.stiffness / case.mass - decay * decay)
    rate, drive = complex(-decay, ring), complex(0.0, omega)
    turn = _exp(rate * h)
    pair = (1.0 + case.restitution) * case.mass * case.body / (case.mass + case.body)
    # x = Re(forced + free): the forced part at the brackets is the same in every period
    steady = -1j * case.force / complex(case.stiffness - case.mass * omega * omega, case.damping * omega)
    forced = np.empty(BRACKETS + 1, np.complex128)
    for k in range(BRACKETS + 1):
        forced[k] = steady * _exp(drive * (k % BRACKETS) * h)
    x, v = case.displacement, case.velocity
    shift = x - steady.real
    free = complex(shift, -(v + omega * steady.imag + decay * shift) / ring)
    body, speed = x + case.slip, v + case.slip_velocity
    for p in range(periods):
        _record(section, p, x, v, body, speed)
        largest = abs(x)
        start, begun_forced, begun_free = 0.0, forced[0], free  # of the segment since the last impact
        for k in range(BRACKETS):
            now, left, phase, ahead = k * h, h, forced[k], forced[k + 1]
            then, there = free * turn, body + speed * h
            if style == _PLAIN:
                ahead, then = steady * _exp(drive * (k + 1) * h), free * _exp(rate * h)
            while True:
                x1 = ahead.real + then.real
                gone = there - x1
                if abs(gone) <= half:
                    break
                side = 1.0 if gone > 0.0 else -1.0
                t = _root(phase, free, body, speed, side, half, rate, omega, left, abs(gone) - half, period)
                x0, v0 = x, v
                phase *= _exp(drive * t)
                free *= _exp(rate * t)
                now, left = now + t, left - t
                x, v = phase.real + free.real, (rate * free).real - omega * phase.imag
                if style == _COMPLETE:
                    largest = _refined(largest, x0, v0, x, v, phase, free, rate, omega, t)
                    _add(case, account[p], begun_forced, begun_free, rate, drive, speed, start, now - start)
                else:
                    largest = max(largest, abs(x))
                impulse = pair * (v - speed)
                if style == _COMPLETE:
                    account[p, 2] += 0.5 * (1.0 - case.restitution) * impulse * (v - speed)
                body, speed, v = x + side * half, speed + impulse / case.body, v - impulse / case.mass
                free += complex(0.0, impulse / (case.mass * ring))
                start, begun_forced, begun_free = now, phase, free
                then, there = free * _exp(rate * left), body + speed * left
            v1 = 0.0
            if style == _COMPLETE:
                v1 = (rate * then).real - omega * ahead.imag
                largest = _refined(largest, x, v, x1, v1, ahead, then, rate, omega, left)
            else:
                largest = max(largest, abs(x1))
            x, v, free, body = x1, v1, then, there
        if style == _COMPLETE:
            _add(case, account[p], begun_forced, begun_free, rate, drive, speed, start, period - start)
        v = (rate * free).real - omega * steady.imag
        peak[p] = largest
    _record(section, periods, x, v, body, speed)


@njit(cache=True)
def _record(section: np.ndarray, p: int, x: float, v: float, body: float, speed: float) -> None:
    section[p, 0], section[p, 1], section[p, 2], section[p, 3] = x, v, body - x, speed - v


@njit(cache=True)
def _exp(z: complex) -> complex:
    size = math.exp(z.real)
    return complex(size * math.cos(z.imag), size * math.sin(z.imag))


@njit(cache=True, error_model="numpy")
def _root(
    phase: complex, free: complex, body: float, speed: float, side: float, half: float, rate: complex, omega: float,
    left: float, beyond: float, period: float,
) -> float:  # fmt: skip
    """Return the time in (0, left] at which the body reaches that wall, which it has passed by `beyond` at `left`."""
    low, high = 0.0, left
    inside = half - side * (body - phase.real - free.real)
    t = left * inside / (inside + beyond) if inside > 0.0 else left
    for _ in range(60):
        fp, fr = phase * _exp(complex(0.0, omega * t)), free * _exp(rate * t)
        value = side * (body + speed * t - fp.real - fr.real) - half
        if value > 0.0:
            high = t
        else:
            low = t
        step = value / (side * (speed + omega * fp.imag - (rate * fr).real))
        better = t - step
        if abs(step) < _CONVERGED * period:
            return min(max(better, 0.0), left)
        t = better if low < better < high else 0.5 * (low + high)
    return t


@njit(cache=True, error_model="numpy")
def _refined(
    largest: float, x0: float, v0: float, x1: float, v1: float, phase: complex, free: complex, rate: complex,
    omega: float, span: float,
) -> float:  # fmt: skip
    """Return the largest |x| over a bracket of length `span` that ends with forced and free part as given."""
    largest = max(largest, abs(x1))
    if v0 * v1 >= 0.0 or max(abs(x0) + abs(v0) * span, abs(x1) + abs(v1) * span) <= largest:
        return largest
    t = -span * v1 / (v1 - v0)  # counted from the end
    x = x1
    for _ in range(8):
        fp, fr = phase * _exp(complex(0.0, omega * t)), free * _exp(rate * t)
        x, v, a = fp.real + fr.real, (rate * fr).real - omega * fp.imag, (rate * rate * fr).real
        step = v / (a - omega * omega * fp.real)
        t -= step
        if abs(step) < 1e-8 * span:
            break
    return max(largest, abs(x))


@njit(cache=True, error_model="numpy")
def _integral(rate: complex, tau: float) -> complex:
    """Return the integral of exp(rate t) over [0, tau] without cancellation."""
    z = rate * tau
    if abs(z.real) + abs(z.imag) < 1e-3:
        return tau * (1.0 + z * (0.5 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z / 120.0))))
    return (_exp(z) - 1.0) / rate


@njit(cache=True, error_model="numpy")
def _add(
    case: ImpactOscillator, account: np.ndarray, forced: complex, free: complex, rate: complex, drive: complex,
    speed: float, start: float, tau: float,
) -> None:  # fmt: skip
    """Add work, viscous loss, mean square, harmonic and momentum of a flight, by closed-form integrals."""
    both, beat = _integral(rate + drive, tau), _integral(rate - drive, tau)
    twice, ringing, driven = _integral(2.0 * rate, tau), _integral(2.0 * rate.real + 0.0j, tau).real, tau
    second = _integral(2.0 * drive, tau)
    back = _exp(-drive * start)
    # the phase of A sin(omega t) = Re(-i A exp(i omega t)) at the segment's start
    load = -1j * case.force * back.conjugate()
    v, w = drive * forced, rate * free
    account[0] += 0.5 * (load * v * second + load * v.conjugate() * driven).real
    account[0] += 0.5 * (load * w * both + load.conjugate() * w * beat).real
    size = (forced * forced * second + abs(forced) ** 2 * driven + free * free * twice + abs(free) ** 2 * ringing).real
    account[3] += 0.5 * size + (free * (forced * both + forced.conjugate() * beat)).real
    size = (v * v * second + abs(v) ** 2 * driven + w * w * twice + abs(w) ** 2 * ringing).real
    account[1] += case.damping * (0.5 * size + (w * (v * both + v.conjugate() * beat)).real)
    total = forced * driven + (forced * second).conjugate() + free * beat + (free * both).conjugate()
    harmonic = 0.5 * back * total
    account[4] += harmonic.real
    account[5] += harmonic.imag
    momentum = case.body * speed * back * _integral(-drive, tau)
    account[6] += momentum.real
    account[7] += momentum.imag
