"""The system of bodies that only slide, as the kernels for sliders take it: rows instead of units.

Friction rows come first, one for the slip of each body on its floor and one for each friction damper, then contact
rows. A body is one coordinate; Jenkins elements have their springs in their rows, not sliders of their own. A gap
between a body and a wall that moves with the floor, and every gap between two bodies, is a difference of slips, which
are the state, so that slips and gaps can never disagree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with
from vanedamp.coupling.system.system import FLOOR, CoordinateBlock, System

#: relative tolerance of a wall that moves as the floor does
_ALIKE = 1e-14


@record_with(sizes=("modes", "bodies", "friction_rows"))
class LineSystem(NamedTuple):
    """Matrices of a scene: n modes, b bodies, N = n + b coordinates, r rows (friction rows first, then contacts).

    Compiled functions take it as it is.
    """

    modes: int  # n
    bodies: int  # b
    friction_rows: int
    scale: float  # displacement per modal coordinate of a rigid structure, m; 1 for others
    mass: np.ndarray  # (N,) 1 for a mode, kg for a body
    stiffness: np.ndarray  # (N,) squared undamped angular frequencies; 0 for bodies
    damping: np.ndarray  # (N, N)
    proportional: bool  # whether damping couples no two modes
    load: np.ndarray  # (e, N) complex amplitudes of the loads of all harmonics, N
    weight: np.ndarray  # (N,) gravity and centrifugal load along each body's cavity, N
    alike: bool  # whether the base accelerates all bodies alike: their cavities have one angle to its motion
    response: np.ndarray  # (N,) functional of the response
    table: np.ndarray  # (e,) complex displacements of a base whose motion is the response (prescribed), m
    frequency: np.ndarray  # (e,) angular frequencies of the harmonics, rad/s
    omega: float  # the first of them, rad/s
    period: float  # s
    floor: np.ndarray  # (b, n) motion of the floor under each body
    J: np.ndarray  # (r, N)
    rest: np.ndarray  # (r,) displacement of a row at q = 0, m
    delassus: np.ndarray  # (r, r) J M^-1 J^T, with no row closed
    limit: np.ndarray  # (r,) friction force at slip, N; 0 for contacts
    spring: np.ndarray  # (r,) stiffness of a row while it is closed, N/m; inf: rigid
    dashpot: np.ndarray  # (r,) N s/m
    restitution: np.ndarray  # (r,) of rigid contacts, or the coefficient from which their law takes it at a speed
    restitution_at: int  # address of that law (numerics.function_address); 0: the coefficient at every speed
    play: np.ndarray  # (r,) of the contact's cavity, m: the scale of its gap; inf for friction rows
    left_body: np.ndarray  # (r,) body to the left of a contact, -1: a wall
    right_body: np.ndarray  # (r,) body to the right of a contact, -1: a wall
    moves_with_floor: np.ndarray  # (r,) whether a contact's gap is a difference of slips
    outputs: np.ndarray  # (k, n) functionals of further outputs

    @property
    def of_structure(self) -> CoordinateBlock:
        """The part of the modal coordinates."""
        return self._part(slice(0, self.modes))

    @property
    def of_bodies(self) -> CoordinateBlock:
        """The part of the bodies."""
        return self._part(slice(self.modes, None))

    @property
    def dampers(self) -> int:
        """Number of friction dampers."""
        return self.friction_rows - self.bodies

    @property
    def order(self) -> np.ndarray:
        """Multiples (e,) of omega that the harmonics are."""
        return np.rint(self.frequency / self.omega).astype(int)

    def phases(self, angle: np.ndarray) -> np.ndarray:
        """Return the phasors (k, e) of the harmonics at angles omega t (k,)."""
        phasors: np.ndarray = np.exp(1j * np.multiply.outer(angle, self.order))
        return phasors

    def _part(self, at: slice) -> CoordinateBlock:
        return CoordinateBlock(
            self.mass[at], self.stiffness[at], self.damping[at, at], self.load[:, at], self.weight[at],
            self.response[at], self.J[:, at],
        )  # fmt: skip


def line_system(system: System) -> LineSystem:
    """Return the rows of a system whose bodies only slide, without springs or tracks of their own."""
    n, b = system.modes, system.bodies
    d, size, contacts = len(system.casing), n + b, slice(0, system.contacts)
    friction = np.zeros((b + d, size))
    friction[:b, :n], friction[:b, n:] = -system.floor[:, :n], np.eye(b)
    friction[b:] = system.casing[:, :size]
    J = np.vstack([friction, system.J[contacts, :size]]) + 0.0
    left, right = (_body_of(sign * system.J[contacts, n:size]) for sign in (-1.0, 1.0))
    on_structure, on_bodies = J[:, :n], J[:, n:]
    on_floors = on_bodies @ -system.floor[:, :n]
    alike = (np.abs(on_structure - on_floors) <= _ALIKE * np.abs(on_floors)).all(axis=1)

    def rows(slips: float, dampers: np.ndarray | float, of_contacts: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(b, slips), np.zeros(d) + dampers, of_contacts[contacts]])

    contact = np.arange(len(J)) >= b + d
    damping = np.zeros((size, size))
    damping[:n, :n] = system.viscous
    mass = system.mass[:size].copy()
    return LineSystem(
        modes=n, bodies=b, friction_rows=b + d, scale=system.scale, mass=mass,
        stiffness=np.concatenate([system.squares, np.zeros(b)]), damping=damping,
        proportional=bool(np.count_nonzero(system.viscous - np.diag(np.diag(system.viscous))) == 0),
        load=system.load[:, :size].copy(), weight=system.weight[:size].copy(), alike=system.alike,
        response=system.response[:size].copy(), table=system.table, frequency=system.frequency, omega=system.omega,
        period=system.period, floor=system.floor[:, :n].copy(), J=J, rest=rows(0.0, 0.0, system.rest),
        delassus=on_structure @ on_structure.T + (on_bodies / mass[n:]) @ on_bodies.T,
        limit=np.concatenate([system.holds, system.grip, np.zeros(system.contacts)]),
        spring=rows(np.inf, system.casing_spring, system.spring), dashpot=rows(0.0, 0.0, system.dashpot),
        restitution=rows(0.0, 0.0, system.restitution), restitution_at=system.restitution_at,
        play=rows(np.inf, np.inf, system.play), left_body=np.r_[np.full(b + d, -1), left],
        right_body=np.r_[np.full(b + d, -1), right],
        moves_with_floor=contact & on_bodies.any(axis=1) & alike, outputs=system.outputs,
    )  # fmt: skip


def rows_of_units(system: System) -> np.ndarray:
    """Return the row (u,) of line_system that each unit is: the gap of a contact, the slip of a friction element."""
    unit, first = np.arange(len(system.rest)), system.bodies + system.dampers
    elements = system.body + np.where(system.surface == FLOOR, 0, system.bodies)
    return np.where(unit < system.contacts, first + unit, elements)


def _body_of(moved: np.ndarray) -> np.ndarray:
    """Return which body (k,) widens each gap as it moves on, of rows (k, b) of the bodies; -1: none."""
    return np.where((moved > 0.0).any(axis=1), (moved > 0.0).argmax(axis=1) if moved.shape[1] else -1, -1)
