"""Impacts with friction: all contacts that are closed at the instant take part, in one problem on velocities.

Newton's law in Moreau's form (Moreau 1988): after the impact v_N + k v_N- >= 0 and the impulse P_N >= 0 complement each
other, and P_T stays within Coulomb's cone, at its edge where the contact still slips. Without friction one
coefficient for all contacts never brings energy; with friction, or with several coefficients, the law can (Kane's
paradox). Then all coefficients are smaller by one factor, the largest that brings none; it is zero for a wedged block
whose contacts cannot part. A single contact of mobility G, brings none up to k = sqrt(1 - G_NT^2/(G_NN G_TT)).

Poisson's law (Glocker and Pfeiffer 1995) is two such problems: one of compression, without restitution, and one of
expansion, in which P_N exceeds k times that of compression only where v_N+ would be negative.

A block that comes to lie rocks from corner to corner ever faster, and ends in finite time, as a ball does. Contacts
that would part for less than CHATTER are closed together: they lose the speed with which they would part.
"""

from __future__ import annotations

import math

from vanedamp.coupling.engine.plane.contact_states import after_impulses, direction, extend_basis, loaded_acceleration
from vanedamp.coupling.engine.plane.friction_problem import solve_rows
from vanedamp.coupling.engine.plane.tolerances import (
    ADDED_ENERGY,
    AT_REST,
    CANCELLED_ENERGY,
    FRICTION_EDGE,
    STEP_SCALE,
    WEDGED,
)
from vanedamp.coupling.numerics.codes import IMPACTS, LOGGED, OPEN, PERIOD, REDUCED
from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel
from vanedamp.coupling.numerics.tolerances import CHATTER, COLLAPSE, SPEED_ROUND_OFF
from vanedamp.coupling.response.recorder import note_impact
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS
from vanedamp.coupling.system.restitution import restitution_at
from vanedamp.coupling.system.system import LEFT, RIGHT
from vanedamp.coupling.system.unit_kinematics import (
    has_friction,
    is_closed,
    is_compliant,
    is_rigid,
    is_second,
    row_speed,
    speed_scale,
)

#: bisections of the factor of the coefficients
_HALVINGS = 40
#: least length of a flight that is not ended, times CHATTER, however elastic it is
_SHORTEST_FLIGHT = 0.1
#: a closed contact in a short step: it pushes, or its slip turns without
_PUSHES, _TURNS = 1, 2
#: how much more than the loads the forces of other contacts may press
_FAR = 100.0


@kernel
def collide(system, st, rec, scratch):
    """Let all closed contacts collide. Returns False if the problem cannot be solved."""
    u, count, tiny = len(system.rest), _list_closed(system, st, scratch), AT_REST * st.scale[0]
    for r in range(2 * u):
        scratch.before_impact[r] = row_speed(system, r, st.v)
    # speeds as they are, round-off included, always have a solution
    if system.two_phases and not _compress(system, scratch, count, tiny) and not _compress(system, scratch, count, 0.0):
        return False
    if not _solve_restitution(system, st, scratch, count, 1.0, tiny):
        st.counters[REDUCED] += 1
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if _solve_restitution(system, st, scratch, count, middle, tiny):
                low = middle
            else:
                high = middle
        # without rebound the speeds as they are have a solution here, too
        wedged = low <= WEDGED
        if not _solve_restitution(system, st, scratch, count, 0.0 if wedged else low, 0.0 if wedged else tiny):
            return False
    _apply(system, st, rec, scratch, count, tiny)
    return _complete_chatter(system, st, scratch, count, tiny)


@inlined
def _list_closed(system, st, scratch):
    """List the contacts whose gaps are zero. Returns their count."""
    count = ZERO
    for r in range(system.contacts):
        if is_rigid(system, r) and is_closed(system, st, r):
            scratch.listed[count], scratch.way[count] = r, 0
            count += 1
    return count


@kernel
def _solve_restitution(system, st, scratch, count, factor, tiny):
    """Find impulses for this factor of the coefficients. Returns False if there are none, or they add energy."""
    if system.two_phases:
        return _expand(system, st, scratch, count, factor, tiny) and not _adds_energy(system, st, scratch)
    _set_speeds(system, scratch, scratch.before_impact, tiny)
    for p in range(count):
        r = scratch.listed[p]
        normal = scratch.speed[r]
        scratch.speed[r] = normal + factor * _restitution(system, st, scratch, r) * min(normal, 0.0)
    return solve_rows(system, scratch, count, scratch.speed, 0.0, system.limit) and not _adds_energy(
        system, st, scratch
    )


