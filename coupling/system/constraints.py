"""Constraint rows of a scene: everything unilateral or frictional is a row of one matrix J over the coordinates (p, x).

p are the modal coordinates of the structure, x the positions of the bodies. Friction rows come first (one a body: its
slip on the floor; one a friction damper: the structure's motion against the casing), then contact rows (one a gap: left
wall to first body, body to body, last body to right wall; one a stop).

A gap between a body and a wall that moves with the floor, and every gap between two bodies, is the difference of slips,
which are the state, so that slips and gaps can never disagree.

A body whose height is known lies flat in a cavity that turns by theta: its centre, h/2 above the floor, moves by
u - theta h/2 where the floor moves by u. So all its rows are those of surfaces at that height; without a height they
are those of the interface coordinates themselves.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.contact_laws.law import Element
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.body_loads import body_loads
from vanedamp.coupling.system.cavities import surface_labels
from vanedamp.coupling.system.modal_basis import ModalBasis, interface_row
from vanedamp.coupling.system.surfaces import SIDES, flexibility, heights, surfaces_of

#: coefficients of friction below this are none
_SMOOTH = 1e-9
#: mobility (1/kg) of a point that the first mode does not move
_LIGHT = 1e-30


class Constraints(NamedTuple):
    """Rows of a scene, with the meaning of the fields of the same name of system.system.System.

    floors: labels of the floors under the bodies.
    """

    friction_rows: int
    floor: np.ndarray
    floors: list[str]
    J: np.ndarray
    rest: np.ndarray
    limit: np.ndarray
    spring: np.ndarray
    dashpot: np.ndarray
    restitution: np.ndarray
    free_travel: np.ndarray
    left_body: np.ndarray
    right_body: np.ndarray
    moves_with_floor: np.ndarray


#: of rows that do not rebound
_RIGID = Element(0.0)


@dataclass(frozen=True)
class _Row:
    """One constraint: its functional of the modal coordinates (n,), the bodies left and right of it (-1: none).

    A friction row has a limit, a contact an element and a free travel; rest: gap with the bodies at mid-travel, m.
    """

    structure: np.ndarray
    left: int = -1
    right: int = -1
    limit: float = 0.0
    element: Element = _RIGID
    rest: float = 0.0
    free_travel: float = np.inf


def constraints_of(scene: Scene, basis: ModalBasis, at: str) -> Constraints:
    """Form the rows of a scene; `at`: interface label of the excitation, where friction dampers act by default.

    Raises InputError for an unknown label.
    """
    cavities = [_surfaces(scene, basis, index) for index in range(len(scene.cavity))]
    names = [cavity.name for cavity in scene.cavity]
    owner = [names.index(damper.cavity) for damper in scene.damper]
    around = [
        _at_height(scene, basis, index, float(height)) if height else cavities[index]
        for index, height in zip(owner, heights(scene), strict=True)
    ]
    n, bodies = len(basis.stiffness), len(owner)
    floor = np.reshape([surfaces.floor for surfaces in around], (bodies, n))
    floors = [surface_labels(scene, index)[2] for index in owner]
    friction = [*_slips(scene, floor, body_loads(scene, basis).across), *_friction_dampers(scene, basis, at)]
    rows = [*friction, *_gaps(scene, cavities, around, owner), *_stops(scene, basis)]
    structure = np.reshape([row.structure for row in rows], (len(rows), n))
    left, right = (np.array([getattr(row, side) for row in rows], np.int64) for side in ("left", "right"))
    numbers = np.arange(bodies)
    on_bodies = (right[:, None] == numbers).astype(float) - (left[:, None] == numbers)
    # a gap that only bodies and walls that move with their floors bound is a difference of slips
    on_floors, slips = on_bodies @ -floor, len(friction)
    contact = np.arange(len(rows)) >= slips
    alike = (np.abs(structure - on_floors) <= 1e-14 * np.abs(on_floors)).all(axis=1)
    moves = contact & on_bodies.any(axis=1) & alike
    return Constraints(
        friction_rows=slips, floor=floor, floors=floors, J=np.hstack([structure, on_bodies]),
        rest=np.array([float(row.rest) for row in rows]), limit=np.array([float(row.limit) for row in rows]),
        spring=np.array([float(row.element.stiffness) for row in rows]),
        dashpot=np.array([float(row.element.dashpot) for row in rows]),
        restitution=np.array([float(row.element.restitution) for row in rows]),
        free_travel=np.array([float(row.free_travel) for row in rows]), left_body=np.where(contact, left, -1),
        right_body=np.where(contact, right, -1), moves_with_floor=moves,
    )  # fmt: skip


class _Surfaces(NamedTuple):
    """Functionals (n,) of left wall, right wall and floor as a body meets them, flexibilities of the walls (m/N)."""

    left: np.ndarray
    right: np.ndarray
    floor: np.ndarray
    flexibility: tuple[float, float]


def _surfaces(scene: Scene, basis: ModalBasis, index: int) -> _Surfaces:
    """Return the surfaces of a cavity where their motions are known."""
    labels = surface_labels(scene, index)
    left, right, floor = (
        interface_row(basis, label, f"cavity[{index}].{side}") for label, side in zip(labels, SIDES, strict=False)
    )
    return _Surfaces(left, right, floor, (basis.flexibility({labels[0]: 1.0}), basis.flexibility({labels[1]: 1.0})))


def _at_height(scene: Scene, basis: ModalBasis, index: int, height: float) -> _Surfaces:
    """Return the surfaces of a cavity at a height above its floor, m."""
    left, right, floor, _ = surfaces_of(scene, basis, index)
    yields = [flexibility(basis, wall, True, 0.0 if wall.y is None else wall.y - height) for wall in (left, right)]
    motions = [surface.motion(0.0, height)[0] for surface in (left, right, floor)]
    return _Surfaces(motions[0], motions[1], motions[2], (yields[0], yields[1]))


def _slips(scene: Scene, floor: np.ndarray, across: np.ndarray) -> list[_Row]:
    """Return a row for the slip of each body on its floor. across: (b,) acceleration that presses it on, m/s^2."""
    rows = []
    for i, damper in enumerate(scene.damper):
        normal = damper.mass * float(across[i]) if damper.normal_load is None else damper.normal_load
        rows.append(_Row(-floor[i], right=i, limit=_coefficient(damper.friction) * max(normal, 0.0)))
    return rows


def _friction_dampers(scene: Scene, basis: ModalBasis, at: str) -> list[_Row]:
    """Return a row for the structure's motion against the casing at each friction damper."""
    rows = []
    for i, damper in enumerate(scene.friction_damper):
        structure = interface_row(basis, damper.at or at, f"friction_damper[{i}].at")
        element = _RIGID if damper.stiffness is None else Element(0.0, damper.stiffness)
        rows.append(_Row(structure, limit=_coefficient(damper.friction) * damper.normal_force, element=element))
    return rows


