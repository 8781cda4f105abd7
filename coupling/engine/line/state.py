"""The records that change during a run: the automaton's state, its event functions and its scratch space.

Sizes: r rows (friction rows first, then contacts), m complex modes, e of them harmonics of the excitation, n modes of
the structure, b bodies, N = n + b coordinates, k event functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.engine.root_search import Expansion, new_expansion
from vanedamp.coupling.numerics.codes import COAST, COUNTERS, OPEN
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.numerics.complementarity import Problem, new_problem
from vanedamp.coupling.response.records import ENERGIES
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.system.line_system import LineSystem, row_motion


@record
class State(NamedTuple):
    """The state at the start of a segment."""

    # changes in every segment
    counters: np.ndarray  # (COUNTERS,) int
    time: np.ndarray  # (1,) within the period, s
    amplitude: np.ndarray  # (m,) complex modal amplitudes, the first e the phases of the excitation's harmonics; the
    # first counters[AWAKE] are awake, the others zero
    change: np.ndarray  # (2m,) real and imaginary parts of their changes since the spell began (exact.energy_balance)
    displacement: np.ndarray  # (r,) of each row, m; of a friction row's spring: its elongation
    low_word: np.ndarray  # (r,) of slips, sums of two doubles: the part beyond the last digit of `displacement`, m
    velocity: np.ndarray  # (r,) of each row, m/s
    contact_impulse: np.ndarray  # (r,) impulse of a compliant contact since it began, N s
    ledger: np.ndarray  # (6,) energies since the start, J

    # changes at impacts and at the start of a period
    largest_speed: np.ndarray  # (1,) bound of the speeds in the structure, m/s: round-off of a speed is relative to it
    last_impact: np.ndarray  # (r,) time of the last impact, counted from the period's start, s

    # changes with the contact states, or is set with their event functions
    state: np.ndarray  # (r,) int: state of each row
    active_set: np.ndarray  # (r,) closed rows, counters[CLOSED_ROWS] of them: the set names the linear subsystem
    released: np.ndarray  # (r,) int: bound at which a row's force was when it let go at this instant, otherwise 0;
    # -bound: a spring that starts to carry load at that bound
    applied_force: np.ndarray  # (r,) constant force of rows that are not closed, N
    capture_speed: np.ndarray  # (r,) rebounds slower than this are completed as a plastic impact, m/s

    # set when a subsystem begins
    coordinates: np.ndarray  # (2n,) p and p' of the structure at that time
    constant: np.ndarray  # (n,) constant part of p
    offset: np.ndarray  # (1,) that of the response, m
    slip_constant: np.ndarray  # (b,) constant part of the displacements of bodies on springs, m
    constant_force: np.ndarray  # (r,) constant part of a closed row's force, N
    free_acceleration: np.ndarray  # (r,) constant acceleration of each row by its free bodies, m/s^2
    coordinate_acceleration: np.ndarray  # (N,) constant acceleration of the free bodies, m/s^2; 0 for modes


@record
class EventFunctions(NamedTuple):
    """The event functions that are watched in a segment.

    Each is k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t) and the growth of driven modes (exact.root_search), and of
    two sides: another constant less the same motion.
    """

    # set at the start of a segment
    row: np.ndarray  # (k, 2) int: the row of each side
    order: np.ndarray  # (k,) int: POSITION, VELOCITY or FORCE
    meaning: np.ndarray  # (k, 2) int: event at a side's root, AT_LOW, AT_HIGH, STOPS, CLOSES, OPENS or RECLOSES
    sides: np.ndarray  # (k,) int: 1, or 2 where the motion is bounded on both sides
    k0: np.ndarray  # (k, 2) constant of each side
    k1: np.ndarray  # (k,) slope of its polynomial
    k2: np.ndarray  # (k,) second derivative of its polynomial
    noise: np.ndarray  # (k,) round-off of its value at the start, apart from that of k0
    g: np.ndarray  # (k, m) complex amplitudes of its exponentials
    drive: np.ndarray  # (k, m) complex rates of growth of the driven modes

    # changes in the search
    status: np.ndarray  # (k,) int: knowledge of its roots, BOUNDED, EXPANDED or ROOT
    no_root_before: np.ndarray  # (k,) time before which no root can lie; its first root once that is known, s
    side: np.ndarray  # (k,) int: side of that root

    expansion: Expansion  # of one of them


@record
class Scratch(NamedTuple):
    """Space for intermediate results: nothing in it outlives the handling of a segment or an event."""

    # a segment: changes of the amplitudes
    gain: np.ndarray  # (m,) change of the awake modes' amplitudes
    bend: np.ndarray  # (m,) the same less its tangent, for displacements

    # a segment: energy balance and peak
    total: np.ndarray  # (2m,) sums of the amplitudes at both ends of a spell
    wave: np.ndarray  # (m,) share of each awake mode in the response
    ahead: np.ndarray  # (m,) that at the next point of a grid
    step_factor: np.ndarray  # (m,) exp(rate t) for one step of a grid
    growth: np.ndarray  # (m,) of driven modes over that step
    drive: np.ndarray  # (m,) share of the response in the growth of driven modes, 1/s

    # a change of subsystem
    coordinates: np.ndarray  # (2n,) p and p'
    slips: np.ndarray  # (2b,) displacements of bodies on springs and their rates

    # forces and accelerations
    loads: np.ndarray  # (N,) on the coordinates, or their accelerations
    rates: np.ndarray  # (N,) time derivatives of these
    sizes: np.ndarray  # (N,) sizes of the terms that they are sums of
    acceleration: np.ndarray  # (r,) of each row, m/s^2
    jerk: np.ndarray  # (r,) of each row, m/s^3

    # impacts
    impulse: np.ndarray  # (r,) of each row, N s
    velocity_jump: np.ndarray  # (n,) of the modal velocities
    touching: np.ndarray  # (r,) int: contacts whose bodies are together

    # contact states: the listed rows may be at rest
    old_state: np.ndarray  # (r,) int: states of the rows before the event
    forced: np.ndarray  # (r,) int: the bound that a row's force has just reached, otherwise 0
    listed: np.ndarray  # (r,) int: the listed rows
    decision: np.ndarray  # (r,) int: state of each listed row in the complementarity problem
    bound: np.ndarray  # (r,) int: bound at which its force is, 0 between both; a mark of contacts in impacts
    reaction: np.ndarray  # (r,) force of each listed row, N; in impacts its impulse, N s
    members: np.ndarray  # (r,) int: places in the list of the rows in the second problem, that of the rates
    problem: Problem


def new_state(system: LineSystem, modes: int, start: RestartState) -> State:
    """Return the state at time zero; `modes` is the room for complex modes."""
    p, rate = (structure / system.scale for structure in (start.displacement, start.velocity))
    displacement, velocity = row_motion(system, start.slip, start.slip_velocity, p, rate, start.elongation)
    r, n, b = len(system.delassus), system.modes, system.bodies
    state = State(
        counters=np.zeros(COUNTERS, np.int64),
        time=np.zeros(1),
        amplitude=np.zeros(modes, complex),
        change=np.zeros(2 * modes),
        displacement=displacement,
        low_word=np.zeros(r),
        velocity=velocity,
        contact_impulse=np.zeros(r),
        ledger=np.zeros(len(ENERGIES)),
        largest_speed=np.zeros(1),
        last_impact=np.full(r, -np.inf),
        state=np.where(np.arange(r) < system.friction_rows, COAST, OPEN),
        active_set=np.zeros(r, np.bool_),
        released=np.zeros(r, np.int64),
        applied_force=np.zeros(r),
        capture_speed=np.zeros(r),
        coordinates=np.r_[p, rate],
        constant=np.zeros(n),
        offset=np.zeros(1),
        slip_constant=np.zeros(b),
        constant_force=np.zeros(r),
        free_acceleration=np.zeros(r),
        coordinate_acceleration=np.zeros(n + b),
    )
    state.amplitude[: len(system.frequency)] = 1.0
    return state


def new_event_functions(system: LineSystem, modes: int) -> EventFunctions:
    """Return room for two event functions a row."""
    k = 2 * len(system.delassus)
    return EventFunctions(
        row=np.zeros((k, 2), np.int64),
        order=np.zeros(k, np.int64),
        meaning=np.zeros((k, 2), np.int64),
        sides=np.ones(k, np.int64),
        k0=np.zeros((k, 2)),
        k1=np.zeros(k),
        k2=np.zeros(k),
        noise=np.zeros(k),
        g=np.zeros((k, modes), complex),
        drive=np.zeros((k, modes), complex),
        status=np.zeros(k, np.int64),
        no_root_before=np.zeros(k),
        side=np.zeros(k, np.int64),
        expansion=new_expansion(modes),
    )


def new_scratch(system: LineSystem, modes: int) -> Scratch:
    """Return scratch space for a scene."""
    r, n, b = len(system.delassus), system.modes, system.bodies
    return Scratch(
        gain=np.zeros(modes, complex),
        bend=np.zeros(modes, complex),
        total=np.zeros(2 * modes),
        wave=np.zeros(modes, complex),
        ahead=np.zeros(modes, complex),
        step_factor=np.zeros(modes, complex),
        growth=np.zeros(modes, complex),
        drive=np.zeros(modes, complex),
        coordinates=np.zeros(2 * n),
        slips=np.zeros(2 * b),
        loads=np.zeros(n + b),
        rates=np.zeros(n + b),
        sizes=np.zeros(n + b),
        acceleration=np.zeros(r),
        jerk=np.zeros(r),
        impulse=np.zeros(r),
        velocity_jump=np.zeros(n),
        touching=np.zeros(r, np.int64),
        old_state=np.zeros(r, np.int64),
        forced=np.zeros(r, np.int64),
        listed=np.zeros(r, np.int64),
        decision=np.zeros(r, np.int64),
        bound=np.zeros(r, np.int64),
        reaction=np.zeros(r),
        members=np.zeros(r, np.int64),
        problem=new_problem(r),
    )
