"""The exact flow of a subsystem at a frequency, in compiled code (plane.subsystems): an index of PlanarFlows."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.form_assembly import (
    FormScratch,
    damp,
    invert_rates,
    list_single,
    new_form_scratch,
    set_form,
    set_linear,
    split,
    take_factor,
)
from vanedamp.coupling.engine.peaks import GRIDS, set_grid_factors
from vanedamp.coupling.engine.plane.subsystems import most_stretches
from vanedamp.coupling.engine.plane.tolerances import FASTEST, SLOWEST, STIFFEST
from vanedamp.coupling.numerics.codes import LEAVING, OPEN, WORK_MAP
from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.numerics.compiler.record import record, record_with, room
from vanedamp.coupling.numerics.elimination import reciprocal, solve
from vanedamp.coupling.numerics.tolerances import CANCELLED
from vanedamp.coupling.system.flow import HELD_ROUND_OFF
from vanedamp.coupling.system.system import FLOOR, System
from vanedamp.coupling.system.unit_kinematics import has_friction, is_compliant, is_slip


@record_with(free_axes=1)
class PlanarFlows(NamedTuple):
    """Stack of the flows met so far, first axis s. m is the largest number of modes, the e harmonics included.

    Forms and their inputs are those of line.subsystem_assembly.Flows; no mode is driven.
    """

    subsystem: Annotated[np.ndarray, "s", int]  # its number among the subsystems; 0: a free index
    used: Annotated[np.ndarray, "s", int]  # events of the run when it was last begun
    key: Annotated[np.ndarray, "s u", int]  # the states
    modes: Annotated[np.ndarray, "s", int]  # 0: it is to be filled
    eigenvalue: Annotated[np.ndarray, "s m", complex]
    inverse: Annotated[np.ndarray, "s m", complex]  # 1/eigenvalue
    size: Annotated[np.ndarray, "s m"]  # |eigenvalue|
    project: Annotated[np.ndarray, "s m 2N", complex]  # c = project (q, q') - offset - harmonics
    offset: Annotated[np.ndarray, "s m", complex]
    in_phase: Annotated[np.ndarray, "s m e", complex]  # contribution of the real part of each harmonic's phase to c
    in_quadrature: Annotated[np.ndarray, "s m e", complex]  # of the imaginary part
    motion: Annotated[np.ndarray, "s N m", complex]  # q of each mode
    velocity: Annotated[np.ndarray, "s N m", complex]  # its rate
    rows: Annotated[np.ndarray, "s 2u m", complex]  # J motion
    bend: Annotated[np.ndarray, "s N"]  # constant acceleration
    bend_held: Annotated[np.ndarray, "s N N"]  # and the addition by displacements held by constraints
    force: Annotated[np.ndarray, "s 2u m", complex]
    force_constant: Annotated[np.ndarray, "s 2u"]
    force_held: Annotated[np.ndarray, "s 2u N"]
    self_stress: Annotated[np.ndarray, "s 2u 2u"]  # projector of forces on those that balance each other
    close_gaps: Annotated[np.ndarray, "s N u"]  # displacement that closes gaps of closed contacts
    stop_rows: Annotated[np.ndarray, "s N 2u"]  # velocity that stops their gaps and the slips that stick
    held: Annotated[np.ndarray, "s u", bool]  # whether constraints hold the slip of a unit that counts as slipping
    holds: Annotated[np.ndarray, "s", bool]  # whether contacts hold any row
    growth: Annotated[np.ndarray, "s"]  # largest rate of growth, 1/s
    fastest: Annotated[np.ndarray, "s"]  # largest |real| + |imaginary part| of an eigenvalue, 1/s
    airborne: Annotated[np.ndarray, "s b", bool]  # whether a body touches no floor
    rocks: Annotated[np.ndarray, "s b", bool]  # whether the rate of a body's tilt in its cavity changes
    rubs: Annotated[np.ndarray, "s", bool]  # whether friction or compliant contacts take energy
    coalescing: Annotated[np.ndarray, "s", bool]  # whether modes nearly coalesce: their quadratic forms are zero

    response: Annotated[np.ndarray, "s m", complex]
    outputs: Annotated[np.ndarray, "s k m", complex]
    momentum: Annotated[np.ndarray, "s m", complex]
    work: Annotated[np.ndarray, "s e m", complex]
    driven: Annotated[np.ndarray, "s phases", int]
    load: Annotated[np.ndarray, "s m", complex]
    grid_factor: Annotated[np.ndarray, "s grids m", complex]
    linear: Annotated[np.ndarray, "s m maps"]
    loss: Annotated[np.ndarray, "s 2m 2m"]
    dashpot: Annotated[np.ndarray, "s 2m 2m"]
    square: Annotated[np.ndarray, "s 2m 2m"]
    friction: Annotated[np.ndarray, "s 2m 2m"]  # loss of all units
    lost: Annotated[np.ndarray, "s c 2m 2m"]  # of friction and dashpot of each of c compliant contacts
    damped: Annotated[np.ndarray, "s", bool]
    uncoupled: Annotated[np.ndarray, "s", bool]
    slow_count: Annotated[np.ndarray, "s", int]
    slow: Annotated[np.ndarray, "s pairs 4", int]
    slow_loss: Annotated[np.ndarray, "s pairs", complex]
    slow_dashpot: Annotated[np.ndarray, "s pairs", complex]
    slow_square: Annotated[np.ndarray, "s pairs", complex]
    slow_friction: Annotated[np.ndarray, "s pairs", complex]
    slow_lost: Annotated[np.ndarray, "s c pairs", complex]


def empty_flows(system: System) -> PlanarFlows:
    """Storage for some flows."""
    u, e, sprung = len(system.rest), len(system.frequency), np.isfinite(system.spring)
    m = e + 2 * most_stretches(system)
    return room(PlanarFlows, {
        "s": 8, "u": u, "m": m, "N": len(system.mass), "e": e, "b": system.bodies, "phases": e + 1,
        "grids": GRIDS, "k": len(system.outputs), "maps": WORK_MAP + 4 * e, "c": int(sprung.sum()),
        "pairs": m * (m + 3),
    })  # fmt: skip


@record
class PlanarAssemblyScratch(NamedTuple):
    """Space for intermediate results of `fill`."""

    wave: Annotated[np.ndarray, "q", complex]  # stretches of a harmonic
    stiffness: Annotated[np.ndarray, "q q", complex]  # dynamic stiffness of the stretches
    net: Annotated[np.ndarray, "N", complex]  # loads less forces of stretches
    moved: Annotated[np.ndarray, "N", complex]  # sqrt(M) q
    slip: Annotated[np.ndarray, "m", complex]  # functionals of a unit
    drag: Annotated[np.ndarray, "m", complex]
    push: Annotated[np.ndarray, "m", complex]
    forms: FormScratch


def new_assembly_scratch(system: System) -> PlanarAssemblyScratch:
    """Return space to fill flows of a system."""
    q, size, u = most_stretches(system), len(system.mass), len(system.rest)
    m = len(system.frequency) + 2 * q
    return room(PlanarAssemblyScratch, {"q": q, "N": size, "m": m}, forms=new_form_scratch(m, size, max(size, 2 * u)))


@kernel
def is_in_states(system, subsystems, k, state):
    """Whether a subsystem is that of these states (u,) in a system."""
    for r in range(len(state)):
        if subsystems.state[k, r] != state[r]:
            return False
        rubs_alike = subsystems.friction[k, r] == system.friction[r] and subsystems.limit[k, r] == system.limit[r]
        if subsystems.slips[k, r] and not rubs_alike:
            return False
        if subsystems.pressed[k, r] and subsystems.rest[k, r] != system.rest[r]:
            return False
    return True


@entry
def fill(system, subsystems, k, flows, s, scratch):
    """Set index s of the flows to subsystem k under the excitation.

    Returns whether doubles resolve it: otherwise the spring of a friction damper is as good as rigid, a mode is too
    fast or too slow for the excitation, or this meets a resonance without damping.
    """
    e, count, omega = len(system.frequency), subsystems.modes[k], system.frequency[0]
    if subsystems.slide[k] > STIFFEST * omega:
        return False
    for j in range(count):
        if not SLOWEST * omega <= abs(subsystems.eigenvalue[k, j]) <= FASTEST * omega:
            return False
    for h in range(e):
        if not _respond(system, subsystems, k, h, scratch):
            return False
        _set_harmonic(system, subsystems, k, flows, s, h, scratch)
    _take_modes(system, subsystems, k, flows, s, count, scratch)
    _take_constants(system, subsystems, k, flows, s)
    flows.driven[s, :], flows.uncoupled[s] = e, False
    _set_units(system, flows, s, e + count)
    set_grid_factors(flows, s, e + count, system.period)
    flows.growth[s], flows.fastest[s] = 0.0, 0.0
    for j in range(e + count):
        rate = flows.eigenvalue[s, j]
        flows.load[s, j], flows.inverse[s, j], flows.size[s, j] = 0.0, reciprocal(rate), abs(rate)
        scratch.forms.inverse_rate[j], scratch.forms.frame[j] = flows.inverse[s, j], j if j < e else -1
        flows.growth[s] = max(flows.growth[s], rate.real if j >= e else 0.0)
        flows.fastest[s] = max(flows.fastest[s], abs(rate.real) + abs(rate.imag))
    flows.coalescing[s] = subsystems.coalescing[k]
    _set_energies(system, flows, s, e + count, scratch)
    flows.modes[s], flows.subsystem[s] = e + count, subsystems.number[k]
    return True


@kernel
def _respond(system, subsystems, k, h, scratch):
    """Set the stretches in the steady state of harmonic h, and the remainder of its loads. False at a resonance."""
    size, q, omega, x = len(system.mass), subsystems.stretches[k], system.frequency[h], scratch.wave
    for a in range(q):
        x[a] = 0.0
        for i in range(size):
            x[a] += subsystems.pushed[k, a, i] * (system.load[h, i] / math.sqrt(system.mass[i]))
        for c in range(q):
            scratch.stiffness[a, c] = complex(subsystems.own[k, a, c], omega * subsystems.loss[k, a, c])
        scratch.stiffness[a, a] -= omega * omega
    if not solve(scratch.stiffness, x, q):
        return False
    for i in range(size):
        net = system.load[h, i] / math.sqrt(system.mass[i])
        for a in range(q):
            net -= complex(subsystems.elastic[k, i, a], omega * subsystems.viscous[k, i, a]) * x[a]
        scratch.net[i] = net
    return True


@kernel
def _set_harmonic(system, subsystems, k, flows, s, h, scratch):
    """Set the functionals of a harmonic."""
    size, q, omega, x, net = len(system.mass), subsystems.stretches[k], system.frequency[h], scratch.wave, scratch.net
    turn, moved, terms, sliders = complex(0.0, omega), scratch.moved, 0.0, len(system.tangential)
    for i in range(size):
        moved[i] = 0.0
        for l in range(size):
            moved[i] -= subsystems.oblique[k, i, l] * net[l]
        moved[i] /= omega * omega
        terms = max(terms, abs(net[i]) / (omega * omega))
    if subsystems.springs[k]:  # forces of stiff springs nearly cancel: their stretches are more accurate
        for a in range(q):
            missed = x[a]
            for i in range(size):
                missed -= subsystems.inner[k, a, i] * moved[i]
            scratch.slip[a] = missed
        for i in range(size):
            for a in range(q):
                moved[i] += subsystems.inner[k, a, i] * scratch.slip[a]
    for j in range(sliders):
        follows = 0.0j
        for i in range(size - sliders):
            follows += subsystems.follow[k, j, i] * moved[i]
        moved[size - sliders + j] = follows
    for i in range(size):
        term = moved[i] / math.sqrt(system.mass[i])
        flows.motion[s, i, h] = term if abs(moved[i]) > HELD_ROUND_OFF * terms else 0.0j
        flows.velocity[s, i, h] = turn * flows.motion[s, i, h]
    flows.eigenvalue[s, h] = turn
    for r in range(len(system.J)):
        move, most, force = 0.0j, 0.0, 0.0j
        for i in range(size):
            term = system.J[r, i] * flows.motion[s, i, h]
            move += term
            most += abs(term)
            force += subsystems.carry[k, r, i] * net[i]
        for a in range(q):
            force += complex(subsystems.spring[k, r, a], omega * subsystems.dashpot[k, r, a]) * x[a]
        flows.rows[s, r, h] = move if abs(move) > CANCELLED * most else 0.0j
        flows.force[s, r, h] = force
    for j in range(len(system.frequency)):
        flows.project[s, j, :], flows.offset[s, j] = 0.0, 0.0
        flows.in_phase[s, j, h], flows.in_quadrature[s, j, h] = 0.0, 0.0
    for j in range(subsystems.modes[k]):
        real, imaginary, at = 0.0j, 0.0j, len(system.frequency) + j
        for a in range(q):
            rate = turn * x[a]
            real += subsystems.split[k, j, a] * x[a].real + subsystems.split[k, j, q + a] * rate.real
            imaginary += subsystems.split[k, j, a] * x[a].imag + subsystems.split[k, j, q + a] * rate.imag
        flows.in_phase[s, at, h], flows.in_quadrature[s, at, h] = real, -imaginary


@kernel
def _take_modes(system, subsystems, k, flows, s, count, scratch):
    """Set the functionals of the subsystem's own modes, and the rows' parts of all."""
    e, size = len(system.frequency), len(system.mass)
    for i in range(count):
        j, rate = e + i, subsystems.eigenvalue[k, i]
        flows.eigenvalue[s, j], flows.offset[s, j] = rate, subsystems.offset[k, i]
        for l in range(size):
            flows.motion[s, l, j] = subsystems.motion[k, l, i]
            flows.velocity[s, l, j] = subsystems.motion[k, l, i] * rate
        for l in range(2 * size):
            flows.project[s, j, l] = subsystems.project[k, i, l]
        for r in range(len(system.J)):
            flows.rows[s, r, j], flows.force[s, r, j] = subsystems.rows[k, r, i], subsystems.force[k, r, i]
    for j in range(e + count):
        response, momentum = system.table[j] if j < e else 0.0j, 0.0j
        for i in range(size):
            response += system.response[i] * flows.motion[s, i, j]
            scratch.forms.speed[j, i] = flows.velocity[s, i, j]
        for i in system.along:
            momentum += system.mass[i] * flows.velocity[s, i, j]
        flows.response[s, j], flows.momentum[s, j], scratch.forms.free[j] = response, momentum, momentum
        for o in range(len(system.outputs)):
            flows.outputs[s, o, j] = 0.0
            for i in range(system.modes):
                flows.outputs[s, o, j] += system.outputs[o, i] * flows.motion[s, i, j]


@kernel
def _take_constants(system, subsystems, k, flows, s):
    """Set what does not depend on the excitation."""
    u, size, flows.holds[s] = len(system.rest), len(system.mass), subsystems.holds[k]
    for r in range(u):
        flows.key[s, r], flows.held[s, r] = subsystems.state[k, r], subsystems.held[k, r]
    for i in range(size):
        flows.bend[s, i] = subsystems.bend[k, i]
        for l in range(size):
            flows.bend_held[s, i, l] = subsystems.bend_held[k, i, l]
        for r in range(u):
            flows.close_gaps[s, i, r] = subsystems.close_gaps[k, i, r]
        for r in range(2 * u):
            flows.stop_rows[s, i, r] = subsystems.stop_rows[k, i, r]
    for r in range(2 * u):
        flows.force_constant[s, r] = subsystems.force_constant[k, r]
        for i in range(size):
            flows.force_held[s, r, i] = subsystems.force_held[k, r, i]
        for l in range(2 * u):
            flows.self_stress[s, r, l] = subsystems.self_stress[k, r, l]


@kernel
def _set_units(system, flows, s, m):
    """Set the units' parts, and how bodies move in their cavities."""
    flows.damped[s], flows.rubs[s] = False, False
    for r in range(len(system.rest)):
        pressed = is_compliant(system, r) and flows.key[s, r] < OPEN
        flows.damped[s] = flows.damped[s] or pressed
        flows.rubs[s] = flows.rubs[s] or pressed or _slides(system, flows, s, r)
    for b in range(system.bodies):
        flows.airborne[s, b], flows.rocks[s, b] = True, False
        for r in range(len(system.rest)):
            closed = flows.key[s, r] != OPEN and flows.key[s, r] != LEAVING
            if closed and system.surface[r] == FLOOR and system.body[r] == b:
                flows.airborne[s, b] = False
        for j in range(m + 1 + len(system.mass) if system.tilt[b] >= 0 else 0):
            tilt, terms = 0.0j, 0.0
            for i in range(len(system.mass)):
                term = flows.bend[s, i] + 0.0j
                if j < m:
                    term = flows.motion[s, i, j]
                elif j > m:
                    term = flows.bend_held[s, i, j - m - 1] + 0.0j
                term *= (1.0 if i == system.tilt[b] else 0.0) - system.turn[b, i]
                tilt += term
                terms += abs(term)
            flows.rocks[s, b] = flows.rocks[s, b] or abs(tilt) > CANCELLED * terms


