"""The recorder of all runs: sections and energies of a period, samples, tilts, and the peak within a step."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import entry, inlined, kernel
from vanedamp.coupling.response.records import STORED


@entry
def record_section(system, records, period, q, v, springs, ledger):
    """Record section and energies at the start of a period.

    q, v: (N,) coordinates and their rates; springs: energy in those of units, J; ledger: (6,) J, whose stored energy is
    set.
    """
    size, bodies, entry, energies = len(q), len(system.along), records.section[period], records.parts[period]
    x, rate, momentum, energy = 0.0, 0.0, 0.0, springs
    for i in range(size):
        x += system.response[i] * q[i]
        rate += system.response[i] * v[i]
        force = 0.0
        for k in range(size):
            force += system.stiffness[i, k] * q[k]
        energy += 0.5 * q[i] * force
    for i in range(system.modes):
        energy += 0.5 * system.mass[i] * v[i] * v[i] - system.weight[i] * q[i]
    energies[0] = energy
    for b in range(bodies):
        at = system.along[b]
        energies[1 + b] = 0.0
        for i in range(at, at + (3 if system.tilt[b] >= 0 else 1)):
            energies[1 + b] += 0.5 * system.mass[i] * v[i] * v[i] - system.weight[i] * q[i]
        energy += energies[1 + b]
        momentum += system.mass[at] * v[at]
        slip, speed = q[at], v[at]
        for i in range(size):
            slip -= system.floor[b, i] * q[i]
            speed -= system.floor[b, i] * v[i]
        entry[3 + b], entry[3 + bodies + b] = slip, speed
    put_response(system, records, period, x, rate, momentum, energy, ledger)


@inlined
def put_response(system, records, period, x, rate, momentum, energy, ledger):
    """Record the response, of which x and rate are those of the modes, the bodies' momentum, stored energy, ledger."""
    entry = records.section[period]
    for h in range(len(system.table)):
        x += system.table[h].real
        rate -= system.frequency[h] * system.table[h].imag
    entry[0], entry[1], entry[2] = x, rate, momentum
    ledger[STORED] = energy
    for i in range(len(ledger)):
        records.ledger[period, i] = ledger[i]


@inlined
def put_sample(system, rec, row, x, q, state, opened):
    """Keep a sample of the response x and the coordinates q; state: (u,) of the contacts, `opened` where they are."""
    rec.samples[row, 0] = x
    for b in range(len(system.along)):
        slip = q[system.along[b]]
        for i in range(len(q)):
            slip -= system.floor[b, i] * q[i]
        rec.samples[row, 1 + b] = slip
    for i in range(len(q)):
        rec.sampled[row, i] = q[i]
    for i in range(rec.coordinates.shape[1]):
        rec.coordinates[row, i] = q[i]
    for r in range(system.contacts):
        rec.shut[row, r] = 0 if state[r] == opened else 1


@inlined
def note_tilts(system, rec, q, period):
    """Note the tilt of each body in its cavity, where it is the largest of the period so far."""
    for b in range(len(system.along)):
        if system.tilt[b] >= 0:
            tilt = q[system.tilt[b]]
            for i in range(len(q)):
                tilt -= system.turn[b, i] * q[i]
            rec.tilt[period, b] = max(rec.tilt[period, b], abs(tilt))


@entry
def cubic_extremum(h, x0, x1, rate0, rate1):
    """Return x on the cubic through both ends where the line through both velocities is zero; x1 if nowhere."""
    if not rate0 * rate1 < 0.0:
        return x1
    t = rate0 / (rate0 - rate1)
    u = 1.0 - t
    return x0 * u * u * (1.0 + 2.0 * t) + x1 * t * t * (3.0 - 2.0 * t) + h * t * u * (u * rate0 - t * rate1)


@inlined
def _integral(h, x0, x1, rate0, rate1):
    """Return the integral over a step of length h of the cubic through both ends."""
    return h * (0.5 * (x0 + x1) + h * (rate0 - rate1) / 12.0)


@kernel
def note_impact(records, period, row, energy):
    """Let an impact on a row of the log, and the energy of its relative motion (J), count in wear."""
    records.struck[period, row] += energy ** records.exponent[0]
    records.hits[period, row] += 1.0


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
        records.swing[period, 2] += _integral(h, x0, x1, rate0, rate1)


@entry
def note_outputs(system, records, period, h, q0, v0, q1, v1):
    """Let the further outputs on a step count as `note_step` does; q, v: coordinates and rates at both ends, (N,)."""
    for k in range(records.outputs.shape[1] if period >= records.counted[0] else 0):
        x0, x1, rate0, rate1, output = 0.0, 0.0, 0.0, 0.0, records.outputs[period, k]
        for i in range(system.outputs.shape[1]):
            weight = system.outputs[k, i]
            x0, x1, rate0, rate1 = (
                x0 + weight * q0[i],
                x1 + weight * q1[i],
                rate0 + weight * v0[i],
                rate1 + weight * v1[i],
            )
        top = cubic_extremum(h, x0, x1, rate0, rate1)
        if len(records.swing) > 0:
            output[0], output[1] = max(output[0], max(x1, top)), min(output[1], min(x1, top))
            output[2] += _integral(h, x0, x1, rate0, rate1)
        else:
            output[0] = max(output[0], max(abs(x1), abs(top)))
