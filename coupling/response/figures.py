"""The sums of a run from its records (quantities.sums), and its class of motion."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict, strict_entry
from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.quantities.sums import ENERGIES, SUMS
from vanedamp.coupling.response.at_rest import at_rest
from vanedamp.coupling.response.records import CONTACT, EXCITATION, FRICTION, IMPACT_LOSS, STORED, VISCOUS
from vanedamp.coupling.response.static_deflection import distance, static_deflection
from vanedamp.coupling.response.steady_state import confidence_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

(
    PERIODS, SPAN, OMEGA, PEAK, PEAKS, CONFIDENCE, STATIC, DISTANCE, DISTANCES, SQUARE, CHANGE, IMPACTS, UNBALANCED,
    MADE, CARRIED, HARMONIC, _, MOMENTUM, _, LOAD, _, ENERGY,
) = range(len(SUMS) - len(ENERGIES) + 1)  # fmt: skip
#: classes of motion: the number of excitation periods after which it repeats, or
NON_PERIODIC, NO_CONTACT, STUCK = 0, -1, -2

#: longest period that is looked for, in excitation periods; its criteria
_LONGEST, _SAME, _REPETITIONS = 16, 1e-6, 8
#: fraction of the energy there is that counts as flow in any case
_CARRIED = 1e-3
#: fraction of the largest order's load below which order 1 counts as unexcited
_NO_SHARE = 1e-9
#: motions of floors, relative to the response's, that count as zero
_ROUND_OFF = 1e-12
#: amplitude of order 1, over the largest displacement there is, or that the exchanged energy could make, below
#: which it is round-off
_STANDS = 1e-12
_TINY = float(np.finfo(float).tiny)


@record_with(free_axes=2)
class FigureInputs(NamedTuple):
    """Inputs of figures from a system (System, whose arrays these are); b bodies, c contacts, e harmonics."""

    clock: Annotated[np.ndarray, "2"]  # angular frequency of order 1, rad/s, and period, s
    frequency: Annotated[np.ndarray, "e"]  # rad/s
    load: Annotated[np.ndarray, "e N", complex]  # N
    table: Annotated[np.ndarray, "e", complex]  # displacements of a prescribed base, m
    squares: Annotated[np.ndarray, "n"]  # squared angular frequencies of the structure
    response: Annotated[np.ndarray, "N"]  # functional of the response
    mass: Annotated[np.ndarray, "N"]  # kg
    along: Annotated[np.ndarray, "b", int]  # coordinate of each body
    holds: Annotated[np.ndarray, "b"]  # friction that holds a body on its floor, N
    rest: Annotated[np.ndarray, "u"]  # gaps at rest, m
    play: Annotated[np.ndarray, "u"]  # m
    J: Annotated[np.ndarray, "2u N"]
    body: Annotated[np.ndarray, "u", int]  # body of a contact
    other: Annotated[np.ndarray, "u", int]  # the body to its right, -1: none
    lies: Annotated[np.ndarray, "c", bool]  # whether a body can lie on the contact: a rigid one along its cavity
    rolls: Annotated[np.ndarray, "b", bool]  # whether friction makes the body roll
    fixed: Annotated[np.ndarray, "b", bool]  # whether the structure does not move its floor
    orders: bool  # whether order 1 may be missing among the loads
    scale: Annotated[np.ndarray, "s"]  # (3 + 2b,) room for the scale of each state
    held: Annotated[np.ndarray, "b", bool]  # room for which bodies are at rest


def measured_of(scene: Scene, system: System) -> FigureInputs:
    """Return inputs of figures from a scene's system."""
    c, b = system.contacts, system.bodies
    moves = np.abs(system.floor) > _ROUND_OFF * np.abs(system.response).max(initial=0.0)
    excitation = scene.excitation
    return FigureInputs(
        clock=np.array([system.omega, system.period]), frequency=system.frequency, load=system.load,
        table=system.table, squares=system.squares, response=system.response, mass=system.mass, along=system.along,
        holds=system.holds, rest=system.rest, play=system.play, J=system.J, body=system.body, other=system.other,
        lies=~system.across & ~system.without_body[:c] & np.isinf(system.spring[:c]),
        rolls=np.array([damper.form.rolls for damper in scene.damper], bool), fixed=~moves.any(axis=1),
        orders=excitation.waveform is not None or bool(excitation.distributed),
        scale=np.zeros(3 + 2 * b), held=np.zeros(b, bool),
    )  # fmt: skip


