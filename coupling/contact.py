"""What happens at an event: impacts by Newton's law, and which rows then rest, stick, slip or open.

Impacts of several contacts at once are one complementarity problem on velocities, the states after every event one on
accelerations (Pfeiffer and Glocker 1996, chapters 5 and 8); friction is free of impulses.
"""

from __future__ import annotations

import numpy as np

from coupling.compiled import kernel
from coupling.complementarity import AT_LOW, DEPENDENT, FREE, solve_box
from coupling.state import (
    CLOSED,
    COAST,
    DETACHES,
    FLOW,
    HELD,
    IMPACT,
    IMPACT_LOSS,
    IMPACTS,
    LOGGED,
    OPEN,
    PERIOD,
    RESTS,
    SEARCHING,
    SLIP_LEFT,
    SLIP_RIGHT,
    SLIPS,
    STICK,
    STICKS,
    TOUCHING,
)

#: gaps closed to this share of the free travel are closed at the same instant
SIMULTANEOUS = 1e-12
#: impacts of one contact that follow each other within this share of a period are the end of an inelastic collapse:
#: bodies in a row can meet infinitely often in finite time (McNamara and Young 1992)
COLLAPSE = 1e-13


@kernel
def collide(rows, st, rec, work):
    """Newton's law at all touching contacts at once: v+ + k v- >= 0 and P >= 0 complement each other.

    Velocities of rows jump; the impulses are left in work.impulse (r,). An impact at the end of a chatter or of an
    inelastic collapse is plastic. Returns False if the problem cannot be solved.
    """
    friction, problem, r_count = rows.friction_rows, work.problem, len(st.state)
    k = _touching(rows, st, work)
    for p in range(k):
        r = work.rows[p]
        before = min(st.velocity[r], 0.0)
        restitution = rows.restitution[r - friction]
        collapsed = st.time[0] - st.last_impact[r] < COLLAPSE * rows.period
        if collapsed or -before * restitution < st.settling[r]:
            restitution = 0.0
        problem.restitution[p] = restitution
        # a contact that separates already may not be driven together: its law starts from zero
        problem.b[p] = st.velocity[r] + restitution * before
        problem.low[p], problem.high[p], problem.forced[p] = 0.0, np.inf, 0
        for q in range(k):
            problem.matrix[p, q] = rows.delassus[r, work.rows[q]]
    if not solve_box(problem, k, 0.0):
        return False
    for p in range(k):
        # kept before the jump, for the ledger and the log
        work.acceleration[p] = st.velocity[work.rows[p]]
    for r in range(r_count):
        work.impulse[r] = 0.0
        change, size = 0.0, 0.0
        for p in range(k):
            part = rows.delassus[r, work.rows[p]] * problem.force[p]
            change += part
            size += abs(part)
        if abs(change) > 1e-13 * size:
            st.velocity[r] += change
    for p in range(k):
        r, before, impulse = work.rows[p], work.acceleration[p], problem.force[p]
        work.impulse[r] = impulse
        st.displacement[r] = 0.0
        if impulse > 0.0 or problem.state[p] == DEPENDENT:
            st.velocity[r] = -problem.restitution[p] * min(before, 0.0)
        st.ledger[IMPACT_LOSS] -= 0.5 * impulse * (before + st.velocity[r])
        if before < 0.0:
            st.last_impact[r] = st.time[0]
            st.counters[IMPACTS] += 1
            rec.impacts[st.counters[PERIOD]] += 1
            _log(rows, st, rec, IMPACT, r, before, st.velocity[r], impulse)
    return True


@kernel
def _touching(rows, st, work):
    friction, count = rows.friction_rows, 0
    for r in range(friction, len(st.state)):
        near = st.displacement[r] <= SIMULTANEOUS * rows.gap[r - friction]
        if st.displacement[r] == 0.0 or (near and st.velocity[r] < 0.0):
            work.rows[count] = r
            count += 1
    return count


@kernel
def all_move(rows, st):
    """Whether no row is or was at rest and no slip has changed its direction: an impact between free flights."""
    for r in range(len(st.state)):
        state = st.state[r]
        if r >= rows.friction_rows:
            if state != OPEN or (st.displacement[r] == 0.0 and st.velocity[r] == 0.0):
                return False
        elif state != COAST and (state >= STICK or state * st.velocity[r] <= 0.0):
            return False
    return True


@kernel
def settle(rows, st, rec, work):
    """States of all rows from velocities and, where these vanish, from the complementarity problem on accelerations.

    st.coordinates holds the structure; work.forced: AT_LOW or AT_HIGH for a row whose force has just reached that
    bound and leaves it. Returns False if the problem cannot be solved.
    """
    friction, k = rows.friction_rows, 0
    _align(rows, st)
    for r in range(friction, len(st.state)):
        k = _stand_by(st, work, r, OPEN, st.displacement[r] == 0.0 and st.velocity[r] == 0.0, k)
    for r in range(friction):
        k = _stand_by(st, work, r, COAST, rows.limit[r] > 0.0 and st.velocity[r] == 0.0, k)
        if rows.limit[r] > 0.0 and st.velocity[r] != 0.0:
            st.state[r] = SLIP_RIGHT if st.velocity[r] > 0.0 else SLIP_LEFT
            st.held[r] = -st.state[r] * rows.limit[r]
    if k > 0 and not _decide(rows, st, work, k):
        return False
    st.key[0], st.key[1] = 0, 0
    for r in range(len(st.state)):
        if r < friction and st.state[r] == STICK:
            st.key[0] |= 1 << r
        elif r >= friction and st.state[r] == CLOSED:
            st.key[1] |= 1 << (r - friction)
    _log_changes(rows, st, rec, work)
    st.counters[SEARCHING] = 1
    return True


