"""Which closed contacts carry a force, stick, slip or let go: Coulomb's law and complementarity on accelerations.

A contact that slips has the one unknown lambda_N; one that is at rest has three: lambda_N, the share lambda_R by which
its friction stays above -mu lambda_N, and the part a_L of its slip's acceleration to the left (Glocker and Pfeiffer
1996). What the instant leaves open, as a force that has just vanished, is decided by the same problem a moment later.
"""

from __future__ import annotations

import math

from vanedamp.coupling.exact.event_functions import CHATTER
from vanedamp.coupling.exact.gap_kinematics import ROUND_OFF, SIMULTANEOUS
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, SLIP_LEFT, SLIP_RIGHT, STICK, TOUCHING
from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.numerics.linear_complementarity import solve_lemke

#: what is small beside the largest term, now and a moment later
_NOTHING, _NEXT_TO_NOTHING = 1e-9, 1e-12
#: factor of the moment after which is decided what an instant leaves open, each time that a decision is made anew
_SOONER = 0.1
#: share of the speeds in a scene that is round-off
AT_REST = 10 * ROUND_OFF
#: shares of its bound, and of its terms, by which an elongation may be short of that
_NEARLY, _DIFFERENCE = 1e-12, 1e-15
_NORMAL, _SLIP = 1, 2
#: what a contact that yields and touches without speed does
_RESTS, _PRESSED, _OPENS = 1, 2, 3
#: of a Jenkins element: its spring is at its bound, and what draws it is at rest
_AT_BOUND = 4
#: unknowns of a contact beside _NORMAL: friction to the right, to the left, and the speed that it leaves
_RIGHT, _LEFT, _SPEED = 3, 4, 5


@inlined
def row_speed(system, row, v):
    """Speed of a row, m/s."""
    total = 0.0
    for i in range(len(v)):
        total += system.J[row, i] * v[i]
    return total


@inlined
def gap(system, unit, q):
    """Gap of a contact, m."""
    return system.rest[unit] + row_speed(system, unit, q)


@inlined
def yields(system, unit):
    """Whether a unit is a contact with a spring."""
    return system.spring[unit] < math.inf


@inlined
def is_rigid(system, unit):
    """Whether a unit is a contact without a spring."""
    return unit < system.contacts and system.spring[unit] == math.inf


@inlined
def spring_force(system, unit, q, v):
    """Return the force of spring and dashpot of a closed contact, N; they never pull."""
    force = system.spring[unit] * gap(system, unit, q) + system.dashpot[unit] * row_speed(system, unit, v)
    return max(-force, 0.0)


@inlined
def least_force(system, unit):
    """Return the force of a contact that yields by the resolution of its gap, N: below, it carries nothing."""
    return SIMULTANEOUS * system.spring[unit] * system.play[unit]


@inlined
def rubs(system, unit):
    """Whether a unit has friction."""
    return unit >= system.contacts or system.friction[unit] > 0.0


@inlined
def speed_scale(system, v):
    """Largest sum of the parts of a row's speed, m/s."""
    largest = 0.0
    for row in range(len(system.J)):
        total = 0.0
        for i in range(len(v)):
            total += abs(system.J[row, i] * v[i])
        largest = max(largest, total)
    return largest


@inlined
def is_shut(system, st, unit):
    """Whether a contact's gap is zero."""
    return st.state[unit] != OPEN or gap(system, unit, st.q) <= SIMULTANEOUS * system.play[unit]


@kernel
def free_acceleration(system, work, q, v, time):
    """Accelerations (work.free) without contact forces, friction elements included, at a time within the period.

    work.terms: sizes of the terms that they are sums of.
    """
    size = len(q)
    for i in range(size):
        total, terms = system.weight[i], abs(system.weight[i])
        for h in range(len(system.frequency)):
            angle, load = system.frequency[h] * time, system.load[h, i]
            total += (load * complex(math.cos(angle), math.sin(angle))).real
            terms += abs(load.real) + abs(load.imag)
        for k in range(size):
            spring, dashpot = system.stiffness[i, k] * q[k], system.damping[i, k] * v[k]
            total -= spring + dashpot
            terms += abs(spring) + abs(dashpot)
        work.free[i], work.terms[i] = total / system.mass[i], terms / system.mass[i]
    for j in range(len(system.tangential)):
        force = system.tangential[j] * elongation(system, j, q)
        for i in range(size - len(system.tangential)):
            part = system.elongation[j, i] * force / system.mass[i]
            work.free[i] -= part
            work.terms[i] += abs(part)


