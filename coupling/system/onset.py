"""Amplitudes at which bodies begin to slip on their floors and to hit their walls, known before any run.

A body that the floor moves by R sin(omega t) sticks while its inertia stays below its friction. Beyond, it slips: to
and fro, or downhill where its cavity is inclined, until it lies at the lower wall. The amplitudes are
for motions that grow slowly; a transient may lead to impacts at smaller ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.sectors import unrolled

#: R omega^2 over the acceleration of friction from which on a body slips without a stop (Code_Aster, SDND104)
NEVER_STICKS = math.sqrt(1.0 + math.pi**2 / 4.0)
#: angle after the begin of a slip before which it does not end
_SOON = 1e-6


class Onset(NamedTuple):
    """Amplitudes of the floor under a body, m, at which it begins to slip and to hit a wall."""

    slip: float
    impact: float


def onset(room: float, friction: float, pull: float, omega: float) -> Onset:
    """Return the onsets of a body with free travel `room`, m, to either wall at an angular frequency, rad/s.

    friction: mu N/m, that holds it, and pull, along the cavity: accelerations, m/s^2.
    """
    from scipy.optimize import brentq

    slip = max(friction - abs(pull), 0.0) / omega**2
    if pull:  # downhill to the wall, which it leaves as the wall runs away from it
        return Onset(slip, (friction + abs(pull)) / omega**2)
    if room >= slip:  # it never sticks: swing(R, s) = R^2 - (pi s/2)^2 under a root
        return Onset(slip, math.hypot(room, 0.5 * math.pi * slip))
    return Onset(slip, float(brentq(lambda reach: swing(reach, slip) - room, slip, NEVER_STICKS * slip)))


def swing(reach: float, slip: float) -> float:
    """Return the amplitude, m, of a body's slip on a level floor of amplitude `reach`, m; slip: where it begins, m."""
    from scipy.optimize import brentq

    if reach <= slip:
        return 0.0
    if reach >= NEVER_STICKS * slip:
        return math.sqrt(reach**2 - (0.5 * math.pi * slip) ** 2)
    begin = math.asin(slip / reach)

    def speed(turn: float) -> float:  # of the slip, over omega
        return reach * math.cos(begin) - slip * turn - reach * math.cos(begin + turn)

    end = float(brentq(speed, _SOON, math.pi + _SOON))
    way = reach * math.cos(begin) * end - 0.5 * slip * end**2 - reach * (math.sin(begin + end) - math.sin(begin))
    return 0.5 * way


def onsets(scene: Scene) -> list[Onset | None]:
    """Return the onsets of all bodies as amplitudes of the response, m, under the scene's sine.

    In the ratio of the linear response without bodies, at the excitation's frequency. None for a body that a spring or
    a track binds, that rolls or begins tilted, that its neighbours do not follow, and under other loads than a sine.
    """
    scene = unrolled(scene)
    system, count = assemble(scene), len(scene.damper)
    if scene.excitation.signal is not None or len(system.frequency) != 1:
        return [None] * count
    omega, free, bodies = system.omega, linear_responses(scene, system)[0], system.of_bodies
    wave = free.motion(scene.frequency)[0]
    response = abs(wave @ free.response + free.table[0])
    # a body that nothing holds stays where it is in space, which moves against the base
    reach = np.abs(system.floor[:, : system.modes] @ wave + bodies.load[0] / (bodies.mass * omega**2))
    positions = scene.positions
    friction, pull = system.holds / bodies.mass, bodies.weight / bodies.mass
    results: list[Onset | None] = []
    for index, damper in enumerate(scene.damper):
        cavity = scene.cavity[scene.cavity_of(damper)]
        row = scene.bodies_in(cavity)
        alike = len(row) == 1 or (np.ptp(friction[row]) == 0.0 and not pull[row].any())
        lies = not damper.form.rolls and not (damper.lift or damper.tilt)
        if damper.sprung or not alike or not lies or not reach[index] or not response:
            results.append(None)
            continue
        room = cavity.gap / 2 - max(abs(positions[other]) for other in row)
        single, ratio = onset(room, friction[index], pull[index], omega), response / reach[index]
        results.append(Onset(single.slip * ratio, single.impact * ratio))
    return results
