"""The derivative of a motion across an event, from the equations of motion.

The derivative of a passage is the product, in the order of time, of the propagators of segments and of the saltation
matrices of events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
Mechanical Systems, 2004, chapter 7). The engine decides everything: times, contact states, impulses. The derivative
checks itself: at every event the motion that its own flows predict must be the engine's, and coordinates at rest must
stay so.
"""

from __future__ import annotations

import math

from vanedamp.coupling.derivatives.constraints import (
    AffineMap,
    applied,
    begun,
    explicit_of,
    followed,
    held,
    largest,
    left,
    left_of,
    presses,
    pressing,
    then,
)
from vanedamp.coupling.derivatives.event_functions import along, generated, is_tangential, new_guards, set_guard
from vanedamp.coupling.derivatives.impact import fastest_of, impact, scaled
from vanedamp.coupling.derivatives.matrices import add_product, dot, integers, matrix, product, unit, vector
from vanedamp.coupling.derivatives.walking import (
    COINCIDENT,
    COMPLETED,
    COUNTS,
    FLOW,
    GAPS,
    GRAZING,
    KNOWN,
    LAW_OF,
    LOST,
    SMOOTH,
    SPEEDS,
    STATUS,
    UNTRUSTED,
    WANTS_FLOW,
    WANTS_LAW,
)
from vanedamp.coupling.numerics.codes import CLOSES, FORCE, OPEN, POSITION, TOUCHING, VELOCITY
from vanedamp.coupling.numerics.compiler.jit import counting, inlined, kernel

#: largest difference of the engine's motion and the own flows', relative to a coordinate's size, and that size
#: where it hardly moves, relative to its typical one
_AGREEMENT, LEAST = 1e-8, 1e-4
#: least size of a coordinate, times the largest: energies are squares of coordinates
_LITTLE = 1e-4
#: difference of a speed after an impact and its law's, relative to the fastest there
_LAW = 1e-9
#: speed that an engine has taken from a row by no impulse, relative to the fastest, beyond round-off
_CAUGHT = 1e-11
#: derivative by a number, relative to number and coordinate, to which round-off is relative at least
_LEAST_TURN = 1e-2
#: largest motion of rows at rest by the derivative, relative to its terms
_STILL = 1e-6
#: bounds reached without a jump agree on both sides to this part of their terms: forces, others
_CONTINUOUS, ROUND_OFF = 1e-9, 1e-12
#: a derivative that does not matter; a difference by which shifts of events may differ that are one
_NOTHING, _ONE_INSTANT = 1e-9, 1e-6
#: flights of a chatter whose order does not matter: times the period, and their speeds, relative to the fastest
LAST_FLIGHT, _LAST_SPEED = 1e-6, 1e-3
#: times this close, relative to a period: of an event and the passage's start or end; of two events at one instant
SIMULTANEOUS, _INSTANT = 1e-12, 1e-15
#: gaps this close are closed, relative to the free travel; speeds this slow count as zero, relative to the fastest
SHUT, SLOW = 1e-12, 1e-12


@inlined
def worsen(walk, status):
    """Note that something is wrong."""
    walk.at[STATUS] = max(walk.at[STATUS], status)


@inlined
def start_of(eq, trace, i):
    """Return the start of segment i, s since the passage's."""
    return trace.period[i] * eq.period + trace.time[i]


@inlined
def begins(eq, trace, i):
    """Return whether segment i begins as the passage does."""
    return start_of(eq, trace, i) <= SIMULTANEOUS * eq.period


@counting
def state_at(room, eq, trace, i):
    """Return z (K,) at the start of segment i."""
    size, e, z = len(eq.root), len(eq.frequency), vector(room, len(eq.typical))
    for k in range(size):
        z[k], z[size + k] = eq.unit[k] * trace.q[i, k], eq.unit[size + k] * trace.v[i, k]
    z[2 * size] = eq.size
    for h in range(e):
        angle = eq.frequency[h] * trace.time[i]
        z[2 * size + 1 + h], z[2 * size + 1 + e + h] = eq.size * math.cos(angle), eq.size * math.sin(angle)
    return z


@counting
def closed_at(room, eq, trace, i):
    """Return whether contacts (u,) are closed as segment i begins, with or without force."""
    closed = integers(room, len(eq.rest))
    for r in range(eq.contacts):
        gap = eq.rest[r] + dot(eq.J[r], trace.q[i])
        # one at rest that parts from now on has been closed until now
        rests = gap <= SHUT * eq.play[r] and abs(dot(eq.J[r], trace.v[i])) <= SLOW * trace.speed[i]
        closed[r] = 1 if trace.state[i, r] != OPEN or rests else 0
    return closed


