"""The exact flow of a subsystem at a frequency, in compiled code: sets an index of line.subsystem_assembly.Flows."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.form_assembly import (
    FormScratch,
    damp,
    invert_rates,
    kick,
    list_single,
    new_form_scratch,
    set_form,
    set_linear,
    split,
    take_factor,
)
from vanedamp.coupling.engine.line.subsystems import most_modes
from vanedamp.coupling.engine.line.tolerances import FAR
from vanedamp.coupling.engine.peaks import set_grid_factors
from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.elimination import reciprocal, solve
from vanedamp.coupling.numerics.tolerances import CANCELLED
from vanedamp.coupling.system.line_system import LineSystem


@record
class AssemblyScratch(NamedTuple):
    """Space for intermediate results of `fill`: m complex modes."""

    # harmonics and the modes that they drive
    order: Annotated[np.ndarray, "m", int]  # which mode of the subsystem each mode of the flow is
    driver: Annotated[np.ndarray, "m", int]  # harmonic that drives a mode of the subsystem, e: none
    push: Annotated[np.ndarray, "m", complex]  # rate at which it makes it grow
    load: Annotated[np.ndarray, "N", complex]  # of a harmonic on the real modes, and their response
    stiffness: Annotated[np.ndarray, "N N", complex]  # dynamic stiffness matrix
    steady: Annotated[np.ndarray, "e N", complex]  # (p, xi) of the steady state, without the part of driven modes

    # rows
    reach: Annotated[np.ndarray, "N"]  # of p under weight
    own: Annotated[np.ndarray, "b", complex]  # displacement of each body that its carrier does not have
    row_acceleration: Annotated[np.ndarray, "r", complex]
    row_size: Annotated[np.ndarray, "r"]  # size of its terms

    forms: FormScratch


def new_assembly_scratch(system: LineSystem) -> AssemblyScratch:
    """Return space to fill flows of a system."""
    n, b, r, e, m = system.modes, system.bodies, len(system.delassus), len(system.frequency), most_modes(system)
    sizes = {"b": b, "N": n + b, "r": r, "e": e, "m": m}
    return room(AssemblyScratch, sizes, forms=new_form_scratch(m + e, n + b, max(n, r)))


@kernel
def code_of(closed):
    """Return a hash of the closed rows (r,)."""
    code = 0
    for r in range(len(closed)):
        if closed[r]:
            code += (r + 1) * (r + 2) * (2 * r + 3)
    return code


@entry
def fill(system, subsystems, k, flows, s, scratch):
    """Set index s of the flows to subsystem k under the excitation.

    Returns whether doubles resolve it: otherwise its modes cancel, it rests too far away under its weight, or it is
    excited at a resonance without damping.
    """
    if not _keeps_digits(system, subsystems, k) or not _rests(system, subsystems, k, scratch.reach):
        return False
    e, count = len(system.frequency), subsystems.modes[k]
    for h in range(e):
        if not _respond(system, subsystems, k, h, scratch):
            return False
    _order_modes(flows, s, count, scratch)
    _take_modes(system, subsystems, k, flows, s, count, scratch)
    for h in range(e):
        _set_harmonic(system, subsystems, k, flows, s, h, scratch)
    _set_outputs(system, flows, s, e + count)
    set_grid_factors(flows, s, e + count, system.period)
    _take_constants(system, subsystems, k, flows, s)
    _set_energies(system, flows, s, e + count, scratch.forms)
    flows.modes[s], flows.subsystem[s], flows.code[s] = e + count, subsystems.number[k], code_of(flows.active_set[s])
    return True


@kernel
def is_closed_as(system, subsystems, k, closed):
    """Whether a subsystem is that of these closed rows (r,)."""
    same = True
    for r in range(len(closed)):
        same = same and subsystems.closed[k, r] == closed[r]
    return same


@kernel
def _keeps_digits(system, subsystems, k):
    """Whether modes do not cancel: round-off in a state (p, xi, p', xi') grows to no more than LOST, or FAR."""
    size, omega, grows, natural = len(system.mass), system.omega, subsystems.round_off[k], subsystems.natural[k]
    for i in range(size):
        frequency = max(omega, natural[i])
        for j in range(size):
            other = max(omega, natural[j])
            largest = max(grows[i, j], grows[i, size + j] * other)
            largest = max(largest, grows[size + i, j] / frequency, grows[size + i, size + j] * (other / frequency))
            if not largest <= 1.0:
                return False
    return True


@kernel
def _rests(system, subsystems, k, reach):
    """Whether the round-off of a gap is less than FAR of it where weight carries the structure."""
    n, nearest, far = system.modes, np.inf, 0.0
    for i in range(n):
        total = 0.0
        for b in range(system.bodies):
            total += subsystems.static[k, i, n + b] * system.weight[n + b]
        reach[i] = abs(total)
    for r in range(len(system.spring)):
        nearest, moved = min(nearest, system.play[r]), 0.0
        for i in range(n):
            moved += abs(subsystems.functional[k, r, i]) * reach[i]
        far = max(far, moved)
    moved = 0.0
    for i in range(n):
        moved += abs(system.response[i]) * reach[i]
    return 2.0**-52 * max(far, moved) <= FAR * nearest


@kernel
def _respond(system, subsystems, k, h, scratch):
    """Set the steady state of harmonic h, without the part of the modes that it drives, and these.

    Returns False where the excitation meets a resonance without damping.
    """
    size, q, x = len(system.mass), subsystems.coordinates[k], scratch.load
    if h == 0:
        for j in range(subsystems.modes[k]):
            scratch.driver[j] = len(system.frequency)
    loaded = False
    for a in range(q):
        x[a] = 0.0
        for i in range(size):
            x[a] += subsystems.loads[k, a, i] * system.load[h, i]
        loaded = loaded or x[a] != 0.0
    for i in range(size):
        scratch.steady[h, i] = 0.0
    if not loaded:  # free decay, at any frequency
        return True
    omega = system.frequency[h]
    if _drives(system, subsystems, k, h, scratch.driver):
        _sum_modes(system, subsystems, k, h, scratch)
        return True
    if subsystems.mixed[k]:
        for a in range(q):
            for c in range(q):
                scratch.stiffness[a, c] = complex(0.0, omega * subsystems.damping[k, a, c])
            frequency = subsystems.frequency[k, a]
            scratch.stiffness[a, a] += frequency * frequency - omega * omega
        if not solve(scratch.stiffness, x, q):
            return False
    else:
        for a in range(q):
            frequency = subsystems.frequency[k, a]
            stiffness = complex(frequency * frequency - omega * omega, omega * subsystems.damping[k, a, a])
            if stiffness == 0.0:
                return False
            x[a] *= reciprocal(stiffness)
    for i in range(size):
        for a in range(q):
            scratch.steady[h, i] += subsystems.lift[k, i, a] * x[a]
    return True


@kernel
def _drives(system, subsystems, k, h, driver):
    """Mark the modes that harmonic h drives. Return whether any."""
    driven, omega, near = False, system.frequency[h], subsystems.near[k] / system.period
    for j in range(subsystems.modes[k]):
        rate = subsystems.eigenvalue[k, j]
        apart = omega - rate.imag
        if rate.real * rate.real + apart * apart < near * near:
            driver[j], driven = h, True
    return driven


@kernel
def _sum_modes(system, subsystems, k, h, scratch):
    """Set the steady state of harmonic h as a sum of modes, and the growth of those that it drives."""
    n, omega, steady = system.modes, system.frequency[h], scratch.steady
    for j in range(subsystems.modes[k]):
        push, push_back, rate = 0.0j, 0.0j, subsystems.eigenvalue[k, j]
        for i in range(len(system.mass)):
            term = subsystems.push[k, j, i]
            push += term * system.load[h, i]
            push_back += term.conjugate() * system.load[h, i]
        half = 0.5 if rate.imag > 0.0 else 1.0
        if scratch.driver[j] == h:
            # a real load turns half with the harmonic, half against it, with the conjugate
            scratch.push[j], along = 0.5 * push, 0.0j
        else:
            along = half * push * reciprocal(complex(-rate.real, omega - rate.imag))
        back = 0.0j
        if rate.imag > 0.0:
            back = half * push_back * reciprocal(complex(-rate.real, omega + rate.imag))
        for i in range(n):
            shape = subsystems.shape[k, j, i]
            steady[h, i] += shape * along + shape.conjugate() * back
        for i in range(system.bodies):
            shape = subsystems.slip_shape[k, j, i]
            steady[h, n + i] += shape * along + shape.conjugate() * back


@kernel
def _order_modes(flows, s, count, scratch):
    """Put driven modes first, in order of the harmonics that drive them."""
    e, rank, forms = flows.driven.shape[1] - 1, np.int64(0), scratch.forms
    for h in range(e + 1):
        flows.driven[s, h] = e + rank
        for j in range(count):
            if scratch.driver[j] == h:
                scratch.order[rank], forms.frame[e + rank] = j, h if h < e else -1
                flows.load[s, e + rank] = scratch.push[j] if h < e else 0.0
                rank += 1


@kernel
def _take_modes(system, subsystems, k, flows, s, count, scratch):
    """Set the functionals of the subsystem's own modes."""
    e, n, b = len(system.frequency), system.modes, system.bodies
    for rank in range(count):
        i, j = scratch.order[rank], e + rank
        rate = subsystems.eigenvalue[k, i]
        flows.eigenvalue[s, j], scratch.forms.inverse_rate[j] = rate, reciprocal(rate)
        flows.response[s, j], flows.momentum[s, j] = subsystems.response[k, i], subsystems.momentum[k, i]
        flows.speed[s, j], flows.acceleration[s, j] = subsystems.speed[k, i], subsystems.acceleration[k, i]
        for end in range(2):
            flows.support[s, j, end] = subsystems.support[k, i, end]
            flows.reach[s, j, end] = subsystems.reach[k, i, end]
        for l in range(n):
            scratch.forms.speed[j, l] = subsystems.shape[k, i, n + l]
        for l in range(2 * n):
            flows.shape[s, j, l], flows.project[s, j, l] = subsystems.shape[k, i, l], subsystems.project[k, i, l]
        for l in range(2 * b):
            flows.project_slip[s, j, l] = subsystems.project_slip[k, i, l]
        for l in range(b):
            scratch.forms.speed[j, n + l] = subsystems.body[k, i, l] * rate
        for r in range(len(system.spring)):
            flows.motion[s, r, j] = subsystems.motion[k, r, i]
            flows.velocity[s, r, j] = subsystems.motion[k, r, i] * rate
            flows.force[s, r, j] = subsystems.force[k, r, i]
            flows.impulse_response[s, r, j] = subsystems.impulse_response[k, r, i]
            if subsystems.closed[k, r] and system.spring[r] < np.inf:
                flows.impulse[s, r, j] = subsystems.force[k, r, i] * scratch.forms.inverse_rate[j]


