"""The loop from event to event of planar bodies: flow, first event, impact, decision; energies of all of it."""

from __future__ import annotations

import math

from vanedamp.coupling.engine.plane.contact_states import decide, move_sliders
from vanedamp.coupling.engine.plane.energy_balance import end_segment, move, response_at
from vanedamp.coupling.engine.plane.event_functions import next_event
from vanedamp.coupling.engine.plane.friction_work import add_friction_work
from vanedamp.coupling.engine.plane.impacts import collide, log_event, log_impact, stop_wedged
from vanedamp.coupling.engine.plane.tolerances import (
    ALMOST_CLOSED,
    AT_REST,
    BEYOND,
    BROKEN,
    GAP_ROUND_OFF,
    OVERLAP,
    SAMPLE,
)
from vanedamp.coupling.engine.root_search import ENDLESS
from vanedamp.coupling.engine.scenes import SLICE
from vanedamp.coupling.numerics.codes import (
    ACCURACY_LOST,
    ACTIVE,
    AT_HIGH,
    AT_LOW,
    AT_ONCE,
    BEGUN,
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
    STATES_GO_ON,
    STATES_OPEN,
    STICK,
    STOPS,
    TOUCHING,
    UNDECIDED,
)
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel
from vanedamp.coupling.numerics.tolerances import SIMULTANEOUS
from vanedamp.coupling.response.recorder import put_sample, record_section
from vanedamp.coupling.response.records import CONTACT, DETACHES, IMPACT_LOSS, RESTS, SLIPS, STICKS
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
    speed_scale,
    spring_force,
)

#: events at one instant after which contacts are said to be undecided, for each unit
_AT_ONCE = 20
#: events at one instant after which a repeated decision is revised, per unit
_REPEATED = 4
#: how often a decision is revised whose forces break their laws
_ATTEMPTS = 4
_TINY = 1e-150


@kernel
def begin(system, st, rec, scratch):
    """Let contacts collide that are closed and approach at time zero, and decide their states. False if that fails."""
    _set_phases(system, st)
    st.scale[0] = max(speed_scale(system, st.v), system.speed)
    if _approaches(system, st) and not collide(system, st, rec, scratch):
        return False
    _begin_contacts(system, st, rec)
    if not _decide_states(system, st, rec, scratch):
        return False
    st.counters[FLOW] = -1
    return True


@kernel
def advance(system, flows, st, watched, rec, scratch, periods, max_events):
    """Advance to the end of `periods`. Returns a code."""
    segments = 0
    while st.counters[PERIOD] < periods:
        if segments == SLICE or st.counters[LOGGED] + 4 * len(system.rest) >= len(rec.log):
            return PAUSED
        segments += 1
        if st.counters[BEGUN] == 0:  # once: it takes round-off away, which another beginning would take again
            outcome = _begin_flow(system, flows, st, rec, scratch)
            if outcome == STATES_OPEN:
                continue
            if outcome != STATES_GO_ON:
                return outcome
            st.counters[BEGUN] = 1
        if st.counters[EVENTS] >= max_events:
            return EVENT_BUDGET
        if st.counters[PERIOD] == 0 and st.time[0] == 0.0:
            record_section(system, rec, st.counters[PERIOD], st.q, st.v, _spring_energy(system, st), st.ledger)
        tau, who = next_event(system, flows, st, watched)
        st.counters[BEGUN] = 0
        if who == ENDLESS:
            return ILL_CONDITIONED
        if tau > 0.0:
            _move(system, flows, st, rec, scratch, tau)
        if who == -1:
            _end_period(system, flows, st, rec)
            continue
        st.time[0] += tau
        _set_phases(system, st)
        if who == -2:
            segments = SLICE
            continue
        if not _handle_event(system, flows, st, rec, scratch, watched.unit[who], watched.what[who]):
            return UNDECIDED
        if not _within_walls(system, st):
            return ACCURACY_LOST
    return DONE