@inlined
def elongation(system, j, q):
    """Return the elongation of the spring of a Jenkins element, m; of velocities, its rate."""
    total = 0.0
    for i in range(len(q)):
        total += system.elongation[j, i] * q[i]
    return total


@kernel
def follow(system, state, q, v):
    """Bring sliders to where they are: at rest, or as far behind what draws them as their springs go."""
    sliders, size = len(system.tangential), len(q)
    for j in range(sliders):
        r, a = len(system.rest) - sliders + j, size - sliders + j
        v[a] = 0.0
        if state[r] != STICK:
            way = 1.0 if state[r] == SLIP_RIGHT else -1.0
            q[a] += elongation(system, j, q) - way * system.limit[r] / system.tangential[j]
            v[a] = elongation(system, j, v)


@kernel
def _hold_sliders(system, st, work, slow):
    """Decide which sliders rest, and which what draws them moves: those whose springs are at their bounds.

    One whose spring is at its bound while what draws it is at rest is marked: its acceleration decides. Sliders that
    have moved until now are at their bounds.
    """
    sliders, size = len(system.tangential), len(st.q)
    for j in range(sliders):
        r, stretched, terms, speed = len(system.rest) - sliders + j, 0.0, 0.0, 0.0
        for i in range(size):
            part = system.elongation[j, i] * st.q[i]
            stretched += part
            terms += abs(part)
        for i in range(size - sliders):
            speed += system.elongation[j, i] * st.v[i]
        most, way = system.limit[r] / system.tangential[j], 1.0 if stretched > 0.0 else -1.0
        at_bound = abs(stretched) >= most - _NEARLY * most - _DIFFERENCE * terms
        if st.state[r] == SLIP_RIGHT or st.state[r] == SLIP_LEFT:
            at_bound, way = True, 1.0 if st.state[r] == SLIP_RIGHT else -1.0
        st.state[r], work.sliding[r], work.resting[r] = STICK, 0, 0
        if at_bound and way * speed >= -slow:
            st.state[r] = SLIP_RIGHT if way > 0.0 else SLIP_LEFT
            work.resting[r] = _AT_BOUND if way * speed <= slow else 0
    follow(system, st.state, st.q, st.v)


@kernel
def _draw_sliders(system, st, work, nothing):
    """Decide by accelerations whether what is at rest draws its slider on. Returns how many stay in doubt, drawn."""
    u, sliders, doubts = len(system.rest), len(system.tangential), 0
    for j in range(sliders):
        r, acceleration, mobility = u - sliders + j, 0.0, 0.0
        if work.resting[r] != _AT_BOUND:
            continue
        for i in range(len(st.q) - sliders):
            total = work.free[i]
            for row in range(2 * u):
                total += system.J[row, i] * work.impulse[row] / system.mass[i]
            acceleration += system.elongation[j, i] * total
            mobility += system.elongation[j, i] * system.elongation[j, i] / system.mass[i]
        acceleration *= 1.0 if st.state[r] == SLIP_RIGHT else -1.0
        if abs(acceleration) <= nothing * math.sqrt(mobility):
            doubts += 1
        else:
            work.resting[r] = 0
            st.state[r] = STICK if acceleration < 0.0 else st.state[r]
    return doubts


