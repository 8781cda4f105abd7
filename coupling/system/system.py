"""The record of a scene as matrices, the same for every method: M q'' + C q' + K q = loads + J^T lambda.

q = (p, x) are the real modal coordinates of the structure, mass-normalised, and the positions of the bodies. All motion
is relative to the base: a prescribed motion is a structure without modes on a moving base. The excitation is a sum of e
exponentials, its harmonics, and so are the loads: Re sum_h load_h exp(i frequency_h t). Those of an excitation that is
no such sum are a function of the angle beside the system (system.assembly.loads_of), whose first harmonics these are.
Everything unilateral or frictional is a row of J (system.constraints), whose displacement is J q + rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record_with


class Part(NamedTuple):
    """The part of a system that belongs to k of its coordinates: as in System, and J (r, k) on them."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    load: np.ndarray
    weight: np.ndarray
    response: np.ndarray
    J: np.ndarray


@record_with(sizes=("modes", "bodies", "friction_rows"))
class System(NamedTuple):
    """Matrices of a scene: n modes, b bodies, N = n + b coordinates, r rows (friction rows first, then contacts).

    Compiled functions take it as it is.
    """

    modes: int  # n
    bodies: int  # b
    friction_rows: int
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
    restitution_at: int  # address of that law (numerics.compiler.function_address); 0: the coefficient at every speed
    free_travel: np.ndarray  # (r,) of the contact's cavity, m: the scale of its gap; inf for friction rows
    left_body: np.ndarray  # (r,) body to the left of a contact, -1: a wall
    right_body: np.ndarray  # (r,) body to the right of a contact, -1: a wall
    moves_with_floor: np.ndarray  # (r,) whether a contact's gap is a difference of slips

    @property
    def of_structure(self) -> Part:
        """The part of the modal coordinates."""
        return self._part(slice(0, self.modes))

    @property
    def of_bodies(self) -> Part:
        """The part of the bodies."""
        return self._part(slice(self.modes, None))

    @property
    def order(self) -> np.ndarray:
        """Multiples (e,) of omega that the harmonics are."""
        return np.rint(self.frequency / self.omega).astype(int)

    def phases(self, angle: np.ndarray) -> np.ndarray:
        """Return the phasors (k, e) of the harmonics at angles omega t (k,)."""
        phasors: np.ndarray = np.exp(1j * np.multiply.outer(angle, self.order))
        return phasors

    def _part(self, at: slice) -> Part:
        return Part(
            self.mass[at], self.stiffness[at], self.damping[at, at], self.load[:, at], self.weight[at],
            self.response[at], self.J[:, at],
        )  # fmt: skip
