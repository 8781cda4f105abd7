"""The periods of a run-up or run-down, and the scene in each.

Within a period of the excitation frequency and speed are constant, the means of the ramp over the period: so it takes
as long as a period of the chirp, a force whose frequency changes all the time, and both have whole phases at the same
instants.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.scene.ramp import Ramp as Table
from vanedamp.coupling.scene.rotation import SPEEDS, Rotation, hertz_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

_FREQUENCY = "frequency"
#: periods of a run that anyone would wait for: some hours
MOST_PERIODS = 10_000_000


class Course(NamedTuple):
    """The p periods of a run.

    value: (p,) the ramp's quantity, in its unit; frequency: (p,) Hz; speed: (p,) rad/s; time: (p,) s, of the starts;
    rate: change of the quantity per second.
    """

    value: np.ndarray
    frequency: np.ndarray
    speed: np.ndarray
    time: np.ndarray
    rate: float


def courses(scene: Scene) -> list[Course]:
    """Return the periods of the runs of a scene's [ramp] table: one run for each rate, then those back.

    Raises InputError for a scene without the table, one that cannot be run so (`ramped`), and a rate that passes the
    range in less than one period.
    """
    table, base = table_of(scene), ramped(scene)
    ends = [(table.from_, table.to), (table.to, table.from_)][: 1 + table.both]
    planned: list[Course] = []
    for begin, end in ends:
        for rate in table.rate or (None,):
            planned.append(_course(base, table, begin, end, rate))
            periods = sum(len(course.time) for course in planned)
            if periods > MOST_PERIODS:
                raise InputError(
                    f"ramp.rate: the runs take more than {MOST_PERIODS} periods of the excitation together; take "
                    "higher or fewer rates"
                )
    return planned


def _course(base: Scene, table: Table, begin: float, end: float, rate: float | None) -> Course:
    """Return the periods from one end of the ramp to the other, as many as fit in; rate: in either direction."""
    share = hertz_of(table.path, base.excitation.engine_order)
    constant = base.frequency if math.isnan(share) else 0.0
    sign = math.copysign(1.0, end - begin)
    # periods from end to end, times the rate
    way = abs(end - begin) * constant if constant else abs(end**2 - begin**2) / 2 * share
    if rate is None:
        assert table.periods is not None
        periods, rate = table.periods, way / table.periods
    else:
        periods = math.floor(way / rate * (1 + 1e-12))
    if periods < 1:
        raise InputError(
            f"ramp.rate: {rate:g} {table.unit} a second passes the range in less than one period of the excitation; "
            "take a lower one"
        )
    if periods > MOST_PERIODS:
        raise InputError(
            f"ramp.rate: at {rate:g} {table.unit} a second the range takes {periods:.3g} periods of the excitation; at "
            f"most {MOST_PERIODS}: take a higher rate"
        )
    number = np.arange(periods + 1)
    if constant:
        edge = begin + sign * rate / constant * number
    else:  # the phase is the integral of the frequency: whole where the square has grown by a multiple of 2 rate/share
        edge = np.sqrt(np.maximum(begin**2 + sign * 2 * rate / share * number, 0.0))
    value = (edge[1:] + edge[:-1]) / 2
    frequency = np.full(periods, constant) if constant else share * value
    speed = value * SPEEDS[table.path] if table.path in SPEEDS else np.full(periods, base.speed)
    time = (edge[:-1] - begin) / (sign * rate)
    return Course(frozen(value), frozen(frequency), frozen(speed), frozen(time), sign * rate)


def table_of(scene: Scene) -> Table:
    """Return the scene's [ramp] table. Raises InputError for a scene without."""
    if scene.ramp is None:
        raise InputError("ramp: missing; say how the frequency changes in a table [ramp], such as from, to and rate")
    return scene.ramp


def ramped(scene: Scene) -> Scene:
    """Return the scene whose frequency or speed is to change. Raises InputError for one that cannot be run so."""
    table, excitation = table_of(scene), scene.excitation
    if isinstance(scene.structure, Prescribed):
        raise InputError(
            "ramp: the velocity of a prescribed motion would jump where its frequency changes; take a structure that "
            "a force moves"
        )
    if scene.solver.method != "exact":
        raise InputError(
            f'solver.method: run-ups are those of the exact engine, not of "{scene.solver.method}"; take "exact"'
        )
    check_waveform(scene, "exact")
    order, near = excitation.engine_order, excitation.resonance_near
    if table.quantity == _FREQUENCY:
        if order is not None:
            raise InputError('ramp.quantity: the frequency follows the speed (engine_order); take "speed" or "rpm"')
    else:
        if scene.rotation is None:
            raise InputError(f'ramp.quantity: "{table.quantity}" changes [rotation], which is missing')
        if excitation.resonance_amplitude is not None and (order is None or isinstance(near, float)):
            raise InputError(
                "ramp: over a speed resonance_amplitude is that of one resonance along an engine order; give "
                "excitation.engine_order, and resonance_near as a range, or excitation.force"
            )
        if order is not None and not min(table.from_, table.to) > 0.0:
            raise InputError("ramp: an engine order has no frequency at standstill; give from and to above zero")
    hertz = hertz_of(table.path, order)
    if near is None and math.isfinite(hertz):  # the level refers to one resonance, as in a sweep
        ends = sorted((table.from_ * hertz, table.to * hertz))
        scene = replace(scene, excitation=replace(excitation, resonance_near=(ends[0], ends[1])))
    return replace(scene, ramp=None, sweep={}, orbit=None)


def scene_at(scene: Scene, table: Table, value: float) -> Scene:
    """Return the scene with the ramp's quantity at a value, in its unit."""
    if table.quantity == _FREQUENCY:
        return replace(scene, excitation=replace(scene.excitation, frequency=value))
    return replace(scene, rotation=Rotation(**{table.quantity: value}))