@kernel
def solve_rows(system, work, count, right, least, bound):
    """Solve the problem of the listed units: accelerations (or speeds) right + G forces, forces in work.impulse (2u,).

    right: (2u,) without the unknown forces; least: what they are to be measured by, at least, per root of the
    diagonal of G; bound: (u,) of friction, to which mu times the unknown normal force is added. Returns False if there
    is no solution, or none is found.
    """
    u, problem, size = len(system.rest), work.lemke, 0
    scale = least
    for p in range(count):
        r = work.listed[p]
        work.place[p] = size
        if is_rigid(system, r):
            scale = max(scale, abs(right[r]) / math.sqrt(system.delassus[r, r]))
            size += 3 if work.way[p] == 0 and system.friction[r] > 0.0 else 1
        else:
            size += 2
        if system.delassus[u + r, u + r] > 0.0:
            scale = max(scale, abs(right[u + r]) / math.sqrt(system.delassus[u + r, u + r]))
            scale = max(scale, bound[r] * math.sqrt(system.delassus[u + r, u + r]))
    for r in range(2 * u):
        work.impulse[r] = 0.0
    if size == 0:
        return True
    scale = scale if scale > 0.0 else 1.0
    _set_up(system, work, count, right, bound, scale, size)
    if not solve_lemke(problem, size, work.attempt[0]) and not _solve_split(system, work, count, size):
        return False
    for p in range(count):
        r, i = work.listed[p], work.place[p]
        contact = is_rigid(system, r)
        if contact:
            work.impulse[r] = problem.z[i] * scale / math.sqrt(system.delassus[r, r])
            if work.way[p] != 0:
                work.impulse[u + r] = -work.way[p] * system.friction[r] * work.impulse[r]
        if work.way[p] == 0 and rubs(system, r):
            low = bound[r] + (system.friction[r] * work.impulse[r] if contact else 0.0)
            share = problem.z[i + 1 if contact else i] * scale / math.sqrt(system.delassus[u + r, u + r])
            work.impulse[u + r] = share - low
    return True


@inlined
def _set_up(system, work, count, right, bound, scale, size):
    """Set up the problem (work.lemke) in numbers of size one."""
    u, problem = len(system.rest), work.lemke
    for i in range(size):
        problem.q[i] = 0.0
        for j in range(size):
            problem.matrix[i, j] = 0.0
    for p in range(count):
        r, i = work.listed[p], work.place[p]
        contact = is_rigid(system, r)
        at_rest = work.way[p] == 0 and rubs(system, r)
        normal = 1.0 / math.sqrt(system.delassus[r, r]) if contact else 0.0
        slip = 1.0 / math.sqrt(system.delassus[u + r, u + r]) if at_rest else 0.0
        first = i + 1 if contact else i  # the unknown of the friction to the right
        if contact:
            problem.q[i] = _loaded(system, work, count, right, bound, r) * normal / scale
        if at_rest:
            problem.q[first] = _loaded(system, work, count, right, bound, u + r) * slip / scale
            problem.matrix[first, first + 1] += 1.0
            problem.matrix[first + 1, first] -= 1.0
            problem.q[first + 1] = 2.0 * bound[r] / (slip * scale)
            if contact:
                problem.matrix[first + 1, i] += 2.0 * system.friction[r] * normal / slip
        for o in range(count):
            c, j = work.listed[o], work.place[o]
            other = is_rigid(system, c)
            free = work.way[o] == 0 and rubs(system, c)
            if other:
                weight = 1.0 / math.sqrt(system.delassus[c, c])
                drag = -system.friction[c] * (1.0 if free else float(work.way[o]))
                if contact:
                    part = system.delassus[r, c] + drag * system.delassus[r, u + c]
                    problem.matrix[i, j] += normal * weight * part
                if at_rest:
                    part = system.delassus[u + r, c] + drag * system.delassus[u + r, u + c]
                    problem.matrix[first, j] += slip * weight * part
            if free:
                k = j + 1 if other else j
                weight = 1.0 / math.sqrt(system.delassus[u + c, u + c])
                if contact:
                    problem.matrix[i, k] += normal * weight * system.delassus[r, u + c]
                if at_rest:
                    problem.matrix[first, k] += slip * weight * system.delassus[u + r, u + c]


