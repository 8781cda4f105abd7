"""Closed springs: compliant contacts, which push and never pull, and Jenkins elements, a spring before a slider."""

from __future__ import annotations

from vanedamp.coupling.exact.event_log import log_event, log_impact
from vanedamp.coupling.exact.gap_kinematics import rigid
from vanedamp.coupling.exact.state import COAST, LEAVING, OPEN, OPENS, RECLOSES, SLIP_LEFT, SLIP_RIGHT, SPRUNG
from vanedamp.coupling.numerics.complementarity import AT_HIGH, AT_LOW
from vanedamp.coupling.numerics.jit import kernel
from vanedamp.coupling.response.records import CONTACT, DETACHES


@kernel
def spring_force(rows, st, r):
    """Force of the closed spring and dashpot of row r, N."""
    return -(rows.spring[r] * st.displacement[r] + rows.dashpot[r] * st.velocity[r])


@kernel
def spring_energy(rows, st, r):
    """Energy in the spring of row r, J."""
    return 0.5 * rows.spring[r] * st.displacement[r] * st.displacement[r]


@kernel
def slide_or_hold(rows, st, work, r):
    """State of a Jenkins element after an event: it slides on in its direction, or its spring holds."""
    state, limit = st.state[r], rows.limit[r]
    if limit == 0.0:
        st.state[r] = COAST
    elif work.forced[r] > 0:
        # at its low bound the force opposes motion to the right
        st.state[r] = SLIP_RIGHT if work.forced[r] == AT_LOW else SLIP_LEFT
        st.held[r] = -st.state[r] * limit
        st.displacement[r] = -st.held[r] / rows.spring[r]
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
def begin_push(rows, st, rec, r):
    """A compliant contact begins at zero gap."""
    st.state[r], st.push[r] = SPRUNG, 0.0
    if st.velocity[r] < 0.0:
        log_impact(rows, st, rec, r, st.velocity[r], 0.0, 0.0)


@kernel
def change_push(rows, st, rec, work, r, what):
    """A compliant contact ends at zero force (a bound of the force), opens behind that (OPENS), or RECLOSES."""
    if what == OPENS:
        st.state[r] = OPEN
    elif what == RECLOSES:
        # what the spring held when it was left went to the ledger
        st.state[r] = SPRUNG
        st.ledger[CONTACT] -= spring_energy(rows, st, r)
    else:
        st.ledger[CONTACT] += spring_energy(rows, st, r)
        st.state[r] = LEAVING if st.displacement[r] < 0.0 and st.velocity[r] > 0.0 else OPEN
        work.forced[r] = AT_LOW  # not to be closed again by round-off
        log_event(rows.period, st.counters, st.time, rec.log, DETACHES, r, 0.0, st.velocity[r], st.push[r])


@kernel
def press(rows, st, rec, work, tolerance):
    """Compliant contacts that touch without speed close if their acceleration (work.acceleration) presses."""
    for r in range(rows.friction_rows, len(st.state)):
        if rigid(rows, r) or st.state[r] != OPEN:
            continue
        st.released[r] = 0
        if st.displacement[r] == 0.0 and st.velocity[r] == 0.0:
            opens = work.acceleration[r] > tolerance or (work.forced[r] != 0 and work.acceleration[r] >= -tolerance)
            if opens:
                st.released[r] = work.forced[r]
            else:
                begin_push(rows, st, rec, r)