@strict_entry
def measure(measured, records, first, done, confidence, sums):
    """Set the row of sums (len(SUMS),) of the periods from `first` to `done`; return the class of motion.

    confidence: of the mean, m; nan: that of the window.
    """
    omega, period = measured.clock[0], measured.clock[1]
    count = done - first
    harmonic, momentum = 0j, 0j
    static = static_deflection(records, first, done, period)
    sums[:] = 0.0
    for i in range(first, done):
        swing = distance(records, i, static)
        sums[PEAK], sums[DISTANCE] = max(sums[PEAK], records.peak[i]), max(sums[DISTANCE], swing)
        sums[PEAKS] += records.peak[i]
        sums[DISTANCES] += swing
        sums[SQUARE] += records.square[i]
        sums[IMPACTS] += records.impacts[i]
        harmonic += records.harmonic[i]
        momentum += records.momentum[i]
    if math.isnan(confidence):
        confidence = confidence_of(records.peak, first, done, np.inf)
    sums[PERIODS], sums[SPAN], sums[OMEGA] = max(count, 1), period, omega
    sums[CONFIDENCE], sums[STATIC] = confidence, static
    sums[HARMONIC], sums[HARMONIC + 1] = harmonic.real, harmonic.imag
    sums[MOMENTUM], sums[MOMENTUM + 1] = momentum.real, momentum.imag
    sums[CHANGE] = records.section[done, 2] - records.section[first, 2]
    for entry in range(len(ENERGIES)):
        sums[ENERGY + entry] = records.ledger[done, entry] - records.ledger[first, entry]
    exchanged = lent_energy(measured.load, measured.along, measured.squares, measured.mass, measured.frequency, omega)
    for i in range(done + 1):
        exchanged = max(exchanged, records.collided[i])
    sums[UNBALANCED] = imbalance(records.ledger, records.parts, done, exchanged)
    sums[MADE] = contact_gain(records.ledger, records.parts, first, done, exchanged)
    _carry(measured, harmonic, count, exchanged, sums)
    _set_scale(measured, records.section, first, done)
    if sums[IMPACTS] > 0.0:
        return repetition(records.section, first, done, measured.scale)
    friction = sums[ENERGY + FRICTION] > 0.0
    return STUCK if not friction and at_rest(measured, records.section, first, done) else NO_CONTACT


@strict_entry
def repetition(section, first, done, scale):
    """Return after how many periods the sections from `first` to `done` repeat, NON_PERIODIC if they do not.

    The last section equals those k, 2k, ... periods before it within 1e-6 of each state's scale (states,), over at
    least 8 repetitions or half of the section.
    """
    for k in range(1, _LONGEST + 1):
        span = min(_REPETITIONS * k, done - first - k)
        if span < k:
            break
        same = True
        for i in range(done, done - span, -1):
            for state in range(len(scale)):
                same = same and abs(section[i, state] - section[i - k, state]) < _SAME * scale[state]
            if not same:
                break
        if same:
            return k
    return NON_PERIODIC


@strict_entry
def imbalance(ledger, parts, done, exchanged):
    """Return the imbalance of the energies of the periods up to `done`, relative to the energy that flowed (_flow)."""
    flowed = _flow(ledger, parts, done, exchanged)
    open_by = ledger[done, EXCITATION] - ledger[0, EXCITATION]
    for entry in range(VISCOUS, ledger.shape[1]):
        open_by -= ledger[done, entry] - ledger[0, entry]
    return 0.0 if flowed == 0.0 else abs(open_by) / flowed


@strict_entry
def contact_gain(ledger, parts, first, done, exchanged):
    """Return the energy that impacts or contacts have made, relative to the energy that flowed (_flow).

    The larger of the two, up to period `done`, from the start of the run or from `first` on; 0: they only took some.
    """
    made = 0.0
    for entry in (IMPACT_LOSS, CONTACT):
        made = max(made, max(ledger[0, entry], ledger[first, entry]) - ledger[done, entry])
    flowed = _flow(ledger, parts, done, exchanged)
    return 0.0 if flowed == 0.0 else made / flowed


