"""A run of the exact engine of sliders."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from vanedamp.coupling.engine.columns import Columns, system_in
from vanedamp.coupling.engine.known import IllConditioned
from vanedamp.coupling.engine.line.columns import columns
from vanedamp.coupling.engine.line.complex_modes import complex_modes
from vanedamp.coupling.engine.line.flow_assembly import new_assembly_scratch
from vanedamp.coupling.engine.line.scenes import run
from vanedamp.coupling.engine.line.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.engine.line.subsystem_assembly import empty_flows
from vanedamp.coupling.engine.line.subsystems import known_subsystems
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.numerics.codes import (
    ACTIVE,
    AT_LOW,
    BOUNDED,
    CARRIED,
    CLOSED,
    CLOSES,
    FLOW,
    HELD,
    PARTS,
    PERIOD,
    POSITION,
    ROOT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.numerics.tolerances import RESOLUTION
from vanedamp.coupling.response.event_log import rows_of_line
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Segment, SegmentEnd, no_event
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import place_sliders
from vanedamp.coupling.system.line_system import LineSystem, rows_of_units
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError


def is_common(system: LineSystem, modes: int) -> bool:
    """Whether this is the most common scene, with lengths compiled in.

    One mode, one body between two rigid walls, one harmonic.
    """
    single = system.modes == system.bodies == len(system.frequency) == 1
    return single and len(system.delassus) == modes == 3 and not len(system.outputs)


class EngineRun(EventDrivenRun):
    """A run of sliders. system: its rows; known: subsystems that runs with its structure have met."""

    rows_of: ClassVar = staticmethod(rows_of_line)
    compiled: ClassVar = staticmethod(run)
    is_common: ClassVar = staticmethod(is_common)
    rooms: ClassVar = (
        known_subsystems, empty_flows, new_assembly_scratch, new_state, new_event_functions, new_scratch
    )  # fmt: skip
    key: ClassVar = "active_set"

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._rows = rows_of_units(self.whole)

    def columns_of(
        self, scene: Scene, start: RestartState, values: Mapping[str, np.ndarray]
    ) -> tuple[Columns, Iterable[int]]:
        """Return the columns of scenes (EventDrivenRun)."""
        return columns(scene, self.whole, self.system, start, values), ()

    def whole_in(self, table: Columns, k: int) -> System:
        """Return the system of scene k."""
        system, line = system_in(self.whole, table, k, np.arange(self.whole.contacts)), self.system
        return system._replace(grip=table.limit[k, line.bodies : line.friction_rows])

    def reuse(self, earlier: EngineRun) -> None:
        """Take over the flows of an earlier run of the same system."""
        if self.whole is earlier.whole:
            self.flows = earlier.flows

    def check(self) -> None:
        """Raise InputError for a structure that is critically damped without any contact."""
        modes = self.system.of_structure
        if not self.known:
            try:
                complex_modes(np.sqrt(modes.stiffness), modes.damping)
            except IllConditioned as error:
                raise InputError(f"structure: {error}; change its damping slightly") from None

    def rows_of_trace(self) -> np.ndarray:
        """Return the rows of the units."""
        return self._rows

    def _segment(self) -> Segment:
        # roots of other segments do not apply
        self.watched.status[int(self.counters[CARRIED]) :] = BOUNDED
        system, line, rows, flows, st = self.whole, self.system, self._rows, self.flows, self.state
        s, active = int(st.counters[FLOW]), slice(int(st.counters[ACTIVE]))
        n, b, units, size = line.modes, line.bodies, len(rows), len(system.mass)
        amplitude, state = st.amplitude[active].copy(), st.state[rows]
        modal = flows.shape[s, active].T  # of (p, p')
        now = (modal @ amplitude).real
        still = (st.state[:b] == STICK) | (st.state[:b] == HELD)
        q, v, bend = np.zeros(size), np.zeros(size), np.zeros(size)
        shape, rate_shape = np.zeros((2, size, len(amplitude)), complex)
        q[:n], v[:n], shape[:n], rate_shape[:n] = st.constant + now[:n], now[n:], modal[:n], modal[n:]
        at = system.along
        q[at] = st.displacement[:b] + st.low_word[:b] + line.floor @ q[:n]
        v[at] = st.velocity[:b] + line.floor @ v[:n]
        bend[at] = np.where(still, 0.0, st.free_acceleration[:b])
        for target, own, on_floor in ((shape, flows.motion, modal[:n]), (rate_shape, flows.velocity, modal[n:])):
            target[at] = np.where(still[:, None], 0.0, own[s, :b, active]) + line.floor @ on_floor
        if len(system.tangential):  # a slider of a Jenkins element rests, or follows its driver
            jenkins = slice(units - len(system.tangential), units)
            place_sliders(system, q, st.displacement[rows[jenkins]])
            follows = np.where(state[jenkins] == SPRUNG, 0.0, 1.0)[:, None] * system.elongation[:, :n]
            for part in (v, shape, rate_shape):
                part[size - len(follows) :] = follows @ part[:n]
            state[jenkins] = np.where(state[jenkins] == SPRUNG, STICK, state[jenkins])
        own = st.state[rows]
        closed = (own == STICK) | (own == CLOSED) | (own == SPRUNG)
        on = np.arange(units)
        on[system.contacts :] += units
        force, open_force = np.zeros((2, 2 * units))
        force_shape = np.zeros((2 * units, len(amplitude)), complex)
        force[on] = np.where(closed, st.constant_force[rows], st.applied_force[rows])
        force_shape[on] = np.where(closed[:, None], flows.force[s, rows, active], 0.0)
        open_force[on] = np.where((own == HELD) | (own == TOUCHING), st.applied_force[rows], 0.0)
        drive, driver = np.zeros((2, len(amplitude)), complex)
        e = len(line.frequency)
        for h in range(e if flows.driven[s, e] > e else 0):
            driven = slice(flows.driven[s, h], flows.driven[s, h + 1])
            drive[driven], driver[driven] = flows.load[s, driven] * amplitude[h], flows.eigenvalue[s, h]
        return Segment(
            system=system, period=int(st.counters[PERIOD]), time=float(st.time[0]), state=state, q=q, v=v, bend=bend,
            speed=max(float(st.largest_speed[0]), float(np.abs(st.velocity).max(initial=0.0)), system.speed),
            rate=flows.eigenvalue[s, active].copy(), amplitude=amplitude, shape=shape, rate_shape=rate_shape,
            force=force, force_shape=force_shape, drive=drive, driver=driver, open_force=open_force,
        )  # fmt: skip

    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, SegmentEnd]:
        system, line, rows, st, watched = self.whole, self.system, self._rows, self.state, self.watched
        unit, event, elapsed, hits = -1, 0, 0.0, True
        if since is not START:
            roots = np.flatnonzero(watched.status == ROOT)
            k = int(roots[np.argmin(np.abs(watched.no_root_before[roots] - (st.time[0] - since.time)))])
            row, meaning = int(watched.row[k, watched.side[k]]), int(watched.meaning[k, watched.side[k]])
            elapsed = float(watched.no_root_before[k])
            elapsed = elapsed if elapsed > RESOLUTION * system.period else 0.0
            unit = int(np.flatnonzero(rows == row)[0])
            event = int(PARTS) if meaning == AT_LOW and row >= line.friction_rows else meaning
            hits = watched.order[k] == POSITION and meaning == CLOSES and np.isinf(line.spring[row])
        impulse = np.zeros(len(system.J))
        impulse[: system.contacts] = self.scratch.impulse[rows[: system.contacts]] * hits
        met = {int(entry[2]): float(entry[3]) for chunk in log for entry in chunk if entry[1] == IMPACT}
        struck = [r for r in range(system.contacts) if impulse[r] != 0.0 or (met and rows[r] in met)]
        return elapsed, no_event(system)._replace(
            unit=unit, what=event, impulse=impulse, struck=np.array(struck, int),
            before=np.array([met.get(int(rows[r]), 0.0) for r in struck]), after=st.velocity[rows[struck]],
            loss=float(st.ledger[IMPACT_LOSS]) - since.loss,
        )  # fmt: skip
