"""Closed springs: compliant contacts, which push and never pull, and Jenkins elements, a spring before a slider."""

from __future__ import annotations

from vanedamp.coupling.exact.event_log import log_event, log_impact
from vanedamp.coupling.exact.gap_kinematics import rigid
from vanedamp.coupling.exact.state import COAST, LEAVING, OPEN, OPENS, RECLOSES, SLIP_LEFT, SLIP_RIGHT, SPRUNG
from vanedamp.coupling.numerics.complementarity import AT_HIGH, AT_LOW
from vanedamp.coupling.numerics.jit import kernel
from vanedamp.coupling.response.records import CONTACT, DETACHES


@kernel
def spring_force(system, st, r):
    """Force of the closed spring and dashpot of row r, N."""
    return -(system.spring[r] * st.displacement[r] + system.dashpot[r] * st.velocity[r])


@kernel
def spring_energy(system, st, r):
    """Energy in the spring of row r, J."""
    return 0.5 * system.spring[r] * st.displacement[r] * st.displacement[r]


@kernel
def slide_or_hold(system, st, work, r):
    """State of a Jenkins element after an event: it slides on in its direction, or its spring holds."""
    state, limit = st.state[r], system.limit[r]
    if limit == 0.0:
        st.state[r] = COAST
    elif work.forced[r] > 0:
        # at its low bound the force opposes motion to the right
        st.state[r] = SLIP_RIGHT if work.forced[r] == AT_LOW else SLIP_LEFT
        st.held[r] = -st.state[r] * limit
        st.displacement[r] = -st.held[r] / system.spring[r]
        work.forced[r] = 0
    elif (state == SLIP_LEFT or state == SLIP_RIGHT) and state * st.velocity[r] > 0.0:
        st.held[r] = -state * limit
    else:
        if st.velocity[r] == 0.0 and (state == SLIP_LEFT or state == SLIP_RIGHT):
            # the spring takes over at its bound, to come away from it with the acceleration
            st.released[r] = -AT_LOW if state == SLIP_RIGHT else -AT_HIGH
        else:
            st.released[r] = min(work.forced[r], 0)
        st.state[r], st.held[r] = SPRUNG, 0.0


@kernel
def begin_push(system, st, rec, r):
    """A compliant contact begins at zero gap."""
    st.state[r], st.push[r] = SPRUNG, 0.0
    if st.velocity[r] < 0.0:
        log_impact(system, st, rec, r, st.velocity[r], 0.0, 0.0)


@kernel
def change_push(system, st, rec, work, r, what):
    """A compliant contact ends at zero force (a bound of the force), opens behind that (OPENS), or RECLOSES."""
    if what == OPENS:
        st.state[r] = OPEN
    elif what == RECLOSES:
        # what the spring held when it was left went to the ledger
        st.state[r] = SPRUNG
        st.ledger[CONTACT] -= spring_energy(system, st, r)
    else:
        st.ledger[CONTACT] += spring_energy(system, st, r)
        st.state[r] = LEAVING if st.displacement[r] < 0.0 and st.velocity[r] > 0.0 else OPEN
        work.forced[r] = AT_LOW  # not to be closed again by round-off
        log_event(system.period, st.counters, st.time, rec.log, DETACHES, r, 0.0, st.velocity[r], st.push[r])


@kernel
def press(system, st, rec, work, tolerance):
    """Compliant contacts that touch without speed close if their acceleration (work.acceleration) presses."""
    for r in range(system.friction_rows, len(st.state)):
        if rigid(system, r) or st.state[r] != OPEN:
            continue
        st.released[r] = 0
        if st.displacement[r] == 0.0 and st.velocity[r] == 0.0:
            opens = work.acceleration[r] > tolerance or (work.forced[r] != 0 and work.acceleration[r] >= -tolerance)
            if opens:
                st.released[r] = work.forced[r]
            else:
                begin_push(system, st, rec, r)