@kernel
def _set_harmonic(system, subsystems, k, flows, s, h, scratch):
    """Set the functionals of a harmonic. A driven mode j adds load_j to its rate."""
    n, b, e, steady = system.modes, system.bodies, len(system.frequency), scratch.steady[h]
    omega, first, last, load = system.frequency[h], flows.driven[s, h], flows.driven[s, h + 1], flows.load[s]
    turn, lowest, highest = complex(0.0, omega), n, np.int64(0)
    flows.eigenvalue[s, h], load[h], scratch.forms.inverse_rate[h], scratch.forms.frame[h] = (
        turn,
        0.0,
        reciprocal(turn),
        h,
    )
    for i in range(n):
        rate = turn * steady[i]
        for j in range(first, last):
            rate += flows.shape[s, j, i] * load[j]
        flows.shape[s, h, i], flows.shape[s, h, n + i], scratch.forms.speed[h, i] = steady[i], rate, rate
        if steady[i] != 0.0 or rate != 0.0:
            lowest, highest = min(lowest, i), i + 1
    flows.support[s, h, 0], flows.support[s, h, 1] = min(lowest, highest), highest
    momentum = 0.0j
    for i in range(b):
        motion, rate = steady[n + i], turn * steady[n + i]
        for j in range(first, last):
            rate += subsystems.slip_shape[k, scratch.order[j - e], i] * load[j]
        flows.excited[s, i, h], flows.excited[s, b + i, h] = motion, rate
        if subsystems.free[k, i]:
            motion -= system.load[h, n + i] / (system.mass[n + i] * omega * omega)
        scratch.own[i], x = motion, motion
        for l in range(n):
            x += subsystems.carrier[k, i, l] * steady[l]
        rate = turn * x
        for j in range(first, last):
            rate += subsystems.body[k, scratch.order[j - e], i] * load[j]
        scratch.forms.speed[h, n + i] = rate
        momentum += system.mass[n + i] * rate
    flows.momentum[s, h], flows.response[s, h] = momentum, system.table[h]
    held = 0.0
    for i in range(n):
        flows.response[s, h] += system.response[i] * steady[i]
        held += abs(system.response[i]) * abs(steady[i])
    largest = abs(flows.response[s, h])
    for r in range(len(system.spring)):
        size, terms = _set_motion(system, subsystems, k, flows, s, h, r, scratch)
        largest, held = max(largest, size), max(held, terms)
    flows.speed[s, h], flows.acceleration[s, h] = largest * omega, max(largest, held) * omega * omega
    _set_forces(system, subsystems, k, flows, s, h, scratch)


