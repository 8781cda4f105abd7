"""The state of a run of planar bodies, and scratch space. Sizes as in System; m modes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.engine.root_search import Expansion, new_expansion
from vanedamp.coupling.numerics.codes import COUNTERS, OPEN
from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.numerics.linear_complementarity import Lemke, new_lemke
from vanedamp.coupling.response.records import ENERGIES
from vanedamp.coupling.system.system import System


@record
class PlanarState(NamedTuple):
    """The state at the start of a segment."""

    # changes all the time
    counters: np.ndarray  # int (numerics.codes)
    time: np.ndarray  # (1,) within the period, s
    q: np.ndarray  # (N,)
    v: np.ndarray  # (N,)
    # (u,) int: OPEN; LEAVING, a compliant contact that has ended before its gap is open; TOUCHING, closed but others
    # carry its force, or nothing presses it; STICK, SLIP_LEFT or SLIP_RIGHT, as which a closed
    # contact without friction counts. A friction element sticks or slips
    state: np.ndarray
    other: np.ndarray  # (u,) int: states that move alike, with forces at their bounds where `state` has them, too
    known: np.ndarray  # (u,) int: states as last logged
    fresh: np.ndarray  # (u,) int: whether contacts have been decided at this instant
    rate: np.ndarray  # (2u,) speeds of rows, scratch
    scale: np.ndarray  # (1,) of the speeds in the scene, m/s: their round-off is relative to it
    reach: np.ndarray  # (N,) largest entry of each coordinate in the rows
    last_impact: np.ndarray  # (u,) time of the last impact, counted from the period's start, s
    pushed: np.ndarray  # (2u,) impulse of a compliant contact since it closed, N s
    lost: np.ndarray  # (u,) its loss since then, J
    ledger: np.ndarray  # (6,) J
    # of a segment
    amplitude: np.ndarray  # (m,) complex; the first e are the phases of the harmonics, those beyond the flow's are zero
    change: np.ndarray  # (2m,) real and imaginary parts of their changes in the segment (energy_forms)
    offset: np.ndarray  # (1 + k,) constant part of the response, m, and of the further outputs
    bend: np.ndarray  # (N,) constant part of the coordinates' acceleration
    force: np.ndarray  # (2u,) constant part of the forces, N
    # (2u,) self-stress of contacts that depend on each other, N: excess of their forces over the least ones
    prestress: np.ndarray


@record
class PlanarEventFunctions(NamedTuple):
    """The event functions of a segment."""

    unit: np.ndarray  # (k,) int
    order: np.ndarray  # (k,) int: POSITION, VELOCITY or FORCE of engine.root_search
    # (k,) int: CLOSES, OPENS, a gap; STOPS, a slip; PARTS, a normal force vanishes; RECLOSES, it would push again;
    # AT_LOW, AT_HIGH, friction at its bound
    what: np.ndarray
    status: np.ndarray  # (k,) int
    k0: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    noise: np.ndarray
    no_root_before: np.ndarray  # s
    g: np.ndarray  # (k, m) complex
    expansion: Expansion


@record
class PlanarScratch(NamedTuple):
    """Space for intermediate results."""

    free: np.ndarray  # (N,) acceleration without contact forces
    terms: np.ndarray  # (N,) size of the terms that it is a sum of
    later: np.ndarray  # (2, N) coordinates and velocities a moment later
    speed: np.ndarray  # (2u,) right-hand side of a problem: accelerations or speeds of the rows
    before_impact: np.ndarray  # (2u,) speeds
    impulse: np.ndarray  # (2u,)
    compression: np.ndarray  # (2u,) impulse of the phase of compression
    compressed: np.ndarray  # (2u,) speeds after it
    least: np.ndarray  # (u,) normal impulse of expansion that compression asks for
    bound: np.ndarray  # (u,) friction that a listed unit has whatever its unknown normal force, N or N s
    before: np.ndarray  # (u,) int: states before the event
    listed: np.ndarray  # (u,) int: units of a problem
    way: np.ndarray  # (u,) int: direction in which a listed unit slips, 0: none yet
    slips: np.ndarray  # (u,) int: direction in which a listed unit slips that might stop; its motion in a short step
    place: np.ndarray  # (u,) int: index of its first unknown
    verdict: np.ndarray  # (u,) int
    doubtful: np.ndarray  # (u,) int: whether the normal force (1) or the slip (2) was not decided
    first: np.ndarray  # (u,) int: verdict now, while that a moment later is sought
    doubt: np.ndarray  # (u,) int: doubtful now
    sliding: np.ndarray  # (u,) int: direction in which a unit slides whose friction is known
    resting: np.ndarray  # (u,) int: whether a compliant contact touches without speed, and its state then
    at_bound: np.ndarray  # (u,) int: whether the spring of a slider is at its bound while its driver is at rest
    drawn: np.ndarray  # (N,) accelerations
    span: np.ndarray  # (N, N) orthonormal basis of rows
    lemke: Lemke
    split: Lemke  # the problem with friction split in two (friction_problem._solve_split)
    part: np.ndarray  # (4u,) int: kind of each of its unknowns
    column: np.ndarray  # (4u,) int: the unknown of `lemke` that it belongs to
    attempt: np.ndarray  # (1,) int: how often a decision has been repeated
    # of a segment's modes: line.state.Scratch
    gain: np.ndarray  # (m,) complex
    bend: np.ndarray  # (m,) complex
    total: np.ndarray  # (2m,)
    wave: np.ndarray  # (m,) complex
    ahead: np.ndarray  # (m,) complex
    step_factor: np.ndarray  # (m,) complex
    growth: np.ndarray  # (m,) complex
    drive: np.ndarray  # (m,) complex


def new_state(system: System, modes: int) -> PlanarState:
    """Return room for the state."""
    u, size = len(system.rest), len(system.mass)
    return PlanarState(
        counters=np.zeros(COUNTERS, np.int64), time=np.zeros(1), q=np.zeros(size), v=np.zeros(size),
        state=np.full(u, OPEN), other=np.full(u, OPEN), known=np.full(u, OPEN), fresh=np.zeros(u, np.int64),
        rate=np.zeros(2 * u), scale=np.zeros(1), reach=np.abs(system.J).max(axis=0, initial=0.0),
        last_impact=np.full(u, -np.inf), pushed=np.zeros(2 * u),
        lost=np.zeros(u), ledger=np.zeros(len(ENERGIES)),
        amplitude=np.zeros(modes, complex), change=np.zeros(2 * modes), offset=np.zeros(1 + len(system.outputs)),
        bend=np.zeros(size), force=np.zeros(2 * u),
        prestress=np.zeros(2 * u),
    )  # fmt: skip


def new_event_functions(system: System, modes: int) -> PlanarEventFunctions:
    """Return storage for three event functions per unit."""
    k = 3 * len(system.rest)
    return PlanarEventFunctions(
        unit=np.zeros(k, np.int64), order=np.zeros(k, np.int64), what=np.zeros(k, np.int64),
        status=np.zeros(k, np.int64), k0=np.zeros(k), k1=np.zeros(k), k2=np.zeros(k), noise=np.zeros(k),
        no_root_before=np.zeros(k), g=np.zeros((k, modes), complex), expansion=new_expansion(modes),
    )  # fmt: skip


def new_scratch(system: System, modes: int) -> PlanarScratch:
    """Return scratch space for a scene."""
    u, size = len(system.rest), len(system.mass)
    integers, waves = iter(np.zeros((12, u), np.int64)), iter(np.zeros((7, modes), complex))
    return PlanarScratch(
        free=np.zeros(size), terms=np.zeros(size), later=np.zeros((2, size)), speed=np.zeros(2 * u),
        before_impact=np.zeros(2 * u), impulse=np.zeros(2 * u), compression=np.zeros(2 * u), compressed=np.zeros(2 * u),
        least=np.zeros(u), bound=np.zeros(u), before=next(integers), listed=next(integers),
        way=next(integers), slips=next(integers), place=next(integers), verdict=next(integers),
        doubtful=next(integers), first=next(integers), doubt=next(integers),
        sliding=next(integers), resting=next(integers), at_bound=next(integers),
        drawn=np.zeros(size),
        span=np.zeros((size, size)), lemke=new_lemke(3 * u),
        split=new_lemke(4 * u), part=np.zeros(4 * u, np.int64), column=np.zeros(4 * u, np.int64),
        attempt=np.zeros(1, np.int64),
        total=np.zeros(2 * modes), gain=next(waves), bend=next(waves), wave=next(waves), ahead=next(waves),
        step_factor=next(waves), growth=next(waves), drive=next(waves),
    )  # fmt: skip