@kernel
def _set_speeds(system, scratch, speed, tiny):
    """Set the speeds of all rows (scratch.speed), of gaps without their round-off."""
    for row in range(len(speed)):
        scratch.speed[row] = speed[row] if row >= len(system.rest) or abs(speed[row]) > tiny else 0.0


@kernel
def _compress(system, scratch, count, tiny):
    """Find the impulses that stop the approach, and the speeds that they leave. Returns False if there are none."""
    _set_speeds(system, scratch, scratch.before_impact, tiny)
    if not solve_rows(system, scratch, count, scratch.speed, 0.0, system.limit):
        return False
    for row in range(len(system.J)):
        scratch.compression[row] = scratch.impulse[row]
        scratch.compressed[row] = after_impulses(system, row, scratch.impulse, scratch.before_impact[row])
    return True


@kernel
def _expand(system, st, scratch, count, factor, tiny):
    """Find the impulses of both phases: in expansion a contact has at least its coefficient's part of compression.

    With that part as given, the rest is the same problem: the more than it and the speed complement each other.
    Returns False if there are none.
    """
    u = len(system.rest)
    for row in range(2 * u):
        scratch.speed[row] = scratch.compressed[row] if abs(scratch.compressed[row]) > tiny else 0.0
    for p in range(count):
        r = scratch.listed[p]
        given = factor * _restitution(system, st, scratch, r) * scratch.compression[r]
        scratch.bound[r] = system.friction[r] * given
        scratch.least[r] = given
        for row in range(2 * u):
            scratch.speed[row] += system.delassus[row, r] * given
    if not solve_rows(system, scratch, count, scratch.speed, 0.0, scratch.bound):
        return False
    for p in range(count):
        r = scratch.listed[p]
        scratch.impulse[r] += scratch.least[r] + scratch.compression[r]
        scratch.impulse[u + r] += scratch.compression[u + r]
    return True


@inlined
def _restitution(system, st, scratch, r):
    """Coefficient of a contact at its speed of approach; an impact at the end of a collapse is plastic."""
    if st.time[0] - st.last_impact[r] < COLLAPSE * system.period:
        return 0.0
    return restitution_at(system, r, -scratch.before_impact[r])


@inlined
def _adds_energy(system, st, scratch):
    """Whether the impulses add more energy than round-off.

    By the velocities that they change: of a wedged block, large impulses nearly balance each other.
    """
    loss, there = 0.0, 0.0
    _push(system, scratch)
    for i in range(len(st.v)):
        pushed = scratch.free[i]
        loss -= pushed * (st.v[i] + 0.5 * pushed / system.mass[i])
        there += 0.5 * system.mass[i] * st.v[i] * st.v[i] + CANCELLED_ENERGY * scratch.terms[i] * abs(st.v[i])
    return loss < -ADDED_ENERGY * there


@inlined
def _push(system, scratch):
    """Set the momenta that the impulses give (scratch.free), and sizes of the terms that they are sums of."""
    for i in range(len(scratch.free)):
        scratch.free[i], scratch.terms[i] = 0.0, 0.0
    for row in range(len(scratch.impulse)):
        if scratch.impulse[row] != 0.0:
            for i in range(len(scratch.free)):
                term = system.J[row, i] * scratch.impulse[row]
                scratch.free[i] += term
                scratch.terms[i] += abs(term)


@kernel
def _apply(system, st, rec, scratch, count, tiny):
    """Change the velocities by the impulses; log the impacts of contacts that these push, or that have approached."""
    u = len(system.rest)
    _push(system, scratch)
    for i in range(len(st.v)):
        st.v[i] += scratch.free[i] / system.mass[i]
    for p in range(count):
        r = scratch.listed[p]
        before, push, drag = scratch.before_impact[r], scratch.impulse[r], scratch.impulse[u + r]
        if push > 0.0 or before < -tiny:
            after, loss = row_speed(system, r, st.v), 0.0
            for row in (r, u + r):
                loss -= 0.5 * scratch.impulse[row] * (scratch.before_impact[row] + row_speed(system, row, st.v))
            log_impact(system, st, rec, r, before, after, push, drag, loss)
    for row in range(2 * u):  # of the whole impact: contributions of single rows may be negative
        if scratch.impulse[row] != 0.0:
            st.ledger[IMPACT_LOSS] -= (
                0.5 * scratch.impulse[row] * (scratch.before_impact[row] + row_speed(system, row, st.v))
            )
    _stop_round_off(system, st, scratch, count)


