"""Records of a run: the log of events, which response.evaluation names, and the section at the start of a period."""

from __future__ import annotations

from vanedamp.coupling.engine.line.gap_kinematics import rigid, spring_energy
from vanedamp.coupling.numerics.codes import ACTIVE, FLOW, IMPACTS, LOGGED, OPEN, PERIOD, SPRUNG, STICK
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.response.recorder import note_impact, put_response
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
    energy = 0.5 * before * before / system.delassus[r, r]
    _count(st.counters, rec.impacts, rec.collided, energy)
    if rec.struck.shape[1] > 0:
        note_impact(rec, st.counters[PERIOD], r, energy)
    log_event(system.period, st.counters, st.time, rec.log, IMPACT, r, before, after, impulse)


@kernel
def _count(counters, impacts, collided, energy):
    """Count an impact and the energy of its relative motion, J. A separate call: compiled in, it slows the loop."""
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


@inlined
def record_start(system, flows, st, rec, scratch):
    """Record section and energies at the start of a period."""
    n, b, y, springs = len(st.constant), system.bodies, scratch.coordinates, 0.0
    structure_state(flows, st, y)
    for r in range(len(st.state)):
        # a Jenkins element keeps its spring's energy while it slides
        if st.state[r] == SPRUNG or (r < system.friction_rows and not rigid(system, r) and system.limit[r] > 0.0):
            springs += spring_energy(system, st, r)
    p, rate, section, energies = y[:n], y[n:], rec.section[st.counters[PERIOD]], rec.parts[st.counters[PERIOD]]
    x, velocity, energy = _structure(system.response, system.stiffness, p, rate)
    energy, momentum = energy + springs, 0.0
    energies[0] = energy
    for k in range(b):
        speed, height = st.velocity[k] + _dot(system.floor[k], rate), st.displacement[k]
        if system.weight[n + k] != 0.0:
            height += _dot(system.floor[k], p)
        momentum += system.mass[n + k] * speed
        energies[1 + k] = 0.5 * system.mass[n + k] * speed * speed - system.weight[n + k] * height
        energy += energies[1 + k]
        section[3 + k], section[3 + b + k] = st.displacement[k], st.velocity[k]
    put_response(system, rec, st.counters[PERIOD], x, velocity, momentum, energy, st.ledger)


@summing
def _structure(response, stiffness, p, p_rate):
    """Return the response of the modes, its rate, and the energy of the structure."""
    x, rate, energy = 0.0, 0.0, 0.0
    for i in range(len(p)):
        x += response[i] * p[i]
        rate += response[i] * p_rate[i]
        energy += 0.5 * (p_rate[i] * p_rate[i] + stiffness[i] * p[i] * p[i])
    return x, rate, energy


@summing
def _dot(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@inlined
def structure_state(flows, st, y):
    """Set y to (p, p') at the segment's start."""
    s = st.counters[FLOW]
    _add_modes(flows.shape[s], flows.support[s], st.amplitude, st.constant, st.counters[ACTIVE], y)


@summing
def _add_modes(shape, support, amplitude, constant, count, y):
    n = len(constant)
    for i in range(n):
        y[i], y[n + i] = constant[i], 0.0
    for j in range(count):
        c = amplitude[j]
        for i in range(support[j, 0], support[j, 1]):
            y[i] += shape[j, i].real * c.real - shape[j, i].imag * c.imag
            y[n + i] += shape[j, n + i].real * c.real - shape[j, n + i].imag * c.imag
