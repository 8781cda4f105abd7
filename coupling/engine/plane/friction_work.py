"""Work of friction of each unit in a segment, by quadrature to round-off: an independent check of the total.

The force on a contact's normal row times its slip is a product of sums of exponentials. Gauss's rule on pieces that
are short for the fastest mode has their integral to round-off, without a form for every unit and subsystem.
"""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.engine.amplitudes import amplitude_changes
from vanedamp.coupling.numerics.codes import ACTIVE, FLOW, PERIOD
from vanedamp.coupling.numerics.compiler.jit import kernel
from vanedamp.coupling.system.unit_kinematics import has_friction, is_slip, row_speed

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
#: turn of the fastest mode within a piece; with 8 nodes the product of two such modes is integrated to 1e-13
_TURN = 2.0
_MOST_PIECES = 4096


@kernel
def add_friction_work(system, flows, st, rec, scratch, tau):
    """Add the work of friction of the units that slip in the segment [0, tau], J. Overwrites the scratch's changes."""
    s, count, period, fastest = st.counters[FLOW], st.counters[ACTIVE], st.counters[PERIOD], 0.0
    for j in range(count):
        fastest = max(fastest, abs(flows.eigenvalue[s, j]))
    pieces = min(max(math.ceil(tau * fastest / _TURN), 1), _MOST_PIECES)
    half = 0.5 * tau / pieces
    for piece in range(pieces):
        for node in range(len(_NODES)):
            t = half * (2 * piece + 1 + _NODES[node])
            amplitude_changes(flows, st, scratch, t)
            for r in range(len(system.rest)):
                if is_slip(st.state[r]) and has_friction(system, r) and not flows.held[s, r]:
                    rec.worn[period, r] += half * _WEIGHTS[node] * _power(system, flows, st, scratch, s, r, t, count)


@kernel
def _power(system, flows, st, scratch, s, r, t, count):
    """Return the power of a unit's friction at time t of the segment, W."""
    row = len(system.rest) + r
    pressed = r if r < system.contacts else row  # a friction element has its limit
    force, speed = st.force[pressed], row_speed(system, row, st.v) + t * row_speed(system, row, st.bend)
    for j in range(count):
        gain = scratch.gain[j]
        force += (flows.force[s, pressed, j] * (st.amplitude[j] + gain)).real
        speed += (flows.rows[s, row, j] * flows.eigenvalue[s, j] * gain).real
    return abs((system.friction[r] if r < system.contacts else 1.0) * force * speed)
