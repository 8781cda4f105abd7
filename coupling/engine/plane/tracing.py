"""The course of a run of planar bodies (engine.trace)."""

from __future__ import annotations

from vanedamp.coupling.engine.trace import STRUCK
from vanedamp.coupling.numerics.codes import BOUNDED, LOGGED, ROOT
from vanedamp.coupling.numerics.compiler.jit import kernel
from vanedamp.coupling.response.records import IMPACT


@kernel
def note_segment(system, flows, st, watched, scratch, trace, i):
    """Write down the motion that begins as segment i."""
    for k in range(len(watched.status)):
        watched.status[k] = BOUNDED  # roots of other segments do not apply
    for k in range(len(st.q)):
        trace.q[i, k], trace.v[i, k] = st.q[k], st.v[k]
    for u in range(len(st.state)):
        trace.state[i, u] = st.state[u]
    for r in range(len(st.prestress)):
        trace.open_force[i, r] = st.prestress[r]
    trace.speed[i] = st.scale[0]


@kernel
def note_event(system, st, watched, rec, scratch, trace, e, ends):
    """Write down event e, which ends a segment, or stands before the first."""
    units = len(st.state)
    if ends:
        first = -1
        for k in range(len(watched.status)):
            sooner = first < 0 or watched.no_root_before[k] < watched.no_root_before[first]
            if watched.status[k] == ROOT and sooner:
                first = k
        trace.unit[e], trace.what[e] = watched.unit[first], watched.what[first]
        trace.duration[e - 1] = st.time[0] - trace.since[0]
    for entry in range(st.counters[LOGGED]):
        if rec.log[entry, 1] == IMPACT:
            h, u = trace.at[STRUCK], int(rec.log[entry, 2])
            trace.struck[h], trace.before[h], trace.after[h] = u, rec.log[entry, 3], rec.log[entry, 4]
            trace.impulse[e, u] += rec.log[entry, 5]
            trace.impulse[e, units + u] += rec.log[entry, 6]
            trace.at[STRUCK] += 1
    if system.two_phases and trace.at[STRUCK] > trace.first[e]:
        for r in range(2 * units):
            trace.compression[e, r] = scratch.compression[r]
