"""Common to methods with time steps: the grid of a period with its loads, matrices, the motion, and the run.

Runs have the exact engine's system and records.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.codes import COUNTERS, DONE, IMPACTS, LOGGED, PERIOD, SOLVES, STEPS
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.plane import plane_of
from vanedamp.coupling.response.records import ENERGIES, IMPACT, LINE_WIDTH, WIDTH, Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import motion_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Loads, loads_of
from vanedamp.coupling.system.system import System, on_structure

#: imbalance of the energies above which a response is not to be used
_OPEN_LEDGER = 0.1
#: steps of all contacts after which compiled functions return to Python, which sees interrupts and empties the log
_SLICE = 100_000

#: marches with a log (k, WIDTH) until a number of steps, of impacts or a penetration relative to the free travel is
#: reached; returns a code of numerics.codes
March = Callable[[np.ndarray, int, int, float], int]


@record
class Sparse(NamedTuple):
    """A square matrix (N, N) without its zeros: up to k entries in each row, the others zeros in column 0."""

    column: np.ndarray  # (N, k) unsigned: no index from the end
    value: np.ndarray  # (N, k)


@record
class TimeGrid(NamedTuple):
    """The steps of an excitation period, and loads on N coordinates and u contacts in them."""

    step: float  # s
    phase: np.ndarray  # (steps + 1, 2) cos and sin of omega t within a period
    load: np.ndarray  # (steps + 1, N) of the excitation, N
    table: np.ndarray  # (steps + 1, 2) displacement and velocity of a base whose motion is the response
    travel: np.ndarray  # (u,) free travel of a rigid contact, m; inf: nothing to check
    stiffness: Sparse  # (N, N)
    damping: Sparse  # (N, N)


@record
class StepState(NamedTuple):
    """The state of a run, advanced in place. Sizes as in System."""

    # changes in every step
    q: np.ndarray  # (N,)
    v: np.ndarray  # (N,)
    half: np.ndarray  # (N,) velocity half a step later (central differences), or acceleration (Newmark)
    force: np.ndarray  # (2u,) of rows, N
    counters: np.ndarray  # (COUNTERS,) int
    ledger: np.ndarray  # (6,) J
    deepest: np.ndarray  # (1,) largest penetration relative to the free travel

    # constant
    spring: np.ndarray  # (u,) stiffness of contacts, N/m; 0: rigid
    live: np.ndarray  # int: rows that may carry a force

    # changes with the contacts
    active: np.ndarray  # (u,) int: contacts that carry force
    speed: np.ndarray  # (u,) at the beginning of the present contact, m/s
    begun: np.ndarray  # (u,) time of that, s
    total: np.ndarray  # (2u,) impulse since then, N s
    lost: np.ndarray  # (u,) energy that it took since then, J

    # of a step
    start: np.ndarray  # (2, N) coordinates and velocities as it begins
    response: np.ndarray  # (2,) displacement and velocity of the response then
    before: np.ndarray  # (2u,) speeds of the rows then
    gap: np.ndarray  # (2, u) gaps of the contacts as it ends, and as it began, m
    impulse: np.ndarray  # (2u,) of the rows
    slowest: np.ndarray  # (1,) speed below which a contact counts as at rest, m/s

    # scratch, named where each method takes it
    coordinates: np.ndarray  # (5, N)
    rows: np.ndarray  # (4, 2u)


def sparse(matrix: np.ndarray) -> Sparse:
    """Return a square matrix without its zeros."""
    most = int((matrix != 0.0).sum(axis=1).max(initial=0))
    column, value = np.zeros((len(matrix), most), np.uint64), np.zeros((len(matrix), most))
    for i, row in enumerate(matrix):
        nonzero = np.flatnonzero(row)
        column[i, : len(nonzero)], value[i, : len(nonzero)] = nonzero, row[nonzero]
    return Sparse(column, value)


def time_grid(scene: Scene, system: System, steps: int) -> TimeGrid:
    """Return the grid of `steps` steps per period."""
    angle = 2 * np.pi * np.arange(steps + 1) / steps
    table = np.column_stack([system.table, 1j * system.frequency * system.table])
    load = loads_at(scene, system)(angle[:-1])
    return TimeGrid(
        step=system.period / steps, phase=np.column_stack([np.cos(angle), np.sin(angle)]),
        load=np.vstack([load, load[:1]]), table=np.ascontiguousarray((system.phases(angle) @ table).real),
        travel=np.where(np.isinf(system.spring), system.play, np.inf),
        stiffness=sparse(system.stiffness), damping=sparse(system.damping),
    )  # fmt: skip


def loads_at(scene: Scene, system: System) -> Loads:
    """Return the loads (k, N) of the excitation at angles omega t (k,), sum of sines or not."""
    signal = scene.excitation.signal
    return loads_of(scene, signal) if signal else lambda angle: (system.phases(angle) @ system.load).real


def start(system: System, begun: RestartState, spring: np.ndarray, records: Records) -> tuple[System, StepState]:
    """Return the system whose slips are those of the drivers of sliders, and its motion at time zero.

    spring: (u,) as in StepState.
    """
    initial = motion_of(system, begun)
    u, size = len(system.rest), len(system.mass)
    contact = np.arange(u) < system.contacts
    return on_structure(system), StepState(
        q=initial.q.copy(), v=initial.v.copy(), half=np.zeros(size), force=np.zeros(2 * u),
        counters=np.zeros(COUNTERS, np.int64),
        ledger=np.zeros(len(ENERGIES)), deepest=np.zeros(1),
        spring=spring,
        live=np.flatnonzero(np.r_[contact, ~contact | (system.friction > 0.0)]), active=np.zeros(u, np.int64),
        speed=np.zeros(u), begun=np.zeros(u), total=np.zeros(2 * u), lost=np.zeros(u), start=np.zeros((2, size)),
        response=np.zeros(2), before=np.zeros(2 * u), gap=np.zeros((2, u)), impulse=np.zeros(2 * u),
        slowest=np.zeros(1), coordinates=np.zeros((5, size)), rows=np.zeros((4, 2 * u)),
    )  # fmt: skip


class SteppedRun:
    """A run of a stepping method, which marches a motion by its steps per period and fills the records."""

    def __init__(
        self, system: System, march: March, motion: StepState, records: Records, events: bool, options: Any
    ) -> None:
        self.system, self.march, self.motion, self.records, self.options = system, march, motion, records, options
        self.plane = plane_of(system, records, options.linearisation) if system.in_plane else None
        # a contact logs at most one impact per step
        self.slice = max(_SLICE // max(system.contacts, 1), 1)
        self.log = np.zeros((_SLICE if events else 0, WIDTH))
        self.chunks: list[np.ndarray] = []

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        counters = self.motion.counters
        while counters[PERIOD] < periods:
            until = min(periods * self.options.smallest_steps, int(counters[STEPS]) + self.slice)
            code = self.march(self.log, until, self.options.max_events, self.options.penetration)
            self.chunks.append(self.log[: counters[LOGGED], : WIDTH if self.plane else LINE_WIDTH].copy())
            counters[LOGGED] = 0
            if code != DONE:
                return STATUS_OF[code]
        return Status.OK

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.motion.counters
        numbers = {
            "impacts": int(counters[IMPACTS]), "steps": int(counters[STEPS]), "solves": int(counters[SOLVES])
        }  # fmt: skip
        return Outcome(
            self.system, self.records, int(counters[PERIOD]), numbers["impacts"], _OPEN_LEDGER, numbers,
            [chunk for chunk in (*self.chunks, self._lasting()) if len(chunk)], rows_of_units(self.system),
            float(self.motion.deepest[0]), self.plane,
        )  # fmt: skip

    def _lasting(self) -> np.ndarray:
        """Return the entries of impacts in contacts that still carry force."""
        m, u = self.motion, len(self.system.rest)
        lasting = np.flatnonzero((m.active == 1) & (m.speed < 0.0)) if len(self.log) else np.zeros(0, int)
        now, total = self.system.J[:u] @ m.v, np.split(m.total, 2)
        rows = np.column_stack([m.begun, np.full(u, IMPACT), np.arange(u), m.speed, now, *total, m.lost])[lasting]
        return rows[:, : WIDTH if self.plane else LINE_WIDTH]

    def final(self) -> None:
        """Return None: the state between two steps is no state that another run could begin with."""