@inlined
def _begin_flow(system, flows, st, rec, scratch):
    """Begin the motion of the states as decided, if forces obey their laws in it; the last states' motion continues.

    Returns STATES_GO_ON, STATES_OPEN where other states are to be tried, NEEDS_FLOW or UNDECIDED.
    """
    if st.counters[FLOW] >= 0:
        _begin_segment(system, flows, st)
        return STATES_GO_ON
    s = _find_flow(flows, st)
    if s < 0:
        return NEEDS_FLOW
    st.counters[FLOW] = s
    flows.used[s] = st.counters[EVENTS]
    _stop_held_rows(system, flows, st)
    _begin_segment(system, flows, st)
    suffice = _forces_suffice(system, flows, st)
    if not suffice and (scratch.attempt[0] == 0 or not _obeys_laws_prestressed(system, flows, st, scratch)):
        for r in range(len(st.state)):
            st.state[r] = st.other[r]
        st.counters[FLOW] = -1
        return STATES_OPEN
    if suffice and not _obeys_laws(system, flows, st) and not _obeys_laws_prestressed(system, flows, st, scratch):
        scratch.attempt[0] += 1
        if scratch.attempt[0] > _ATTEMPTS or not decide(system, st, scratch, st.scale[0]):
            return UNDECIDED
        st.counters[FLOW] = -1
        return STATES_OPEN
    scratch.attempt[0] = 0
    _log_changes(system, flows, st, rec)
    return STATES_GO_ON


@inlined
def _move(system, flows, st, rec, scratch, tau):
    """Advance the motion by tau > 0, with its integrals and samples."""
    q, v = scratch.later[0], scratch.later[1]
    _sample(system, flows, st, rec, scratch, tau, q, v)
    if rec.worn.shape[1] > 0 and st.counters[PERIOD] >= rec.counted[0] and flows.rubs[st.counters[FLOW]]:
        add_friction_work(system, flows, st, rec, scratch, tau)
    move(system, flows, st, scratch, tau, q, v)
    end_segment(system, flows, st, rec, scratch, tau, q, v)
    for i in range(len(q)):
        st.q[i], st.v[i] = q[i], v[i]
    for r in range(len(st.fresh)):
        st.fresh[r] = 0
    st.counters[AT_ONCE] = 0


@inlined
def _end_period(system, flows, st, rec):
    """Begin the next period and record its section."""
    st.counters[PERIOD] += 1
    st.time[0] = 0.0
    for r in range(len(st.last_impact)):
        st.last_impact[r] -= system.period
    _set_phases(system, st)
    _project(system, flows, st, st.counters[FLOW])
    record_section(system, rec, st.counters[PERIOD], st.q, st.v, _spring_energy(system, st), st.ledger)


@inlined
def _approaches(system, st):
    """Whether a contact that is closed approaches, by more than round-off."""
    for r in range(system.contacts):
        if is_rigid(system, r) and is_closed(system, st, r) and row_speed(system, r, st.v) < -AT_REST * st.scale[0]:
            return True
    return False


@inlined
def _almost_closes(system, st):
    """Whether an open contact is so close that round-off of the closed ones may decide whether it is shut, too.

    The other corner of a face that lands flat is off by what a body has turned against the wall that holds it.
    """
    for r in range(system.contacts):
        if st.state[r] == OPEN and SIMULTANEOUS < gap(system, r, st.q) / system.play[r] <= ALMOST_CLOSED:
            return True
    return False


@kernel
def _begin_contacts(system, st, rec):
    """Begin the compliant contacts that are closed and approach."""
    for r in range(system.contacts):
        touches = is_compliant(system, r) and (st.state[r] == OPEN or st.state[r] == TOUCHING)
        touches = touches and gap(system, r, st.q) <= SIMULTANEOUS * system.play[r]
        if touches and row_speed(system, r, st.v) < -AT_REST * st.scale[0]:
            st.state[r] = SLIP_RIGHT  # decided next
            st.pushed[r], st.pushed[len(system.rest) + r], st.lost[r] = 0.0, 0.0, 0.0
            log_impact(system, st, rec, r, row_speed(system, r, st.v), 0.0, 0.0, 0.0, 0.0)


