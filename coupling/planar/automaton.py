"""The loop from event to event of bodies with extent: flow, first event, impact, decision; energies of all of it."""

from __future__ import annotations

import math

from vanedamp.coupling.exact.event_functions import ENDLESS
from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.numerics.codes import (
    ACCURACY_LOST,
    AT_HIGH,
    AT_LOW,
    AT_ONCE,
    CLOSES,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    ILL_CONDITIONED,
    LEAVING,
    LOGGED,
    NEEDS_FLOW,
    OPEN,
    OPENS,
    PARTS,
    PAUSED,
    PERIOD,
    RECLOSES,
    SLIP_LEFT,
    SLIP_RIGHT,
    STICK,
    STOPS,
    TOUCHING,
    UNDECIDED,
)
from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.planar.contact_decisions import (
    AT_REST,
    decide,
    elongation,
    follow,
    gap,
    is_rigid,
    is_shut,
    least_force,
    row_speed,
    rubs,
    speed_scale,
    spring_force,
    yields,
)
from vanedamp.coupling.planar.event_functions import next_event
from vanedamp.coupling.planar.impacts import collide, jam, log_event, note_impact
from vanedamp.coupling.planar.quadrature import add_up, motion_at, response_at
from vanedamp.coupling.planar.recorder import put_sample, record_section
from vanedamp.coupling.response.records import CONTACT, DETACHES, IMPACT_LOSS, RESTS, SLIPS, STICKS

#: overlap, as a share of the play, beyond which round-off has lost a contact
_LOST = 1e-7
#: gap, as a share of the play, below which round-off may tell whether it is shut
_CLOSE = 1e-11
#: events at one instant after which contacts are said to be undecided, for each unit
_AT_ONCE = 20
#: segments after which a run returns to Python, which sees interrupts
_SLICE = 4096
#: events at one instant after which a decision that repeats itself is made anew, for each unit
_REPEATED = 4
#: how often a decision is made anew where its forces break their laws
_ATTEMPTS = 4
_TINY = 1e-150
#: share of its terms that a force may be beyond its bound
_OVER = 1e-9
#: share of all forces by which one may break its law
_BROKEN = 1e-6
#: share of the play that is round-off of a gap, over the share by which a force may break its law
_ROUGH = 1e-6


@entry
def begin(system, st, rec, log, work):
    """Let contacts collide that are closed and approach at time zero, and decide their states. False if that fails."""
    _phase(system, st)
    st.scale[0] = max(speed_scale(system, st.v), system.speed)
    if _approaches(system, st) and not collide(system, st, rec, log, work):
        return False
    _press(system, st, rec, log)
    if not _settle(system, st, rec, log, work):
        return False
    st.counters[FLOW] = -1
    return True