@kernel
def _solve_split(system, work, count, size):
    """Solve the problem that is set up (work.lemke) by splitting each friction force in two, to the right and left.

    In this form, with an unknown more, Lemke's method finds a solution wherever the right-hand sides of contacts that
    do not slip yet are speeds or accelerations of one motion (Stewart and Trinkle 1996; Anitescu and Potra 1997); in
    the other not always. Returns False if it finds none.
    """
    one, two, part, of = work.lemke, work.split, work.part, work.column
    many = 0
    for p in range(count):
        r, i = work.listed[p], work.place[p]
        if is_rigid(system, r):
            part[many], of[many] = _NORMAL, i
            many += 1
            i += 1
        if work.way[p] == 0 and rubs(system, r):
            for kind in (_RIGHT, _LEFT, _SPEED):
                part[many], of[many] = kind, i
                many += 1
    for a in range(many):
        row, way = of[a], -1.0 if part[a] == _LEFT else 1.0
        if part[a] == _SPEED:
            two.q[a] = 0.5 * one.q[row + 1]
        else:
            two.q[a] = one.q[row]
            for b in range(many):
                if part[b] == _SPEED:
                    two.q[a] += 0.5 * one.matrix[row, of[b]] * one.q[of[b] + 1]
            two.q[a] *= way
        for b in range(many):
            column, total = of[b], 0.0
            if part[a] == _SPEED:
                if part[b] == _NORMAL:
                    total = 0.5 * one.matrix[row + 1, column]
                elif (part[b] == _RIGHT or part[b] == _LEFT) and column == row:
                    total = -1.0
            elif part[b] == _SPEED:
                total = 1.0 if column == row and part[a] != _NORMAL else 0.0
            else:
                total = one.matrix[row, column]
                if part[b] == _NORMAL and b + 1 < many and part[b + 1] == _RIGHT:
                    # without the friction at its lower bound
                    total += 0.5 * one.matrix[column + 2, column] * one.matrix[row, column + 1]
                total *= -way if part[b] == _LEFT else way
            two.matrix[a, b] = total
    if not solve_lemke(two, many, 0):
        return False
    for a in range(many):
        if part[a] == _NORMAL:
            one.z[of[a]], one.w[of[a]] = two.z[a], two.w[a]
    for a in range(many):
        if part[a] == _SPEED:
            first = of[a]
            bound = two.q[a]
            if a >= 3 and part[a - 3] == _NORMAL:
                bound += two.matrix[a, a - 3] * two.z[a - 3]
            one.z[first] = max(bound + two.z[a - 2] - two.z[a - 1], 0.0)
            one.w[first + 1] = max(bound - two.z[a - 2] + two.z[a - 1], 0.0)
    for a in range(many):
        if part[a] == _SPEED:
            first, speed = of[a], one.q[of[a]]
            for j in range(size):
                if j != first + 1:
                    speed += one.matrix[first, j] * one.z[j]
            # to the left as far as the friction is at its right bound
            one.w[first], one.z[first + 1] = max(speed, 0.0), max(-speed, 0.0)
    return True


@inlined
def _loaded(system, work, count, right, bound, row):
    """What a row has without the unknowns: friction counts from its lower bound."""
    u, total = len(system.rest), right[row]
    for p in range(count):
        c = work.listed[p]
        if bound[c] > 0.0:
            total -= system.delassus[row, u + c] * bound[c]
    return total


@kernel
def _judge(system, st, work, count, terms, nothing):
    """Decide the states of the listed units (work.verdict) by accelerations (work.speed). False if none are possible.

    Lemke's method need not find forces of contacts that slip. Over a short step in which they might stop it does: the
    slips become parts of the accelerations that remain to be stopped. Its forces are those of the instant if no
    contact that presses stops; if one does, none are found, and the slip ends by impulses (impacts.jam).
    """
    u = len(system.rest)
    if solve_rows(system, work, count, work.speed, terms, work.bound):
        _classify(system, work, count, nothing)
        return True
    moment, possible = CHATTER * system.period, True
    for p in range(count):
        work.slips[p] = work.way[p]
        if work.way[p] != 0:
            work.speed[u + work.listed[p]] += row_speed(system, u + work.listed[p], st.v) / moment
            work.way[p] = 0
    if not solve_rows(system, work, count, work.speed, terms, work.bound):
        return False
    _classify(system, work, count, nothing)
    for p in range(count):
        if work.slips[p] != 0:
            same = work.verdict[p] == (SLIP_RIGHT if work.slips[p] > 0 else SLIP_LEFT)
            possible = possible and (same or work.verdict[p] >= OPEN)
            work.way[p] = work.slips[p]
    return possible


