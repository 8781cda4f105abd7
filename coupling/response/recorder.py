"""The recorder of all methods: section and ledger of a period, and the peak within a step."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import entry, inlined, summing
from vanedamp.coupling.response.records import STORED


@entry
def record_section(system, records, period, p, p_rate, slip, slip_velocity, springs, ledger):
    """Record section and ledger at the start of a period, for every method: the entry from Python."""
    put_section(system, records, period, p, p_rate, slip, slip_velocity, springs, ledger)


@inlined
def put_section(system, records, period, p, p_rate, slip, slip_velocity, springs, ledger):
    """Record section and ledger at the start of a period, in compiled functions.

    p, p_rate: (n,) modal coordinates and their rates; slip, slip_velocity: (b,) of the bodies; springs: energy in all
    springs of rows, J; ledger: (6,) J, whose stored energy is set.
    """
    n, b, entry, part = system.modes, system.bodies, records.section[period], records.parts[period]
    x, rate, energy = _structure(system.response, system.stiffness, p, p_rate)
    energy, momentum = energy + springs, 0.0
    for h in range(len(system.table)):
        x += system.table[h].real
        rate -= system.frequency[h] * system.table[h].imag
    part[0] = energy
    for k in range(b):
        velocity, height = slip_velocity[k] + _dot(system.floor[k], p_rate), slip[k]
        if system.weight[n + k] != 0.0:
            height += _dot(system.floor[k], p)
        momentum += system.mass[n + k] * velocity
        part[1 + k] = 0.5 * system.mass[n + k] * velocity * velocity - system.weight[n + k] * height
        energy += part[1 + k]
        entry[3 + k], entry[3 + b + k] = slip[k], slip_velocity[k]
    entry[0], entry[1], entry[2] = x, rate, momentum
    ledger[STORED] = energy
    for i in range(len(ledger)):
        records.ledger[period, i] = ledger[i]


@summing
def _structure(response, stiffness, p, p_rate):
    """Return the response of the modes, its rate, and the energy of the structure."""
    x, rate, energy = 0.0, 0.0, 0.0
    for i in range(len(p)):
        x += response[i] * p[i]
        rate += response[i] * p_rate[i]
        energy += 0.5 * (p_rate[i] * p_rate[i] + stiffness[i] * p[i] * p[i])
    return x, rate, energy


@summing
def _dot(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@entry
def cubic_extremum(h, x0, x1, rate0, rate1):
    """Return x on the cubic through both ends where the line through both velocities is zero; x1 if nowhere."""
    if not rate0 * rate1 < 0.0:
        return x1
    t = rate0 / (rate0 - rate1)
    u = 1.0 - t
    return x0 * u * u * (1.0 + 2.0 * t) + x1 * t * t * (3.0 - 2.0 * t) + h * t * u * (u * rate0 - t * rate1)


@entry
def note_response(records, period, x):
    """Let a value x of the response count among the period's largest and smallest."""
    records.peak[period] = max(records.peak[period], abs(x))
    if len(records.swing) > 0:
        swing = records.swing[period]
        swing[0], swing[1] = max(swing[0], x), min(swing[1], x)


@entry
def note_step(records, period, h, x0, x1, rate0, rate1):
    """Let the response on a step of length h count: its end, its extremum, and its integral by both ends."""
    note_response(records, period, x1)
    note_response(records, period, cubic_extremum(h, x0, x1, rate0, rate1))
    if len(records.swing) > 0:
        records.swing[period, 2] += h * (0.5 * (x0 + x1) + h * (rate0 - rate1) / 12.0)
