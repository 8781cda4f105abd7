"""The figures of a run from its records: amplitudes, energies, classification, attached mass."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.jit import strict, strict_entry
from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.response.at_rest import at_rest
from vanedamp.coupling.response.records import CONTACT, ENERGIES, EXCITATION, FRICTION, IMPACT_LOSS, STORED, VISCOUS
from vanedamp.coupling.response.static_deflection import distance, static_deflection
from vanedamp.coupling.response.steady_state import confidence_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System

#: the row of figures of a run: fields of a Response (nan: not known), contact_gain and its energies behind them
FIGURES = (
    "amplitude_max", "amplitude_mean", "amplitude_mean_confidence", "static_deflection", "amplitude_max_dynamic",
    "amplitude_mean_dynamic", "amplitude_rms", "amplitude_harmonic", "phase", "impacts_per_period", "energy_residual",
    "attached_mass_fraction", "contact_gain", *ENERGIES,
)  # fmt: skip
(
    MAX, MEAN, CONFIDENCE, STATIC, MAX_DYNAMIC, MEAN_DYNAMIC, RMS, HARMONIC, PHASE, IMPACTS, RESIDUAL, ATTACHED, GAIN,
    ENERGY,
) = range(14)  # fmt: skip
#: classes of motion: the number of excitation periods after which it repeats, or
NON_PERIODIC, NO_CONTACT, STUCK = 0, -1, -2

#: longest period that is looked for, in excitation periods; what it takes to be one
_LONGEST, _SAME, _REPETITIONS = 16, 1e-6, 8
#: fraction of the energy there is that counts as flow in any case
_CARRIED = 1e-3
#: fraction of the largest order's load below which order 1 counts as unexcited
_NO_SHARE = 1e-9
#: motions of floors, relative to the response's, that count as zero
_ROUND_OFF = 1e-12
_TINY = float(np.finfo(float).tiny)


@record_with(free_axes=2)
class Measured(NamedTuple):
    """What the figures need of a system (System, whose arrays these are); b bodies, c contacts, e harmonics."""

    clock: Annotated[np.ndarray, "2"]  # angular frequency of order 1, rad/s, and period, s
    frequency: Annotated[np.ndarray, "e"]  # rad/s
    load: Annotated[np.ndarray, "e N", complex]  # N
    table: Annotated[np.ndarray, "e", complex]  # displacements of a prescribed base, m
    squares: Annotated[np.ndarray, "n"]  # squared angular frequencies of the structure
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


def measured_of(scene: Scene, system: System) -> Measured:
    """Return what the figures need of a scene's system."""
    c, b = system.contacts, system.bodies
    moves = np.abs(system.floor) > _ROUND_OFF * np.abs(system.response).max(initial=0.0)
    excitation = scene.excitation
    return Measured(
        clock=np.array([system.omega, system.period]), frequency=system.frequency, load=system.load,
        table=system.table, squares=system.squares, mass=system.mass, along=system.along, holds=system.holds,
        rest=system.rest, play=system.play, J=system.J, body=system.body, other=system.other,
        lies=~system.across & ~system.without_body[:c] & np.isinf(system.spring[:c]),
        rolls=np.array([damper.form.rolls for damper in scene.damper], bool), fixed=~moves.any(axis=1),
        orders=excitation.waveform is not None or bool(excitation.distributed),
        scale=np.zeros(3 + 2 * b), held=np.zeros(b, bool),
    )  # fmt: skip


@strict_entry
def measure(measured, records, first, done, confidence, figures):
    """Set the row of figures (len(FIGURES),) of the periods from `first` to `done`; return the class of motion.

    confidence: of the mean, m; nan: that of the window.
    """
    omega, period = measured.clock[0], measured.clock[1]
    count = done - first
    span = max(count, 1) * period
    peak, dynamic, peaks, dynamics, square, impacts = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    harmonic, momentum = 0j, 0j
    static = static_deflection(records, first, done, period)
    for i in range(first, done):
        own = distance(records, i, static)
        peak, dynamic = max(peak, records.peak[i]), max(dynamic, own)
        peaks += records.peak[i]
        dynamics += own
        square += records.square[i]
        impacts += records.impacts[i]
        harmonic += records.harmonic[i]
        momentum += records.momentum[i]
    harmonic *= 2.0 / span
    if math.isnan(confidence):
        confidence = confidence_of(records.peak, first, done, np.inf)
    figures[MAX], figures[MEAN], figures[CONFIDENCE] = peak, peaks / max(count, 1), confidence
    figures[STATIC], figures[MAX_DYNAMIC], figures[MEAN_DYNAMIC] = static, dynamic, dynamics / max(count, 1)
    figures[RMS] = math.sqrt(max(square / span, 0.0))
    # 0.0 - x is no -0.0
    figures[HARMONIC] = math.hypot(harmonic.real, harmonic.imag)
    figures[PHASE] = math.atan2(harmonic.real, 0.0 - harmonic.imag)
    figures[IMPACTS] = impacts / max(count, 1)
    for entry in range(len(ENERGIES)):
        figures[ENERGY + entry] = records.ledger[done, entry] - records.ledger[first, entry]
    exchanged = lent_energy(measured.load, measured.along, measured.squares, measured.mass, measured.frequency, omega)
    for i in range(done + 1):
        exchanged = max(exchanged, records.collided[i])
    figures[RESIDUAL] = imbalance(records.ledger, records.parts, done, exchanged)
    figures[GAIN] = contact_gain(records.ledger, records.parts, first, done, exchanged)
    change = records.section[done, 2] - records.section[first, 2]
    figures[ATTACHED] = _attached(measured, change, momentum, harmonic, count, span)
    _set_scale(measured, records.section, first, done)
    if impacts > 0.0:
        return repetition(records.section, first, done, measured.scale)
    friction = figures[ENERGY + FRICTION] > 0.0
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
    """Return the energy that the loads (e, N) lend within a period, J. Arguments as in Measured."""
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
def _attached(measured, change, momentum, harmonic, count, span):
    """Return the attached mass over the bodies' mass, Re(F / (omega^2 X)) / sum m; F: all contact forces on it.

    Of several harmonics, order 1 counts; nan where it is not excited.
    """
    omega, load, total = measured.clock[0], measured.load, 0.0
    square = harmonic.real * harmonic.real + harmonic.imag * harmonic.imag
    # a structure that does not move feels no mass: its harmonic is 0, or the remainder of a decayed start
    small = math.hypot(harmonic.real, harmonic.imag) <= math.sqrt(_TINY)
    if len(measured.along) == 0 or small or count == 0 or (measured.orders and _without_first(measured)):
        return np.nan
    force = 2.0 / span * complex(change - omega * momentum.imag, omega * momentum.real)
    for i in measured.along:
        force -= load[0, i]
        total += measured.mass[i]
    felt = force.real * harmonic.real + force.imag * harmonic.imag
    return -felt / (omega * omega * square) / total


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
