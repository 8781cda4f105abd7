"""Histories of orbits: their motion over the periods that they take, with its impacts, for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.orbits.period_map import PeriodMap
from vanedamp.coupling.response.response import Event, Response
from vanedamp.coupling.scene.registration import meets_body
from vanedamp.files.store import frozen

#: samples of an excitation period
SAMPLES = 400


@dataclass(frozen=True, eq=False)
class OrbitHistory:
    """The motion along an orbit, n samples from the start of its first excitation period to its end, both included.

    Of a run: its last periods, without their end.

    time          (n,) s
    displacement  (n,) m at excitation.at; velocity: (n,) m/s
    slip          (n, bodies) m, of the bodies in their cavities; slip_velocity: (n, bodies) m/s
    impact_time   (m,) s; impact_body: (m,) number of the body, -1: of the structure on a stop

    Velocities are differences of the samples between impacts, of second order in their distance.
    """

    time: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    slip: np.ndarray
    slip_velocity: np.ndarray
    impact_time: np.ndarray
    impact_body: np.ndarray


def orbit_history(period_map: PeriodMap, state: np.ndarray) -> OrbitHistory:
    """Return the motion that a period map passes from a state (k,), an orbit's at the start of its period."""
    response = period_map.run(state, events=True, samples_per_period=SAMPLES)
    # the orbit ends where it began
    time = np.append(response.time, period_map.periods / period_map.scene.frequency)
    displacement, slip = (
        np.concatenate([each, each[:1]]) for each in (response.displacement, response.body_displacement)
    )
    return _history(time, displacement, slip, response.event_list)


def late_history(response: Response, periods: int) -> OrbitHistory:
    """Return the motion in the last periods of a run that kept samples and events; all of a shorter one."""
    each = len(response.time) // max(response.periods, 1)
    late = slice(max(len(response.time) - periods * each, 0), None)
    time = response.time[late]
    events = [event for event in response.event_list if len(time) and event.time >= time[0]]
    return _history(time, response.displacement[late], response.body_displacement[late], events)


def _history(time: np.ndarray, displacement: np.ndarray, slip: np.ndarray, events: Sequence[Event]) -> OrbitHistory:
    impacts = [event for event in events if event.kind == "impact"]
    moments = np.array([event.time for event in impacts])
    return OrbitHistory(
        time=frozen(time), displacement=frozen(displacement), velocity=frozen(_rate(time, displacement, moments)),
        slip=frozen(slip), slip_velocity=frozen(_rate(time, slip, moments)), impact_time=frozen(moments),
        impact_body=frozen([event.damper if meets_body(event.side) else -1 for event in impacts], int),
    )  # fmt: skip


def _rate(time: np.ndarray, values: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Return the derivative of values (n, ...) by time between its jumps; nan between two that one sample parts."""
    rate = np.full(values.shape, np.nan)
    for piece in np.split(np.arange(len(time)), np.searchsorted(time, jumps)):
        if len(piece) > 1:
            rate[piece] = np.gradient(values[piece], time[piece], axis=0, edge_order=2 if len(piece) > 2 else 1)
    return rate