@kernel
def _classify(system, work, count, nothing):
    """States (work.verdict) of the listed units from the solution, and what it leaves open (work.doubtful)."""
    problem = work.lemke
    for p in range(count):
        r, i = work.listed[p], work.place[p]
        work.doubtful[p] = 0
        contact = is_rigid(system, r)
        if contact and problem.z[i] <= nothing:
            work.verdict[p] = OPEN if problem.w[i] > nothing else TOUCHING
            work.doubtful[p] = _NORMAL if problem.w[i] <= nothing else 0
        elif work.way[p] != 0:
            work.verdict[p] = SLIP_RIGHT if work.way[p] > 0 else SLIP_LEFT
        elif contact and system.friction[r] == 0.0:
            work.verdict[p] = SLIP_RIGHT
        else:
            first = i + 1 if contact else i
            # a spring without force has no friction: both bounds are one, and the acceleration tells
            left = problem.w[first + 1] <= nothing and problem.z[first + 1] > nothing
            if problem.z[first] <= nothing and not left:
                work.verdict[p] = SLIP_RIGHT
                work.doubtful[p] = _SLIP if problem.w[first] <= nothing else 0
            elif problem.w[first + 1] <= nothing:
                work.verdict[p] = SLIP_LEFT
                work.doubtful[p] = _SLIP if problem.z[first + 1] <= nothing else 0
            else:
                work.verdict[p] = STICK


@entry
def decide(system, st, work, scale):
    """Decide the state of every unit at st.q, st.v. Returns False if the problem cannot be solved.

    scale: the speeds in the scene, m/s, whose round-off counts as rest.
    """
    u, count = len(system.rest), 0
    sliders = len(system.tangential)
    if sliders > 0:
        _hold_sliders(system, st, work, AT_REST * scale)
    for r in range(u - sliders):
        work.sliding[r], work.resting[r] = 0, 0
        slip = row_speed(system, u + r, st.v)
        way = 0 if abs(slip) <= AT_REST * scale else (1 if slip > 0.0 else -1)
        if yields(system, r):
            if not _is_pressed(system, st, work, r, AT_REST * scale):
                continue
            if way != 0 or not rubs(system, r):
                st.state[r] = SLIP_LEFT if way < 0 and rubs(system, r) else SLIP_RIGHT
                work.sliding[r] = way if rubs(system, r) else 0
                continue
            st.state[r] = STICK
        elif r >= system.contacts:
            if way != 0:
                st.state[r] = SLIP_RIGHT if way > 0 else SLIP_LEFT
                work.sliding[r] = way
                continue
        elif not is_shut(system, st, r) or row_speed(system, r, st.v) > AT_REST * scale:
            st.state[r] = OPEN
            continue
        work.listed[count], work.way[count] = r, way if rubs(system, r) else 0
        count += 1
    terms = loaded_acceleration(system, st, work, st.q, st.v, st.time[0])
    if not _judge(system, st, work, count, terms, _NOTHING):
        return False
    doubts = _press_or_open(system, work, count, _NOTHING * terms)
    if sliders > 0:
        doubts += _draw_sliders(system, st, work, _NOTHING * terms)
    for p in range(count):
        doubts += work.doubtful[p]
    if doubts > 0:
        if not _look_ahead(system, st, work, count):
            return False
        _stick_in_doubt(system, work, count)
    if sliders > 0:
        follow(system, st.state, st.q, st.v)
    for r in range(u):
        st.other[r] = st.state[r]
    for p in range(count):
        r = work.listed[p]
        st.state[r], st.other[r] = work.verdict[p], work.verdict[p]
        if doubts > 0 and work.doubtful[p] == _SLIP and _may_stick(system, work, p):
            st.state[r] = STICK
    for r in range(u):
        if work.resting[r] == _OPENS or work.resting[r] == _RESTS:
            st.state[r] = OPEN if work.resting[r] == _OPENS else TOUCHING
            st.other[r] = st.state[r]
        if work.resting[r] == _PRESSED or work.resting[r] == _RESTS:
            _rest(system, st, r)
        st.fresh[r] = 1
    return True


