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
from vanedamp.coupling.numerics.jit import ZERO, kernel

#: forces and accelerations below this share of the terms that they are sums of are round-off
ROUND_OFF = 1e-12
#: a spring's force has the round-off of the travel that its compression is a small difference of: this share of it
TRAVEL = 1e-2


@kernel
def settle(rows, st, rec, work):
    """Decide the state of every row from displacements, velocities and st.coordinates; name the subsystem.

    work.forced marks rows whose force has just reached a bound. Returns False if the problem cannot be solved.
    """
    friction, k = rows.friction_rows, ZERO
    _halt(rows, st, work)
    for r in range(friction, len(st.state)):
        if rigid(rows, r):
            k = _stand_by(st, work, r, OPEN, st.displacement[r] == 0.0 and st.velocity[r] == 0.0, k)
        else:
            work.before[r] = SPRUNG
    for r in range(friction):
        if not rigid(rows, r):
            work.before[r], st.released[r], st.held[r] = st.state[r], 0, 0.0
            slide_or_hold(rows, st, work, r)
            continue
        k = _stand_by(st, work, r, COAST, rows.limit[r] > 0.0 and st.velocity[r] == 0.0, k)
        if rows.limit[r] > 0.0 and st.velocity[r] != 0.0:
            st.state[r] = SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
            st.held[r] = -st.state[r] * rows.limit[r]
    if not _decide(rows, st, rec, work, k):
        return False
    st.counters[CLOSED_ROWS] = 0
    for r in range(len(st.state)):
        st.key[r] = st.state[r] == SPRUNG or st.state[r] == (STICK if r < friction else CLOSED)
        st.counters[CLOSED_ROWS] += st.key[r]
    log_changes(rows, st, rec, work)
    st.counters[SEARCHING] = 1
    return True


@kernel
def stop_riders(rows, flows, st):
    """Bodies that ride on the structure do not slip: true to round-off after an impact, made exact here.

    Returns whether a slip was stopped: its friction is then open again.
    """
    s, stopped = st.counters[FLOW], False
    for r in range(rows.friction_rows):
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
def _halt(rows, st, work):
    """Bodies whose contacts touch without speed, to round-off, rest against each other exactly."""
    tiny = slowest(rows, st)
    for r in range(rows.friction_rows, len(st.state)):
        work.shut[r] = rigid(rows, r) and st.displacement[r] == 0.0 and abs(st.velocity[r]) <= tiny
        if work.shut[r] and not rows.rides[r]:
            st.velocity[r] = 0.0
    join_speeds(rows, st, work)
    measure_gaps(rows, st)


@kernel
def _stand_by(st, work, r, moving, rests, k):
    """Note the old state of row r, take it for moving, and list it if it may be at rest."""
    work.before[r] = st.state[r]
    st.released[r], st.held[r], st.state[r] = 0, 0.0, moving
    if rests:
        work.rows[k] = r
        k += 1
    return k


@kernel
def _decide(rows, st, rec, work, k):
    """Solve for the k listed rows at rest: which are closed, stick, slip or open."""
    friction, problem = rows.friction_rows, work.problem
    scale = _free_acceleration(rows, st, work)
    for p in range(k):
        r = work.rows[p]
        problem.b[p] = work.acceleration[r]
        problem.low[p], problem.high[p] = (-rows.limit[r], rows.limit[r]) if r < friction else (0.0, np.inf)
        problem.forced[p] = work.forced[r]
        for q in range(k):
            problem.matrix[p, q] = rows.delassus[r, work.rows[q]]
    if not solve_box(problem, k, scale):
        return False
    for p in range(k):
        work.verdict[p], work.reaction[p] = problem.state[p], problem.force[p]
        for r in range(len(st.state)):
            work.acceleration[r] += rows.delassus[r, work.rows[p]] * problem.force[p]
    members = _undecided(rows, work, k, ROUND_OFF * scale)
    if members > 0 and not _decide_by_rates(rows, st, work, k, members):
        return False
    for p in range(k):
        r, state = work.rows[p], work.verdict[p]
        if state == FREE:
            st.state[r] = STICK if r < friction else CLOSED
            continue
        st.held[r] = work.reaction[p]
        if state == DEPENDENT:
            st.state[r] = HELD if r < friction else TOUCHING
        elif r < friction:
            st.state[r] = SLIP_RIGHT if state == AT_LOW else SLIP_LEFT
    press(rows, st, rec, work, ROUND_OFF * scale)
    return True


@kernel
def _undecided(rows, work, k, tolerance):
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


@kernel
def _decide_by_rates(rows, st, work, k, members):
    """Complementarity of the rates: a force at its bound may come in, at rest, or stay there and let its row go."""
    problem = work.problem
    scale = _free_jerk(rows, st, work, k)
    for u in range(members):
        p = work.members[u]
        r, side = work.rows[p], work.side[p]
        problem.b[u] = work.jerk[r]
        problem.low[u] = 0.0 if side == AT_LOW else -np.inf
        problem.high[u] = 0.0 if side == AT_HIGH else np.inf
        problem.forced[u] = work.forced[r] if side != 0 else 0
        for v in range(members):
            problem.matrix[u, v] = rows.delassus[r, work.rows[work.members[v]]]
    if not solve_box(problem, members, scale):
        return False
    for u in range(members):
        p = work.members[u]
        work.verdict[p] = problem.state[u]
        if problem.state[u] == AT_LOW or problem.state[u] == AT_HIGH:
            r = work.rows[p]
            st.released[r] = problem.state[u]
            if r < rows.friction_rows:
                work.reaction[p] = -rows.limit[r] if problem.state[u] == AT_LOW else rows.limit[r]
            else:
                work.reaction[p] = 0.0
    return True


