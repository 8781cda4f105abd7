"""Contact states after an event: which rows rest, stick, slip or open.

Forces and accelerations complement each other (Pfeiffer and Glocker, 1996, chapter 5). Where a force and its
acceleration vanish together, as when a contact lets go, their rates decide likewise.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.engine.line.compliant_contacts import close_pressed_contacts, slide_or_hold, spring_force
from vanedamp.coupling.engine.line.gap_kinematics import join_speeds, measure_gaps, rigid, slowest
from vanedamp.coupling.engine.line.recording import log_changes
from vanedamp.coupling.engine.line.tolerances import TRAVEL
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    CLOSED,
    CLOSED_ROWS,
    COAST,
    DEPENDENT,
    FLOW,
    FREE,
    HELD,
    OPEN,
    SEARCHING,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel, summing
from vanedamp.coupling.numerics.complementarity import solve_box
from vanedamp.coupling.numerics.tolerances import FORCE_ROUND_OFF


@inlined
def resolve_contact_states(system, st, rec, scratch):
    """Decide the state of every row from displacements, velocities and st.coordinates; name the subsystem.

    scratch.forced marks rows whose force has just reached a bound. Returns False if the problem cannot be solved.
    """
    friction, k = system.friction_rows, ZERO
    _snap_to_rest(system, st, scratch)
    for r in range(friction, len(st.state)):
        if rigid(system, r):
            k = _list_candidate(st, scratch, r, OPEN, st.displacement[r] == 0.0 and st.velocity[r] == 0.0, k)
        else:
            scratch.old_state[r] = SPRUNG
    for r in range(friction):
        if not rigid(system, r):
            scratch.old_state[r], st.released[r], st.applied_force[r] = st.state[r], 0, 0.0
            slide_or_hold(system, st, scratch, r)
            continue
        k = _list_candidate(st, scratch, r, COAST, system.limit[r] > 0.0 and st.velocity[r] == 0.0, k)
        if system.limit[r] > 0.0 and st.velocity[r] != 0.0:
            st.state[r] = SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
            st.applied_force[r] = -st.state[r] * system.limit[r]
    if not _decide(system, st, rec, scratch, k):
        return False
    st.counters[CLOSED_ROWS] = 0
    for r in range(len(st.state)):
        st.active_set[r] = st.state[r] == SPRUNG or st.state[r] == (STICK if r < friction else CLOSED)
        st.counters[CLOSED_ROWS] += st.active_set[r]
    log_changes(system, st, rec, scratch)
    st.counters[SEARCHING] = 1
    return True


@kernel
def stop_attached_bodies(system, flows, st):
    """Set the slip speed of bodies that move with the structure to zero, which it is to round-off after an impact.

    Returns whether a slip was stopped: its friction must then be decided again.
    """
    s, stopped = st.counters[FLOW], False
    for r in range(system.friction_rows):
        if (st.state[r] == SLIP_LEFT or st.state[r] == SLIP_RIGHT) and st.free_acceleration[r] == 0.0:
            j = ZERO
            while j < flows.modes[s] and flows.motion[s, r, j] == 0.0:
                j += 1
            if j == flows.modes[s]:
                st.velocity[r] = 0.0
                stopped = True
    return stopped


@kernel
def keep_released(st, scratch):
    """Keep rows released that open now, unless an impulse presses them shut."""
    for r in range(len(st.state)):
        scratch.forced[r] = st.released[r]


@kernel
def _snap_to_rest(system, st, scratch):
    """Set bodies in touch without speed, to round-off, exactly to rest against each other."""
    tiny = slowest(system, st)
    for r in range(system.friction_rows, len(st.state)):
        scratch.touching[r] = rigid(system, r) and st.displacement[r] == 0.0 and abs(st.velocity[r]) <= tiny
        if scratch.touching[r] and not system.moves_with_floor[r]:
            st.velocity[r] = 0.0
    join_speeds(system, st, scratch)
    measure_gaps(system, st)


@kernel
def _list_candidate(st, scratch, r, moving, rests, k):
    """Keep the old state of row r, set it to moving, and list it if it may be at rest. Return the list's length."""
    scratch.old_state[r] = st.state[r]
    st.released[r], st.applied_force[r], st.state[r] = 0, 0.0, moving
    if rests:
        scratch.listed[k] = r
        k += 1
    return k


