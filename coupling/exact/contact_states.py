"""Which rows rest, stick, slip or open after an event: complementarity of forces and accelerations.

Pfeiffer and Glocker (1996), chapter 5. Where a force and its acceleration vanish together, as at the instant at which a
contact lets go, their rates decide in the same way.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.exact.compliant_contacts import press, slide_or_hold, spring_force
from vanedamp.coupling.exact.event_log import log_changes
from vanedamp.coupling.exact.gap_kinematics import join_speeds, measure_gaps, rigid, slowest
from vanedamp.coupling.exact.state import (
    CLOSED,
    CLOSED_ROWS,
    COAST,
    FLOW,
    HELD,
    OPEN,
    SEARCHING,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
)
from vanedamp.coupling.numerics.complementarity import AT_HIGH, AT_LOW, DEPENDENT, FREE, solve_box
from vanedamp.coupling.numerics.jit import ZERO, inlined, kernel

#: forces and accelerations below this share of the terms that they are sums of are round-off
ROUND_OFF = 1e-12
#: a spring's force has the round-off of the travel that its compression is a small difference of: this share of it
TRAVEL = 1e-2


@inlined
def settle(system, st, rec, work):
    """Decide the state of every row from displacements, velocities and st.coordinates; name the subsystem.

    work.forced marks rows whose force has just reached a bound. Returns False if the problem cannot be solved.
    """
    friction, k = system.friction_rows, ZERO
    _halt(system, st, work)
    for r in range(friction, len(st.state)):
        if rigid(system, r):
            k = _stand_by(st, work, r, OPEN, st.displacement[r] == 0.0 and st.velocity[r] == 0.0, k)
        else:
            work.before[r] = SPRUNG
    for r in range(friction):
        if not rigid(system, r):
            work.before[r], st.released[r], st.held[r] = st.state[r], 0, 0.0
            slide_or_hold(system, st, work, r)
            continue
        k = _stand_by(st, work, r, COAST, system.limit[r] > 0.0 and st.velocity[r] == 0.0, k)
        if system.limit[r] > 0.0 and st.velocity[r] != 0.0:
            st.state[r] = SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
            st.held[r] = -st.state[r] * system.limit[r]
    if not _decide(system, st, rec, work, k):
        return False
    st.counters[CLOSED_ROWS] = 0
    for r in range(len(st.state)):
        st.key[r] = st.state[r] == SPRUNG or st.state[r] == (STICK if r < friction else CLOSED)
        st.counters[CLOSED_ROWS] += st.key[r]
    log_changes(system, st, rec, work)
    st.counters[SEARCHING] = 1
    return True


@kernel
def stop_riders(system, flows, st):
    """Bodies that ride on the structure do not slip: true to round-off after an impact, made exact here.

    Returns whether a slip was stopped: its friction is then open again.
    """
    s, stopped = st.counters[FLOW], False
    for r in range(system.friction_rows):
        if (st.state[r] == SLIP_LEFT or st.state[r] == SLIP_RIGHT) and st.drift[r] == 0.0:
            still = True
            for j in range(flows.modes[s]):
                still = still and flows.motion[s, r, j] == 0.0
            if still:
                st.velocity[r] = 0.0
                stopped = True
    return stopped


@kernel
def keep_released(st, work):
    """Rows that let go at this instant are not caught again by what else happens in it, unless it pushes them."""
    for r in range(len(st.state)):
        work.forced[r] = st.released[r]


@kernel
def _halt(system, st, work):
    """Bodies whose contacts touch without speed, to round-off, rest against each other exactly."""
    tiny = slowest(system, st)
    for r in range(system.friction_rows, len(st.state)):
        work.shut[r] = rigid(system, r) and st.displacement[r] == 0.0 and abs(st.velocity[r]) <= tiny
        if work.shut[r] and not system.moves_with_floor[r]:
            st.velocity[r] = 0.0
    join_speeds(system, st, work)
    measure_gaps(system, st)


@kernel
def _stand_by(st, work, r, moving, rests, k):
    """Note the old state of row r, take it for moving, and list it if it may be at rest."""
    work.before[r] = st.state[r]
    st.released[r], st.held[r], st.state[r] = 0, 0.0, moving
    if rests:
        work.listed[k] = r
        k += 1
    return k


@inlined
def _decide(system, st, rec, work, k):
    """Solve for the k listed rows at rest: which are closed, stick, slip or open."""
    friction, problem = system.friction_rows, work.problem
    scale = _free_acceleration(system, st, work)
    for p in range(k):
        r = work.listed[p]
        problem.b[p] = work.acceleration[r]
        problem.low[p], problem.high[p] = (-system.limit[r], system.limit[r]) if r < friction else (0.0, np.inf)
        problem.forced[p] = work.forced[r]
        for q in range(k):
            problem.matrix[p, q] = system.delassus[r, work.listed[q]]
    if not solve_box(problem, k, scale):
        return False
    for p in range(k):
        work.verdict[p], work.reaction[p] = problem.state[p], problem.force[p]
        for r in range(len(st.state)):
            work.acceleration[r] += system.delassus[r, work.listed[p]] * problem.force[p]
    members = _undecided(system, work, k, ROUND_OFF * scale)
    if members > 0 and not _decide_by_rates(system, st, work, k, members):
        return False
    for p in range(k):
        r, state = work.listed[p], work.verdict[p]
        if state == FREE:
            st.state[r] = STICK if r < friction else CLOSED
            continue
        st.held[r] = work.reaction[p]
        if state == DEPENDENT:
            st.state[r] = HELD if r < friction else TOUCHING
        elif r < friction:
            st.state[r] = SLIP_RIGHT if state == AT_LOW else SLIP_LEFT
    press(system, st, rec, work, ROUND_OFF * scale)
    return True


@inlined
def _undecided(system, work, k, tolerance):
    """List the rows that rest; returns how many, or 0 if no force is at a bound without acceleration.

    work.side: bound at which a row's force is, 0 if between its bounds.
    """
    problem, count, undecided = work.problem, ZERO, False
    for p in range(k):
        work.side[p] = problem.forced[p]
        rests = problem.state[p] == FREE or problem.state[p] == DEPENDENT
        if rests:
            near = tolerance / problem.matrix[p, p]
            if problem.force[p] - problem.low[p] <= near:
                work.side[p] = AT_LOW
            elif problem.high[p] - problem.force[p] <= near:
                work.side[p] = AT_HIGH
        if rests or work.side[p] != 0:
            work.members[count] = p
            count += 1
            undecided = undecided or work.side[p] != 0
    return count if undecided else 0


@inlined
def _decide_by_rates(system, st, work, k, members):
    """Complementarity of the rates: a force at its bound may come in, at rest, or stay there and let its row go."""
    problem = work.problem
    scale = _free_jerk(system, st, work, k)
    for u in range(members):
        p = work.members[u]
        r, side = work.listed[p], work.side[p]
        problem.b[u] = work.jerk[r]
        problem.low[u] = 0.0 if side == AT_LOW else -np.inf
        problem.high[u] = 0.0 if side == AT_HIGH else np.inf
        problem.forced[u] = work.forced[r] if side != 0 else 0
        for v in range(members):
            problem.matrix[u, v] = system.delassus[r, work.listed[work.members[v]]]
    if not solve_box(problem, members, scale):
        return False
    for u in range(members):
        p = work.members[u]
        work.verdict[p] = problem.state[u]
        if problem.state[u] == AT_LOW or problem.state[u] == AT_HIGH:
            r = work.listed[p]
            st.released[r] = problem.state[u]
            if r < system.friction_rows:
                work.reaction[p] = -system.limit[r] if problem.state[u] == AT_LOW else system.limit[r]
            else:
                work.reaction[p] = 0.0
    return True


@inlined
def constant_loads(system, st, work):
    """Constant loads (work.loads): weight, sliding friction, forces of rows that others hold."""
    for i in range(len(work.loads)):
        work.loads[i] = system.weight[i]
    for r in range(len(st.state)):
        if st.held[r] != 0.0:
            add_force(system, work, r, st.held[r])


@kernel
def add_force(system, work, r, force):
    """Add the force of row r (N) to work.loads."""
    for i in range(len(work.loads)):
        work.loads[i] += system.J[r, i] * force


@inlined
def _free_acceleration(system, st, work):
    """Acceleration of each row under the known forces, with no rigid row closed, at st.coordinates.

    Returns the size of the terms that the accelerations are sums of. Leaves the accelerations of the coordinates in
    work.loads.
    """
    n, size, largest = len(st.constant), len(work.loads), 0.0
    constant_loads(system, st, work)
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            add_force(system, work, r, spring_force(system, st, r))
    for i in range(n):
        p, speed = st.coordinates[i], st.coordinates[n + i]
        damper = _damping_force(system, st.coordinates[n:], i)
        # sizes by amplitude: what passes through zero has the round-off of its peak
        work.sizes[i] = (
            abs(work.loads[i]) + abs(damper)
            + system.stiffness[i] * abs(p) + np.sqrt(system.stiffness[i]) * abs(speed)
        )  # fmt: skip
        work.loads[i] -= system.stiffness[i] * p + damper
    for i in range(n, size):
        work.sizes[i] = abs(work.loads[i])
    for h in range(len(system.frequency)):
        for i in range(size):
            work.loads[i] += (system.load[h, i] * st.amplitude[h]).real
            work.sizes[i] += abs(system.load[h, i])
    for i in range(n, size):
        work.sizes[i] /= system.mass[i]
        work.loads[i] /= system.mass[i]
    for r in range(len(st.state)):
        total, terms = 0.0, 0.0
        for i in range(size):
            total += system.J[r, i] * work.loads[i]
            terms += abs(system.J[r, i]) * work.sizes[i]
        if r >= system.friction_rows and st.state[r] == SPRUNG:
            terms += TRAVEL * system.spring[r] * system.free_travel[r] * system.delassus[r, r]
        work.acceleration[r] = total
        largest = max(largest, terms)
    return largest


@kernel
def _damping_force(system, speed, i):
    if system.proportional:
        return system.damping[i, i] * speed[i]
    total = 0.0
    for k in range(system.modes):
        total += system.damping[i, k] * speed[k]
    return total


@inlined
def _free_jerk(system, st, work, k):
    """Rate of each row's acceleration with the forces of the k listed rows held as they are (after _free_acceleration).

    Returns the size of the terms that it is a sum of.
    """
    n, size, largest = len(st.constant), len(work.loads), 0.0
    for p in range(k):
        add_force(system, work, work.listed[p], work.reaction[p])
    for i in range(size):
        work.rates[i], work.sizes[i] = 0.0, 0.0
    for h in range(len(system.frequency)):
        turn = 1j * system.frequency[h] * st.amplitude[h]
        for i in range(size):
            work.rates[i] += (system.load[h, i] * turn).real
            work.sizes[i] += system.frequency[h] * abs(system.load[h, i])
    for i in range(n):
        speed = st.coordinates[n + i]
        damper = _damping_force(system, work.loads, i)
        work.rates[i] -= system.stiffness[i] * speed + damper
        work.sizes[i] += (
            abs(damper) + system.stiffness[i] * abs(speed)
            + system.stiffness[i] * np.sqrt(system.stiffness[i]) * abs(st.coordinates[i])
        )  # fmt: skip
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            rate = -(system.spring[r] * st.velocity[r] + system.dashpot[r] * work.acceleration[r])
            for i in range(size):
                work.rates[i] += system.J[r, i] * rate
                work.sizes[i] += abs(system.J[r, i] * rate)
    for i in range(n, size):
        work.rates[i] /= system.mass[i]
        work.sizes[i] /= system.mass[i]
    for r in range(len(st.state)):
        total, terms = 0.0, 0.0
        for i in range(size):
            total += system.J[r, i] * work.rates[i]
            terms += abs(system.J[r, i]) * work.sizes[i]
        work.jerk[r] = total
        largest = max(largest, terms)
    return largest