@inlined
def _rest(system, st, r):
    """Take the round-off of its speed from a contact that touches without speed: its force would end as it begins."""
    speed = row_speed(system, r, st.v)
    if speed != 0.0:
        for i in range(len(st.v)):
            st.v[i] -= system.J[r, i] / system.mass[i] * speed / system.delassus[r, r]


@inlined
def _is_pressed(system, st, work, r, slow):
    """Whether a contact that yields is closed, for all that its gap and speed tell.

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
        work.resting[r] = _RESTS
    return True


@kernel
def _press_or_open(system, work, count, nothing):
    """Decide by accelerations whether contacts that touch without speed are pressed. Returns how many stay in doubt."""
    u, doubts = len(system.rest), 0
    for r in range(system.contacts):
        if work.resting[r] == _RESTS:
            acceleration = work.speed[r]
            for row in range(2 * u):
                acceleration += system.delassus[r, row] * work.impulse[row]
            least = least_force(system, r) * system.delassus[r, r]
            if abs(acceleration) <= max(nothing * math.sqrt(system.delassus[r, r]), least):
                doubts += 1
            else:
                work.resting[r] = _PRESSED if acceleration < 0.0 else _OPENS
    for p in range(count):
        if work.resting[work.listed[p]] == _OPENS:
            work.verdict[p], work.doubtful[p] = OPEN, 0
    return doubts


@inlined
def loaded_acceleration(system, st, work, q, v, time):
    """Accelerations of the rows (work.speed) without unknown forces: with those of springs, and of units that slide.

    Sets the bounds of friction that are known (work.bound). Returns the size of the terms that accelerations are sums
    of, per root of the diagonal of G: what is far below is round-off.
    """
    u = len(system.rest)
    free_acceleration(system, work, q, v, time)
    for r in range(u):
        work.bound[r] = system.limit[r]
        if yields(system, r) and st.state[r] < OPEN:
            force = spring_force(system, r, q, v)
            if work.resting[r] == _RESTS and force <= least_force(system, r):
                force = 0.0  # it would press others
            work.bound[r] = system.friction[r] * force
            for i in range(len(q)):
                part = system.J[r, i] * force / system.mass[i]
                work.free[i] += part
                work.terms[i] += abs(part)
        if work.sliding[r] != 0:
            for i in range(len(q)):
                work.free[i] -= work.sliding[r] * work.bound[r] * system.J[u + r, i] / system.mass[i]
    largest = 0.0
    for r in range(2 * u):
        work.speed[r] = row_speed(system, r, work.free)
        terms = 0.0
        for i in range(len(q)):
            terms += abs(system.J[r, i]) * work.terms[i]
        if system.delassus[r, r] > 0.0:
            largest = max(largest, terms / math.sqrt(system.delassus[r, r]))
    return largest


@kernel
def _look_ahead(system, st, work, count):
    """Decide what was left open by the accelerations a moment later. Returns False if that cannot be solved.

    Where forces have only begun, they may all be others after that moment: a decision made anew looks less far ahead.
    """
    u, size = len(system.rest), len(st.q)
    for i in range(size):
        work.ahead[1, i] = work.free[i]
        for r in range(2 * u):
            work.ahead[1, i] += system.J[r, i] * work.impulse[r] / system.mass[i]
    moment = _before_end(system, st, work, count, work.ahead[1], system.moment * _SOONER ** work.attempt[0])
    for i in range(size):
        total = work.ahead[1, i]
        work.ahead[0, i] = st.q[i] + moment * (st.v[i] + 0.5 * moment * total)
        work.ahead[1, i] = st.v[i] + moment * total
    if len(system.tangential) > 0:
        follow(system, st.state, work.ahead[0], work.ahead[1])
    for p in range(count):
        work.first[p], work.doubt[p] = work.verdict[p], work.doubtful[p]
    terms = loaded_acceleration(system, st, work, work.ahead[0], work.ahead[1], st.time[0] + moment)
    if not _judge(system, st, work, count, terms, _NEXT_TO_NOTHING):
        return False
    # which of contacts that depend on each other carry the force is decided for all of them together
    carriers = False
    for p in range(count):
        carriers = carriers or work.doubt[p] == _NORMAL
    for p in range(count):
        sure = work.doubt[p] == 0 or (work.doubt[p] == _SLIP and work.verdict[p] >= OPEN)
        if sure and not (carriers and (work.verdict[p] == TOUCHING or work.attempt[0] > 0)):
            work.verdict[p], work.doubtful[p] = work.first[p], work.doubt[p]
    _press_or_open(system, work, count, _NEXT_TO_NOTHING * terms)
    if len(system.tangential) > 0:
        _draw_sliders(system, st, work, _NEXT_TO_NOTHING * terms)
    return True


@inlined
def _before_end(system, st, work, count, acceleration, moment):
    """Return the moment, or a shorter one in which no contact that yields ends whose slip is in doubt: without force
    there is nothing to decide."""
    for p in range(count):
        r = work.listed[p]
        if yields(system, r) and work.doubtful[p] == _SLIP and work.resting[r] == 0:
            force, speed = spring_force(system, r, st.q, st.v), row_speed(system, r, st.v)
            falls = system.spring[r] * speed + system.dashpot[r] * row_speed(system, r, acceleration)
            if force > least_force(system, r) and falls * moment > 0.5 * force:
                moment = 0.5 * force / falls
    return moment


@kernel
def _stick_in_doubt(system, work, count):
    """Let contacts stick whose friction is at its bound though nothing moves them, unless others hold their slip.

    Both corners of a block that lies still may push against each other. Where others hold its slip, a force at the
    bound is one of the possible ones (st.other); contacts share the force as long as none of them needs more than its
    bound (automaton._shares).
    """
    u, found = len(system.rest), 0
    for p in range(count):
        r = work.listed[p]
        if work.verdict[p] < OPEN and is_rigid(system, r):
            found = span(system, work, r, found)
    for p in range(count):
        if work.verdict[p] == STICK:
            found = span(system, work, u + work.listed[p], found)
    for p in range(count):
        r = work.listed[p]
        if work.doubtful[p] == _SLIP and _may_stick(system, work, p):
            more = span(system, work, u + r, found)
            if more > found:
                work.verdict[p], found = STICK, more


@inlined
def _may_stick(system, work, p):
    """Whether a listed unit that counts as slipping has friction and no slip."""
    r = work.listed[p]
    slips = work.verdict[p] == SLIP_RIGHT or work.verdict[p] == SLIP_LEFT
    return slips and work.way[p] == 0 and rubs(system, r)


@kernel
def span(system, work, row, found):
    """Add a row to the orthonormal basis of those that are kept. Returns its size, the same if they hold the row."""
    size, whole, left = len(system.mass), 0.0, 0.0
    if found >= size:
        return found
    new = work.span[found]
    for i in range(size):
        new[i] = system.J[row, i] / math.sqrt(system.mass[i])
        whole += new[i] * new[i]
    for _ in range(2):
        for k in range(found):
            part = 0.0
            for i in range(size):
                part += work.span[k, i] * new[i]
            for i in range(size):
                new[i] -= part * work.span[k, i]
    for i in range(size):
        left += new[i] * new[i]
    if left <= _NOTHING * whole:
        return found
    for i in range(size):
        new[i] /= math.sqrt(left)
    return found + 1