@counting
def agrees(room, eq, walk, predicted, actual):
    """Return whether two states u (2N,) are one."""
    size, sliders = len(eq.root), len(eq.bound)
    sizes, terms = vector(room, len(eq.scale)), vector(room, 2 * size)
    for s in range(len(sizes)):
        sizes[s] = abs(dot(eq.to_state[s], actual))
    for i in range(2 * size):
        # slip and structure may cancel
        for s in range(len(sizes)):
            terms[i] += abs(eq.from_state[i, s]) * sizes[s]
    same, least = True, _LITTLE * terms.max()
    for i in range(size):
        # a coordinate and its rate have one size, since either may pass through zero; a wave may leave modes at rest
        both = max(terms[i], terms[size + i], least)
        for at in (i, size + i):
            walk.size[at] = max(walk.size[at], both)
            if not (i >= size - sliders or abs(predicted[at] - actual[at]) <= _AGREEMENT * walk.size[at]):
                same = False
    return same


@counting
def _guards_of(room, eq, turns, flows, walk, trace, i, z, moving):
    """Return the event functions that vanish at event i, of which the first is its own."""
    units, f = len(eq.rest), walk.at[FLOW]
    unit_, event, time = trace.unit[i], trace.what[i], start_of(eq, trace, i - 1) + trace.duration[i - 1]
    more, count = integers(room, units), 1
    for r in range(units):
        struck = False
        for h in range(trace.first[i], trace.first[i + 1]):
            struck = struck or trace.struck[h] == r
        if struck and eq.spring[r] == math.inf and trace.state[i - 1, r] == OPEN and r != unit_:
            more[r] = CLOSES
            count += 1
    if eq.order[event] == VELOCITY:
        for r in range(units):
            slides = flows.way[f, r] != 0.0 and not flows.slips_held[f, r] and eq.rubs[r]
            slides = slides and trace.state[i, r] != trace.state[i - 1, r] and r != unit_
            if slides and abs(dot(eq.J[units + r], trace.v[i])) <= ROUND_OFF * trace.speed[i - 1]:
                count += 1 if more[r] == 0 else 0
                more[r] = event
    guards, bending = new_guards(room, eq, turns, count), vector(room, len(z))
    generated(flows, f, moving, bending)
    g = 0
    for k in range(-1, units):
        r, code = (unit_, event) if k < 0 else (k, more[k])
        if k >= 0 and code == 0:
            continue
        met = math.nan
        if code == CLOSES:
            for h in range(trace.first[i], trace.first[i + 1]):
                if trace.struck[h] == r:
                    met = trace.before[h]
        set_guard(
            room, eq, turns, flows, f, z, moving, bending, guards, g, r, code, met, trace.speed[i - 1], time,
            time - walk.took_part[r],
        )  # fmt: skip
        g += 1
    return guards


