"""What changes during a run: the automaton's state, its event functions, its records and its scratch space.

Sizes: r rows (friction rows first, then contacts), m complex modes, e of them harmonics of the excitation, n modes of
the structure, b bodies, k channels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.exact.root_search import DEGREE
from vanedamp.coupling.numerics.complementarity import Problem, new_problem
from vanedamp.coupling.response.records import ENERGIES
from vanedamp.coupling.system.assembly import InitialMotion
from vanedamp.coupling.system.system import System

# names that functions are called with are numbers of numpy: numba would compile once for every literal

# state of a friction row; a row that slips is known by its direction, one without friction coasts; HELD: at rest, but
# another row carries its force
SLIP_LEFT, COAST, SLIP_RIGHT, STICK, HELD = np.arange(-1, 4)
# state of a contact row; TOUCHING: closed, but another row carries its force; LEAVING: a compliant contact that has
# ended at zero force, before its gap is open again
OPEN, CLOSED, TOUCHING, LEAVING = np.array([0, 1, 2, 5])
# state of a row, friction or contact, whose spring is closed
SPRUNG = np.int64(4)

# what an event function of a contact stands for, besides the bounds of a force: the gap closes, a gap that was left
# under compression opens, or closes again because its spring would push
CLOSES, OPENS, RECLOSES = np.arange(10, 13)

# a pair of modes whose product hardly changes over a period: what vanishes is the sum of their eigenvalues, the same
# with one conjugate, or one alone
SUM, DIFFERENCE, ALONE, CALM = range(4)

# what is known of an event function: a bound of its second derivative; expansions; `safe` is its first root
BOUNDED, EXPANDED, ROOT = range(3)

COUNTERS = (
    "period", "flow", "searching", "logged", "events", "impacts", "evaluations", "segments", "awake", "carried",
    "closed",
)  # fmt: skip
(
    PERIOD, FLOW, SEARCHING, LOGGED, EVENTS, IMPACTS, EVALUATIONS, SEGMENTS, AWAKE, CARRIED, CLOSED_ROWS,
) = range(len(COUNTERS))  # fmt: skip


class State(NamedTuple):
    """The state at the start of a segment."""

    counters: np.ndarray  # int, by the names above
    time: np.ndarray  # (1,) within the period, s
    key: np.ndarray  # (r,) whether a row is closed: the set names the linear subsystem; counters[CLOSED_ROWS] of them
    amplitude: np.ndarray  # (m,) complex modal amplitudes; the first e are the phases of the excitation's harmonics
    awake: np.ndarray  # (m,) the modes that are awake are the first counters[AWAKE] of these
    coordinates: np.ndarray  # (2n,) p and p' of the structure where a new subsystem begins
    constant: np.ndarray  # (n,) constant part of p
    slip_constant: np.ndarray  # (b,) constant part of the displacements of bodies on springs
    displacement: np.ndarray  # (r,) of each row, m; of a friction row's spring: its elongation
    low: np.ndarray  # (r,) of slips: what is beyond the last digit of `displacement`, m
    velocity: np.ndarray  # (r,)
    drift: np.ndarray  # (r,) constant acceleration of each row's free bodies
    drifts: np.ndarray  # (N,) constant acceleration of the free bodies, 0 for modes
    held: np.ndarray  # (r,) constant force of rows that are not closed, N
    level: np.ndarray  # (r,) constant part of a closed row's force, N
    state: np.ndarray  # (r,) int
    released: np.ndarray  # (r,) the bound at which a row's force was when it let go at this very instant, otherwise 0;
    # minus that bound for a spring that takes over from sliding there
    settling: np.ndarray  # (r,) speed of a flight that takes as long as a chatter may be cut short, m/s
    last_impact: np.ndarray  # (r,) time of the last impact, counted from the period's start, s
    push: np.ndarray  # (r,) impulse of a compliant contact since it began, N s
    fastest: np.ndarray  # (1,) bound of the speeds in the structure, m/s: round-off of a speed is relative to it
    ledger: np.ndarray  # (6,) J


class Channels(NamedTuple):
    """The event functions watched in a segment."""

    row: np.ndarray
    order: np.ndarray
    side: np.ndarray
    known: np.ndarray  # how: BOUNDED, EXPANDED or ROOT
    k0: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    noise: np.ndarray  # round-off of its value at the start, besides that of k0
    safe: np.ndarray  # time before which no root can lie
    g: np.ndarray  # (k, m)
    drive: np.ndarray  # (k, m): of the driven modes
    lower: np.ndarray  # (2, DEGREE + 1) scratch space: lower polynomials of one of them (exact.root_search)


class Scratch(NamedTuple):
    """Space for intermediate results."""

    gain: np.ndarray  # (m,) change of the awake modes' amplitudes over the segment
    bend: np.ndarray  # (m,) what exceeds the tangent in displacements, as amplitudes
    drive: np.ndarray  # (m,) share of the response in the growth of driven modes, 1/s
    coordinates: np.ndarray  # (2n,)
    slips: np.ndarray  # (2b,)
    loads: np.ndarray  # (N,) on the coordinates, or their accelerations
    rates: np.ndarray  # (N,) of these
    sizes: np.ndarray  # (N,) of the terms that they are sums of
    jump: np.ndarray  # (n,) of the modal velocities
    acceleration: np.ndarray  # (r,)
    jerk: np.ndarray  # (r,)
    impulse: np.ndarray  # (r,)
    reaction: np.ndarray  # (r,) of the listed rows
    before: np.ndarray  # (r,) int, row states
    forced: np.ndarray  # (r,) int: the bound that a row's force has just reached
    shut: np.ndarray  # (r,) int: contacts whose bodies are together
    listed: np.ndarray  # (r,) int: the listed rows
    verdict: np.ndarray  # (r,) int, of the listed rows
    side: np.ndarray  # (r,) int, of the listed rows
    members: np.ndarray  # (r,) int: places in that list
    problem: Problem
    order: np.ndarray  # (m,) int: places of the awake modes, those first that the response feels
    change: np.ndarray  # (m,) of the amplitudes over the segment, in that order
    total: np.ndarray  # (m,) sum of the amplitudes at its start and end
    wave: np.ndarray  # (m,) share of the response
    rate: np.ndarray  # (m,) its eigenvalue
    turn: np.ndarray  # (m,) exp(rate t) for one step of a grid
    growth: np.ndarray  # (m,) of driven modes over that step


def new_state(system: System, modes: int, initial: InitialMotion) -> State:
    """The state at time zero; `modes` is the room for complex modes."""
    r, n, b = len(system.delassus), system.modes, system.bodies
    state = State(
        counters=np.zeros(len(COUNTERS), np.int64), time=np.zeros(1), key=np.zeros(r, np.bool_),
        amplitude=np.zeros(modes, complex), awake=np.zeros(modes, np.int64),
        coordinates=np.r_[initial.p, initial.p_rate], constant=np.zeros(n), slip_constant=np.zeros(b),
        displacement=np.array(initial.displacement), low=np.zeros(r), velocity=np.array(initial.velocity),
        drift=np.zeros(r), drifts=np.zeros(n + b), held=np.zeros(r), level=np.zeros(r), state=np.zeros(r, np.int64),
        released=np.zeros(r, np.int64), settling=np.zeros(r), last_impact=np.full(r, -np.inf), push=np.zeros(r),
        fastest=np.zeros(1), ledger=np.zeros(len(ENERGIES)),
    )  # fmt: skip
    state.amplitude[: len(system.frequency)] = 1.0
    return state


def new_channels(system: System, modes: int) -> Channels:
    """Room for two event functions a row."""
    k = 2 * len(system.delassus)
    integers, reals = np.zeros((4, k), np.int64), np.zeros((5, k))
    return Channels._make([*integers, *reals, *np.zeros((2, k, modes), complex), np.zeros((2, DEGREE + 1))])


def new_scratch(system: System, modes: int) -> Scratch:
    """Scratch space for a scene."""
    r, n, b = len(system.delassus), system.modes, system.bodies
    complexes, reals, integers = np.zeros((9, modes), complex), np.zeros((4, r)), np.zeros((7, r), np.int64)
    sizes = (2 * n, 2 * b, n + b, n + b, n + b, n)
    return Scratch._make(
        [*complexes[:3], *(np.zeros(size) for size in sizes), *reals, *integers, new_problem(r),
         np.zeros(modes, np.int64), *complexes[3:]]
    )  # fmt: skip