@kernel
def _end_contact(system, st, rec, r):
    """End a compliant contact as its force vanishes: its spring's energy is lost."""
    u, shift, speed = len(system.rest), gap(system, r, st.q), row_speed(system, r, st.v)
    left = 0.5 * system.spring[r] * shift * shift
    st.ledger[CONTACT] += left
    parts = shift < -SIMULTANEOUS * system.play[r] and speed > AT_REST * st.scale[0]
    st.state[r] = LEAVING if system.dashpot[r] > 0.0 and parts else OPEN
    if st.state[r] == OPEN:
        _close_gap(system, st, r)
    log_event(system, st, rec, DETACHES, r, 0.0, speed, st.pushed[r], st.pushed[u + r], st.lost[r] + left)


@inlined
def _is_unloaded(system, st, r):
    """Whether the force of a compliant contact has vanished, but for round-off of its gap, and it parts.

    Its friction is at both of its bounds there, and round-off would decide which comes first.
    """
    spent = spring_force(system, r, st.q, st.v) <= least_force(system, r)
    return spent and row_speed(system, r, st.v) > AT_REST * st.scale[0]


@kernel
def _end_unloaded(system, st, rec, r, event):
    """End the other compliant contacts whose forces vanish within round-off at the event of unit r: they may pull."""
    for i in range(system.contacts):
        presses = is_compliant(system, i) and st.state[i] < OPEN and st.fresh[i] == 0
        if presses and not (event == RECLOSES and i == r) and _is_unloaded(system, st, i):
            _end_contact(system, st, rec, i)


@inlined
def _handle_event(system, flows, st, rec, scratch, r, event):
    """Apply the event of unit r and decide the states after it. Returns False if they cannot be decided."""
    st.counters[EVENTS] += 1
    st.counters[AT_ONCE] += 1
    scratch.attempt[0] = st.counters[AT_ONCE] // (_REPEATED * len(system.rest))
    if st.counters[AT_ONCE] > _AT_ONCE * len(system.rest):
        return False
    if event == CLOSES and _almost_closes(system, st):
        _project(system, flows, st, st.counters[FLOW])
    st.scale[0] = max(st.scale[0], speed_scale(system, st.v))
    for i in range(len(system.rest)):
        scratch.before[i] = st.state[i]
    _change_unit(system, st, rec, r, event)
    _end_unloaded(system, st, rec, r, event)
    # at any event another gap may be closed as well, within the resolution of gaps
    if _approaches(system, st) and not collide(system, st, rec, scratch):
        return False
    _begin_contacts(system, st, rec)
    if not _decide_states(system, st, rec, scratch):
        return False
    known = system.slider[r] < 0 and (is_compliant(system, r) or r >= system.contacts)
    if known and (event == AT_LOW or event == AT_HIGH) and scratch.attempt[0] > 0 and st.state[r] == STICK:
        # again and again: the decision's force is short of its known bound by round-off, that of the motion is not
        st.state[r] = SLIP_RIGHT if event == AT_LOW else SLIP_LEFT
        st.other[r] = st.state[r]
    for i in range(len(system.rest)):
        changed = scratch.before[i] != st.state[i] or st.other[i] != st.state[i]
        if changed or st.prestress[i] != 0.0 or st.prestress[len(system.rest) + i] != 0.0:
            st.counters[FLOW] = -1
    return True


@inlined
def _change_unit(system, st, rec, r, event):
    """Change the state of unit r by its event."""
    at_bound = event == AT_LOW or event == AT_HIGH
    if event == CLOSES:
        _close_gap(system, st, r)
    elif is_compliant(system, r) and (event == PARTS or (at_bound and _is_unloaded(system, st, r))):
        _end_contact(system, st, rec, r)
    elif event == OPENS:
        st.state[r] = OPEN
        _close_gap(system, st, r)
    elif event == RECLOSES:
        st.state[r] = SLIP_RIGHT  # decided next; the ledger has taken the energy that the spring has
        st.ledger[CONTACT] -= 0.5 * system.spring[r] * gap(system, r, st.q) ** 2
    elif system.slider[r] >= 0 and at_bound:
        st.state[r] = SLIP_RIGHT if event == AT_LOW else SLIP_LEFT  # decided next: its spring is at its bound
    elif event == STOPS and system.slider[r] < 0:
        # the slip within the resolution of time is rest
        st.scale[0] = max(st.scale[0], abs(row_speed(system, len(system.rest) + r, st.v)) / AT_REST)


