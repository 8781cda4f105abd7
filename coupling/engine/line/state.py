"""The records that change during a run: the automaton's state, its event functions and its scratch space.

Sizes: r rows (friction rows first, then contacts), m complex modes, e of them harmonics of the excitation, n modes of
the structure, b bodies, N = n + b coordinates, k event functions.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from vanedamp.coupling.engine.line.sleeping import SLEEP
from vanedamp.coupling.engine.root_search import Expansion, new_expansion
from vanedamp.coupling.numerics.codes import COUNTERS
from vanedamp.coupling.numerics.compiler.record import record, room
from vanedamp.coupling.numerics.complementarity import Problem, new_problem
from vanedamp.coupling.response.records import ENERGIES
from vanedamp.coupling.system.line_system import LineSystem


@record
class State(NamedTuple):
    """The state at the start of a segment."""

    # changes in every segment
    counters: Annotated[np.ndarray, "counters", int]  # numerics.codes
    time: Annotated[np.ndarray, "1"]  # within the period, s
    # modal amplitudes, the first e the phases of the excitation's harmonics; the first counters[ACTIVE] are active, the
    # others zero
    amplitude: Annotated[np.ndarray, "m", complex]
    # real and imaginary parts of their changes since the interval began (line.energy_balance)
    change: Annotated[np.ndarray, "2m"]
    displacement: Annotated[np.ndarray, "r"]  # of each row, m; of a friction row's spring: its elongation
    low_word: Annotated[np.ndarray, "r"]  # of slips, sums of two doubles: the part beyond `displacement`, m
    velocity: Annotated[np.ndarray, "r"]  # of each row, m/s
    contact_impulse: Annotated[np.ndarray, "r"]  # impulse of a compliant contact since it began, N s
    ledger: Annotated[np.ndarray, "energies"]  # energies since the start, J

    # bodies that sleep (line.sleeping)
    asleep: Annotated[np.ndarray, "b", int]  # the first contact of one that sleeps, otherwise 0
    sleepers: Annotated[np.ndarray, "b sleep"]

    # changes at impacts and at the start of a period
    largest_speed: Annotated[np.ndarray, "1"]  # bound of the structure's speeds, m/s: scale of their round-off
    last_impact: Annotated[np.ndarray, "r"]  # time of the last impact, counted from the period's start, s

    # changes with the contact states, or is set with their event functions
    state: Annotated[np.ndarray, "r", int]  # state of each row
    active_set: Annotated[np.ndarray, "r", bool]  # the counters[CLOSED_ROWS] closed rows, which name the subsystem
    # bound at which a row's force was when it released at this instant, otherwise 0; -bound: a spring that starts to
    # carry load at that bound
    released: Annotated[np.ndarray, "r", int]
    applied_force: Annotated[np.ndarray, "r"]  # constant force of rows that are not closed, N
    included_force: Annotated[np.ndarray, "r"]  # the one that the constant parts include, N
    capture_speed: Annotated[np.ndarray, "r"]  # rebounds slower than this are completed as a plastic impact, m/s

    # set when a subsystem begins
    coordinates: Annotated[np.ndarray, "2n"]  # p and p' of the structure at that time
    constant: Annotated[np.ndarray, "n"]  # constant part of p
    offset: Annotated[np.ndarray, "values"]  # of the response, m, and of the further outputs
    slip_constant: Annotated[np.ndarray, "b"]  # constant part of the displacements of bodies on springs, m
    constant_force: Annotated[np.ndarray, "r"]  # constant part of a closed row's force, N
    free_acceleration: Annotated[np.ndarray, "r"]  # constant acceleration of each row by its free bodies, m/s^2
    coordinate_acceleration: Annotated[np.ndarray, "N"]  # constant acceleration of the free bodies, m/s^2; 0 for modes


@record
class EventFunctions(NamedTuple):
    """The event functions that are watched in a segment.

    Each is k0 + k1 t + k2 t^2/2 + Re sum_j g_j E(lambda_j t) and the growth of driven modes (engine.root_search), and
    of two sides: another constant less the same motion.
    """

    # set at the start of a segment
    row: Annotated[np.ndarray, "k 2", int]  # the row of each side
    order: Annotated[np.ndarray, "k", int]  # POSITION, VELOCITY or FORCE
    # event at a side's root: AT_LOW, AT_HIGH, STOPS, CLOSES, OPENS or RECLOSES
    meaning: Annotated[np.ndarray, "k 2", int]
    sides: Annotated[np.ndarray, "k", int]  # 1, or 2 where the motion is bounded on both sides
    k0: Annotated[np.ndarray, "k 2"]  # constant of each side
    k1: Annotated[np.ndarray, "k"]  # slope of its polynomial
    k2: Annotated[np.ndarray, "k"]  # second derivative of its polynomial
    noise: Annotated[np.ndarray, "k"]  # round-off of its value at the start, apart from k0's
    g: Annotated[np.ndarray, "k m", complex]  # amplitudes of its exponentials
    drive: Annotated[np.ndarray, "k m", complex]  # rates of growth of the driven modes
    slope: Annotated[np.ndarray, "k"]  # its slope at the start
    bound: Annotated[np.ndarray, "k"]  # of the second derivative of its exponentials
    stop: Annotated[np.ndarray, "b", int]  # the function of each body's slip, -1: none

    # changes in the search
    status: Annotated[np.ndarray, "k", int]  # knowledge of its roots, BOUNDED, EXPANDED or ROOT
    no_root_before: Annotated[np.ndarray, "k"]  # time before which no root lies; its first root once that is known, s
    side: Annotated[np.ndarray, "k", int]  # side of that root

    expansion: Expansion  # of one


@record
class Scratch(NamedTuple):
    """Space for intermediate results: nothing in it outlives the handling of a segment or an event."""

    # a segment: changes of the amplitudes
    gain: Annotated[np.ndarray, "m", complex]  # change of the active modes' amplitudes
    bend: Annotated[np.ndarray, "m", complex]  # the same less its tangent, for displacements

    # a segment: energy balance and peak
    total: Annotated[np.ndarray, "2m"]  # sums of the amplitudes at both ends of an interval
    wave: Annotated[np.ndarray, "m", complex]  # part of each active mode in the response
    ahead: Annotated[np.ndarray, "m", complex]  # that at the next point of a grid
    step_factor: Annotated[np.ndarray, "m", complex]  # exp(rate t) for one step of a grid
    growth: Annotated[np.ndarray, "m", complex]  # of driven modes over that step
    drive: Annotated[np.ndarray, "m", complex]  # part of the response in the growth of driven modes, 1/s

    # a change of subsystem
    coordinates: Annotated[np.ndarray, "2n"]  # p and p'
    slips: Annotated[np.ndarray, "2b"]  # displacements of bodies on springs and their rates

    # forces and accelerations
    loads: Annotated[np.ndarray, "N"]  # on the coordinates, or their accelerations
    rates: Annotated[np.ndarray, "N"]  # time derivatives of these
    sizes: Annotated[np.ndarray, "N"]  # sizes of the terms that they are sums of
    acceleration: Annotated[np.ndarray, "r"]  # of each row, m/s^2
    jerk: Annotated[np.ndarray, "r"]  # of each row, m/s^3

    # impacts
    impulse: Annotated[np.ndarray, "r"]  # of each row, N s
    touching: Annotated[np.ndarray, "r", int]  # contacts whose bodies are together

    # contact states: the listed rows may be at rest
    old_state: Annotated[np.ndarray, "r", int]  # states of the rows before the event
    forced: Annotated[np.ndarray, "r", int]  # the bound that a row's force has just reached, otherwise 0
    listed: Annotated[np.ndarray, "r", int]  # the listed rows
    decision: Annotated[np.ndarray, "r", int]  # state of each listed row in the complementarity problem
    bound: Annotated[np.ndarray, "r", int]  # bound at which its force is, 0 between both; a mark of contacts in impacts
    reaction: Annotated[np.ndarray, "r"]  # force of each listed row, N; in impacts its impulse, N s
    members: Annotated[np.ndarray, "r", int]  # indices in the list of the rows in the second problem, for the rates
    problem: Problem


def new_state(system: LineSystem, modes: int) -> State:
    """Return storage for a state, which a scene's start sets (line.scenes); `modes` complex modes fit."""
    return room(State, _sizes(system, modes))


def new_event_functions(system: LineSystem, modes: int) -> EventFunctions:
    """Return storage for two event functions per row."""
    return room(EventFunctions, _sizes(system, modes), expansion=new_expansion(modes))


def new_scratch(system: LineSystem, modes: int) -> Scratch:
    """Return scratch space for a scene."""
    return room(Scratch, _sizes(system, modes), problem=new_problem(len(system.delassus)))


def _sizes(system: LineSystem, modes: int) -> dict[str, int]:
    r, n, b = len(system.delassus), system.modes, system.bodies
    return {
        "r": r, "k": 2 * r, "m": modes, "n": n, "b": b, "N": n + b, "counters": COUNTERS, "energies": len(ENERGIES),
        "values": 1 + len(system.outputs), "sleep": SLEEP,
    }  # fmt: skip
