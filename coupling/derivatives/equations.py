"""The equations of a system as compiled functions take them: of ScaledDynamics, of its numbers, and of the flows met.

N coordinates, u units, K entries of z, k states, j sliders, e harmonics, b bodies; P numbers by
which there are derivatives, k + P columns of these.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from vanedamp.coupling.derivatives.dynamics import ScaledDynamics
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.numerics.compiler.record import record, record_with
from vanedamp.coupling.system.system import FLOOR
from vanedamp.coupling.system.unit_laws import EVENTS, contacts_of, rubs

#: signals of event functions (unit_laws.signals_of) and their factors: the direction of slip, or fields of a system
SIGNALS = ("gap", "rate", "slip", "push", "drag", "one")
FACTORS = ("", "way", "friction", "limit", "spring", "dashpot")
GAP, RATE, SLIP, PUSH, DRAG, ONE = range(len(SIGNALS))
CONSTANT, WAY, FRICTION_FACTOR, LIMIT_FACTOR, SPRING_FACTOR, DASHPOT_FACTOR = range(len(FACTORS))
#: most terms of an event function
_TERMS = 3


@record_with(free_axes=2)
class Equations(NamedTuple):
    """ScaledDynamics and its system, in the same scales."""

    modes: int
    contacts: int
    two_phases: bool
    law: bool  # whether restitutions depend on speeds
    parts: int  # of the system that are not coupled
    in_line: bool  # whether no body has a tilt
    size: float  # of constants and harmonics in z
    period: float
    omega: float
    root: np.ndarray  # (N,)
    rate: np.ndarray  # (N,)
    unit: np.ndarray  # (2N,)
    rows: np.ndarray  # (2u, N)
    gap: np.ndarray  # (u, K)
    speed: np.ndarray  # (2u, K)
    typical: np.ndarray  # (K,)
    to_state: np.ndarray  # (k, 2N)
    from_state: np.ndarray  # (2N, k)
    scale: np.ndarray  # (k,)
    part: np.ndarray  # (N,) int
    follows: np.ndarray  # (j, 2N)
    bound: np.ndarray  # (j,)
    ease: np.ndarray  # (j,)
    sprung: np.ndarray  # (j,) int
    slider: np.ndarray  # (u,) int
    frequency: np.ndarray  # (e,)
    mass: np.ndarray  # (N,)
    J: np.ndarray  # (2u, N)
    mobility: np.ndarray  # (2u,) J M^-1 J^T of each row
    friction: np.ndarray  # (u,)
    limit: np.ndarray  # (u,)
    restitution: np.ndarray  # (u,)
    spring: np.ndarray  # (u,)
    dashpot: np.ndarray  # (u,)
    play: np.ndarray  # (u,)
    rest: np.ndarray  # (u,)
    rubs: np.ndarray  # (u,) int
    floor_unit: np.ndarray  # (u,) int: whether it is the friction of a body on its floor
    body: np.ndarray  # (u,) int
    along: np.ndarray  # (b,) int
    floor: np.ndarray  # (b, N)
    travel: np.ndarray  # (b,) gaps of the bodies' cavities
    tangential: np.ndarray  # (j,)
    # of the event functions, by their codes: order, terms: signal and factor of each, -1: none; numbers as factors
    order: np.ndarray  # (c,) int
    terms: np.ndarray  # (c, 3, 2) int
    factor: np.ndarray  # (c, 3)
    scaled: np.ndarray  # (c, 3) int: fields whose product the function is relative to


@record_with(free_axes=3)
class EquationTangents(NamedTuple):
    """Derivatives of the equations by P numbers, times their sizes (derivatives.numbers.EquationArrays)."""

    numbers: int
    root: np.ndarray
    rows: np.ndarray
    gap: np.ndarray
    speed: np.ndarray
    mass: np.ndarray
    J: np.ndarray
    friction: np.ndarray
    limit: np.ndarray
    restitution: np.ndarray
    spring: np.ndarray
    dashpot: np.ndarray
    frequency: np.ndarray
    from_state: np.ndarray
    follows: np.ndarray
    bound: np.ndarray
    ease: np.ndarray
    tangential: np.ndarray


@record
class FlowStack(NamedTuple):
    """Flows (f) that a motion has met, by the states of the units; empty indices have none.

    x: n entries of X at row and column; d: those of its derivatives by a number, at rows `to` and columns `of`;
    margin, slope: m functionals of possible events and their rates (dynamics.Flow), possible: their units and codes.
    """

    clock: Annotated[np.ndarray, "1", int]
    used: Annotated[np.ndarray, "f", int]  # by the clock
    counts: Annotated[np.ndarray, "f 3", int]  # entries of X, of its derivatives, and possible events
    state: Annotated[np.ndarray, "f u", int]
    open_force: Annotated[np.ndarray, "f 2u"]
    way: Annotated[np.ndarray, "f u"]
    slips_held: Annotated[np.ndarray, "f u", int]
    stuck: Annotated[np.ndarray, "f u", int]
    most: Annotated[np.ndarray, "f 2u"]  # largest forces that hold (Flow.possible_forces)
    forces: Annotated[np.ndarray, "f 2u K"]
    of_forces: Annotated[np.ndarray, "f P 2u K"]
    norm: Annotated[np.ndarray, "f"]  # of the balanced X, 1/s
    fastest: Annotated[np.ndarray, "f"]  # rate, 1/s
    x: Annotated[np.ndarray, "f n"]
    row: Annotated[np.ndarray, "f n", int]
    column: Annotated[np.ndarray, "f n", int]
    d: Annotated[np.ndarray, "f d"]
    number: Annotated[np.ndarray, "f d", int]
    to: Annotated[np.ndarray, "f d", int]
    of: Annotated[np.ndarray, "f d", int]
    possible: Annotated[np.ndarray, "f m 2", int]
    margin: Annotated[np.ndarray, "f m K"]
    slope: Annotated[np.ndarray, "f m K"]


def equations_of(dynamics: ScaledDynamics) -> Equations:
    """Return the equations of a system by its dynamics."""
    d, system = dynamics, dynamics.system
    codes = max(EVENTS) + 1
    order, terms = np.zeros(codes, int), np.full((codes, _TERMS, 2), -1)
    factor, scaled = np.zeros((codes, _TERMS)), np.full((codes, _TERMS), -1)
    for code, event in EVENTS.items():
        order[code] = event.order
        for place, (signal, by) in enumerate(event.terms):
            terms[code, place] = SIGNALS.index(signal), FACTORS.index(by) if isinstance(by, str) else CONSTANT
            factor[code, place] = 0.0 if isinstance(by, str) else by
        for place, name in enumerate(event.scale):
            scaled[code, place] = _SCALES.index(name)
    cavities = [d.frame.scene.cavity[index] for index in system.cavity]
    arrays = {
        "modes": system.modes, "contacts": system.contacts,
        "parts": int(d.part.max(initial=-1)) + 1, "part": d.part, "two_phases": bool(system.two_phases),
        "law": bool(system.restitution_at), "size": float(d.size),
        "in_line": bool(np.all(system.tilt < 0)), "period": float(system.period), "omega": float(system.omega),
        "mobility": np.diag(system.delassus), "rubs": rubs(system).astype(int),
        "floor_unit": (~contacts_of(system) & (system.surface == FLOOR)).astype(int),
        "travel": np.array([cavity.gap for cavity in cavities], float),
        "order": order, "terms": terms, "factor": factor, "scaled": scaled,
    }  # fmt: skip
    known = system._asdict() | vars(d) | arrays
    return Equations(*(_plain(known[name]) for name in Equations._fields))


#: fields of a system that event functions are relative to
_SCALES = ("play", "spring", "limit")


def turns_of(dynamics: ScaledDynamics, numbers: Parameters | None) -> EquationTangents:
    """Return derivatives by numbers; None: no number."""
    if numbers is not None:
        return EquationTangents(
            len(numbers), *(_plain(getattr(numbers.parts, name)) for name in EquationTangents._fields[1:])
        )
    known = dynamics.system._asdict() | vars(dynamics)
    return EquationTangents(0, *(np.zeros((0, *np.shape(known[name]))) for name in EquationTangents._fields[1:]))


def _plain(value: Any) -> Any:
    """Return an array that compiled functions take as others, and that is nobody else's."""
    if not isinstance(value, np.ndarray):
        return value
    return np.array(value, int if value.dtype.kind in "ib" else float, order="C")
