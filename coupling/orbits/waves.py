"""Travelling waves of a tuned ring: each sector does the same one phase later."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit, least_squares, zero_of_map
from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.files.toml_input import InputError

#: largest fraction of the scale by which a travelling wave misses itself after a whole period; least time between
#: events, over the period: sectors opposite to each other may have theirs together, though no part tells their order
_CLOSED, _TOGETHER = 1e-6, 1e-9
#: scaled distances at which a derivative is taken near a wave, scaled residual of the wave, and steps to it
_BESIDE, _RESIDUAL, _STEPS = (1e-6, 1e-6, 1e-5, 1e-4), 1e-10, 40


def of_waves(period_map: PeriodMap) -> PeriodMap:
    """Return the map of the part of a period in which a wave comes to the next sector.

    Raises InputError for a scene without that symmetry.
    """
    if period_map.travelling is None or period_map.periods != 1:
        raise InputError(
            "orbit.wave: a wave travels over equal sectors with bodies or joints in equal steps (c@0, c@1, ...), "
            "without mistuning or scatter, under one engine order that is no multiple of their number; over one period"
        )
    return replace(period_map, wave=True, earlier=[])


def find_wave(period_map: PeriodMap, start: np.ndarray) -> PeriodicOrbit:
    """Return the travelling wave that Newton's method finds from a state (k,), or the last iterate and why it failed.

    Raises InputError for a scene without that symmetry.
    """
    wave = of_waves(period_map)
    zero = zero_of_map(wave, start)
    if zero.status is not OrbitStatus.OK:
        zero = _from_beside(wave, np.asarray(start, float)) or zero
    if zero.status is not OrbitStatus.OK:
        return zero
    orbit = whole(zero)
    if not orbit.residual < _CLOSED * (1.0 + float(np.abs(zero.state / zero.scale).max(initial=0.0))):
        return replace(zero, status=OrbitStatus.NOT_CONVERGED, residual=orbit.residual, map=orbit.map)
    return orbit


def whole(wave: PeriodicOrbit) -> PeriodicOrbit:
    """Return an orbit of a map of waves over the whole period, its derivative the product of the parts'."""
    assert wave.map is not None and wave.map.travelling is not None
    symmetry, period_map = wave.map.travelling, replace(wave.map, wave=False, earlier=[])
    passage, of_wave = period_map(wave.state, derivative=False), wave.passage
    missed = float(np.abs((passage.state - wave.state) / wave.scale).max(initial=0.0))
    # (image part)^times is the whole period, with the sectors shifted all the way round or by a period of the loads
    back, step = np.linalg.inv(symmetry.image), of_wave.derivative
    derivative = np.linalg.matrix_power(back, symmetry.times) @ np.linalg.matrix_power(step, symmetry.times)
    status, times = of_wave.status, [crossing.time for crossing in passage.crossings]
    if status is PassageStatus.OK and np.any(np.diff(times) < _TOGETHER * max(times, default=0.0)):
        status = PassageStatus.COINCIDENT
    together = passage._replace(derivative=derivative, status=status, clearance=of_wave.clearance)
    return replace(wave, passage=together, residual=max(missed, wave.residual), map=period_map)


def _from_beside(wave: PeriodMap, start: np.ndarray) -> PeriodicOrbit | None:
    """Return the wave by steps with a derivative taken nearby; None if they lead to none.

    Where sectors have events at one instant, the derivative holds for motions in which they still meet, and Newton's
    steps go astray. Near the wave their events are apart.
    """
    state, scale, last = start, wave.scale, math.inf
    random, neighbour = np.random.default_rng(0), None
    for count in range(_STEPS):
        passage = wave(state, derivative=False)
        if not passage.serves(False):
            return None
        residual = (passage.state - state) / scale
        missed = float(np.abs(residual).max(initial=0.0))
        if missed > 0.1 * last or neighbour is None:
            for distance in _BESIDE:
                tried = wave(state + distance * scale * random.standard_normal(len(state)))
                if tried.serves(True):
                    neighbour = tried
                    break
        if neighbour is None:
            return None
        if missed <= _RESIDUAL * (1.0 + float(np.abs(state / scale).max(initial=0.0))):
            one_sided = neighbour._replace(status=PassageStatus.COINCIDENT)
            return PeriodicOrbit(OrbitStatus.OK, math.nan, state, 1, scale, one_sided, missed, count, map=wave)
        state = state - scale * least_squares(neighbour.scaled(scale) - np.eye(len(state)), residual)
        last = missed
    return None