@entry
def advance(system, flows, st, guards, rec, log, work, periods, max_events):
    """Advance to the end of `periods`. Returns a code."""
    segments = 0
    while st.counters[PERIOD] < periods:
        if st.counters[FLOW] < 0:
            s = _find(flows, st)
            if s < 0:
                return NEEDS_FLOW
            st.counters[FLOW] = s
            _enter(system, flows, st)
            _begin_segment(system, flows, st)
            shared = _shares(system, flows, st)
            if not shared and (work.attempt[0] == 0 or not _holds_prestressed(system, flows, st, work)):
                for r in range(len(st.state)):
                    st.state[r] = st.other[r]
                st.counters[FLOW] = -1
                continue
            if shared and not _holds(system, flows, st) and not _holds_prestressed(system, flows, st, work):
                work.attempt[0] += 1
                if work.attempt[0] > _ATTEMPTS or not decide(system, st, work, st.scale[0]):
                    return UNDECIDED
                st.counters[FLOW] = -1
                continue
            work.attempt[0] = 0
            _log_changes(system, flows, st, log)
        else:
            _begin_segment(system, flows, st)
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if segments == _SLICE or st.counters[LOGGED] + 4 * len(system.rest) >= len(log):
            return PAUSED
        segments += 1
        if st.counters[PERIOD] == 0 and st.time[0] == 0.0:
            record_section(system, st, rec, _spring_energy(system, st))
        tau, who = next_event(system, flows, st, guards)
        if who == ENDLESS:
            return ILL_CONDITIONED
        if tau > 0.0:
            add_up(system, flows, st, rec, work, tau)
            _sample(system, flows, st, rec, work, tau)
            motion_at(system, flows, st, work, tau, work.ahead[0], work.ahead[1])
            for i in range(len(st.q)):
                st.q[i], st.v[i] = work.ahead[0, i], work.ahead[1, i]
            for r in range(len(st.fresh)):
                st.fresh[r] = 0
            st.counters[AT_ONCE] = 0
        if who == -2:
            st.time[0] += tau
            _phase(system, st)
            segments = _SLICE
            continue
        if who < 0:
            st.counters[PERIOD] += 1
            st.time[0] = 0.0
            for r in range(len(st.last_impact)):
                st.last_impact[r] -= system.period
            _phase(system, st)
            _snap(system, flows, st, st.counters[FLOW])
            record_section(system, st, rec, _spring_energy(system, st))
            continue
        st.counters[EVENTS] += 1
        st.counters[AT_ONCE] += 1
        work.attempt[0] = st.counters[AT_ONCE] // (_REPEATED * len(system.rest))
        st.time[0] += tau
        _phase(system, st)
        if st.counters[AT_ONCE] > _AT_ONCE * len(system.rest):
            return UNDECIDED
        if guards.what[who] == CLOSES and _is_close(system, st):
            _snap(system, flows, st, st.counters[FLOW])
        if not _happen(system, st, rec, log, work, guards.unit[who], guards.what[who]):
            return UNDECIDED
        if not _inside(system, st):
            return ACCURACY_LOST
    return DONE


@inlined
def _approaches(system, st):
    """Whether a contact that is closed approaches, by more than round-off."""
    for r in range(system.contacts):
        if is_rigid(system, r) and is_shut(system, st, r) and row_speed(system, r, st.v) < -AT_REST * st.scale[0]:
            return True
    return False


@inlined
def _is_close(system, st):
    """Whether an open contact is so close that round-off of the closed ones may decide whether it is shut, too.

    The other corner of a face that lands flat is off by what a body has turned against the wall that holds it.
    """
    for r in range(system.contacts):
        if st.state[r] == OPEN:
            part = gap(system, r, st.q) / system.play[r]
            if SIMULTANEOUS < part <= _CLOSE:
                return True
    return False


@kernel
def _press(system, st, rec, log):
    """Begin the contacts that yield, are closed and approach."""
    for r in range(system.contacts):
        touches = yields(system, r) and (st.state[r] == OPEN or st.state[r] == TOUCHING)
        if touches and gap(system, r, st.q) <= SIMULTANEOUS * system.play[r]:
            speed = row_speed(system, r, st.v)
            if speed < -AT_REST * st.scale[0]:
                st.state[r] = SLIP_RIGHT  # decided next
                st.pushed[r], st.pushed[len(system.rest) + r], st.lost[r] = 0.0, 0.0, 0.0
                note_impact(system, st, rec, log, r, speed, 0.0, 0.0, 0.0, 0.0)


@kernel
def _part(system, st, log, r):
    """End a contact that yields as its force vanishes: what its spring still holds is lost."""
    u, shift, speed = len(system.rest), gap(system, r, st.q), row_speed(system, r, st.v)
    left = 0.5 * system.spring[r] * shift * shift
    st.ledger[CONTACT] += left
    parts = shift < -SIMULTANEOUS * system.play[r] and speed > AT_REST * st.scale[0]
    st.state[r] = LEAVING if system.dashpot[r] > 0.0 and parts else OPEN
    if st.state[r] == OPEN:
        _close(system, st, r)
    log_event(system, st, log, DETACHES, r, 0.0, speed, st.pushed[r], st.pushed[u + r], st.lost[r] + left)


