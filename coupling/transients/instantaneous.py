"""Instantaneous frequency and damping of a free motion from its turning points, which are known exactly.

Between turning points x_k at times t_k a half cycle has the amplitude |x_k - x_{k+1}|/2 and the frequency
1/(2 (t_{k+1} - t_k)). Turning points, not zero crossings: under dry friction the centre of the motion jumps with the
direction, which moves crossings but not the times between turning points. Swings |x_k - x_{k+1}| contain no constant
offset; of a linear mode with damping ratio zeta their ratio is exp(-pi zeta/sqrt(1 - zeta^2)), exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit

from vanedamp.coupling.response.segment import Segment, beyond_line
from vanedamp.coupling.system.unit_laws import presses

#: fraction of the largest speed below which a mode is not felt
_FELT = 1e-9
#: points per period of the fastest mode between which the sign of the speed is followed
_LOOKS = 16
#: fraction of the speed before that counts as rest, and by which that speed is forgotten from one period to the next
_STILL, _FORGOTTEN = 1e-12, 0.01
#: fraction of the swings before and after below which a swing is a rebound within a half cycle; the most in a row
_REBOUND, _MOST_REBOUNDS = 0.1, 100


class Energy(NamedTuple):
    """Energies at a time, J: of structure, bodies and springs together; of the structure's modes, and kinetic of it."""

    total: float
    structure: float
    kinetic: float


class Followed:
    """A segment of a free motion, with one modal coordinate followed.

    start, duration: s; rate: (m,) 1/s; wave: (m,) coefficients of exp(rate t) in the coordinate; powers: (3,) value,
    slope and second derivative of the rest.
    """

    def __init__(self, segment: Segment, mode: int) -> None:
        self.start, self.duration = segment.start, segment.duration
        self._segment, self.rate, self.wave = segment, segment.rate, segment.shape[mode] * segment.amplitude
        self.powers = np.array([segment.q[mode], segment.v[mode], segment.bend[mode]])

    @property
    def fastest(self) -> float:
        """Angular frequency of the fastest mode in the followed coordinate, rad/s."""
        speed = np.abs(self.wave * self.rate)
        felt = speed > _FELT * speed.max(initial=0.0)
        return float(np.abs(self.rate[felt]).max(initial=0.0))

    def coordinate(self, t: float) -> float:
        """Return the followed modal coordinate after a time t, s."""
        constant, slope, bend = self.powers
        return float(constant + t * (slope + 0.5 * t * bend) + (self.wave @ beyond_line(self.rate * t)).real)

    def speed(self, t: np.ndarray) -> np.ndarray:
        """Return the rates (k,) of the followed modal coordinate after times t (k,), s."""
        turned = np.expm1(np.multiply.outer(t, self.rate))
        speed: np.ndarray = self.powers[1] + t * self.powers[2] + (turned @ (self.wave * self.rate)).real
        return speed

    def energy(self, t: float) -> Energy:
        """Return the energies after a time t, s."""
        system, (q, v) = self._segment.system, self._segment.at(t)
        n, u, massive = system.modes, system.contacts, slice(len(q) - len(system.tangential))
        kinetic = 0.5 * float(v[:n] @ v[:n])
        total = 0.5 * float(system.mass[massive] @ v[massive] ** 2 + q @ system.stiffness @ q)
        total -= float(system.weight @ q)
        state = self._segment.state[:u]
        pressed = np.isfinite(system.spring[:u]) & presses(state)
        gap = (system.rest[:u] + system.J[:u] @ q)[pressed]
        total += 0.5 * float(system.spring[:u][pressed] @ gap**2 + system.tangential @ (system.elongation @ q) ** 2)
        return Energy(total, kinetic + 0.5 * float(q[:n] @ system.stiffness[:n, :n] @ q[:n]), kinetic)


class TurningPoint(NamedTuple):
    """A point where a coordinate turns: time (s), the coordinate, energies of all and of the structure (J)."""

    time: float
    coordinate: float
    energy: float
    structure_energy: float