@kernel
def _slides(system, flows, s, r):
    """Whether a unit slips against friction, which takes energy."""
    return is_slip(flows.key[s, r]) and not flows.held[s, r] and has_friction(system, r)


@kernel
def _set_energies(system, flows, s, m, scratch):
    """Set the antiderivatives of the energies' terms for m complex modes, whose functionals are set."""
    u, size, forms, index, width = len(system.rest), len(system.mass), scratch.forms, 0, 0
    set_linear(system, flows, s, m, forms)
    pairs = invert_rates(flows, s, m, system.period, forms)
    for energy in range(5 + len(system.rest)):  # here only: compiled once
        if energy == 0:
            form, slow = flows.loss[s], flows.slow_loss[s]
            split(forms.speed[:m], forms.left)
            for j in range(m):
                forms.span[j, 0], forms.span[j, 1] = 0, size
            damp(system.damping, forms.left, forms.right, forms.span, m, size, False)
        elif energy == 1:
            form, slow = flows.square[s], flows.slow_square[s]
            take_factor(flows.response[s], flows.response[s], 1.0, 0, m, forms)
        elif energy == 2:
            if not flows.rubs[s]:
                break
            form, slow = flows.dashpot[s], flows.slow_dashpot[s]
            for r in range(u):
                width = _take_dashpot(system, flows, s, r, m, scratch, width)
        elif energy == 3:
            form, slow, width = flows.friction[s], flows.slow_friction[s], 0
            for r in range(u):
                width = _take_friction(system, flows, s, r, m, scratch, width)
        elif energy - 4 < u:
            r = energy - 4
            if not is_compliant(system, r):
                continue
            form, slow = flows.lost[s, index], flows.slow_lost[s, index]
            width, index = _take_dashpot(system, flows, s, r, m, scratch, 0), index + 1
            width = _take_friction(system, flows, s, r, m, scratch, width)
        else:
            break
        if energy > 1 and width == 0:
            form[: 2 * m, : 2 * m], slow[:pairs] = 0.0, 0.0
            continue
        set_form(flows, s, m, forms, form, slow, pairs)
        if flows.coalescing[s]:  # plane.energy_balance integrates by quadrature
            form[: 2 * m, : 2 * m], slow[:pairs] = 0.0, 0.0
    flows.slow_count[s] = list_single(flows, s, m, system.period, pairs)


@kernel
def _take_dashpot(system, flows, s, r, m, scratch, index):
    """Take the power of the dashpot of a contact as factor `index` of products. Returns how many there are."""
    if not (is_compliant(system, r) and flows.key[s, r] < OPEN):
        return index
    for j in range(m):
        scratch.push[j] = flows.rows[s, r, j] * flows.eigenvalue[s, j]
    take_factor(scratch.push, scratch.push, system.dashpot[r], index, m, scratch.forms)
    return index + 1


@kernel
def _take_friction(system, flows, s, r, m, scratch, index):
    """Take the power of the friction of a unit, in both orders, as two factors. Returns how many there are."""
    if not _slides(system, flows, s, r):
        return index
    row = len(system.rest) + r
    for j in range(m):
        scratch.slip[j] = flows.rows[s, row, j] * flows.eigenvalue[s, j]
        scratch.drag[j] = flows.force[s, row, j]
    take_factor(scratch.slip, scratch.drag, -0.5, index, m, scratch.forms)
    take_factor(scratch.drag, scratch.slip, -0.5, index + 1, m, scratch.forms)
    return index + 2