@inlined
def _is_spent(system, st, r):
    """Whether the force of a contact that yields has vanished, but for round-off of its gap, and it parts.

    Its friction is at both of its bounds there, and round-off would tell which of them, or its end, comes first.
    """
    spent = spring_force(system, r, st.q, st.v) <= least_force(system, r)
    return spent and row_speed(system, r, st.v) > AT_REST * st.scale[0]


@kernel
def _part_spent(system, st, log, r, what):
    """End the other contacts whose forces vanish as good as at the event of unit r: their round-off may pull."""
    for i in range(system.contacts):
        presses = yields(system, i) and st.state[i] < OPEN and st.fresh[i] == 0 and not (what == RECLOSES and i == r)
        if presses and _is_spent(system, st, i):
            _part(system, st, log, i)


@inlined
def _happen(system, st, rec, log, work, r, what):
    """The event of unit r. Returns False if it cannot be decided."""
    st.scale[0] = max(st.scale[0], speed_scale(system, st.v))
    for i in range(len(system.rest)):
        work.before[i] = st.state[i]
    if what == CLOSES:
        _close(system, st, r)
    elif yields(system, r) and (what == PARTS or ((what == AT_LOW or what == AT_HIGH) and _is_spent(system, st, r))):
        _part(system, st, log, r)
    elif what == OPENS:
        st.state[r] = OPEN
        _close(system, st, r)
    elif what == RECLOSES:
        st.state[r] = SLIP_RIGHT  # decided next; the ledger has taken the energy that the spring has
        st.ledger[CONTACT] -= 0.5 * system.spring[r] * gap(system, r, st.q) ** 2
    elif r >= len(system.rest) - len(system.tangential) and (what == AT_LOW or what == AT_HIGH):
        st.state[r] = SLIP_RIGHT if what == AT_LOW else SLIP_LEFT  # decided next: its spring is at its bound
    elif what == STOPS and r < len(system.rest) - len(system.tangential):
        # what the resolution of time leaves of its slip is rest
        st.scale[0] = max(st.scale[0], abs(row_speed(system, len(system.rest) + r, st.v)) / AT_REST)
    _part_spent(system, st, log, r, what)
    # at any event another gap may be closed as well, within the resolution of gaps
    if _approaches(system, st) and not collide(system, st, rec, log, work):
        return False
    _press(system, st, rec, log)
    if not _settle(system, st, rec, log, work):
        return False
    own = yields(system, r) or system.contacts <= r < len(system.rest) - len(system.tangential)
    if own and (what == AT_LOW or what == AT_HIGH) and work.attempt[0] > 0 and st.state[r] == STICK:
        # again and again: the decision's force is short of its known bound by round-off, that of the motion is not
        st.state[r] = SLIP_RIGHT if what == AT_LOW else SLIP_LEFT
        st.other[r] = st.state[r]
    for i in range(len(system.rest)):
        changed = work.before[i] != st.state[i] or st.other[i] != st.state[i]
        if changed or st.prestress[i] != 0.0 or st.prestress[len(system.rest) + i] != 0.0:
            st.counters[FLOW] = -1
    return True


@kernel
def _settle(system, st, rec, log, work):
    """Decide the states, if no forces are possible after the impulses that stop what slips. False if that fails."""
    for _ in range(len(system.rest) + 1):
        if decide(system, st, work, st.scale[0]):
            return True
        if not jam(system, st, rec, log, work):
            return False
    return False