@kernel
def _decide_states(system, st, rec, scratch):
    """Decide the states, if no forces are possible after the impulses that stop what slips. False if that fails."""
    for _ in range(len(system.rest) + 1):
        if decide(system, st, scratch, st.scale[0]):
            return True
        if not stop_wedged(system, st, rec, scratch):
            return False
    return False


@kernel
def _log_changes(system, flows, st, rec):
    """Log which units have changed their states."""
    u = len(system.rest)
    for i in range(u):
        was, now, speed = st.known[i], st.state[i], 0.0
        if is_slip(now) and flows.held[st.counters[FLOW], i] and has_friction(system, i):
            now = STICK  # its force is at its bound, but others hold it
        st.known[i] = now
        if is_rigid(system, i) and (was == OPEN) != (now == OPEN):
            kind = DETACHES if now == OPEN else RESTS
            speed = row_speed(system, i, st.v) if now == OPEN else 0.0
        elif now == STICK and is_slip(was):
            kind = STICKS
        elif was == STICK and is_slip(now):
            kind, speed = SLIPS, row_speed(system, u + i, st.v)
        else:
            continue
        log_event(system, st, rec, kind, i, 0.0, speed, 0.0, 0.0, 0.0)


@kernel
def _close_gap(system, st, r):
    """Shift the unit's body by its gap's round-off: the contact is closed, exactly."""
    error, square = gap(system, r, st.q), 0.0
    for i in range(len(st.q)):
        square += system.J[r, i] * system.J[r, i] / system.mass[i]
    for i in range(len(st.q)):
        st.q[i] -= system.J[r, i] / system.mass[i] * error / square


@inlined
def _find_flow(flows, st):
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
def _stop_held_rows(system, flows, st):
    """Stop what the contacts hold, and enter the loss."""
    size, loss = len(st.q) - len(system.tangential), 0.0  # sliders have no mass
    st.prestress[:] = 0.0
    for i in range(size):
        loss += 0.5 * system.mass[i] * st.v[i] * st.v[i]
    _project(system, flows, st, st.counters[FLOW])
    for i in range(size):
        loss -= 0.5 * system.mass[i] * st.v[i] * st.v[i]
    st.ledger[IMPACT_LOSS] += loss


@inlined
def _project(system, flows, st, s):
    """Bring back gaps, and speeds of rows at rest, from round-off to zero."""
    u, size = len(system.rest), len(st.q)
    if flows.holds[s]:
        for r in range(2 * u):
            st.rate[r] = row_speed(system, r, st.v) if _at_rest(system, st, r) else 0.0
        for r in range(2 * u):
            if st.rate[r] != 0.0:
                for i in range(size):
                    st.v[i] -= flows.stop_rows[s, i, r] * st.rate[r]
        for r in range(system.contacts):
            st.rate[r] = gap(system, r, st.q) if is_rigid(system, r) and st.state[r] != OPEN else 0.0
        for r in range(system.contacts):
            if st.rate[r] != 0.0:
                for i in range(size):
                    st.q[i] -= flows.close_gaps[s, i, r] * st.rate[r]
    for i in range(size):  # the smallest doubles are slow
        st.q[i] = st.q[i] if abs(st.q[i]) > _TINY else 0.0
        st.v[i] = st.v[i] if abs(st.v[i]) > _TINY else 0.0
    move_sliders(system, st.state, st.q, st.v)


@inlined
def _at_rest(system, st, row):
    """Whether contacts hold a row: the gap of a closed contact, the slip of one that sticks."""
    u = len(system.rest)
    return st.state[row] != OPEN and is_rigid(system, row) if row < u else st.state[row - u] == STICK