def _gaps(scene: Scene, cavities: list[_Surfaces], around: list[_Surfaces], owner: list[int]) -> list[_Row]:
    """Return the rows of all gaps, cavity by cavity from left to right.

    around: (b,) the surfaces as each body meets them.
    """
    rows = []
    for index, cavity in enumerate(scene.cavity):
        inside = [i for i, where in enumerate(owner) if where == index]
        for left, right in itertools.pairwise([-1, *inside, -1]) if inside else ():
            if right < 0:
                wall = around[left].right
            elif left < 0:
                wall = -around[right].left
            else:  # the cavity turns their faces, and centres of blocks may have two heights
                wall = around[left].floor - around[right].floor
            pair = [scene.damper[i] for i in (left, right) if i >= 0]
            coefficients = [damper.restitution for damper in pair]
            restitution = coefficients[0] if len(pair) == 1 else scene.contact.pair_restitution(*coefficients)
            # the wall's mass is that of the structure's first mode, the same for every number of modes
            mobility = float(sum(1 / damper.mass for damper in pair) + (wall[:1] ** 2).sum())
            # between two bodies, the mean flexibility of the cavity's walls
            yields = around[right].flexibility[0] if left < 0 else around[left].flexibility[1]
            yields = yields if len(pair) == 1 else 0.5 * sum(cavities[index].flexibility)
            element = scene.contact.element(restitution, 1 / mobility, yields)
            rest = 0.5 * cavity.gap if len(pair) == 1 else 0.0
            rows.append(_Row(wall, left, right, element=element, rest=rest, free_travel=cavity.gap))
    return rows


def _stops(scene: Scene, basis: ModalBasis) -> list[_Row]:
    """Return a row for the gap of each stop, which closes as the structure moves to that side."""
    rows = []
    for i, stop in enumerate(scene.stop):
        ends = [(stop.at or "structure", "at", 1.0)] + ([(stop.to, "to", -1.0)] if stop.to else [])
        towards = -1.0 if stop.side == "right" else 1.0
        gap = np.sum([towards * sign * interface_row(basis, label, f"stop[{i}].{key}") for label, key, sign in ends], 0)
        yields = sum(basis.flexibility({label: 1.0}) for label, _, _ in ends)
        # the mass is that of the first mode, as at the walls of cavities
        element = scene.contact.element(stop.restitution, 1 / max(float((gap[:1] ** 2).sum()), _LIGHT), yields)
        rows.append(_Row(gap, element=element, rest=stop.gap, free_travel=stop.gap))
    return rows


def _coefficient(friction: float) -> float:
    """Return a coefficient of friction, zero where it is lost in the round-off of other forces."""
    return friction if friction > _SMOOTH else 0.0