@kernel
def _log_changes(system, flows, st, log):
    """Log which units have changed their states."""
    u = len(system.rest)
    for i in range(u):
        was, now = st.known[i], st.state[i]
        if (now == SLIP_RIGHT or now == SLIP_LEFT) and flows.held[st.counters[FLOW], i] and rubs(system, i):
            now = STICK  # its force is at its bound, but others hold it
        st.known[i] = now
        if is_rigid(system, i) and was == OPEN and now != OPEN:
            log_event(system, st, log, RESTS, i, 0.0, 0.0, 0.0, 0.0, 0.0)
        elif is_rigid(system, i) and was != OPEN and now == OPEN:
            log_event(system, st, log, DETACHES, i, 0.0, row_speed(system, i, st.v), 0.0, 0.0, 0.0)
        elif now == STICK and (was == SLIP_RIGHT or was == SLIP_LEFT):
            log_event(system, st, log, STICKS, i, 0.0, 0.0, 0.0, 0.0, 0.0)
        elif was == STICK and (now == SLIP_RIGHT or now == SLIP_LEFT):
            log_event(system, st, log, SLIPS, i, 0.0, row_speed(system, u + i, st.v), 0.0, 0.0, 0.0)


@kernel
def _close(system, st, r):
    """Shift the unit's body by what round-off has left of its gap: the contact is closed, exactly."""
    error, square = gap(system, r, st.q), 0.0
    for i in range(len(st.q)):
        square += system.J[r, i] * system.J[r, i] / system.mass[i]
    for i in range(len(st.q)):
        st.q[i] -= system.J[r, i] / system.mass[i] * error / square


@inlined
def _find(flows, st):
    for s in range(len(flows.modes)):
        same = flows.modes[s] > 0
        for r in range(len(st.state)):
            if not same:
                break
            same = flows.key[s, r] == st.state[r]
        if same:
            return s
    return -1


@kernel
def _enter(system, flows, st):
    """Stop what the contacts hold, and enter what that takes from the motion."""
    s, size, loss = st.counters[FLOW], len(st.q), 0.0
    for r in range(len(st.prestress)):
        st.prestress[r] = 0.0
    size -= len(system.tangential)  # sliders have no mass
    for i in range(size):
        loss += 0.5 * system.mass[i] * st.v[i] * st.v[i]
    _snap(system, flows, st, s)
    for i in range(size):
        loss -= 0.5 * system.mass[i] * st.v[i] * st.v[i]
    st.ledger[IMPACT_LOSS] += loss


@inlined
def _snap(system, flows, st, s):
    """Bring back gaps, and speeds of rows at rest, from round-off to zero."""
    u, size = len(system.rest), len(st.q)
    for r in range(2 * u):
        st.rate[r] = row_speed(system, r, st.v) if _at_rest(system, st, r) else 0.0
    for r in range(2 * u):
        if st.rate[r] != 0.0:
            for i in range(size):
                st.v[i] -= flows.snap_rate[s, i, r] * st.rate[r]
    for r in range(system.contacts):
        st.rate[r] = gap(system, r, st.q) if is_rigid(system, r) and st.state[r] != OPEN else 0.0
    for r in range(system.contacts):
        if st.rate[r] != 0.0:
            for i in range(size):
                st.q[i] -= flows.snap[s, i, r] * st.rate[r]
    for i in range(size):  # the smallest doubles are slow
        st.q[i] = st.q[i] if abs(st.q[i]) > _TINY else 0.0
        st.v[i] = st.v[i] if abs(st.v[i]) > _TINY else 0.0
    if len(system.tangential) > 0:
        follow(system, st.state, st.q, st.v)


@inlined
def _at_rest(system, st, row):
    """Whether contacts hold a row: the gap of a closed contact, the slip of one that sticks."""
    u = len(system.rest)
    return st.state[row] != OPEN and is_rigid(system, row) if row < u else st.state[row - u] == STICK