@inlined
def log_impact(system, st, rec, r, before, after, normal, tangential, loss):
    """Count an impact and log it: relative velocities, normal and tangential impulse, the energy that they take."""
    st.last_impact[r] = st.time[0]
    energy = 0.5 * before * before / system.delassus[r, r]
    if not is_second(system, r):
        st.counters[IMPACTS] += 1
        rec.impacts[st.counters[PERIOD]] += 1
        rec.collided[st.counters[PERIOD]] += energy
        if rec.struck.shape[1] > 0:
            note_impact(rec, st.counters[PERIOD], r, energy)
    if system.surface[r] == LEFT or system.surface[r] == RIGHT:
        rec.walls[st.counters[PERIOD], system.body[r]] += 1
    log_event(system, st, rec, IMPACT, r, before, after, normal, tangential, loss)


@inlined
def log_event(system, st, rec, kind, r, before, after, normal, tangential, loss):
    """One entry: time, kind, unit, relative velocities (m/s), impulses (N s), energy (J)."""
    entry = rec.log[st.counters[LOGGED]]
    st.counters[LOGGED] += 1
    entry[0] = st.counters[PERIOD] * system.period + st.time[0]
    entry[1], entry[2], entry[3], entry[4] = kind, r, before, after
    entry[5], entry[6], entry[7] = normal, tangential, loss


@kernel
def _complete_chatter(system, st, scratch, count, tiny):
    """Stop contacts that would part for less than CHATTER: those that push in a step of that length.

    The step is one of Moreau's scheme, and one for all: over steps of several lengths the forces of contacts at
    rest would push others more, or less, than they do. A chatter takes 1/(1 - k) times its next flight. Returns False
    if that cannot be decided.
    """
    slow, near, flight = _FAR * _accelerate(system, st, scratch), False, 1.0
    for p in range(count):
        speed = row_speed(system, scratch.listed[p], st.v)
        if tiny < speed < slow:
            near, flight = (
                True,
                min(flight, max(1.0 - restitution_at(system, scratch.listed[p], speed), _SHORTEST_FLIGHT)),
            )
    if not near:
        return True
    if not _short_step(system, st, scratch, count, flight):
        return False
    near = False
    for p in range(count):
        r = scratch.listed[p]
        scratch.slips[p] = _PUSHES if scratch.impulse[r] > 0.0 else 0
        near = near or (scratch.impulse[r] > 0.0 and row_speed(system, r, st.v) > tiny)
    if near:
        _stop(system, st, scratch, count, tiny, slow, 1.0 - FRICTION_EDGE)
    return True


@kernel
def stop_wedged(system, st, rec, scratch):
    """Apply the impulses of closed contacts that no forces can hold (Painleve's paradox): a wedged block stops.

    They are those of a step of Moreau's scheme in the limit of short ones. Slips that the loads turn within it stop.
    Returns False if there are none.
    """
    u, count = len(system.rest), _list_closed(system, st, scratch)
    tiny = AT_REST * max(speed_scale(system, st.v), st.scale[0])
    slow = _FAR * _accelerate(system, st, scratch)
    if not _short_step(system, st, scratch, count, 1.0):
        return False
    for r in range(2 * u):
        scratch.before_impact[r] = row_speed(system, r, st.v)
    _apply(system, st, rec, scratch, count, math.inf)
    for p in range(count):
        r = scratch.listed[p]
        slip = after_impulses(system, u + r, scratch.impulse, scratch.speed[u + r])
        turns = has_friction(system, r) and slip * row_speed(system, u + r, st.v) < 0.0
        turns = turns and abs(row_speed(system, r, st.v)) <= tiny
        scratch.slips[p] = _PUSHES if scratch.impulse[r] > 0.0 else (_TURNS if turns else 0)
    _stop(system, st, scratch, count, tiny, slow, math.inf)
    return True


@inlined
def _accelerate(system, st, scratch):
    """Set accelerations of the rows (scratch.speed) without contact forces. Returns the speed they give in CHATTER."""
    u, largest = len(system.rest), 0.0
    for r in range(u):
        scratch.sliding[r] = 0
        if system.slider[r] >= 0:
            continue
        if r >= system.contacts or (is_compliant(system, r) and has_friction(system, r) and st.state[r] < OPEN):
            scratch.sliding[r] = direction(system, st, r, AT_REST * st.scale[0])
    loaded_acceleration(system, st, scratch, st.q, st.v, st.time[0])
    for r in range(2 * u):
        largest = max(largest, abs(scratch.speed[r]))
    return largest * CHATTER * system.period


