"""Impacts by Newton's law: several contacts at once are one complementarity problem on velocities, solved exactly.

Pfeiffer and Glocker (1996), chapter 8; friction is free of impulses.
"""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.engine.line.gap_kinematics import close_gaps, join_speeds, measure_gaps, rigid, slowest
from vanedamp.coupling.engine.line.recording import log_impact
from vanedamp.coupling.engine.line.tolerances import JUMP
from vanedamp.coupling.numerics.codes import AT_LOW, CLOSED, COAST, DEPENDENT, FREE, OPEN, SPRUNG, STICK
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.complementarity import solve_box
from vanedamp.coupling.numerics.tolerances import COLLAPSE, SIMULTANEOUS
from vanedamp.coupling.response.records import IMPACT_LOSS
from vanedamp.coupling.system.restitution import restitution_at


@inlined
def single_impact(system, st, rec, scratch, r):
    """Apply the ordinary impact: of row r only, all other contacts open, no end of a chatter.

    Returns False, with nothing changed, if it is not that: then `simultaneous_impacts` decides.
    """
    friction, speed = system.friction_rows, st.velocity[r]
    restitution = restitution_at(system, r, -speed)
    last = st.time[0] - st.last_impact[r] < COLLAPSE * system.period
    if not rigid(system, r) or not system.moves_with_floor[r] or last or -speed * restitution <= st.capture_speed[r]:
        return False
    if -speed <= slowest(system, st):
        return False
    for i in range(friction, len(st.state)):
        if st.state[i] != OPEN or (i != r and st.displacement[i] <= SIMULTANEOUS * system.play[i]):
            return False
    impulse = -(1.0 + restitution) * speed / system.delassus[r, r]
    for i in range(len(st.state)):
        scratch.impulse[i] = 0.0
        if i < friction or not system.moves_with_floor[i]:
            st.velocity[i] += system.delassus[i, r] * impulse
    # the contact obeys the law to the last bit
    left, right, half = system.left_body[r], system.right_body[r], system.rest[r]
    if left < 0:
        st.displacement[right], st.low_word[right], st.velocity[right] = -half, 0.0, -restitution * speed
    elif right < 0:
        st.displacement[left], st.low_word[left], st.velocity[left] = half, 0.0, restitution * speed
    else:
        st.displacement[right], st.low_word[right] = st.displacement[left], st.low_word[left]
        st.velocity[right] = st.velocity[left] - restitution * speed
    measure_gaps(system, st)
    scratch.impulse[r] = impulse
    st.ledger[IMPACT_LOSS] -= 0.5 * (1.0 - restitution) * impulse * speed
    _record_impact(system, st, rec, r, speed, -restitution * speed, impulse)
    return True


@inlined
def _record_impact(system, st, rec, r, before, after, impulse):
    """Log an impact and keep its time."""
    st.last_impact[r] = st.time[0]
    log_impact(system, st, rec, r, before, after, impulse)


@inlined
def simultaneous_impacts(system, st, rec, scratch):
    """Apply Newton's law at all touching rigid contacts at once: v+ + k v- >= 0 and P >= 0 complement each other.

    Velocities of rows jump; the impulses are left in scratch.impulse (r,). An impact at the end of a chatter or of an
    inelastic collapse is plastic. Contacts that would separate below their st.capture_speed end their chatter together
    (`_complete_chatter`), so that bodies that chatter on one structure do not set each other in motion for ever.
    Returns False if the problem cannot be solved.
    """
    problem = scratch.problem
    k = close_gaps(system, st, scratch)
    tiny = slowest(system, st)
    for p in range(k):
        r = scratch.listed[p]
        speed = st.velocity[r] if abs(st.velocity[r]) > tiny else 0.0
        # before the jump, for energies and log
        scratch.jerk[p], scratch.acceleration[p] = speed, min(speed, 0.0)
        restitution = restitution_at(system, r, -speed)
        collapsed = st.time[0] - st.last_impact[r] < COLLAPSE * system.period
        if collapsed or -speed * restitution < _flight_part(restitution) * st.capture_speed[r]:
            restitution = 0.0
        problem.restitution[p] = restitution
        # a contact that separates already may not be driven together: its law starts from zero
        problem.b[p] = speed + restitution * min(speed, 0.0)
        problem.low[p], problem.high[p], problem.forced[p] = 0.0, np.inf, 0
        for q in range(k):
            problem.matrix[p, q] = system.delassus[r, scratch.listed[q]]
        scratch.reaction[p] = 0.0
    if not solve_box(problem, k, 0.0):
        return False
    if _mark_slow_departures(system, st, scratch, k) and not _complete_chatter(system, st, scratch, k):
        return False
    _apply_impulses(system, st, scratch, k)
    for p in range(k):
        r, before, impulse = scratch.listed[p], scratch.acceleration[p], problem.force[p]
        after = st.velocity[r]
        if impulse != 0.0 or problem.state[p] == DEPENDENT:
            after = -problem.restitution[p] * before
        st.ledger[IMPACT_LOSS] -= 0.5 * impulse * (scratch.jerk[p] + after)
        if before < 0.0:
            _record_impact(system, st, rec, r, before, after, max(impulse, scratch.reaction[p]))
    return True


