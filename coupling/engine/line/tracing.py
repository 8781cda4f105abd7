"""The course of a run of sliders (engine.trace), in the coordinates of its System."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.line.recording import structure_state
from vanedamp.coupling.engine.trace import STRUCK
from vanedamp.coupling.numerics.codes import (
    AT_LOW,
    BOUNDED,
    CARRIED,
    CLOSES,
    HELD,
    LOGGED,
    PARTS,
    POSITION,
    ROOT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.numerics.compiler.jit import kernel
from vanedamp.coupling.numerics.tolerances import RESOLUTION
from vanedamp.coupling.response.records import IMPACT


@kernel
def note_segment(system, flows, st, watched, scratch, trace, i):
    """Write down the motion that begins as segment i."""
    for k in range(st.counters[CARRIED], len(watched.status)):
        watched.status[k] = BOUNDED  # roots of other segments do not apply
    n, b, y = system.modes, system.bodies, scratch.coordinates
    units, sliders = len(trace.rows), trace.q.shape[1] - n - b
    structure_state(flows, st, y)
    q, v = trace.q[i], trace.v[i]
    for k in range(n):
        q[k], v[k] = y[k], y[n + k]
    for k in range(b):
        q[n + k], v[n + k] = st.displacement[k] + st.low_word[k], st.velocity[k]
        for j in range(n):
            q[n + k] += system.floor[k, j] * y[j]
            v[n + k] += system.floor[k, j] * y[n + j]
    trace.open_force[i, :] = 0.0
    for u in range(units):
        r = trace.rows[u]
        state, contact = st.state[r], r >= system.friction_rows
        trace.state[i, u] = state
        if state == HELD or state == TOUCHING:
            trace.open_force[i, u if contact else units + u] = st.applied_force[r]
        if u >= units - sliders:  # a slider of a Jenkins element rests, or follows its driver
            at = n + b + u - (units - sliders)
            q[at], v[at] = -st.displacement[r], 0.0
            for j in range(n):
                q[at] += system.J[r, j] * y[j]
                if state != SPRUNG:
                    v[at] += system.J[r, j] * y[n + j]
            if state == SPRUNG:
                trace.state[i, u] = STICK
    trace.speed[i] = max(st.largest_speed[0], trace.fastest[0])
    for r in range(len(st.velocity)):
        trace.speed[i] = max(trace.speed[i], abs(st.velocity[r]))


@kernel
def note_event(system, st, watched, rec, scratch, trace, e, ends):
    """Write down event e, which ends a segment, or stands before the first."""
    hits, units = False, len(trace.rows)
    contacts = len(st.state) - system.friction_rows
    for entry in range(st.counters[LOGGED]):
        hits = hits or (rec.log[entry, 1] == IMPACT and system.spring[int(rec.log[entry, 2])] == math.inf)
    if ends:
        k, nearest = -1, math.inf
        for j in range(len(watched.status)):
            away = abs(watched.no_root_before[j] - (st.time[0] - trace.since[0]))
            if watched.status[j] == ROOT and (k < 0 or away < nearest):
                k, nearest = j, away
        side = watched.side[k]
        row, meaning, elapsed = watched.row[k, side], watched.meaning[k, side], watched.no_root_before[k]
        trace.duration[e - 1] = elapsed if elapsed > RESOLUTION * system.period else 0.0
        for u in range(units):
            if trace.rows[u] == row:
                trace.unit[e] = u
                break
        trace.what[e] = PARTS if meaning == AT_LOW and row >= system.friction_rows else meaning
        hits = watched.order[k] == POSITION and meaning == CLOSES and system.spring[row] == math.inf
    for u in range(contacts):
        r, met, speed = trace.rows[u], False, 0.0
        for entry in range(st.counters[LOGGED]):
            if rec.log[entry, 1] == IMPACT and int(rec.log[entry, 2]) == r:
                met, speed = True, rec.log[entry, 3]
        trace.impulse[e, u] = scratch.impulse[r] if hits else 0.0
        if trace.impulse[e, u] != 0.0 or met:
            h = trace.at[STRUCK]
            trace.struck[h], trace.before[h], trace.after[h] = u, speed, st.velocity[r]
            trace.at[STRUCK] += 1