@strict
def _flow(ledger, parts, done, exchanged):
    """Return the energy that flowed up to `done`, J.

    The largest term, with stored energy by its parts (periods + 1, 1 + b): energy that moves with a heavy body, and no
    further, is no flow. `exchanged` (J) comes and goes within a period. A thousandth of the stored energy always
    counts: below it the imbalance would measure the round-off of energy that only moves with a body.
    """
    flowed, swing, most = exchanged, 0.0, 0.0
    for part in range(parts.shape[1]):
        low, high = parts[0, part], parts[0, part]
        for i in range(1, done + 1):
            low, high = min(low, parts[i, part]), max(high, parts[i, part])
        swing += high - low
    for i in range(done + 1):
        stored = 0.0
        for part in range(parts.shape[1]):
            stored += abs(parts[i, part])
        most = max(most, stored)
        for entry in range(STORED):
            flowed = max(flowed, abs(ledger[i, entry] - ledger[0, entry]))
    return max(flowed, swing, _CARRIED * most)


@strict_entry
def lent_energy(load, along, squares, mass, frequency, omega):
    """Return the energy that the loads (e, N) exchange within a period, J. Arguments as in FigureInputs."""
    lent = 0.0
    for h in range(len(frequency)):
        # the mean of a waveform counts as a slow load
        rate = max(frequency[h], omega)
        for i in range(len(squares)):
            size = load[h, i].real * load[h, i].real + load[h, i].imag * load[h, i].imag
            lent += size / max(squares[i], rate * rate)
        for i in along:
            size = load[h, i].real * load[h, i].real + load[h, i].imag * load[h, i].imag
            lent += size / (mass[i] * (rate * rate))
    return lent / 2.0


@strict
def _set_scale(measured, section, first, done):
    """Set the scale of each state of the section.

    A displacement and its velocity have one scale, because either may vanish at the period's start. The scale of the
    bodies' momentum is that at the largest speed: of a heavy body, which almost rests, it is a small difference of
    the slip's speed and the structure's, and its slow drift does not act on the motion in the cavity.
    """
    scale, b, omega = measured.scale, len(measured.along), measured.clock[0]
    for state in range(len(scale)):
        scale[state] = 0.0
        for i in range(first, done + 1):
            scale[state] = max(scale[state], abs(section[i, state]))
    x, total = max(scale[0], scale[1] / omega), 0.0
    widest = x
    for body in range(b):
        slip = max(scale[3 + body], scale[3 + b + body] / omega)
        scale[3 + body], scale[3 + b + body] = slip + _TINY, omega * slip + _TINY
        widest = max(widest, slip)
        total += measured.mass[measured.along[body]]
    scale[0], scale[1], scale[2] = x + _TINY, omega * x + _TINY, total * omega * widest + _TINY


@strict
def _carry(measured, harmonic, count, exchanged, sums):
    """Set the loads on the bodies and their mass; nan where no attached mass is felt.

    A structure at rest has none: its harmonic is 0, the remainder of a decayed start, or the round-off of
    where friction holds it against its loads. Of several harmonics, order 1 counts; nothing is known where it
    is not excited.
    """
    amplitude = 2.0 / (sums[PERIODS] * sums[SPAN]) * math.hypot(harmonic.real, harmonic.imag)
    small = amplitude <= max(math.sqrt(_TINY), _STANDS * max(sums[PEAK], _reach(measured, exchanged)))
    for i in measured.along:
        sums[LOAD] += measured.load[0, i].real
        sums[LOAD + 1] += measured.load[0, i].imag
        sums[CARRIED] += measured.mass[i]
    if len(measured.along) == 0 or small or count == 0 or (measured.orders and _without_first(measured)):
        sums[CARRIED] = np.nan


@strict
def _reach(measured, energy):
    """Return the largest displacement of the response that an energy (J) could make, m; 0 of a prescribed one."""
    yields = 0.0
    for i in range(len(measured.squares)):
        weight = measured.response[i]
        yields += weight * weight / max(measured.squares[i], measured.clock[0] * measured.clock[0])
    return math.sqrt(2.0 * energy * yields)


@strict
def _without_first(measured):
    """Whether a waveform or loads have sines of higher orders only, by which no attached mass is measured."""
    first, most = 0.0, 0.0
    for h in range(len(measured.table)):
        size = math.hypot(measured.table[h].real, measured.table[h].imag)
        for i in range(measured.load.shape[1]):
            size = max(size, math.hypot(measured.load[h, i].real, measured.load[h, i].imag))
        first, most = (size if h == 0 else first), max(most, size)
    return first <= _NO_SHARE * most