@kernel
def _set_outputs(system, flows, s, count):
    """Set the functionals of the further outputs, of modes and harmonics alike."""
    for k in range(len(system.outputs)):
        for j in range(count):
            total = 0.0j
            for i in range(flows.support[s, j, 0], flows.support[s, j, 1]):
                total += system.outputs[k, i] * flows.shape[s, j, i]
            flows.outputs[s, k, j] = total


@kernel
def _set_motion(system, subsystems, k, flows, s, h, r, scratch):
    """Set displacement and velocity of a row in a harmonic. Return its size, and the structure's terms'."""
    n, turn, move, terms = system.modes, flows.eigenvalue[s, h], 0.0j, 0.0
    for i in range(n):
        term = subsystems.functional[k, r, i] * flows.shape[s, h, i]
        move += term
        terms += abs(term)
    held = terms
    for i in range(system.bodies):
        term = system.J[r, n + i] * scratch.own[i]
        move += term
        terms += abs(term)
    if abs(move) <= CANCELLED * terms:
        move = 0.0j  # line.subsystems._functionals
    rate = turn * move
    for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
        rate += flows.motion[s, r, j] * flows.load[s, j]
    flows.motion[s, r, h], flows.velocity[s, r, h], flows.impulse_response[s, r, h] = move, rate, 0.0
    return abs(move), held


