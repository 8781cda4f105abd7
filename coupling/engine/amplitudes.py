"""Changes of the amplitudes of modes over a time, and their effect on a row. Records as in either engine."""

from __future__ import annotations

from vanedamp.coupling.numerics.codes import ACTIVE, FLOW
from vanedamp.coupling.numerics.compiler.jit import inlined, kernel, summing
from vanedamp.coupling.numerics.exponentials import (
    exp_minus_line,
    exp_minus_one,
    is_long,
    long_minus_line,
    secular,
    whole_vectors,
)


@inlined
def amplitude_changes(flows, st, scratch, tau):
    """Set the changes of the active modes' amplitudes over the segment."""
    s, e = st.counters[FLOW], flows.driven.shape[1] - 1
    count = whole_vectors(st.counters[ACTIVE], len(st.amplitude))
    if is_long(flows.eigenvalue[s], flows.driven[s, e], st.counters[ACTIVE], tau):
        grow(long_minus_line, flows.eigenvalue[s], st.amplitude, count, tau, scratch.gain, scratch.bend)
    else:
        grow(exp_minus_line, flows.eigenvalue[s], st.amplitude, count, tau, scratch.gain, scratch.bend)
    if flows.driven[s, e] > e:
        _add_driven_growth(
            flows.eigenvalue[s], flows.driven[s], flows.load[s], st.amplitude, scratch.gain, scratch.bend, tau
        )


@summing
def grow(term, eigenvalue, amplitude, count, tau, gain, bend):
    """Set the changes of amplitudes over a time, and the same less their tangents, by this function of z."""
    for j in range(count):
        rate, c = eigenvalue[j], amplitude[j]
        z = complex(rate.real * tau, rate.imag * tau)
        first = exp_minus_one(z)
        gain[j] = c * first
        bend[j] = c * term(z, first)


@kernel
def _add_driven_growth(eigenvalue, driven, load, phase, gain, bend, tau):
    """Add the growth of the modes that the harmonics drive: the first ones, always active."""
    for h in range(len(driven) - 1):
        for j in range(driven[h], driven[h + 1]):
            growth, beyond = secular(eigenvalue[j], eigenvalue[h], tau)
            gain[j] += load[j] * phase[h] * growth
            bend[j] += load[j] * phase[h] * beyond


@summing
def row_change(motion, velocity, bend, gain, count):
    """Return the modes' part of displacement and velocity of a row or a coordinate."""
    shift, speed = 0.0, 0.0
    for j in range(count):
        shift += motion[j].real * bend[j].real - motion[j].imag * bend[j].imag
        speed += velocity[j].real * gain[j].real - velocity[j].imag * gain[j].imag
    return shift, speed


@summing
def real_sum(functional, amplitude, count):
    """Return the value of a functional of the first `count` amplitudes."""
    total = 0.0
    for j in range(count):
        total += functional[j].real * amplitude[j].real - functional[j].imag * amplitude[j].imag
    return total