@inlined
def _decide(system, st, rec, scratch, k):
    """Solve for the k listed rows at rest: which are closed, stick, slip or open."""
    friction, problem, rigid_only = system.friction_rows, scratch.problem, True
    for r in range(friction, len(st.state)):
        rigid_only = rigid_only and rigid(system, r)
    if k == 0 and rigid_only:
        return True
    scale = _free_accelerations(system, st, scratch)
    for p in range(k):
        r = scratch.listed[p]
        problem.b[p] = scratch.acceleration[r]
        problem.low[p], problem.high[p] = (-system.limit[r], system.limit[r]) if r < friction else (0.0, np.inf)
        problem.forced[p] = scratch.forced[r]
        for q in range(k):
            problem.matrix[p, q] = system.delassus[r, scratch.listed[q]]
    if not solve_box(problem, k, scale):
        return False
    for p in range(k):
        scratch.decision[p], scratch.reaction[p] = problem.state[p], problem.force[p]
        for r in range(len(st.state)):
            scratch.acceleration[r] += system.delassus[r, scratch.listed[p]] * problem.force[p]
    members = _list_undecided(system, scratch, k, FORCE_ROUND_OFF * scale)
    if members > 0 and not _decide_by_rates(system, st, scratch, k, members):
        return False
    for p in range(k):
        r, state = scratch.listed[p], scratch.decision[p]
        if state == FREE:
            st.state[r] = STICK if r < friction else CLOSED
            continue
        st.applied_force[r] = scratch.reaction[p]
        if state == DEPENDENT:
            st.state[r] = HELD if r < friction else TOUCHING
        elif r < friction:
            st.state[r] = SLIP_RIGHT if state == AT_LOW else SLIP_LEFT
    close_pressed_contacts(system, st, rec, scratch, FORCE_ROUND_OFF * scale)
    return True


@inlined
def _list_undecided(system, scratch, k, tolerance):
    """List the rows that rest. Return their number, or 0 if no force is at a bound without acceleration.

    scratch.bound: bound at which a row's force is, 0 if between its bounds.
    """
    problem, count, undecided = scratch.problem, ZERO, False
    for p in range(k):
        scratch.bound[p] = problem.forced[p]
        rests = problem.state[p] == FREE or problem.state[p] == DEPENDENT
        if rests:
            near = tolerance / problem.matrix[p, p]
            if problem.force[p] - problem.low[p] <= near:
                scratch.bound[p] = AT_LOW
            elif problem.high[p] - problem.force[p] <= near:
                scratch.bound[p] = AT_HIGH
        if rests or scratch.bound[p] != 0:
            scratch.members[count] = p
            count += 1
            undecided = undecided or scratch.bound[p] != 0
    return count if undecided else 0


@inlined
def _decide_by_rates(system, st, scratch, k, members):
    """Solve for the rates: a force at its bound may leave it, its row at rest, or stay there and release its row."""
    problem = scratch.problem
    scale = _free_jerks(system, st, scratch, k)
    for u in range(members):
        p = scratch.members[u]
        r, side = scratch.listed[p], scratch.bound[p]
        problem.b[u] = scratch.jerk[r]
        problem.low[u] = 0.0 if side == AT_LOW else -np.inf
        problem.high[u] = 0.0 if side == AT_HIGH else np.inf
        problem.forced[u] = scratch.forced[r] if side != 0 else 0
        for v in range(members):
            problem.matrix[u, v] = system.delassus[r, scratch.listed[scratch.members[v]]]
    if not solve_box(problem, members, scale):
        return False
    for u in range(members):
        p = scratch.members[u]
        scratch.decision[p] = problem.state[u]
        if problem.state[u] == AT_LOW or problem.state[u] == AT_HIGH:
            r = scratch.listed[p]
            st.released[r] = problem.state[u]
            if r < system.friction_rows:
                scratch.reaction[p] = -system.limit[r] if problem.state[u] == AT_LOW else system.limit[r]
            else:
                scratch.reaction[p] = 0.0
    return True


@inlined
def constant_loads(system, st, scratch):
    """Set the constant loads (scratch.loads): weight, sliding friction, forces of rows that others hold."""
    for i in range(len(scratch.loads)):
        scratch.loads[i] = system.weight[i]
    for r in range(len(st.state)):
        if st.applied_force[r] != 0.0:
            add_force(system, scratch, r, st.applied_force[r])


@kernel
def add_force(system, scratch, r, force):
    """Add the force of row r (N) to scratch.loads."""
    add_multiple(system.J[r], force, scratch.loads)


