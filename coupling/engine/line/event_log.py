"""The log of events as the compiled engine writes it; response.evaluation turns it into events by name."""

from __future__ import annotations

from vanedamp.coupling.numerics.codes import IMPACTS, LOGGED, OPEN, PERIOD, SPRUNG, STICK
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.response.records import DETACHES, IMPACT, RESTS, SLIPS, STICKS


@kernel
def log_event(period, counters, time, log, kind, r, before, after, impulse):
    """Add an entry: kind and row, relative velocities (m/s), impulse (N s)."""
    entry = log[counters[LOGGED]]
    counters[LOGGED] += 1
    entry[0] = counters[PERIOD] * period + time[0]
    entry[1], entry[2], entry[3], entry[4], entry[5] = kind, r, before, after, impulse


@inlined
def log_impact(system, st, rec, r, before, after, impulse):
    """Count an impact of row r and log it: relative velocities (m/s), impulse (N s)."""
    _count(st.counters, rec.impacts, rec.collided, 0.5 * before * before / system.delassus[r, r])
    log_event(system.period, st.counters, st.time, rec.log, IMPACT, r, before, after, impulse)


@kernel
def _count(counters, impacts, collided, energy):
    """Count an impact and the energy of its relative motion, J. A call of its own: compiled in, it slows the loop."""
    counters[IMPACTS] += 1
    impacts[counters[PERIOD]] += 1
    collided[counters[PERIOD]] += energy


@kernel
def log_changes(system, st, rec, scratch):
    """Log the changes of state. A body that rests at a wall is at rest on the floor too, and only the wall is named."""
    for r in range(len(st.state)):
        was, now = scratch.old_state[r], st.state[r]
        if r < system.friction_rows:
            if now >= STICK > was and not _at_wall(system, st.state, r):
                log_event(system.period, st.counters, st.time, rec.log, STICKS, r, 0.0, 0.0, 0.0)
            elif was >= STICK > now and not _at_wall(system, scratch.old_state, r):
                log_event(system.period, st.counters, st.time, rec.log, SLIPS, r, 0.0, st.velocity[r], 0.0)
        elif now == SPRUNG or was == SPRUNG:
            continue  # logged where a compliant contact begins and ends
        elif now != OPEN and was == OPEN:
            log_event(system.period, st.counters, st.time, rec.log, RESTS, r, 0.0, 0.0, 0.0)
        elif now == OPEN and was != OPEN:
            log_event(system.period, st.counters, st.time, rec.log, DETACHES, r, 0.0, st.velocity[r], 0.0)


@kernel
def _at_wall(system, state, body):
    """Whether a body rests at a wall that moves with its floor."""
    for r in range(system.friction_rows, len(state)):
        at_wall = (system.left_body[r] == body and system.right_body[r] < 0) or (
            system.right_body[r] == body and system.left_body[r] < 0
        )
        if at_wall and system.moves_with_floor[r] and state[r] != OPEN and state[r] != SPRUNG:
            return True
    return False