@kernel
def _shares(system, flows, st):
    """Whether no contact needs to pull, and none that sticks more than its bound, where some could do with less.

    Now and right after. The normal forces may be others too, and with them friction elsewhere: what begins to slip, or
    to part, must still do so.
    """
    u, differs = len(system.rest), False
    for r in range(u):
        differs = differs or st.state[r] != st.other[r]
    if not differs:
        return True
    for r in range(u - len(system.tangential)):
        if is_rigid(system, r) and st.state[r] < OPEN and _is_beyond(system, flows, st, r, 1.0, 0.0):
            return False
        if st.state[r] == STICK:
            for way in (-1.0, 1.0):
                if _is_beyond(system, flows, st, r, system.friction[r], way):
                    return False
        elif st.state[r] == OPEN and _rests_open(system, st, r):
            if _turns_back(system, flows, st, r, 1.0):
                return False
        elif (st.state[r] == SLIP_RIGHT or st.state[r] == SLIP_LEFT) and not flows.held[st.counters[FLOW], r]:
            starts = abs(row_speed(system, u + r, st.v)) <= AT_REST * st.scale[0]
            way = 1.0 if st.state[r] == SLIP_RIGHT else -1.0
            if starts and rubs(system, r) and _turns_back(system, flows, st, u + r, way):
                return False
    return True


@kernel
def _holds(system, flows, st):
    """Whether the forces obey their laws as a flow begins: no contact pulls, friction stays within its bound.

    A decision that has mistaken the forces of contacts that depend on each other is found here, and is no answer.
    """
    s, u, largest = st.counters[FLOW], len(system.rest), 0.0
    for r in range(system.contacts):
        if yields(system, r) and st.state[r] < OPEN:  # round-off of its gap
            largest = max(largest, _ROUGH * system.spring[r] * system.play[r])
    for check in range(2):
        for r in range(u):
            normal, slip, size = st.force[r], st.force[u + r], abs(st.force[r]) + abs(st.force[u + r])
            for j in range(flows.modes[s]):
                push, drag = flows.force[s, r, j] * st.amplitude[j], flows.force[s, u + r, j] * st.amplitude[j]
                normal, slip = normal + push.real, slip + drag.real
                size += abs(push.real) + abs(push.imag) + abs(drag.real) + abs(drag.imag)
            if check == 0:
                largest = max(largest, size)
            elif r < system.contacts and st.state[r] < OPEN and normal < -_BROKEN * largest:
                return False
            elif st.state[r] == STICK:
                bound = system.friction[r] * normal if r < system.contacts else system.limit[r]
                if rubs(system, r) and abs(slip) > bound + _BROKEN * largest:
                    return False
    return True


@kernel
def _holds_prestressed(system, flows, st, work):
    """Let contacts that depend on each other have the forces of the decision. Returns whether those obey their laws.

    Without it they have the least ones, which may pull, or exceed the friction, where others would do.
    """
    s, many = st.counters[FLOW], len(st.force)
    for r in range(many):
        work.speed[r] = work.impulse[r] - st.force[r]
        for j in range(flows.modes[s]):
            work.speed[r] -= (flows.force[s, r, j] * st.amplitude[j]).real
    for r in range(many):
        st.prestress[r] = 0.0
        for k in range(many):
            st.prestress[r] += flows.self_stress[s, r, k] * work.speed[k]
        st.force[r] += st.prestress[r]
    return _holds(system, flows, st)


@inlined
def _rests_open(system, st, r):
    """Whether the gap of an open contact is zero and stays so but for accelerations."""
    return is_shut(system, st, r) and abs(row_speed(system, r, st.v)) <= AT_REST * st.scale[0]


@inlined
def _turns_back(system, flows, st, row, way):
    """Whether a row at rest accelerates against its way, now or right after."""
    s, total, rate, size = st.counters[FLOW], 0.0, 0.0, 0.0
    for i in range(len(st.q)):
        part = system.J[row, i] * st.bend[i]
        total += part
        size += abs(part)
    for j in range(flows.modes[s]):
        eigenvalue = flows.eigenvalue[s, j]
        part = flows.rows[s, row, j] * st.amplitude[j] * eigenvalue * eigenvalue
        total += part.real
        size += abs(part.real) + abs(part.imag)
        rate += (part * eigenvalue).real
    return way * total < -_OVER * size or (way * total <= _OVER * size and way * rate < 0.0)