@inlined
def _short_step(system, st, scratch, count, fraction):
    """Find the impulses (scratch.impulse) of a step of Moreau's scheme, a fraction of CHATTER long. False if none.

    Speeds of so short a step may be so small that round-off of the motion contradicts rows that depend on each other:
    then they are measured by the motion.
    """
    u, ahead, motion = len(system.rest), CHATTER * system.period * fraction, 0.0
    for i in range(len(st.v)):
        motion += system.mass[i] * st.v[i] * st.v[i]
    for p in range(count):
        r = scratch.listed[p]
        scratch.speed[r] = row_speed(system, r, st.v) + ahead * scratch.speed[r]
        scratch.speed[u + r] = row_speed(system, u + r, st.v) + ahead * scratch.speed[u + r]
    return solve_rows(system, scratch, count, scratch.speed, 0.0, system.limit) or solve_rows(
        system, scratch, count, scratch.speed, STEP_SCALE * math.sqrt(motion), system.limit
    )


@inlined
def _stop(system, st, scratch, count, tiny, slow, most):
    """Stop contacts that push or turn (scratch.slips), with their slips if they stick, and whom that drives together.

    most: fraction of its bound below which friction counts as sticking.
    """
    u, rank, before = len(system.rest), 0, _kinetic(system, st)
    for p in range(count):
        r = scratch.listed[p]
        normal = scratch.impulse[r]
        if scratch.slips[p] != 0:
            rank = _stop_row(system, st, scratch, r, rank)
            sticks = scratch.slips[p] == _TURNS or abs(scratch.impulse[u + r]) < most * system.friction[r] * normal
            if sticks and abs(row_speed(system, u + r, st.v)) < slow:
                rank = _stop_row(system, st, scratch, u + r, rank)
    _stop_driven(system, st, scratch, count, tiny, rank, before)


@inlined
def _stop_driven(system, st, scratch, count, tiny, rank, before):
    """Stop closed contacts that approach after others have been stopped, and enter the loss.

    rank: number of directions stopped; before: kinetic energy before that.
    """
    again = rank > 0
    while again:
        again = False
        for p in range(count):
            if row_speed(system, scratch.listed[p], st.v) < -tiny:
                more = _stop_row(system, st, scratch, scratch.listed[p], rank)
                again, rank = again or more > rank, more
    st.ledger[IMPACT_LOSS] += before - _kinetic(system, st)


@kernel
def _stop_round_off(system, st, scratch, count):
    """Stop rows whose speeds are round-off of the impulses (_push): those of a wedged block nearly balance each other.

    Otherwise the last bits would decide which of them separate or slip, and which way, until they turn at once.
    """
    u, rank, terms, before = len(system.rest), 0, 0.0, _kinetic(system, st)
    for p in range(count):
        for row in (scratch.listed[p], u + scratch.listed[p]):
            total = 0.0
            for i in range(len(st.v)):
                total += abs(system.J[row, i]) * scratch.terms[i] / system.mass[i]
            terms = max(terms, total)
    noise, tiny = SPEED_ROUND_OFF * terms, AT_REST * st.scale[0]
    if noise <= tiny:
        return
    for p in range(count):
        r = scratch.listed[p]
        for row in (r, u + r):
            if abs(row_speed(system, row, st.v)) <= noise and (row == r or has_friction(system, r)):
                rank = _stop_row(system, st, scratch, row, rank)
    _stop_driven(system, st, scratch, count, tiny, rank, before)


@inlined
def _kinetic(system, st):
    """Return the kinetic energy, J."""
    energy = 0.0
    for i in range(len(st.v)):
        energy += 0.5 * system.mass[i] * st.v[i] * st.v[i]
    return energy


@inlined
def _stop_row(system, st, scratch, row, rank):
    """Take a row's speed out of the velocities, and keep it stopped. Returns the number of directions stopped."""
    more = extend_basis(system, scratch, row, rank)
    if more > rank:
        speed = 0.0
        for i in range(len(st.v)):
            speed += scratch.span[rank, i] * math.sqrt(system.mass[i]) * st.v[i]
        for i in range(len(st.v)):
            st.v[i] -= scratch.span[rank, i] * speed / math.sqrt(system.mass[i])
    return more