@kernel
def _forces_suffice(system, flows, st):
    """Whether no contact needs to pull, and none that sticks more than its bound, where some could do with less.

    Now and right after. The normal forces may be others too, and with them friction elsewhere: what begins to slip, or
    to part, must still do so.
    """
    u, differs = len(system.rest), False
    for r in range(u):
        differs = differs or st.state[r] != st.other[r]
    if not differs:
        return True
    for r in range(u):
        if system.slider[r] >= 0 and st.state[r] < OPEN:
            continue
        if is_rigid(system, r) and st.state[r] < OPEN and _violates(system, flows, st, r, 1.0, 0.0):
            return False
        if st.state[r] == STICK:
            for way in (-1.0, 1.0):
                if _violates(system, flows, st, r, system.friction[r], way):
                    return False
        elif st.state[r] == OPEN and is_closed(system, st, r):
            still = abs(row_speed(system, r, st.v)) <= AT_REST * st.scale[0]
            if still and _reverses(system, flows, st, r, 1.0):
                return False
        elif is_slip(st.state[r]) and not flows.held[st.counters[FLOW], r]:
            still = abs(row_speed(system, u + r, st.v)) <= AT_REST * st.scale[0]
            if still and has_friction(system, r) and _reverses(system, flows, st, u + r, float(st.state[r])):
                return False
    return True


@kernel
def _obeys_laws(system, flows, st):
    """Whether the forces obey their laws as a flow begins: no contact pulls, friction stays within its bound.

    A decision that has mistaken the forces of contacts that depend on each other is found here, and is no answer.
    """
    s, u, largest = st.counters[FLOW], len(system.rest), 0.0
    for r in range(system.contacts):
        if is_compliant(system, r) and st.state[r] < OPEN:  # round-off of its gap
            largest = max(largest, GAP_ROUND_OFF * system.spring[r] * system.play[r])
    for check in range(2):
        for r in range(u):
            normal, slip, size = st.force[r], st.force[u + r], abs(st.force[r]) + abs(st.force[u + r])
            for j in range(flows.modes[s]):
                push, drag = flows.force[s, r, j] * st.amplitude[j], flows.force[s, u + r, j] * st.amplitude[j]
                normal, slip = normal + push.real, slip + drag.real
                size += abs(push.real) + abs(push.imag) + abs(drag.real) + abs(drag.imag)
            if check == 0:
                largest = max(largest, size)
            elif r < system.contacts and st.state[r] < OPEN and normal < -BROKEN * largest:
                return False
            elif st.state[r] == STICK:
                bound = system.friction[r] * normal if r < system.contacts else system.limit[r]
                if has_friction(system, r) and abs(slip) > bound + BROKEN * largest:
                    return False
    return True


@kernel
def _obeys_laws_prestressed(system, flows, st, scratch):
    """Let contacts that depend on each other have the forces of the decision. Returns whether those obey their laws.

    Without it they have the least ones, which may pull, or exceed the friction, where others would do.
    """
    s, many = st.counters[FLOW], len(st.force)
    for r in range(many):
        scratch.speed[r] = scratch.impulse[r] - st.force[r]
        for j in range(flows.modes[s]):
            scratch.speed[r] -= (flows.force[s, r, j] * st.amplitude[j]).real
    for r in range(many):
        st.prestress[r] = 0.0
        for k in range(many):
            st.prestress[r] += flows.self_stress[s, r, k] * scratch.speed[k]
        st.force[r] += st.prestress[r]
    return _obeys_laws(system, flows, st)


@inlined
def _reverses(system, flows, st, row, way):
    """Whether a row at rest accelerates against its way, now or right after."""
    s, total, rate, size = st.counters[FLOW], 0.0, 0.0, 0.0
    for i in range(len(st.q)):
        term = system.J[row, i] * st.bend[i]
        total += term
        size += abs(term)
    for j in range(flows.modes[s]):
        eigenvalue = flows.eigenvalue[s, j]
        term = flows.rows[s, row, j] * st.amplitude[j] * eigenvalue * eigenvalue
        total += term.real
        size += abs(term.real) + abs(term.imag)
        rate += (term * eigenvalue).real
    return way * total < -BEYOND * size or (way * total <= BEYOND * size and way * rate < 0.0)