@kernel
def _set_forces(system, subsystems, k, flows, s, h, scratch):
    """Set the forces of closed rows in a harmonic."""
    n, rows, closed = system.modes, len(system.spring), subsystems.closed[k]
    acceleration, size, stiff = scratch.row_acceleration, scratch.row_size, False
    for r in range(rows):
        flows.force[s, r, h] = 0.0
        if closed[r] and system.spring[r] < np.inf:
            push = -system.spring[r] * flows.motion[s, r, h] - system.dashpot[r] * flows.velocity[s, r, h]
            grown = push
            for j in range(flows.driven[s, h], flows.driven[s, h + 1]):
                grown -= flows.impulse[s, r, j] * flows.load[s, j]
            flows.force[s, r, h], flows.impulse[s, r, h] = push, grown * scratch.forms.inverse_rate[h]
        stiff = stiff or (closed[r] and system.spring[r] == np.inf)
    if not stiff:
        return
    for r in range(rows):
        if not (closed[r] and system.spring[r] == np.inf):
            continue
        excited, pulled, terms = 0.0j, 0.0j, 0.0
        for i in range(len(system.mass)):
            excited += system.J[r, i] * (system.load[h, i] / system.mass[i])
        for i in range(2 * n):
            term = subsystems.pull[k, r, i] * flows.shape[s, h, i]
            pulled += term
            terms += abs(term)
        for c in range(rows):
            if closed[c] and system.spring[c] < np.inf:
                pulled += system.delassus[r, c] * flows.force[s, c, h]
        acceleration[r], size[r] = pulled + excited, terms + abs(excited)
    for r in range(rows):
        if closed[r] and system.spring[r] == np.inf:
            force, terms = 0.0j, 0.0
            for c in range(rows):
                if closed[c] and system.spring[c] == np.inf:
                    force -= subsystems.closed_inverse[k, r, c] * acceleration[c]
                    terms += abs(subsystems.closed_inverse[k, r, c]) * size[c]
            flows.force[s, r, h] = force if abs(force) > CANCELLED * terms else 0.0j