@kernel
def _align(rows, st):
    """Slips and gaps that are one motion, on walls and floors that move as one, are at rest together, exactly."""
    for r in range(rows.friction_rows, len(st.state)):
        if rows.wall_body[r] >= 0 and st.displacement[r] == 0.0 and st.velocity[r] == 0.0:
            st.velocity[rows.wall_body[r]] = 0.0
    for r in range(rows.friction_rows, len(st.state)):
        if rows.rides[r] and _bodies_rest(rows, st, r):
            st.velocity[r] = 0.0


@kernel
def _bodies_rest(rows, st, r):
    """Whether the bodies of a contact rest on their floor: friction rows of bodies have the bodies' numbers."""
    for b in range(len(rows.mass)):  # noqa: SIM110 (numba compiles no generator)
        if rows.bodies[r, b] != 0.0 and st.velocity[b] != 0.0:
            return False
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
def _stand_by(st, work, r, moving, rests, k):
    """Note the old state of row r, take it for moving, and list it if it may be at rest."""
    work.before[r] = st.state[r]
    st.released[r], st.held[r], st.state[r] = 0, 0.0, moving
    if rests:
        work.rows[k] = r
        k += 1
    return k


@kernel
def _decide(rows, st, work, k):
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
        r, state = work.rows[p], problem.state[p]
        st.released[r] = problem.forced[p]
        if state == FREE:
            st.state[r] = STICK if r < friction else CLOSED
            continue
        st.held[r] = problem.force[p]
        if state == DEPENDENT:
            st.state[r] = HELD if r < friction else TOUCHING
        elif r < friction:
            st.state[r] = SLIP_RIGHT if state == AT_LOW else SLIP_LEFT
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
            for i in range(n):
                work.on_structure[i] += rows.structure[r, i] * st.held[r]
            for i in range(b):
                work.on_bodies[i] += rows.bodies[r, i] * st.held[r]


@kernel
def _free_acceleration(rows, st, work):
    """Acceleration of each row under the known forces, with no row closed, at st.coordinates.

    Returns the size of the terms that the accelerations are sums of.
    """
    n, b, largest = len(st.constant), len(rows.mass), 0.0
    constant_loads(rows, st, work)
    phase = st.amplitude[0]
    for i in range(n):
        p, speed, damper = st.coordinates[i], st.coordinates[n + i], 0.0
        if rows.proportional:
            damper = rows.damping[i, i] * speed
        else:
            for k in range(n):
                damper += rows.damping[i, k] * st.coordinates[n + k]
        # sizes by amplitude: what passes through zero has the round-off of its peak
        work.jump[i] = (
            abs(work.on_structure[i]) + abs(rows.force[i]) + abs(damper)
            + rows.stiffness[i] * abs(p) + np.sqrt(rows.stiffness[i]) * abs(speed)
        )  # fmt: skip
        work.on_structure[i] += (rows.force[i] * phase).real - rows.stiffness[i] * p - damper
    for r in range(len(st.state)):
        total, size = 0.0, 0.0
        for i in range(n):
            total += rows.structure[r, i] * work.on_structure[i]
            size += abs(rows.structure[r, i]) * work.jump[i]
        for i in range(b):
            total += rows.bodies[r, i] * (work.on_bodies[i] + (rows.inertia[i] * phase).real) / rows.mass[i]
            size += abs(rows.bodies[r, i]) * (abs(work.on_bodies[i]) + abs(rows.inertia[i])) / rows.mass[i]
        work.acceleration[r] = total
        largest = max(largest, size)
    return largest


@kernel
def _log(rows, st, rec, kind, r, before, after, impulse):
    entry = rec.log[st.counters[LOGGED]]
    st.counters[LOGGED] += 1
    entry[0] = st.counters[PERIOD] * rows.period + st.time[0]
    entry[1], entry[2], entry[3], entry[4], entry[5] = kind, r, before, after, impulse


@kernel
def _log_changes(rows, st, rec, work):
    """Log what changed. A body that rests at a wall is at rest on the floor too, and only the wall is named."""
    for r in range(len(st.state)):
        was, now = work.before[r], st.state[r]
        if r < rows.friction_rows:
            if now >= STICK > was and not _at_wall(rows, st.state, r):
                _log(rows, st, rec, STICKS, r, 0.0, 0.0, 0.0)
            elif was >= STICK > now and not _at_wall(rows, work.before, r):
                _log(rows, st, rec, SLIPS, r, 0.0, st.velocity[r], 0.0)
        elif now != OPEN and was == OPEN:
            _log(rows, st, rec, RESTS, r, 0.0, 0.0, 0.0)
        elif now == OPEN and was != OPEN:
            _log(rows, st, rec, DETACHES, r, 0.0, st.velocity[r], 0.0)


@kernel
def _at_wall(rows, state, body):
    for r in range(rows.friction_rows, len(state)):  # noqa: SIM110 (numba compiles no generator)
        if rows.wall_body[r] == body and state[r] != OPEN:
            return True
    return False