@counting
def _jump(room, eq, turns, walk, trace, i, before, z):
    """Return the derivative of u after event i by u before, at one time, the jump (N,) of w, and whether it is known.

    before, z: (K,) before and after.
    """
    size, units = len(eq.root), len(eq.rest)
    map_ = AffineMap(unit(room, size), unit(room, size), matrix(room, 2 * size, turns.numbers))
    w, w_new = before[size : 2 * size], z[size : 2 * size]
    kick, hits, struck = vector(room, size), False, vector(room, size)
    for r in range(2 * units):
        if trace.impulse[i, r] != 0.0:
            hits = True
            for k in range(size):
                kick[k] += trace.impulse[i, r] * eq.rows[r, k]
    for k in range(size):
        struck[k] = w[k]
    if hits:
        v = vector(room, size)
        for k in range(size):
            v[k] = w[k] / eq.root[k]
        jump = impact(room, eq, turns, trace, i, walk.law, v, trace.speed[i - 1])
        bound = _LAW * fastest_of(trace, i) + ROUND_OFF * trace.speed[i - 1]
        for h in range(trace.first[i], trace.first[i + 1]):
            r = trace.struck[h]
            if eq.spring[r] < math.inf:
                continue
            if abs(dot(eq.J[r], jump.v) - trace.after[h]) > bound:
                return map_, kick, False
            # after a plastic impact a small restitution adds bounces that end at once, whose sum is nothing to first
            # order; not so where the contact opens
            if eq.restitution[r] == 0.0 and not presses(trace.state[i, r]) and trace.state[i, r] != TOUCHING:
                for p in range(turns.numbers):
                    if turns.restitution[p, r] != 0.0:
                        return map_, kick, False
        rates, offset = scaled(room, eq, turns, jump, w)
        map_ = AffineMap(map_.places, rates, map_.offset)
        for k in range(size):
            struck[k] = eq.root[k] * jump.v[k]
            for p in range(turns.numbers):
                map_.offset[size + k, p] = offset[k, p]
    after = vector(room, len(z))
    for k in range(len(z)):
        after[k] = z[k]
    for k in range(size):
        after[k], after[size + k] = before[k], struck[k]
    follow = followed(room, eq, turns, trace.state[i], after)
    map_ = _on_rates(room, map_, follow)
    known = True
    for h in range(trace.first[i], trace.first[i + 1]):
        for other in range(h + 1, trace.first[i + 1]):
            known = known and trace.struck[h] != trace.struck[other]
    by_law, by_impulse, sum_ = vector(room, 2 * size), vector(room, 2 * size), vector(room, size)
    for k in range(size):
        sum_[k] = w[k] + kick[k]
    for k in range(size):
        by_law[k] = by_impulse[k] = before[k]
        by_law[size + k], by_impulse[size + k] = dot(follow.rates[k], struck), dot(follow.rates[k], sum_)
    known = agrees(room, eq, walk, by_law, by_impulse) and known
    caught = False
    for r in range(2 * units):
        over = 0.0
        for k in range(size):
            over += eq.rows[r, k] * (by_impulse[size + k] - w_new[k])
        caught = caught or abs(over) > _CAUGHT * trace.speed[i]
    if caught:  # a chatter has been completed
        walk.at[COMPLETED] = 1
        closed, still, stuck = closed_at(room, eq, trace, i), integers(room, units), integers(room, units)
        for r in range(units):
            if closed[r] and abs(dot(eq.J[r], trace.v[i])) <= ROUND_OFF * trace.speed[i]:
                still[r] = 1
            slow = abs(dot(eq.J[units + r], trace.v[i])) <= ROUND_OFF * trace.speed[i]
            if closed[r] and eq.friction[r] > 0.0 and slow:
                stuck[r] = 1
        stop = then(
            room, held(room, eq, turns, still, stuck, z), followed(room, eq, turns, trace.state[i], z)
        )  # fmt: skip
        map_ = _on_rates(room, map_, stop)
        for k in range(size):
            by_law[k] = before[k]
            by_law[size + k] = dot(stop.rates[k], by_impulse[size:])
            kick[k] = w_new[k] - w[k]
        for k in range(size):
            by_impulse[size + k] = w_new[k]
        known = agrees(room, eq, walk, by_law, by_impulse) and known
    for k in range(size):
        by_impulse[k], by_impulse[size + k] = before[k], w_new[k]
    known = known and agrees(room, eq, walk, by_impulse, z)
    for k in range(size - len(eq.bound), size):
        kick[k] = w_new[k] - w[k]
    return map_, kick, known


@counting
def _on_rates(room, one, other):
    """Return a map of rates and then that part of another: places stay."""
    size = len(one.places)
    offset = matrix(room, 2 * size, one.offset.shape[1])
    add_product(offset[size:], other.rates, one.offset[size:])
    for k in range(size, 2 * size):
        for p in range(offset.shape[1]):
            offset[k, p] += other.offset[k, p]
    return AffineMap(one.places, product(room, other.rates, one.rates), offset)


