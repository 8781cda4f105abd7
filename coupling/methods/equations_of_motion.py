"""The time grid and the motion of methods that take time steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import COUNTERS
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Loads, loads_of
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.coupling.system.system import System


@record
class TimeGrid(NamedTuple):
    """The steps of an excitation period."""

    step: float  # s
    phase: np.ndarray  # (steps + 1, 2) cos and sin of omega t within a period
    load: np.ndarray  # (steps + 1, N) of the excitation, N
    table: np.ndarray  # (steps + 1, 2) displacement and velocity of a base whose motion is the response
    travel: np.ndarray  # (r,) free travel of a rigid contact's cavity, m; inf: nothing to check


@record
class Motion(NamedTuple):
    """The state of a run, advanced in place."""

    # changes in every step
    q: np.ndarray  # (N,) coordinates
    v: np.ndarray  # (N,) their velocities
    half: np.ndarray  # (N,) velocity half a step later (central differences), or acceleration (Newmark)
    force: np.ndarray  # (r,) of rows, N
    elongation: np.ndarray  # (friction rows,) of Jenkins elements' springs, m
    deepest: np.ndarray  # (1,) largest penetration relative to the free travel
    losses: np.ndarray  # (6,) energies since the start, J
    counters: np.ndarray  # (COUNTERS,) int

    # changes with the contacts
    active: np.ndarray  # (r,) int: contacts that carry force
    speed: np.ndarray  # (r,) at the beginning of the present contact, m/s
    begun: np.ndarray  # (r,) time of that, s
    impulse: np.ndarray  # (r,) since then, N s

    # scratch, named where each method takes it
    coordinates: np.ndarray  # (6, N)
    rows: np.ndarray  # (8, r)
    listed: np.ndarray  # (r,) int: rows in the problem of a step


def line_loads(scene: Scene, line: LineSystem) -> Loads | None:
    """Return the loads (k, N) of an excitation that is no sum of sines, on sliders; None for others."""
    signal = scene.excitation.signal
    if signal is None:
        return None
    loads, size = loads_of(scene, signal), len(line.mass)
    return lambda angle: loads(angle)[:, :size]


def line_grid(scene: Scene, line: LineSystem, steps: int) -> TimeGrid:
    """Return the grid of `steps` steps per period of a scene of sliders."""
    return time_grid(line, steps, line_loads(scene, line))


def time_grid(system: LineSystem | System, steps: int, loads: Loads | None = None) -> TimeGrid:
    """Return the grid of `steps` steps a period. loads: of an excitation that is no sum of the system's harmonics."""
    angle = 2 * np.pi * np.arange(steps + 1) / steps
    phases = system.phases(angle)
    table = np.column_stack([system.table, 1j * system.frequency * system.table])
    travel = np.where(np.isinf(system.spring), system.free_travel, np.inf)
    load = (phases @ system.load).real if loads is None else loads(angle[:-1])[[*range(steps), 0]]
    return TimeGrid(
        step=system.period / steps, phase=np.column_stack([np.cos(angle), np.sin(angle)]),
        load=np.ascontiguousarray(load), table=np.ascontiguousarray((phases @ table).real),
        travel=travel,
    )  # fmt: skip


def start(system: LineSystem, begun: RestartState) -> Motion:
    """Return the motion at time zero."""
    size, r = len(system.mass), len(system.J)
    p, rate = begun.displacement / system.scale, begun.velocity / system.scale
    q = np.concatenate([p, begun.slip + system.floor @ p])
    v = np.concatenate([rate, begun.slip_velocity + system.floor @ rate])
    return Motion(
        q=q, v=v, half=np.zeros(size), force=np.zeros(r), elongation=np.zeros(system.friction_rows),
        active=np.zeros(r, np.int64), speed=np.zeros(r), begun=np.zeros(r), impulse=np.zeros(r), deepest=np.zeros(1),
        losses=np.zeros(6), counters=np.zeros(COUNTERS, np.int64),
        coordinates=np.zeros((6, size)), rows=np.zeros((8, r)), listed=np.zeros(r, np.int64),
    )  # fmt: skip
