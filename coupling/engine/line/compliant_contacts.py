"""Closed springs: compliant contacts, which push and never pull, and Jenkins elements, a spring before a slider."""

from __future__ import annotations

from vanedamp.coupling.engine.line.gap_kinematics import rigid, spring_energy
from vanedamp.coupling.engine.line.recording import log_event, log_impact
from vanedamp.coupling.numerics.codes import (
    AT_HIGH,
    AT_LOW,
    COAST,
    LEAVING,
    OPEN,
    OPENS,
    RECLOSES,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
)
from vanedamp.coupling.numerics.compiler.jit import kernel
from vanedamp.coupling.response.records import CONTACT, DETACHES


@kernel
def spring_force(system, st, r):
    """Return the force of the closed spring and dashpot of row r, N."""
    return -(system.spring[r] * st.displacement[r] + system.dashpot[r] * st.velocity[r])


@kernel
def slide_or_hold(system, st, scratch, r):
    """Set the state of a Jenkins element after an event: it slides on in its direction, or its spring holds."""
    state, limit = st.state[r], system.limit[r]
    if limit == 0.0:
        st.state[r] = COAST
    elif scratch.forced[r] > 0:
        # at its low bound the force opposes motion to the right
        st.state[r] = SLIP_RIGHT if scratch.forced[r] == AT_LOW else SLIP_LEFT
        st.applied_force[r] = -st.state[r] * limit
        st.displacement[r] = -st.applied_force[r] / system.spring[r]
        scratch.forced[r] = 0
    elif (state == SLIP_LEFT or state == SLIP_RIGHT) and state * st.velocity[r] > 0.0:
        st.applied_force[r] = -state * limit
    else:
        if st.velocity[r] == 0.0 and (state == SLIP_LEFT or state == SLIP_RIGHT):
            # the spring takes over at its bound, to come away from it with the acceleration
            st.released[r] = -AT_LOW if state == SLIP_RIGHT else -AT_HIGH
        else:
            st.released[r] = min(scratch.forced[r], 0)
        st.state[r], st.applied_force[r] = SPRUNG, 0.0


@kernel
def begin_contact(system, st, rec, r):
    """Begin a compliant contact at zero gap."""
    st.state[r], st.contact_impulse[r] = SPRUNG, 0.0
    if st.velocity[r] < 0.0:
        log_impact(system, st, rec, r, st.velocity[r], 0.0, 0.0)


@kernel
def change_contact(system, st, rec, scratch, r, meaning):
    """End a compliant contact at zero force (AT_LOW), open it after that (OPENS), or close it again (RECLOSES)."""
    if meaning == OPENS:
        st.state[r] = OPEN
    elif meaning == RECLOSES:
        # the energy balance has taken the energy that the spring had when the contact ended
        st.state[r] = SPRUNG
        st.ledger[CONTACT] -= spring_energy(system, st, r)
    else:
        st.ledger[CONTACT] += spring_energy(system, st, r)
        st.state[r] = LEAVING if st.displacement[r] < 0.0 and st.velocity[r] > 0.0 else OPEN
        scratch.forced[r] = AT_LOW  # not to be closed again by round-off
        log_event(system.period, st.counters, st.time, rec.log, DETACHES, r, 0.0, st.velocity[r], st.contact_impulse[r])


@kernel
def close_pressed_contacts(system, st, rec, scratch, tolerance):
    """Close compliant contacts that touch without speed if their acceleration (scratch.acceleration) presses."""
    for r in range(system.friction_rows, len(st.state)):
        if rigid(system, r) or st.state[r] != OPEN:
            continue
        st.released[r] = 0
        if st.displacement[r] == 0.0 and st.velocity[r] == 0.0:
            acceleration = scratch.acceleration[r]
            opens = acceleration > tolerance or (scratch.forced[r] != 0 and acceleration >= -tolerance)
            if opens:
                st.released[r] = scratch.forced[r]
            else:
                begin_contact(system, st, rec, r)