@counting
def after_event(room, eq, turns, flows, walk, trace, i, f, z):
    """Return the derivative (2N, C) after event i as the motion continues from z (K,) in flow f, and the outcome."""
    before, M, one = walk.z, walk.end[: len(eq.unit)], len(eq.unit)
    for c in range(len(walk.shift)):
        walk.shift[c] = 0.0
    if trace.unit[i] < 0:
        return M, KNOWN if agrees(room, eq, walk, before, z) else UNTRUSTED
    if eq.law and walk.at[LAW_OF] != i and trace.first[i] < trace.first[i + 1]:
        return M, WANTS_LAW
    moving = vector(room, len(z))
    generated(flows, walk.at[FLOW], before, moving)
    guards = _guards_of(room, eq, turns, flows, walk, trace, i, before, moving)
    walk.met[i] = guards.rate[0]
    if walk.at[LOST] or not walk.at[SMOOTH]:
        return M, UNTRUSTED
    jump, kick, known = _jump(room, eq, turns, walk, trace, i, before, z)
    if not known:
        return M, UNTRUSTED
    if begins(eq, trace, i):  # rows at rest or in touch to round-off: the passage begins with them so
        moved = applied(
            room, begun(room, eq, turns, trace.state[i], closed_at(room, eq, trace, i), z), applied(room, jump, M)
        )  # fmt: skip
        # a gap that round-off has opened closes at once, without speed
        met = abs(dot(eq.speed[trace.unit[i]], before))
        rests = eq.spring[trace.unit[i]] == math.inf and met <= ROUND_OFF * trace.speed[i - 1]
        if eq.order[trace.what[i]] == POSITION and not rests:
            worsen(walk, GRAZING)
    else:
        moved, outcome = _saltation(
            room, eq, turns, flows, walk, trace, i, f, z, M, moving, jump, kick, guards
        )  # fmt: skip
        if outcome != KNOWN:
            return M, outcome
    moved, known = _still(room, eq, turns, flows, walk, trace, i, f, z, moved)
    if not known:
        return M, UNTRUSTED
    check_idle(room, eq, turns, walk, trace, i, moved, z)
    for r in range(len(eq.rest)):
        if trace.state[i - 1, r] != trace.state[i, r]:
            walk.took_part[r] = start_of(eq, trace, i)
    walk.took_part[trace.unit[i]] = start_of(eq, trace, i)
    for h in range(trace.first[i], trace.first[i + 1]):
        walk.took_part[trace.struck[h]] = start_of(eq, trace, i)
    return moved[:one], KNOWN


@counting
def _saltation(room, eq, turns, flows, walk, trace, i, f, z, M, moving, jump, jumped, guards):
    """Return the derivative after an event: jump M, and the effect of the event's shift in time; and the outcome.

    z: (K,) after; moving: X z before; jumped: (N,) of w. Parts of the system that are not coupled have their own
    events.
    """
    size, one, columns, units = len(eq.root), len(eq.unit), M.shape[1], len(eq.rest)
    event, count, parts = trace.what[i], len(guards.rate), walk.last_shift.shape[0]
    after, kick, hits = vector(room, len(z)), vector(room, one), False
    generated(flows, f, z, after)
    for r in range(2 * units):
        hits = hits or trace.impulse[i, r] != 0.0
    of_force = eq.order[event] == FORCE
    round_off = _CONTINUOUS if of_force else ROUND_OFF
    for k in range(one):
        on_rates = k >= size
        by_jump = dot(jump.rates[k - size], moving[size:]) if on_rates else moving[k]
        terms = abs(after[k])
        if on_rates:
            for j in range(size):
                terms += abs(jump.rates[k - size, j] * moving[size + j])
        else:
            terms += abs(moving[k])
        kick[k] = after[k] - by_jump
        if abs(kick[k]) <= round_off * terms:
            kick[k] = 0.0
    if hits:
        for k in range(size):
            kick[k] = eq.rate[k] * jumped[k]
    shifts, known, first = matrix(room, parts, columns), integers(room, parts), int(guards.part[0])
    for g in range(count):
        part = int(guards.part[g])
        if known[part] == 0:
            known[part], derivative = 1, along(room, guards, g, M)
            rate = guards.rate[g] if guards.rate[g] != 0.0 else math.inf
            for c in range(columns):
                shifts[part, c] = -derivative[c] / rate
    for c in range(columns):
        walk.shift[c] = shifts[first, c]
    unmoved = applied(room, jump, M)
    moved, difference = matrix(room, one, columns), matrix(room, one, columns)
    for k in range(one):
        derivative = eq.part[k % size]
        owner = derivative if known[derivative] and derivative != first else first
        for c in range(columns):
            difference[k, c] = -kick[k] * shifts[owner, c]
            moved[k, c] = unmoved[k, c] + difference[k, c]
    matters = hits or largest(room, eq, difference) > _NOTHING * max(largest(room, eq, M), 1.0)
    if event == CLOSES and eq.spring[trace.unit[i]] < math.inf:
        begin = 0
        for r in range(units):
            yields = eq.spring[r] < math.inf and presses(trace.state[i, r]) and trace.state[i - 1, r] == OPEN
            begin += 1 if yields else 0
        if begin > 1:
            moved, outcome = _closings(room, eq, turns, flows, walk, trace, i, M)
            if outcome != KNOWN:
                return M, outcome
        # friction stops the slips of neighbours at once where this motion has none
        moved = applied(room, begun(room, eq, turns, trace.state[i], pressing(room, trace.state[i]), z), moved)
    if not matters:
        return moved, KNOWN
    for g in range(count):
        if is_tangential(guards, g):
            worsen(walk, GRAZING)
    closed = closed_at(room, eq, trace, i)
    stopped, shut = True, True
    for h in range(trace.first[i], trace.first[i + 1]):
        stopped = stopped and trace.after[h] == 0.0
        shut = shut and closed[trace.struck[h]]
    rests = event == CLOSES and count > 1 and (stopped or shut)
    # sliders come to rest at several contacts in any order, and a chatter ends in any
    free = (rests and eq.in_line) or _last_flights(eq, walk, trace, i, guards)
    any_apart, counts = _apart(room, eq, walk, trace, i, M, guards, shifts, free)
    if counts:
        worsen(walk, COINCIDENT)
    if rests and (free or any_apart):  # nothing is left of gaps and speeds
        moved = applied(room, held(room, eq, turns, closed, integers(room, units), z), unmoved)
    if of_force:
        for r in range(2 * units):
            if trace.open_force[i - 1, r] != 0.0:
                return M, UNTRUSTED  # of undetermined forces the engine has chosen one
    walk.last[0] = start_of(eq, trace, i)
    for part in range(parts):
        walk.shifted[part] = known[part]
        for c in range(columns):
            walk.last_shift[part, c] = shifts[part, c]
    return moved, KNOWN


