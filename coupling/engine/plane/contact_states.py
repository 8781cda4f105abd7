"""Which closed contacts carry a force, stick, slip or separate: Coulomb's law and complementarity on accelerations.

Cases that are degenerate at the instant, as a force that has just vanished, are decided by the same problem
(friction_problem) a moment later.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.plane.friction_problem import solve_rows
from vanedamp.coupling.engine.plane.tolerances import AT_REST, DOUBTFUL, DOUBTFUL_LATER, NEAR_BOUND, NEAR_BOUND_TERMS
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, SLIP_LEFT, SLIP_RIGHT, STICK, TOUCHING
from vanedamp.coupling.numerics.compiler.jit import ZERO, entry, inlined, kernel
from vanedamp.coupling.numerics.tolerances import CHATTER, DEPENDENCE, SIMULTANEOUS
from vanedamp.coupling.system.unit_kinematics import (
    elongation,
    gap,
    has_friction,
    is_closed,
    is_compliant,
    is_rigid,
    is_slip,
    least_force,
    row_speed,
    slider_bound,
    slider_speed,
    spring_force,
)

#: shrink the look-ahead by this at each revised decision
_SOONER = 0.1
_NORMAL, _SLIP = 1, 2
#: states of a compliant contact that touches without speed
_TOUCHES, _PRESSES, _OPENS = 1, 2, 3


@kernel
def free_acceleration(system, scratch, q, v, time):
    """Accelerations (scratch.free) without contact forces, friction elements included, at a time within the period.

    scratch.terms: sizes of the terms that they are sums of.
    """
    size = len(q)
    for i in range(size):
        scratch.free[i], scratch.terms[i] = system.weight[i], abs(system.weight[i])
    for h in range(len(system.frequency)):
        angle = system.frequency[h] * time
        phase = complex(math.cos(angle), math.sin(angle))
        for i in range(size):
            load = system.load[h, i]
            scratch.free[i] += (load * phase).real
            scratch.terms[i] += abs(load.real) + abs(load.imag)
    for i in range(size):
        total, terms = scratch.free[i], scratch.terms[i]
        for k in range(size):
            spring, dashpot = system.stiffness[i, k] * q[k], system.damping[i, k] * v[k]
            total -= spring + dashpot
            terms += abs(spring) + abs(dashpot)
        scratch.free[i], scratch.terms[i] = total / system.mass[i], terms / system.mass[i]
    for j in range(len(system.tangential)):
        force = system.tangential[j] * elongation(system, j, q)
        for i in range(size - len(system.tangential)):
            term = system.elongation[j, i] * force / system.mass[i]
            scratch.free[i] -= term
            scratch.terms[i] += abs(term)


@kernel
def move_sliders(system, state, q, v):
    """Bring sliders to their positions: at rest, or behind their drivers by their springs."""
    for r in range(len(system.rest)):
        j = system.slider[r]
        if j < 0:
            continue
        a = len(q) - len(system.tangential) + j
        v[a] = 0.0
        if state[r] != STICK:
            q[a] += elongation(system, j, q)
            if is_slip(state[r]):
                q[a] -= state[r] * slider_bound(system, r, q) / system.tangential[j]
            v[a] = slider_speed(system, r, state[r], v)


@kernel
def _hold_slider(system, st, scratch, r, slow):
    """Decide whether a unit's slider rests, or moves: its spring is at its bound.

    One whose spring is at its bound while its driver is at rest is marked: its acceleration decides. A slider that
    has moved until now is at its bound. Without a bound, as a contact begins to press, it goes as its driver does.
    """
    if not has_friction(system, r):
        st.state[r] = SLIP_RIGHT
        return
    j, stretched, terms = system.slider[r], 0.0, 0.0
    for i in range(len(st.q)):
        term = system.elongation[j, i] * st.q[i]
        stretched += term
        terms += abs(term)
    most = slider_bound(system, r, st.q) / system.tangential[j]
    if r < system.contacts:
        room = abs(system.rest[r])
        for i in range(len(st.q)):
            room += abs(system.J[r, i] * st.q[i])
        terms += system.friction[r] * system.spring[r] / system.tangential[j] * room
    at_bound = abs(stretched) >= most - NEAR_BOUND * most - NEAR_BOUND_TERMS * terms
    way = SLIP_RIGHT if stretched > 0.0 else SLIP_LEFT
    if most <= NEAR_BOUND_TERMS * terms:
        way = SLIP_RIGHT if slider_speed(system, r, STICK, st.v) > 0.0 else SLIP_LEFT
    elif is_slip(st.state[r]):
        at_bound, way = True, st.state[r]
    st.state[r], scratch.at_bound[r] = STICK, 0
    if at_bound:
        speed = way * slider_speed(system, r, way, st.v)
        if speed >= -slow:
            st.state[r], scratch.at_bound[r] = way, 1 if speed <= slow else 0


@kernel
def _draw_sliders(system, st, scratch, nothing):
    """Decide by accelerations whether drivers at rest draw their sliders on. Returns how many stay in doubt, drawn."""
    u, doubts, total = len(system.rest), 0, scratch.drawn
    for r in range(u):
        if scratch.at_bound[r] == 0:
            continue
        j, mobility = system.slider[r], 0.0
        for i in range(len(st.q) - len(system.tangential)):
            total[i] = scratch.free[i]
            for row in range(2 * u):
                total[i] += system.J[row, i] * scratch.impulse[row] / system.mass[i]
            mobility += system.elongation[j, i] * system.elongation[j, i] / system.mass[i]
        if scratch.bound[r] <= 0.0:
            st.state[r] = SLIP_RIGHT if slider_speed(system, r, STICK, total) > 0.0 else SLIP_LEFT
        acceleration = st.state[r] * slider_speed(system, r, st.state[r], total)
        if abs(acceleration) <= nothing * math.sqrt(mobility):
            doubts += 1
        else:
            scratch.at_bound[r] = 0
            st.state[r] = STICK if acceleration < 0.0 else st.state[r]
    return doubts


@kernel
def _solve_states(system, st, scratch, count, terms, nothing):
    """Decide the states of the listed units (scratch.verdict) by accelerations (scratch.speed). False if none exist.

    Lemke's method need not find forces of contacts that slip. Over a short step in which they might stop it does: the
    slips become parts of the accelerations that remain to be stopped. Its forces are those of the instant if no
    contact that presses stops; if one does, none are found, and the slip ends by impulses (impacts.stop_wedged).
    """
    u = len(system.rest)
    if solve_rows(system, scratch, count, scratch.speed, terms, scratch.bound):
        _classify(system, scratch, count, nothing)
        return True
    moment, possible = CHATTER * system.period, True
    for p in range(count):
        scratch.slips[p] = scratch.way[p]
        if scratch.way[p] != 0:
            scratch.speed[u + scratch.listed[p]] += row_speed(system, u + scratch.listed[p], st.v) / moment
            scratch.way[p] = 0
    if not solve_rows(system, scratch, count, scratch.speed, terms, scratch.bound):
        return False
    _classify(system, scratch, count, nothing)
    for p in range(count):
        if scratch.slips[p] != 0:
            possible = possible and (scratch.verdict[p] == scratch.slips[p] or scratch.verdict[p] >= OPEN)
            scratch.way[p] = scratch.slips[p]
    return possible


@kernel
def _classify(system, scratch, count, nothing):
    """States (scratch.verdict) of the listed units from the solution, and doubtful ones (scratch.doubtful)."""
    problem = scratch.lemke
    for p in range(count):
        r, i = scratch.listed[p], scratch.place[p]
        scratch.doubtful[p] = 0
        contact = is_rigid(system, r)
        if contact and problem.z[i] <= nothing:
            scratch.verdict[p] = OPEN if problem.w[i] > nothing else TOUCHING
            scratch.doubtful[p] = _NORMAL if problem.w[i] <= nothing else 0
        elif scratch.way[p] != 0:
            scratch.verdict[p] = scratch.way[p]
        elif contact and system.friction[r] == 0.0:
            scratch.verdict[p] = SLIP_RIGHT
        else:
            first = i + 1 if contact else i
            # a spring without force has no friction: both bounds are one; the acceleration decides
            left = problem.w[first + 1] <= nothing and problem.z[first + 1] > nothing
            if problem.z[first] <= nothing and not left:
                scratch.verdict[p] = SLIP_RIGHT
                scratch.doubtful[p] = _SLIP if problem.w[first] <= nothing else 0
            elif problem.w[first + 1] <= nothing:
                scratch.verdict[p] = SLIP_LEFT
                scratch.doubtful[p] = _SLIP if problem.z[first + 1] <= nothing else 0
            else:
                scratch.verdict[p] = STICK


@entry
def decide(system, st, scratch, scale):
    """Decide the state of every unit at st.q, st.v. Returns False if the problem cannot be solved.

    scale: the speeds in the scene, m/s, whose round-off counts as rest.
    """
    count, decided, slow = ZERO, True, AT_REST * scale
    for r in range(len(system.rest)):
        if _is_undecided(system, st, scratch, r, slow):
            scratch.listed[count], scratch.way[count] = (
                r,
                direction(system, st, r, slow) if has_friction(system, r) else 0,
            )
            count += 1
        decided = decided and count == 0 and scratch.resting[r] == 0 and scratch.at_bound[r] == 0
    if len(system.tangential) > 0:
        move_sliders(system, st.state, st.q, st.v)
    if decided:  # gaps and speeds have decided all
        for row in range(len(scratch.impulse)):
            scratch.impulse[row] = 0.0
        _take_decisions(system, st, scratch, count, False)
        return True
    terms = loaded_acceleration(system, st, scratch, st.q, st.v, st.time[0])
    if not _solve_states(system, st, scratch, count, terms, DOUBTFUL):
        return False
    doubts = _close_or_open(system, scratch, count, DOUBTFUL * terms)
    if len(system.tangential) > 0:
        doubts += _draw_sliders(system, st, scratch, DOUBTFUL * terms)
    for p in range(count):
        doubts += scratch.doubtful[p]
    if doubts > 0:
        if not _decide_later(system, st, scratch, count):
            return False
        _stick_in_doubt(system, scratch, count)
    if len(system.tangential) > 0:
        move_sliders(system, st.state, st.q, st.v)
    _take_decisions(system, st, scratch, count, doubts > 0)
    return True


@inlined
def direction(system, st, r, slow):
    """Return the direction in which a unit slips, 0 for none."""
    slip = row_speed(system, len(system.rest) + r, st.v)
    return 0 if abs(slip) <= slow else (1 if slip > 0.0 else -1)


@inlined
def _is_undecided(system, st, scratch, r, slow):
    """Whether forces decide the state of a unit. Otherwise gap and speeds do, and it is set."""
    scratch.sliding[r], scratch.resting[r], scratch.at_bound[r] = 0, 0, 0
    if is_compliant(system, r) and not _is_pressed(system, st, scratch, r, slow):
        return False
    if system.slider[r] >= 0:
        _hold_slider(system, st, scratch, r, slow)
        return False
    if is_compliant(system, r):
        way = direction(system, st, r, slow)
        if not has_friction(system, r):
            st.state[r] = SLIP_RIGHT
            return False
        if way != 0:
            st.state[r], scratch.sliding[r] = way, way
            return False
        st.state[r] = STICK
    elif r >= system.contacts:
        way = direction(system, st, r, slow)
        if way != 0:
            st.state[r], scratch.sliding[r] = way, way
            return False
    elif not is_closed(system, st, r) or row_speed(system, r, st.v) > slow:
        st.state[r] = OPEN
        return False
    return True


@inlined
def _take_decisions(system, st, scratch, count, doubtful):
    """Set the states of all units from the decisions; doubtful: whether any was made a moment later."""
    u = len(system.rest)
    for r in range(u):
        st.other[r] = st.state[r]
    for p in range(count):
        r = scratch.listed[p]
        st.state[r], st.other[r] = scratch.verdict[p], scratch.verdict[p]
        if doubtful and scratch.doubtful[p] == _SLIP and _may_stick(system, scratch, p):
            st.state[r] = STICK
    for r in range(u):
        if scratch.resting[r] == _OPENS or scratch.resting[r] == _TOUCHES:
            st.state[r] = OPEN if scratch.resting[r] == _OPENS else TOUCHING
            st.other[r] = st.state[r]
        if scratch.resting[r] == _PRESSES or scratch.resting[r] == _TOUCHES:
            _stop_approach(system, st, r)
        st.fresh[r] = 1


@inlined
def _stop_approach(system, st, r):
    """Take the round-off of its speed from a contact that touches without speed: its force would end as it begins."""
    speed = row_speed(system, r, st.v)
    if speed != 0.0:
        for i in range(len(st.v)):
            st.v[i] -= system.J[r, i] / system.mass[i] * speed / system.delassus[r, r]


@inlined
def _is_pressed(system, st, scratch, r, slow):
    """Whether a compliant contact is closed, by gap and speed.

    One that touches without speed has no force yet, and is marked: its acceleration decides.
    """
    if st.state[r] < OPEN:
        return True
    if st.state[r] == LEAVING:
        return False
    rate = row_speed(system, r, st.v)
    if gap(system, r, st.q) > SIMULTANEOUS * system.play[r] or rate > slow:
        st.state[r] = OPEN
        return False
    if rate >= -slow:
        scratch.resting[r] = _TOUCHES
    return True


@kernel
def _close_or_open(system, scratch, count, nothing):
    """Decide by accelerations whether contacts that touch without speed are pressed. Returns how many stay in doubt."""
    doubts = 0
    for r in range(system.contacts):
        if scratch.resting[r] == _TOUCHES:
            acceleration = after_impulses(system, r, scratch.impulse, scratch.speed[r])
            least = least_force(system, r) * system.delassus[r, r]
            if abs(acceleration) <= max(nothing * math.sqrt(system.delassus[r, r]), least):
                doubts += 1
            else:
                scratch.resting[r] = _PRESSES if acceleration < 0.0 else _OPENS
    for p in range(count):
        if scratch.resting[scratch.listed[p]] == _OPENS:
            scratch.verdict[p], scratch.doubtful[p] = OPEN, 0
    return doubts


@inlined
def after_impulses(system, row, impulse, speed):
    """Return the speed of a row after impulses (2u,) of all rows, or its acceleration with their forces."""
    for other in range(len(impulse)):
        speed += system.delassus[row, other] * impulse[other]
    return speed


@inlined
def loaded_acceleration(system, st, scratch, q, v, time):
    """Set accelerations of the rows (scratch.speed) by all known forces, of springs and of units that slide as well.

    Sets the bounds of friction that are known (scratch.bound). Returns the size of the terms that accelerations are
    sums of, per root of the diagonal of G: what is far below is round-off.
    """
    u = len(system.rest)
    free_acceleration(system, scratch, q, v, time)
    for r in range(u):
        scratch.bound[r] = system.limit[r]
        if is_compliant(system, r) and st.state[r] < OPEN:
            force = spring_force(system, r, q, v)
            if scratch.resting[r] == _TOUCHES and force <= least_force(system, r):
                force = 0.0  # it would press others
            scratch.bound[r] = system.friction[r] * force
            for i in range(len(q)):
                term = system.J[r, i] * force / system.mass[i]
                scratch.free[i] += term
                scratch.terms[i] += abs(term)
        if scratch.sliding[r] != 0:
            for i in range(len(q)):
                scratch.free[i] -= scratch.sliding[r] * scratch.bound[r] * system.J[u + r, i] / system.mass[i]
    largest = 0.0
    for r in range(2 * u):
        scratch.speed[r] = row_speed(system, r, scratch.free)
        terms = 0.0
        for i in range(len(q)):
            terms += abs(system.J[r, i]) * scratch.terms[i]
        if system.delassus[r, r] > 0.0:
            largest = max(largest, terms / math.sqrt(system.delassus[r, r]))
    return largest


@kernel
def _decide_later(system, st, scratch, count):
    """Decide doubtful contacts by accelerations a moment later. Returns False if that cannot be solved.

    Where forces have only begun, they may all be others after that moment: a revised decision looks less far ahead.
    """
    u, size = len(system.rest), len(st.q)
    for i in range(size):
        scratch.later[1, i] = scratch.free[i]
        for r in range(2 * u):
            scratch.later[1, i] += system.J[r, i] * scratch.impulse[r] / system.mass[i]
    moment = _before_end(system, st, scratch, count, scratch.later[1], system.moment * _SOONER ** scratch.attempt[0])
    for i in range(size):
        total = scratch.later[1, i]
        scratch.later[0, i] = st.q[i] + moment * (st.v[i] + 0.5 * moment * total)
        scratch.later[1, i] = st.v[i] + moment * total
    if len(system.tangential) > 0:
        move_sliders(system, st.state, scratch.later[0], scratch.later[1])
    for p in range(count):
        scratch.first[p], scratch.doubt[p] = scratch.verdict[p], scratch.doubtful[p]
    terms = loaded_acceleration(system, st, scratch, scratch.later[0], scratch.later[1], st.time[0] + moment)
    if not _solve_states(system, st, scratch, count, terms, DOUBTFUL_LATER):
        return False
    # which of contacts that depend on each other carry the force is decided for all together
    carriers = False
    for p in range(count):
        carriers = carriers or scratch.doubt[p] == _NORMAL
    for p in range(count):
        sure = scratch.doubt[p] == 0 or (scratch.doubt[p] == _SLIP and scratch.verdict[p] >= OPEN)
        if sure and not (carriers and (scratch.verdict[p] == TOUCHING or scratch.attempt[0] > 0)):
            scratch.verdict[p], scratch.doubtful[p] = scratch.first[p], scratch.doubt[p]
    _close_or_open(system, scratch, count, DOUBTFUL_LATER * terms)
    if len(system.tangential) > 0:
        _draw_sliders(system, st, scratch, DOUBTFUL_LATER * terms)
    return True


@inlined
def _before_end(system, st, scratch, count, acceleration, moment):
    """Return the moment, or a shorter one in which no compliant contact ends whose slip is in doubt: without force
    there is nothing to decide."""
    for p in range(count):
        r = scratch.listed[p]
        if is_compliant(system, r) and scratch.doubtful[p] == _SLIP and scratch.resting[r] == 0:
            force, speed = spring_force(system, r, st.q, st.v), row_speed(system, r, st.v)
            falls = system.spring[r] * speed + system.dashpot[r] * row_speed(system, r, acceleration)
            if force > least_force(system, r) and falls * moment > 0.5 * force:
                moment = 0.5 * force / falls
    return moment


@kernel
def _stick_in_doubt(system, scratch, count):
    """Let contacts stick whose friction is at its bound unless others hold their slip.

    Both corners of a block that lies still may push against each other. Where others hold its slip, a force at the
    bound is one of the possible ones (st.other); contacts share the force while none of them needs more than its
    bound (automaton._forces_suffice).
    """
    u, rank = len(system.rest), 0
    for p in range(count):
        r = scratch.listed[p]
        if scratch.verdict[p] < OPEN and is_rigid(system, r):
            rank = extend_basis(system, scratch, r, rank)
    for p in range(count):
        if scratch.verdict[p] == STICK:
            rank = extend_basis(system, scratch, u + scratch.listed[p], rank)
    for p in range(count):
        r = scratch.listed[p]
        if scratch.doubtful[p] == _SLIP and _may_stick(system, scratch, p):
            more = extend_basis(system, scratch, u + r, rank)
            if more > rank:
                scratch.verdict[p], rank = STICK, more


@inlined
def _may_stick(system, scratch, p):
    """Whether a listed unit that counts as slipping has friction and no slip."""
    r = scratch.listed[p]
    return is_slip(scratch.verdict[p]) and scratch.way[p] == 0 and has_friction(system, r)


@kernel
def extend_basis(system, scratch, row, rank):
    """Add a row to the orthonormal basis of those that are kept. Returns its size, the same if they hold the row."""
    size, whole, left = len(system.mass), 0.0, 0.0
    if rank >= size:
        return rank
    new = scratch.span[rank]
    for i in range(size):
        new[i] = system.J[row, i] / math.sqrt(system.mass[i])
        whole += new[i] * new[i]
    for _ in range(2):
        for k in range(rank):
            product = 0.0
            for i in range(size):
                product += scratch.span[k, i] * new[i]
            for i in range(size):
                new[i] -= product * scratch.span[k, i]
    for i in range(size):
        left += new[i] * new[i]
    if left <= DEPENDENCE * whole:
        return rank
    for i in range(size):
        new[i] /= math.sqrt(left)
    return rank + 1