class TurningPoints:
    """The turning points of the followed coordinate, gathered segment by segment: `found`.

    A coordinate that turns at an impact turns at the event's time; between events the root of the speed is found to
    round-off. One that comes to rest turns where it stops.
    """

    def __init__(self) -> None:
        self.found: list[TurningPoint] = []
        self._sign, self._speed, self._energy = 0.0, 0.0, 0.0
        #: where the speed has vanished, until it is known whether the coordinate moves on
        self._stop: TurningPoint | None = None

    @property
    def rest(self) -> TurningPoint | None:
        """Where the coordinate has come to rest; None if it moves, or never has."""
        return self._stop if self._sign else None

    def add(self, segment: Followed) -> None:
        """Follow a segment."""
        if segment.fastest == 0.0:
            now = segment.energy(0.0)
            if now.kinetic > _STILL**2 * max(now.structure, self._energy):
                # other modes move, and this one has become so small compared with them that the engine leaves it out
                self._sign, self._stop = 0.0, None
                return
        looks = max(int(np.ceil(segment.duration * segment.fastest * _LOOKS / (2 * np.pi))), 2)
        times = np.linspace(0.0, segment.duration, looks + 1)
        for first in range(0, looks, _LOOKS):
            self._follow(segment, times[first : first + _LOOKS + 1])

    def _follow(self, segment: Followed, times: np.ndarray) -> None:
        """Follow the sign of the speed from one of the times (k,) within a segment to the next."""
        speeds = segment.speed(times)
        largest = float(np.abs(speeds).max())
        self._energy = self._energy or segment.energy(0.0).structure
        if largest > _STILL * self._speed:
            self._speed = max(largest, _FORGOTTEN * self._speed)
        signs = np.where(np.abs(speeds) <= _STILL * self._speed, 0.0, np.sign(speeds))
        for k in np.flatnonzero(np.diff(signs, prepend=np.nan)):
            if signs[k] == 0.0:
                self._stop = self._stop or _point(segment, times[k])
                continue
            if self._sign == -signs[k]:
                # between two segments an impact has turned it
                turn = _root(segment, times[k - 1], times[k]) if k and self._stop is None else times[k]
                self._turn(self._stop or _point(segment, turn))
            elif not self._sign and self._stop is not None:
                self.found.append(self._stop)  # released at rest
            self._sign, self._stop = float(signs[k]), None

    def _turn(self, point: TurningPoint) -> None:
        """Keep a turning point; one that turns back at the instant of the last leaves none of both."""
        if self.found and point.time <= self.found[-1].time:
            self.found.pop()
        else:
            self.found.append(point)


def _root(segment: Followed, before: float, after: float) -> float:
    """Return the time between two at which the speed vanishes."""
    return float(brentq(lambda t: segment.speed(np.array([t]))[0], before, after, xtol=1e-16 * after, rtol=1e-15))


def _point(segment: Followed, t: float) -> TurningPoint:
    energy = segment.energy(t)
    return TurningPoint(float(segment.start + t), segment.coordinate(t), energy.total, energy.structure)


def without_rebounds(points: list[TurningPoint]) -> list[TurningPoint]:
    """Return the turning points that bound half cycles: rebounds of impacts within a half cycle are left out.

    Rebounds are swings that are all smaller than a tenth of both the swings before and after them. At the end of a
    half cycle its outermost turning point stays, on its way none.
    """
    turning: list[TurningPoint] = []
    for point in points:
        turning.append(point)
        swing = np.abs(np.diff([each.coordinate for each in turning[-_MOST_REBOUNDS:]]))
        large = np.flatnonzero(swing[:-1] >= _REBOUND * swing[-1:])
        first = int(large[-1]) + 1 if len(large) else len(swing)
        rebounds = swing[first:-1]
        if not len(rebounds) or rebounds.max() >= _REBOUND * swing[first - 1]:
            continue
        begun = len(turning) - 2 - len(rebounds)  # the turning point before the first rebound
        outer = max if turning[begun].coordinate > turning[begun - 1].coordinate else min
        stays = [outer(turning[begun:-1], key=lambda each: each.coordinate)] if len(rebounds) % 2 == 0 else []
        turning[begun:-1] = stays
    return turning


