"""Segments and events of a run of sliders in the coordinates and units of its System (response.segment)."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.engine.line.event_functions import RESOLUTION
from vanedamp.coupling.engine.line.state import EventFunctions, Scratch, State
from vanedamp.coupling.engine.line.subsystem_assembly import Flows
from vanedamp.coupling.numerics.codes import (
    AT_LOW,
    AWAKE,
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
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS
from vanedamp.coupling.response.segment import START, Begun, Event, Segment, no_event
from vanedamp.coupling.system.assembly import place_sliders
from vanedamp.coupling.system.line_system import LineSystem
from vanedamp.coupling.system.system import System


def segment_of(system: System, line: LineSystem, rows: np.ndarray, flows: Flows, st: State) -> Segment:
    """Return the motion from a state on. rows: (u,) of the units (rows_of_units)."""
    s, awake = int(st.counters[FLOW]), slice(int(st.counters[AWAKE]))
    n, b, units, size = line.modes, line.bodies, len(rows), len(system.mass)
    amplitude, state = st.amplitude[awake].copy(), st.state[rows]
    modal = flows.shape[s, awake].T  # of (p, p')
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
        target[at] = np.where(still[:, None], 0.0, own[s, :b, awake]) + line.floor @ on_floor
    if len(system.tangential):  # a slider of a Jenkins element rests, or follows what draws it
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
    force_shape[on] = np.where(closed[:, None], flows.force[s, rows, awake], 0.0)
    open_force[on] = np.where((own == HELD) | (own == TOUCHING), st.applied_force[rows], 0.0)
    drive, driver = np.zeros((2, len(amplitude)), complex)
    e = len(line.frequency)
    for h in range(e if flows.driven[s, e] > e else 0):
        driven = slice(flows.driven[s, h], flows.driven[s, h + 1])
        drive[driven], driver[driven] = flows.load[s, driven] * amplitude[h], flows.eigenvalue[s, h]
    return Segment(
        system=system, period=int(st.counters[PERIOD]), time=float(st.time[0]), state=state, q=q, v=v, bend=bend,
        speed=max(float(st.largest_speed[0]), float(np.abs(st.velocity).max(initial=0.0)), system.speed),
        rate=flows.eigenvalue[s, awake].copy(), amplitude=amplitude, shape=shape, rate_shape=rate_shape, force=force,
        force_shape=force_shape, drive=drive, driver=driver, open_force=open_force,
    )  # fmt: skip


def event_of(
    system: System, line: LineSystem, rows: np.ndarray, st: State, watched: EventFunctions, work: Scratch,
    log: list[np.ndarray], since: Begun,
) -> tuple[float, Event]:  # fmt: skip
    """Return the last event and the time from the segment's begin to it. log: entries since then, in chunks."""
    unit, what, elapsed, hits = -1, 0, 0.0, True
    if since is not START:
        roots = np.flatnonzero(watched.status == ROOT)
        k = int(roots[np.argmin(np.abs(watched.no_root_before[roots] - (st.time[0] - since.time)))])
        row, meaning = int(watched.row[k, watched.side[k]]), int(watched.meaning[k, watched.side[k]])
        elapsed = float(watched.no_root_before[k])
        elapsed = elapsed if elapsed > RESOLUTION * system.period else 0.0
        unit = int(np.flatnonzero(rows == row)[0])
        what = int(PARTS) if meaning == AT_LOW and row >= line.friction_rows else meaning
        hits = watched.order[k] == POSITION and meaning == CLOSES and np.isinf(line.spring[row])
    impulse = np.zeros(len(system.J))
    impulse[: system.contacts] = work.impulse[rows[: system.contacts]] * hits
    met = {int(entry[2]): float(entry[3]) for chunk in log for entry in chunk if entry[1] == IMPACT}
    struck = [r for r in range(system.contacts) if impulse[r] != 0.0 or (met and rows[r] in met)]
    return elapsed, no_event(system)._replace(
        unit=unit, what=what, impulse=impulse, struck=np.array(struck, int),
        before=np.array([met.get(int(rows[r]), 0.0) for r in struck]), after=st.velocity[rows[struck]],
        loss=float(st.ledger[IMPACT_LOSS]) - since.loss,
    )  # fmt: skip