@inlined
def _flight_part(restitution):
    """Return the fraction of the rest of a chatter that its next flight takes.

    An elastic contact has no chatter, but the losses of other contacts may shorten its flights without end.
    """
    return max(1.0 - restitution, 0.1)


@kernel
def _mark_slow_departures(system, st, scratch, k):
    """Mark the contacts (scratch.bound) that rest or would separate too slowly. Return whether any would separate."""
    problem, marked = scratch.problem, False
    for p in range(k):
        r = scratch.listed[p]
        scratch.bound[p] = problem.restitution[p] == 0.0 or scratch.acceleration[p] == 0.0
        after = problem.acceleration[p] - problem.restitution[p] * scratch.acceleration[p]
        if problem.state[p] == AT_LOW and after < _flight_part(restitution_at(system, r, after)) * st.capture_speed[r]:
            scratch.bound[p], marked = True, True
    return marked


@kernel
def _complete_chatter(system, st, scratch, k):
    """End the chatter of the marked contacts together, by the impulses until it is over.

    A chatter that is over within CHATTER leaves its contacts closed without speed. Its impacts and the pressing forces
    in between have then handed over impulses that only push: those of one step of Moreau's scheme of that length
    (Moreau 1988), left in scratch.reaction. Contacts that keep an impulse in it are closed from now on; others leave.
    The impulse of the pressing forces in that time is still to come: the jump, which ties the contacts, leaves it out.
    Returns False if the problem cannot be solved.
    """
    problem = scratch.problem
    for p in range(k):
        problem.forced[p] = 0  # the solver's own mark
        if scratch.bound[p]:
            problem.restitution[p] = 0.0
            problem.b[p] = scratch.jerk[p] + _pressed_speed(system, st, scratch, p, k)
    if not solve_box(problem, k, 0.0):
        return False
    for p in range(k):
        problem.forced[p] = 0
        if scratch.bound[p]:
            problem.b[p] = scratch.jerk[p]
            if problem.state[p] == FREE:
                problem.low[p], scratch.reaction[p] = -np.inf, problem.force[p]
    return solve_box(problem, k, 0.0)


@kernel
def _pressed_speed(system, st, scratch, p, k):
    """Return the speed (m/s) that touching contact p gains within CHATTER if none of them carries a force."""
    r = scratch.listed[p]
    speed = 0.0 if st.state[r] == CLOSED else -2.0 * st.capture_speed[r]
    for q in range(k):
        other = scratch.listed[q]
        if st.state[other] == CLOSED:
            # the speed that its own force holds back
            speed -= 2.0 * st.capture_speed[other] * system.delassus[r, other] / system.delassus[other, other]
    return speed


@inlined
def _apply_impulses(system, st, scratch, k):
    """Apply the impulses to the velocities. Contacts obey the law, or are at rest, to the last bit."""
    friction, problem, speed = system.friction_rows, scratch.problem, st.velocity
    for r in range(len(st.state)):
        scratch.impulse[r], scratch.touching[r] = 0.0, False
    for p in range(k):
        scratch.impulse[scratch.listed[p]] = problem.force[p]
    for r in range(len(st.state)):
        if r >= friction and system.moves_with_floor[r]:
            continue
        change, size = 0.0, 0.0
        for p in range(k):
            term = system.delassus[r, scratch.listed[p]] * problem.force[p]
            change += term
            size += abs(term)
        if abs(change) > JUMP * size:
            speed[r] += change
    measure_gaps(system, st)
    tiny = slowest(system, st)
    for p in range(k):
        r = scratch.listed[p]
        if problem.force[p] != 0.0 or problem.state[p] == DEPENDENT:
            after = -problem.restitution[p] * scratch.acceleration[p]
            scratch.touching[r] = after == 0.0
            if not system.moves_with_floor[r]:
                speed[r] = after
            elif system.left_body[r] < 0:
                speed[system.right_body[r]] = after
            elif system.right_body[r] < 0:
                speed[system.left_body[r]] = -after
        else:
            # one that still approaches is below the solver's resolution
            scratch.touching[r] = speed[r] <= tiny
        if scratch.touching[r] and not system.moves_with_floor[r]:
            speed[r] = 0.0
    join_speeds(system, st, scratch)
    measure_gaps(system, st)


@inlined
def all_in_flight(system, st):
    """Whether no row is or was at rest and no slip has changed its direction: an impact between free flights."""
    for r in range(len(st.state)):
        state = st.state[r]
        if state == SPRUNG:
            continue  # a spring's force does not jump
        if r >= system.friction_rows:
            if state != OPEN or (st.displacement[r] == 0.0 and st.velocity[r] == 0.0):
                return False
        elif state != COAST and (state >= STICK or state * st.velocity[r] <= 0.0):
            return False
    return True