@kernel
def _last_flights(eq, walk, trace, i, guards):
    """Return whether contacts that meet end flights of a chatter that the engine leaves out."""
    last = len(guards.rate) > 1
    for g in range(len(guards.rate)):
        last = last and guards.flight[g] <= LAST_FLIGHT * eq.period
        last = last and abs(guards.rate[g]) <= _LAST_SPEED * trace.speed[i - 1]
    if last:
        walk.at[COMPLETED] = 1
    return last


@counting
def _apart(room, eq, walk, trace, i, M, guards, shifts, free):
    """Return whether another event at the instant of one is apart in neighbouring motions, and in one that counts."""
    some, counts = False, False
    for g in range(len(guards.rate) if not free else 0):
        part, derivative = int(guards.part[g]), along(room, guards, g, M)
        again = g == 0 and start_of(eq, trace, i) - walk.last[0] <= _INSTANT * eq.period
        if g == 0 and not (again and walk.shifted[part]):
            continue
        for c in range(M.shape[1]):
            later = guards.rate[g] * (walk.last_shift[part, c] if g == 0 else shifts[part, c])
            terms = abs(derivative[c]) + abs(later)
            if abs(derivative[c] + later) > max(_ONE_INSTANT * terms, _NOTHING * guards.scale[g]):
                some, counts = True, counts or c >= walk.at[COUNTS]
    return some, counts


@counting
def _closings(room, eq, turns, flows, walk, trace, i, M):
    """Return the derivative after contacts that yield have begun at one instant, each by its own gap."""
    units, one, columns, z = len(eq.rest), len(eq.unit), M.shape[1], walk.z
    order, count = integers(room, units), 0
    for unit_ in range(-1, units):
        r = trace.unit[i] if unit_ < 0 else unit_
        closes = trace.state[i - 1, r] == OPEN and presses(trace.state[i, r]) and eq.spring[r] < math.inf
        if closes and (unit_ < 0 or r != trace.unit[i]):
            order[count] = r
            count += 1
    ways, rate, later = matrix(room, 2 * one, columns), vector(room, len(z)), vector(room, len(z))
    for way in range(2):
        moved, f = ways[way * one : (way + 1) * one], walk.at[FLOW]
        for k in range(one):
            for c in range(columns):
                moved[k, c] = M[k, c]
        for r in range(units):
            walk.wanted[r] = trace.state[i - 1, r]
        for n in range(count):
            contact = order[n if way == 0 else count - 1 - n]
            walk.wanted[contact] = trace.state[i, contact]
            for r in range(2 * units):
                walk.wanted_force[r] = trace.open_force[i - 1, r]
            other = find(flows, walk.wanted, walk.wanted_force)
            if other < 0:
                return M, WANTS_FLOW
            generated(flows, f, z, rate)
            generated(flows, other, z, later)
            speed, closes = dot(eq.gap[contact], rate), left_of(room, eq, turns, moved, z, contact, GAPS)
            for k in range(one):
                for c in range(columns):
                    moved[k, c] += (later[k] - rate[k]) / speed * closes[c]
            f = other
    difference = matrix(room, one, columns)
    for k in range(one):
        for c in range(columns):
            difference[k, c] = ways[k, c] - ways[one + k, c]
    if largest(room, eq, difference) > _ONE_INSTANT * largest(room, eq, ways[:one]):
        worsen(walk, COINCIDENT)
    return ways[:one], KNOWN