@summing
def add_multiple(row, factor, total):
    """Add the first numbers of a row, as many as `total` has, times a factor to it."""
    for i in range(len(total)):
        total[i] += row[i] * factor


@summing
def row_terms(row, values, sizes):
    """Return the sum of values by a row's factors, and its terms' sizes, by sizes of the values."""
    total, terms = 0.0, 0.0
    for i in range(len(values)):
        total += row[i] * values[i]
        terms += abs(row[i]) * abs(sizes[i])
    return total, terms


@inlined
def _free_accelerations(system, st, scratch):
    """Set the acceleration of each row under the known forces, with no rigid row closed, at st.coordinates.

    Returns the size of the terms that the accelerations are sums of. Leaves the accelerations of the coordinates in
    scratch.loads.
    """
    largest = 0.0
    constant_loads(system, st, scratch)
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            add_force(system, scratch, r, spring_force(system, st, r))
    _to_accelerations(system, st.coordinates, st.amplitude, scratch.loads, scratch.sizes)
    for r in range(len(st.state)):
        total, terms = row_terms(system.J[r], scratch.loads, scratch.sizes)
        if r >= system.friction_rows and st.state[r] == SPRUNG:
            terms += TRAVEL * system.spring[r] * system.play[r] * system.delassus[r, r]
        scratch.acceleration[r] = total
        largest = max(largest, terms)
    return largest


@summing
def _to_accelerations(system, y, phase, loads, sizes):
    """Make constant loads the accelerations of the coordinates at y = (p, p'). Set the sizes of their terms."""
    n, size = len(y) // 2, len(loads)
    for i in range(n):
        damper = _damping_force(system, y[n:], i)
        # sizes by amplitude: a term that passes through zero has the round-off of its peak
        sizes[i] = (
            abs(loads[i]) + abs(damper)
            + system.stiffness[i] * abs(y[i]) + math.sqrt(system.stiffness[i]) * abs(y[n + i])
        )  # fmt: skip
        loads[i] -= system.stiffness[i] * y[i] + damper
    for i in range(n, size):
        sizes[i] = abs(loads[i])
    for h in range(len(system.frequency)):
        c = phase[h]
        for i in range(size):
            load = system.load[h, i]
            loads[i] += load.real * c.real - load.imag * c.imag
            sizes[i] += math.sqrt(load.real * load.real + load.imag * load.imag)
    for i in range(n, size):
        sizes[i] /= system.mass[i]
        loads[i] /= system.mass[i]


@kernel
def _damping_force(system, speed, i):
    """Return the viscous force on mode i, or its rate from accelerations."""
    if system.proportional:
        return system.damping[i, i] * speed[i]
    total = 0.0
    for k in range(system.modes):
        total += system.damping[i, k] * speed[k]
    return total


@inlined
def _free_jerks(system, st, scratch, k):
    """Set the rate of each row's acceleration, the forces of the k listed rows constant (after _free_accelerations).

    Returns the size of the terms that it is a sum of.
    """
    n, size, largest = len(st.constant), len(scratch.loads), 0.0
    for p in range(k):
        add_force(system, scratch, scratch.listed[p], scratch.reaction[p])
    for i in range(size):
        scratch.rates[i], scratch.sizes[i] = 0.0, 0.0
    for h in range(len(system.frequency)):
        turn = 1j * system.frequency[h] * st.amplitude[h]
        for i in range(size):
            scratch.rates[i] += (system.load[h, i] * turn).real
            scratch.sizes[i] += system.frequency[h] * abs(system.load[h, i])
    for i in range(n):
        speed = st.coordinates[n + i]
        damper = _damping_force(system, scratch.loads, i)
        scratch.rates[i] -= system.stiffness[i] * speed + damper
        scratch.sizes[i] += (
            abs(damper) + system.stiffness[i] * abs(speed)
            + system.stiffness[i] * np.sqrt(system.stiffness[i]) * abs(st.coordinates[i])
        )  # fmt: skip
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            rate = -(system.spring[r] * st.velocity[r] + system.dashpot[r] * scratch.acceleration[r])
            for i in range(size):
                scratch.rates[i] += system.J[r, i] * rate
                scratch.sizes[i] += abs(system.J[r, i] * rate)
    for i in range(n, size):
        scratch.rates[i] /= system.mass[i]
        scratch.sizes[i] /= system.mass[i]
    for r in range(len(st.state)):
        scratch.jerk[r], terms = row_terms(system.J[r], scratch.rates, scratch.sizes)
        largest = max(largest, terms)
    return largest