@inlined
def _violates(system, flows, st, r, on_normal, on_slip):
    """Whether the limit, and the forces of both rows of a unit times these factors, are negative, or become so."""
    s, u, rate = st.counters[FLOW], len(system.rest), 0.0
    room = system.limit[r] + on_normal * st.force[r] + on_slip * st.force[u + r]
    size = system.limit[r] + abs(on_normal * st.force[r]) + abs(on_slip * st.force[u + r])
    for j in range(flows.modes[s]):
        term = (on_normal * flows.force[s, r, j] + on_slip * flows.force[s, u + r, j]) * st.amplitude[j]
        room += term.real
        rate += (term * flows.eigenvalue[s, j]).real
        size += abs(term.real) + abs(term.imag)
    return room < -BEYOND * size or (room <= BEYOND * size and rate < 0.0)


@inlined
def _set_phases(system, st):
    for h in range(len(system.frequency)):
        angle = system.frequency[h] * st.time[0]
        st.amplitude[h] = complex(math.cos(angle), math.sin(angle))


@kernel
def _begin_segment(system, flows, st):
    """Amplitudes of the modes, constant accelerations and forces, from the state."""
    s, size, e = st.counters[FLOW], len(st.q), len(system.frequency)
    _project(system, flows, st, s)
    for j in range(e, flows.modes[s]):
        total = -flows.offset[s, j]
        for i in range(size):
            total += flows.project[s, j, i] * st.q[i] + flows.project[s, j, size + i] * st.v[i]
        for h in range(e):
            phase = st.amplitude[h]
            total -= flows.in_phase[s, j, h] * phase.real + flows.in_quadrature[s, j, h] * phase.imag
        st.amplitude[j] = total
    for j in range(flows.modes[s], len(st.amplitude)):
        st.amplitude[j] = 0.0  # loops in whole vectors go beyond the modes
    st.counters[ACTIVE] = flows.modes[s]
    st.offset[0] = 0.0
    for i in range(size):
        st.offset[0] += system.response[i] * st.q[i]
    for h in range(e):
        st.offset[0] += (system.table[h] * st.amplitude[h]).real
    for j in range(flows.modes[s]):
        st.offset[0] -= (flows.response[s, j] * st.amplitude[j]).real
    for k in range(len(system.outputs)):
        st.offset[1 + k] = 0.0
        for i in range(system.modes):
            st.offset[1 + k] += system.outputs[k, i] * st.q[i]
        for j in range(flows.modes[s]):
            st.offset[1 + k] -= (flows.outputs[s, k, j] * st.amplitude[j]).real
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
        speed = abs(st.v[i])
        for j in range(flows.modes[s]):
            rate = flows.velocity[s, i, j] * st.amplitude[j]
            speed += abs(rate.real) + abs(rate.imag)
        swing = max(swing, speed * st.reach[i])
    st.scale[0] = max(swing, system.speed)


@inlined
def _spring_energy(system, st):
    """Return the energy in the springs of closed contacts and before sliders, J."""
    energy = 0.0
    for r in range(system.contacts):
        if is_compliant(system, r) and st.state[r] < OPEN:
            energy += 0.5 * system.spring[r] * gap(system, r, st.q) ** 2
    for j in range(len(system.tangential)):
        energy += 0.5 * system.tangential[j] * elongation(system, j, st.q) ** 2
    return energy


@inlined
def _within_walls(system, st):
    """Whether round-off has kept every body inside its cavity."""
    for r in range(system.contacts):
        if st.state[r] == OPEN and not gap(system, r, st.q) >= -OVERLAP * system.play[r]:
            return False
    return True


@inlined
def _sample(system, flows, st, rec, scratch, tau, q, v):
    """Take the samples of the segment."""
    periods = len(rec.peak) - 1
    many = len(rec.samples) // periods if periods > 0 else 0
    if many == 0:
        return
    step = system.period / many
    k = math.ceil(st.time[0] / step - SAMPLE)
    while k < many and k * step < st.time[0] + tau:
        row = st.counters[PERIOD] * many + k
        if row < len(rec.samples):
            move(system, flows, st, scratch, max(k * step - st.time[0], 0.0), q, v)
            x, _ = response_at(system, q, v, k * step)
            put_sample(system, rec, row, x, q, st.state, OPEN)
        k += 1