@inlined
def _is_beyond(system, flows, st, r, on_normal, on_slip):
    """Whether the limit, and the forces of both rows of a unit times these factors, are negative, or become so."""
    s, u, rate = st.counters[FLOW], len(system.rest), 0.0
    room = system.limit[r] + on_normal * st.force[r] + on_slip * st.force[u + r]
    size = system.limit[r] + abs(on_normal * st.force[r]) + abs(on_slip * st.force[u + r])
    for j in range(flows.modes[s]):
        part = (on_normal * flows.force[s, r, j] + on_slip * flows.force[s, u + r, j]) * st.amplitude[j]
        room += part.real
        rate += (part * flows.eigenvalue[s, j]).real
        size += abs(part.real) + abs(part.imag)
    return room < -_OVER * size or (room <= _OVER * size and rate < 0.0)


@inlined
def _phase(system, st):
    for h in range(len(system.frequency)):
        angle = system.frequency[h] * st.time[0]
        st.amplitude[h] = complex(math.cos(angle), math.sin(angle))


@kernel
def _begin_segment(system, flows, st):
    """Amplitudes of the modes, constant accelerations and forces, from the state."""
    s, size, e = st.counters[FLOW], len(st.q), len(system.frequency)
    _snap(system, flows, st, s)
    for j in range(e, flows.modes[s]):
        total = -flows.offset[s, j]
        for i in range(size):
            total += flows.project[s, j, i] * st.q[i] + flows.project[s, j, size + i] * st.v[i]
        for h in range(e):
            phase = st.amplitude[h]
            total -= flows.in_phase[s, j, h] * phase.real + flows.in_quadrature[s, j, h] * phase.imag
        st.amplitude[j] = total
    for i in range(size):
        st.bend[i] = flows.bend[s, i]
        for k in range(size):
            st.bend[i] += flows.bend_held[s, i, k] * st.q[k]
    for r in range(len(st.force)):
        st.force[r] = flows.force_constant[s, r] + st.prestress[r]
        for k in range(size):
            st.force[r] += flows.force_held[s, r, k] * st.q[k]
    swing = 0.0
    for i in range(size):
        part = abs(st.v[i])
        for j in range(flows.modes[s]):
            rate = flows.motion[s, i, j] * flows.eigenvalue[s, j] * st.amplitude[j]
            part += abs(rate.real) + abs(rate.imag)
        largest = 0.0
        for r in range(len(system.J)):
            largest = max(largest, abs(system.J[r, i]))
        swing = max(swing, part * largest)
    st.scale[0] = max(swing, system.speed)


@inlined
def _spring_energy(system, st):
    """Return the energy in the springs of closed contacts and of Jenkins elements, J."""
    energy = 0.0
    for r in range(system.contacts):
        if yields(system, r) and st.state[r] < OPEN:
            energy += 0.5 * system.spring[r] * gap(system, r, st.q) ** 2
    for j in range(len(system.tangential)):
        energy += 0.5 * system.tangential[j] * elongation(system, j, st.q) ** 2
    return energy


@inlined
def _inside(system, st):
    """Whether round-off has kept every body inside its cavity."""
    for r in range(system.contacts):
        if st.state[r] == OPEN and not gap(system, r, st.q) >= -_LOST * system.play[r]:
            return False
    return True


@inlined
def _sample(system, flows, st, rec, work, tau):
    """Take the samples of the segment."""
    periods = len(rec.peak) - 1
    many = len(rec.samples) // periods if periods > 0 else 0
    if many == 0:
        return
    step, q, v = system.period / many, work.ahead[0], work.ahead[1]
    k = math.ceil(st.time[0] / step - 1e-9)
    while k < many and k * step < st.time[0] + tau:
        row = st.counters[PERIOD] * many + k
        if row < len(rec.samples):
            motion_at(system, flows, st, work, max(k * step - st.time[0], 0.0), q, v)
            x, _ = response_at(system, q, v, k * step)
            put_sample(system, st, rec, row, x, q, st.state, OPEN)
        k += 1