@kernel
def find(flows, state, open_force):
    """Return the index of the flow with units in states (u,), -1 without."""
    for f in range(len(flows.norm)):
        same = flows.counts[f, 0] > 0  # empty: none
        for r in range(len(state)):
            same = same and flows.state[f, r] == state[r]
        for r in range(len(open_force) if same else 0):
            same = same and flows.open_force[f, r] == open_force[r]
        if same:
            flows.clock[0] += 1
            flows.used[f] = flows.clock[0]
            return f
    return -1


@kernel
def set_largest(M, states, most):
    """Set most (m, 1 + P) to the largest entries of rows of a derivative (m, k + P): by the start, by each number."""
    for i in range(len(M)):
        most[i, 0] = 0.0
        for c in range(M.shape[1]):
            if c < states:
                most[i, 0] = max(most[i, 0], abs(M[i, c]))
            else:
                most[i, 1 + c - states] = abs(M[i, c])


@counting
def _still(room, eq, turns, flows, walk, trace, i, f, z, M):
    """Return the derivative without motion of rows at rest, and whether that was round-off.

    Round-off is relative to the largest derivatives so far: after a chatter has amplified these, it may be as large
    as the derivative is now.
    """
    units, one, k, P = len(eq.rest), len(eq.unit), len(eq.scale), turns.numbers
    closed, count = integers(room, units), 0
    for r in range(eq.contacts):
        closed[r] = 1 if eq.spring[r] == math.inf and presses(trace.state[i, r]) else 0
        count += closed[r]
    gaps, speeds, stuck = integers(room, count), integers(room, count + units), 0
    for r in range(units):
        if closed[r]:
            gaps[stuck] = speeds[stuck] = r
            stuck += 1
    for r in range(units):
        if flows.stuck[f, r]:
            speeds[stuck] = units + r
            stuck += 1
    now = matrix(room, one, 1 + P)
    set_largest(M, k, now)
    for j in range(one):
        for c in range(1 + P):
            # a number that hardly moves anything leaves round-off of the coordinates' sizes
            least = _LEAST_TURN * walk.size[j] if c > 0 else 0.0
            walk.reach[j, c] = max(max(walk.reach[j, c], now[j, c]), least)
    loose = False
    for kind in range(2):
        rows = speeds[:stuck] if kind == SPEEDS else gaps
        moved, most = left(room, eq, turns, M, z, rows, kind), matrix(room, len(rows), 1 + P)
        set_largest(moved, k, most)
        for a in range(len(rows)):
            functional = eq.speed[rows[a]] if kind == SPEEDS else eq.gap[rows[a]]
            for c in range(1 + P):
                terms = abs(explicit_of(turns, c - 1, rows[a], z, kind)) if c > 0 else 0.0
                of_now = terms
                for j in range(one):
                    terms += abs(functional[j]) * walk.reach[j, c]
                    of_now += abs(functional[j]) * now[j, c]
                if most[a, c] > _STILL * terms:
                    return M, False
                loose = loose or most[a, c] > _STILL * of_now
    if loose:
        return applied(room, begun(room, eq, turns, trace.state[i], closed, z), M), True
    return M, True


@counting
def check_idle(room, eq, turns, walk, trace, i, M, z):
    """Note contacts that touch without force and that neighbouring motions open or hit: they have a kink."""
    units, count = len(eq.rest), 0
    idle = integers(room, units)
    for r in range(units):
        if trace.state[i, r] == TOUCHING:
            idle[count] = r
            count += 1
    if count == 0:
        return
    # gaps and their rates, of which a contact with a force holds some
    carried = applied(room, begun(room, eq, turns, trace.state[i], pressing(room, trace.state[i]), z), M)
    for kind in range(2):
        opened = left(room, eq, turns, carried, z, idle[:count], kind)
        for a in range(count):
            size = eq.play[idle[a]] * (eq.omega if kind == SPEEDS else 1.0)
            for c in range(walk.at[COUNTS], M.shape[1]):
                if abs(opened[a, c]) > _NOTHING * size:
                    worsen(walk, GRAZING)