class HalfCycles(NamedTuple):
    """Half cycles between turning points: time of their middle (s), amplitude (the coordinate's unit), frequency (Hz).

    Arrays (h,).
    """

    time: np.ndarray
    amplitude: np.ndarray
    frequency: np.ndarray


class DampingWindows(NamedTuple):
    """Damping over windows of whole cycles that begin at every turning point but the last ones. Arrays (c,).

    time: s, of the window's middle; amplitude: mean of the swings in the window, halved; damping_ratio: by the
    logarithmic decrement from its first swing to its last one; damping_ratio_energy: by the energy that all parts lose
    from its first turning point to its last one, `loss` (J), relative to the structure's energy at the first.
    """

    time: np.ndarray
    amplitude: np.ndarray
    damping_ratio: np.ndarray
    damping_ratio_energy: np.ndarray
    loss: np.ndarray


def half_cycles(time: np.ndarray, coordinate: np.ndarray) -> HalfCycles:
    """Return the half cycles between turning points (k,)."""
    return HalfCycles((time[1:] + time[:-1]) / 2, np.abs(np.diff(coordinate)) / 2, 0.5 / np.diff(time))


def cycles(
    time: np.ndarray, coordinate: np.ndarray, energy: np.ndarray, structure_energy: np.ndarray, count: int = 1
) -> DampingWindows:
    """Return the damping over windows of `count` cycles between turning points (k,).

    Both estimates are exact for a linear mode. The loss of energy includes all parts: in a window in which bodies
    lose more than the structure has at its start, that estimate is nan.
    """
    half = 2 * count
    if len(time) <= half:
        return DampingWindows(*np.zeros((5, 0)))
    swing = np.abs(np.diff(coordinate))
    loss = energy[:-half] - energy[half:]
    with np.errstate(invalid="ignore", divide="ignore"):  # at rest there is none
        decrement = np.log(swing[: len(swing) - half + 1] / swing[half - 1 :]) / (half - 1)
        ratio = damping_ratio(decrement)
        left = np.log1p(-loss / structure_energy[:-half])
        by_energy = damping_ratio(-left / (2 * half))
    total = np.concatenate([[0.0], np.cumsum(swing)])
    return DampingWindows(
        (time[half:] + time[:-half]) / 2, (total[half:] - total[:-half]) / (2 * half), ratio,
        np.where(np.isfinite(left), by_energy, np.nan), loss,
    )  # fmt: skip


def damping_ratio(decrement: np.ndarray) -> np.ndarray:
    """Return the damping ratio of a linear mode whose swings shrink by exp(-decrement) per half cycle."""
    ratio: np.ndarray = decrement / np.hypot(np.pi, decrement)
    return ratio


class Bins(NamedTuple):
    """Values by amplitude. Arrays (b,); nan where a bin has too few values.

    low, high: edges of the amplitude; number: of the values; mean, with the half width of its 95 % confidence interval,
    from every `stride`-th value so that their windows do not overlap; median.
    """

    low: np.ndarray
    high: np.ndarray
    number: np.ndarray
    mean: np.ndarray
    confidence: np.ndarray
    median: np.ndarray


def bins(amplitude: np.ndarray, values: np.ndarray, edges: np.ndarray, stride: int = 1) -> Bins:
    """Return bins over the amplitudes (k,) of values (k,), nan left out. edges: (b + 1,), the outer ones open."""
    bin_ = np.searchsorted(edges[1:-1], amplitude, side="right")
    rows = []
    for k in range(len(edges) - 1):
        members = values[(bin_ == k) & np.isfinite(values)]
        apart = members[::stride]
        spread = np.nan
        if len(apart) > 1:
            spread = stdtrit(len(apart) - 1, 0.975) * apart.std(ddof=1) / np.sqrt(len(apart))
        rows.append(
            [
                len(members),
                members.mean() if len(members) else np.nan,
                spread,
                np.median(members) if len(members) else np.nan,
            ]
        )
    return Bins(edges[:-1], edges[1:], *np.reshape(rows, (-1, 4)).T)