@kernel
def constant_loads(rows, st, work):
    """Constant loads on structure and bodies: weight, sliding friction, forces of rows that others hold."""
    n, b = len(st.constant), len(rows.mass)
    for i in range(n):
        work.on_structure[i] = 0.0
    for i in range(b):
        work.on_bodies[i] = rows.weight[i]
    for r in range(len(st.state)):
        if st.held[r] != 0.0:
            add_force(rows, work, r, st.held[r])


@kernel
def add_force(rows, work, r, force):
    """Add the force of row r (N) to the loads."""
    for i in range(len(work.on_structure)):
        work.on_structure[i] += rows.structure[r, i] * force
    for i in range(len(rows.mass)):
        work.on_bodies[i] += rows.bodies[r, i] * force


@kernel
def _free_acceleration(rows, st, work):
    """Acceleration of each row under the known forces, with no rigid row closed, at st.coordinates.

    Returns the size of the terms that the accelerations are sums of. Leaves the accelerations of the structure's modes
    in work.on_structure, the forces on the bodies in work.on_bodies.
    """
    n, b, largest = len(st.constant), len(rows.mass), 0.0
    constant_loads(rows, st, work)
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            add_force(rows, work, r, spring_force(rows, st, r))
    phase = st.amplitude[0]
    for i in range(n):
        p, speed = st.coordinates[i], st.coordinates[n + i]
        damper = _damping_force(rows, st.coordinates[n:], i)
        # sizes by amplitude: what passes through zero has the round-off of its peak
        work.jump[i] = (
            abs(work.on_structure[i]) + abs(rows.force[i]) + abs(damper)
            + rows.stiffness[i] * abs(p) + np.sqrt(rows.stiffness[i]) * abs(speed)
        )  # fmt: skip
        work.on_structure[i] += (rows.force[i] * phase).real - rows.stiffness[i] * p - damper
    for i in range(b):
        work.on_bodies[i] += (rows.inertia[i] * phase).real
    for r in range(len(st.state)):
        total, size = 0.0, 0.0
        for i in range(n):
            total += rows.structure[r, i] * work.on_structure[i]
            size += abs(rows.structure[r, i]) * work.jump[i]
        for i in range(b):
            total += rows.bodies[r, i] * work.on_bodies[i] / rows.mass[i]
            size += abs(rows.bodies[r, i]) * (abs(work.on_bodies[i]) + abs(rows.inertia[i])) / rows.mass[i]
        if r >= rows.friction_rows and st.state[r] == SPRUNG:
            size += TRAVEL * rows.spring[r] * rows.gap[r - rows.friction_rows] * rows.delassus[r, r]
        work.acceleration[r] = total
        largest = max(largest, size)
    return largest


@kernel
def _damping_force(rows, speed, i):
    if rows.proportional:
        return rows.damping[i, i] * speed[i]
    total = 0.0
    for k in range(len(rows.stiffness)):
        total += rows.damping[i, k] * speed[k]
    return total


@kernel
def _free_jerk(rows, st, work, k):
    """Rate of each row's acceleration with the forces of the k listed rows held as they are (after _free_acceleration).

    Returns the size of the terms that it is a sum of.
    """
    n, b, largest = len(st.constant), len(rows.mass), 0.0
    for p in range(k):
        add_force(rows, work, work.rows[p], work.reaction[p])
    turn = 1j * rows.omega * st.amplitude[0]
    for i in range(n):
        speed = st.coordinates[n + i]
        damper = _damping_force(rows, work.on_structure, i)
        work.jump[i] = (rows.force[i] * turn).real - rows.stiffness[i] * speed - damper
        work.sizes[i] = (
            rows.omega * abs(rows.force[i]) + abs(damper) + rows.stiffness[i] * abs(speed)
            + rows.stiffness[i] * np.sqrt(rows.stiffness[i]) * abs(st.coordinates[i])
        )  # fmt: skip
    for i in range(b):
        work.slips[i] = (rows.inertia[i] * turn).real
    for r in range(len(st.state)):
        if st.state[r] == SPRUNG:
            rate = -(rows.spring[r] * st.velocity[r] + rows.dashpot[r] * work.acceleration[r])
            for i in range(n):
                work.jump[i] += rows.structure[r, i] * rate
                work.sizes[i] += abs(rows.structure[r, i] * rate)
            for i in range(b):
                work.slips[i] += rows.bodies[r, i] * rate
    for r in range(len(st.state)):
        total, size = 0.0, 0.0
        for i in range(n):
            total += rows.structure[r, i] * work.jump[i]
            size += abs(rows.structure[r, i]) * work.sizes[i]
        for i in range(b):
            total += rows.bodies[r, i] * work.slips[i] / rows.mass[i]
            size += abs(rows.bodies[r, i]) * (abs(work.slips[i]) + rows.omega * abs(rows.inertia[i])) / rows.mass[i]
        work.jerk[r] = total
        largest = max(largest, size)
    return largest
