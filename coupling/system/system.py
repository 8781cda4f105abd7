"""The record of a scene as matrices, the same for every method: M q'' + C q' + K q = loads + J^T lambda.

q = (p, bodies, sliders): real modal coordinates of the structure, mass-normalised; of each body its position x along
its cavity and, of a planar one, y across it and its tilt; and sliders behind springs (Jenkins elements), coordinates
without mass. All motion is relative to the base: a prescribed motion is a structure without modes on a moving base. x
and y count from where the bodies of a cavity stand side by side on the floor, in the middle of the free travel. Tilts
are small: a point (a, b) of a body, from its centre, moves by (x - tilt b, y + tilt a).

The excitation is a sum of e exponentials, its harmonics, and so are the loads: Re sum_h load_h exp(i frequency_h t).
For an excitation that is no such sum, they depend on the angle (system.assembly.loads_of), whose first harmonics
these are.

Everything unilateral or frictional is a unit (system.units).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.scene.shapes.shape import SIDES

#: names of a unit's counterparts, also of elements assembled so far
SURFACES = [*SIDES, "body", "stop", "casing"]
LEFT, RIGHT, FLOOR, CEILING, BODY, STOP, CASING = range(len(SURFACES))


def surface_code(name: str) -> int:
    """Return the index of a name in SURFACES, which is added if new."""
    if name not in SURFACES:
        SURFACES.append(name)
    return SURFACES.index(name)


class CoordinateBlock(NamedTuple):
    """The part of a system that belongs to k of its coordinates."""

    mass: np.ndarray  # (k,)
    stiffness: np.ndarray  # (k,) of a structure, squared undamped angular frequencies; 0 for bodies
    damping: np.ndarray  # (k, k), of a structure
    load: np.ndarray  # (e, k)
    weight: np.ndarray  # (k,)
    response: np.ndarray  # (k,)
    J: np.ndarray  # (rows, k)


@record_with(sizes=("modes", "bodies", "contacts"))
class System(NamedTuple):
    """Matrices of a scene: N coordinates, n of them modes, e harmonics, u units, b bodies, d friction dampers.

    A unit is a contact with its normal row and its slip, or, behind the contacts, a friction element with a constant
    limit, which has only a slip. j units have a spring before their slip, that of a slider; the sliders are the last
    j coordinates, in the order of the units. Rows (2u, N): normals first, then slips. Compiled functions take it as it
    is.
    """

    modes: int  # n
    bodies: int  # b
    contacts: int
    scale: float  # displacement per modal coordinate of a rigid structure, m; 1 for others
    mass: np.ndarray  # (N,) 1 for a mode; kg; kg m^2; of a slider, which has none, a scale
    stiffness: np.ndarray  # (N, N) without springs before sliders
    damping: np.ndarray  # (N, N)
    squares: np.ndarray  # (n,) squared undamped angular frequencies of the structure without bodies
    viscous: np.ndarray  # (n, n) damping of the structure without bodies
    load: np.ndarray  # (e, N) complex amplitudes of the loads of all harmonics, N
    weight: np.ndarray  # (N,) gravity and centrifugal load
    alike: bool  # whether the base accelerates all bodies alike: their cavities have one angle to its motion
    response: np.ndarray  # (N,) functional of the response
    table: np.ndarray  # (e,) complex displacements of a base whose motion is the response (prescribed), m
    frequency: np.ndarray  # (e,) angular frequencies of the harmonics, rad/s
    omega: float  # the first of them, rad/s
    period: float  # s
    moment: float  # after which undecided states are checked again, s
    speed: float  # that the loads give the rows within a period, m/s: a scale for round-off
    J: np.ndarray  # (2u, N)
    rest: np.ndarray  # (u,) gap at q = 0, m
    delassus: np.ndarray  # (2u, 2u) J M^-1 J^T
    friction: np.ndarray  # (u,) coefficient of a contact
    limit: np.ndarray  # (u,) constant limit of a friction element, N; 0 for contacts
    restitution: np.ndarray  # (u,) or the coefficient from which the law takes it at a speed
    restitution_at: int  # address of that law (system.restitution); 0: the coefficient at every speed
    spring: np.ndarray  # (u,) stiffness of a contact that yields, N/m; inf: rigid, and friction elements
    dashpot: np.ndarray  # (u,) N s/m
    slider: np.ndarray  # (u,) int: number of the slider whose slip is the unit's, -1: none
    tangential: np.ndarray  # (j,) stiffness of the springs before sliders, N/m
    elongation: np.ndarray  # (j, N) of these springs
    in_plane: bool  # whether bodies have an extent or springs, or impacts two phases: more than line_system holds
    two_phases: bool  # whether impacts have a phase of compression and one of expansion
    play: np.ndarray  # (u,) free travel, m: the scale of a contact's gap; inf for friction elements
    body: np.ndarray  # (u,) number of the unit's body, the left one of two; without a body, of its own table
    other: np.ndarray  # (u,) number of the body to its right; -1: none
    surface: np.ndarray  # (u,) int: index of its name in SURFACES
    corner: np.ndarray  # (u,) int: 0 to 3, counterclockwise from the lower left one; -1: none
    along: np.ndarray  # (b,) coordinate x of each body
    tilt: np.ndarray  # (b,) coordinate of its tilt, -1: none
    floor: np.ndarray  # (b, N) motion of the cavity along itself, at the height of the body's centre
    turn: np.ndarray  # (b, N) rotation of the cavity
    rise: np.ndarray  # (b, N) motion of the floor across the cavity, below the body's centre
    height: np.ndarray  # (b,) of a body's centre above the floor, m; 0 where a slider has none
    cavity: np.ndarray  # (b,) number of the body's cavity
    holds: np.ndarray  # (b,) friction that holds a body on its floor under its weight, at most, N
    neglected: (
        np.ndarray
    )  # (b,) shortening over the smallest play, per square of the tilt; nan for sliders, 0 for discs
    casing: np.ndarray  # (d, N) motion of the structure at each friction damper
    grip: np.ndarray  # (d,) friction force at slip of each friction damper, N; 0: none
    casing_spring: np.ndarray  # (d,) stiffness before its slider, N/m; inf: rigid
    # (k, n) functionals of further outputs: the response in each sector of a ring
    outputs: np.ndarray = np.zeros((0, 0))

    @property
    def of_structure(self) -> CoordinateBlock:
        """The part of the modal coordinates, without bodies."""
        at = slice(0, self.modes)
        return CoordinateBlock(
            self.mass[at], self.squares, self.viscous, self.load[:, at], self.weight[at], self.response[at],
            self.J[:, at],
        )  # fmt: skip

    @property
    def of_bodies(self) -> CoordinateBlock:
        """The part of the positions of the bodies along their cavities."""
        at = self.along
        return CoordinateBlock(
            self.mass[at], np.zeros(len(at)), self.damping[np.ix_(at, at)], self.load[:, at], self.weight[at],
            self.response[at], self.J[:, at],
        )  # fmt: skip

    @property
    def dampers(self) -> int:
        """Number of friction dampers."""
        return len(self.casing)

    @property
    def sprung(self) -> np.ndarray:
        """The units (j,) with sliders, in their order."""
        return np.flatnonzero(self.slider >= 0)

    @property
    def ease(self) -> np.ndarray:
        """How far sliders (j,) that slip move on, in their direction, as the gap of their contact opens by one."""
        unit = self.sprung
        springs = np.where(unit < self.contacts, self.spring[unit], 0.0)
        return self.friction[unit] * springs / self.tangential

    @property
    def elongations(self) -> int:
        """Number of elongations in a state: of friction dampers, 0 of rigid ones, then of contacts with sliders."""
        return self.dampers + int(np.count_nonzero(self.slider[: self.contacts] >= 0))

    @property
    def drawn(self) -> np.ndarray:
        """Places (j,) of the sliders' elongations in a state."""
        unit, contact = self.sprung, self.sprung < self.contacts
        return np.where(contact, self.dampers + self.slider[unit], self.body[unit])

    @property
    def without_body(self) -> np.ndarray:
        """Whether each unit (u,) moves no body: it is between points of the structure, or one and the ground."""
        bodies = slice(self.modes, len(self.mass) - len(self.tangential))
        moves: np.ndarray = self.J[:, bodies].any(axis=1).reshape(2, -1).any(axis=0)
        return ~moves

    @property
    def across(self) -> np.ndarray:
        """Whether each contact (contacts,) is one with a floor or a ceiling."""
        side = self.surface[: self.contacts]
        return (side == FLOOR) | (side == CEILING)

    @property
    def travels(self) -> np.ndarray:
        """Free travel (contacts,) of each contact, m: along its cavity or across it."""
        return self.play[: self.contacts]

    @property
    def order(self) -> np.ndarray:
        """Multiples (e,) of omega that the harmonics are."""
        return np.rint(self.frequency / self.omega).astype(int)

    def phases(self, angle: np.ndarray) -> np.ndarray:
        """Return the phasors (k, e) of the harmonics at angles omega t (k,)."""
        phasors: np.ndarray = np.exp(1j * np.multiply.outer(angle, self.order))
        return phasors


def on_structure(system: System) -> System:
    """Return the system whose slips follow the drivers of sliders, instead of these."""
    if not len(system.tangential):
        return system
    J = system.J.copy()
    J[len(system.rest) + system.sprung] += system.elongation
    return system._replace(J=J, delassus=(J / system.mass) @ J.T)