@kernel
def _take_constants(system, subsystems, k, flows, s):
    """Set what does not depend on the excitation."""
    n, b, flows.coalescing[s] = system.modes, system.bodies, subsystems.coalescing[k]
    flows.sprung[s], flows.damped[s], flows.uncoupled[s], flows.tied[s] = (
        subsystems.sprung[k], subsystems.damped[k], subsystems.uncoupled[k], subsystems.tied[k]
    )  # fmt: skip
    for r in range(len(system.spring)):
        flows.active_set[s, r] = subsystems.closed[k, r]
        for c in range(len(system.spring)):
            flows.closed_inverse[s, r, c] = subsystems.closed_inverse[k, r, c]
    for i in range(n + b):
        for l in range(n + b):
            flows.static[s, i, l] = subsystems.static[k, i, l]
        for l in range(n):
            flows.constrained[s, i, l] = subsystems.constrained[k, i, l]
    for i in range(b):
        flows.attached[s, i] = subsystems.held[k, i]
        for l in range(b):
            flows.body_acceleration[s, i, l] = subsystems.body_acceleration[k, i, l]


@kernel
def _set_energies(system, flows, s, m, forms):
    """Set the antiderivatives of the energies' terms for m complex modes, whose functionals are set."""
    n, e, rows = system.modes, len(system.frequency), len(system.spring)
    # impacts between free flights happen where no rigid row is closed (line.impacts.all_in_flight)
    jumps = True
    for r in range(rows):
        jumps = jumps and not (flows.active_set[s, r] and system.spring[r] == math.inf)
    crowd = flows.step.shape[1] if jumps else 0
    for r in range(crowd):
        for j in range(e, m):
            flows.step_response[s, r, j] = flows.impulse_response[s, r, j] * forms.inverse_rate[j]
    for j in range(m):
        forms.free[j] = 0.0
        for i in range(system.bodies):
            if flows.body_acceleration[s, i, i] != 0.0:
                forms.free[j] += system.mass[n + i] * flows.velocity[s, i, j]
    set_linear(system, flows, s, m, forms)
    pairs = invert_rates(flows, s, m, system.period, forms)
    for energy in range(3):  # here only: compiled once
        if energy == 0:
            form, slow = flows.loss[s], flows.slow_loss[s]
            split(flows.shape[s, :m, n:], forms.left)
            for j in range(m):
                forms.span[j, 0], forms.span[j, 1] = flows.support[s, j, 0], flows.support[s, j, 1]
            damp(system.damping, forms.left, forms.right, forms.span, m, n, system.proportional)
        elif energy == 1:
            form, slow = flows.square[s], flows.slow_square[s]
            take_factor(flows.response[s], flows.response[s], 1.0, 0, m, forms)
        else:
            if not flows.damped[s]:
                break
            form, slow, width = flows.dashpot[s], flows.slow_dashpot[s], 0
            for r in range(rows):
                if flows.active_set[s, r] and system.dashpot[r] > 0.0:
                    take_factor(flows.velocity[s, r], flows.velocity[s, r], system.dashpot[r], width, m, forms)
                    width += 1
        set_form(flows, s, m, forms, form, slow, pairs)
        if flows.coalescing[s]:  # line.energy_balance integrates by quadrature
            form[: 2 * m, : 2 * m], slow[:pairs] = 0.0, 0.0
        for r in range(rows if jumps else 0):
            kick(flows.impulse_response[s, r, :m], form, flows.kick[s, r, energy])
        for r in range(crowd):
            kick(flows.step_response[s, r, :m], form, flows.step[s, r, energy])
    flows.slow_count[s] = list_single(flows, s, m, system.period, pairs)
    for r in range(rows if jumps else 0):
        _set_maps(flows, s, e, m, flows.impulse_response[s, r], flows.kick_maps[s, r])
    for r in range(rows if crowd > 0 else 0):
        moved, stirred = 0.0, 0.0
        for j in range(e, m):
            rate = abs(flows.eigenvalue[s, j])
            moved += (rate * abs(flows.motion[s, r, j])) ** 2
            stirred += (rate * abs(flows.impulse_response[s, r, j])) ** 2
        flows.stir[s, r, 0], flows.stir[s, r, 1] = math.sqrt(moved), math.sqrt(stirred)
    for r in range(crowd):
        _set_maps(flows, s, e, m, flows.step_response[s, r], flows.step_maps[s, r])


@kernel
def _set_maps(flows, s, e, m, change, maps):
    """Set the linear maps of a change of the amplitudes of the modes from e to m."""
    for c in range(len(maps)):
        maps[c] = 0.0
        for j in range(e, m):
            maps[c] += change[j].real * flows.linear[s, j, 2 * c] + change[j].imag * flows.linear[s, j, 2 * c + 1]
