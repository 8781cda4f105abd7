"""The scene as rows: everything unilateral or frictional is a row of one matrix J over the coordinates (p, x).

p are the modal coordinates of the structure, x the positions of the bodies. Friction rows come first (one a body: its
slip on the floor; one a friction damper: the structure's motion against the casing), then contact rows (one a gap: left
wall to first body, body to body, last body to right wall).

A gap between a body and a wall that moves with the floor, and every gap between two bodies, rides: it is the difference
of slips, which alone are the state, so that slips and gaps can never disagree.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.contact_laws import Element
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.modal_structure import LinearStructure

#: coefficients of friction below this are none
_SMOOTH = 1e-9


class Rows(NamedTuple):
    """What the compiled engine needs to know besides the subsystems. n modes, b bodies, r rows."""

    friction_rows: int
    structure: np.ndarray  # (r, n) J on the modal coordinates
    bodies: np.ndarray  # (r, b) J on the bodies
    delassus: np.ndarray  # (r, r) J M^-1 J^T with no constraint closed
    limit: np.ndarray  # (friction rows,) friction force at slip, N
    spring: np.ndarray  # (r,) stiffness of a row while it is closed, N/m; inf: rigid
    dashpot: np.ndarray  # (r,) N s/m
    restitution: np.ndarray  # (contacts,)
    gap: np.ndarray  # (contacts,) free travel of the contact's cavity, m: the scale of its gap
    before: np.ndarray  # (r,) body to the left of a contact, -1: the wall
    after: np.ndarray  # (r,) body to the right of a contact, -1: the wall
    rides: np.ndarray  # (r,) whether a contact's gap is a difference of slips: no wall that moves apart from the floor
    floor: np.ndarray  # (b, n) floor functional under each body
    mass: np.ndarray  # (b,) kg
    weight: np.ndarray  # (b,) gravity force along the body's cavity, N
    stiffness: np.ndarray  # (n,)
    damping: np.ndarray  # (n, n)
    proportional: bool
    response: np.ndarray  # (n,)
    force: np.ndarray  # (n,) complex harmonic load on the modes
    alike: bool  # whether the base accelerates all bodies alike: their cavities have one angle to its motion
    inertia: np.ndarray  # (b,) complex harmonic load on the bodies: the base's acceleration along their cavities
    table: complex
    omega: float
    period: float


class _Contact(NamedTuple):
    """One gap before it becomes a row."""

    before: int
    after: int
    structure: np.ndarray
    gap: float
    element: Element


def rows_of(scene: Scene, structure: LinearStructure) -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows of a scene, with the initial displacement and velocity of each row, shapes (r,)."""
    bodies, n = len(scene.damper), structure.modes
    contacts, owner = _contacts(scene, structure)
    casing = structure.casing
    floor = structure.floor[owner].reshape(bodies, n)
    friction_rows = bodies + len(casing)
    j_structure = np.vstack(
        [-floor, casing, np.reshape([contact.structure for contact in contacts], (len(contacts), n))]
    )
    before, after = (
        np.r_[np.full(friction_rows, -1), [contact[side] for contact in contacts]].astype(np.int64) for side in (0, 1)
    )
    j_bodies = np.vstack([np.eye(bodies), np.zeros((len(casing) + len(contacts), bodies))])
    for r in range(friction_rows, len(j_bodies)):
        if before[r] >= 0:
            j_bodies[r, before[r]] = -1.0
        if after[r] >= 0:
            j_bodies[r, after[r]] = 1.0
    mass = np.array([damper.mass for damper in scene.damper])
    along, across = structure.gravity[owner].T
    base = structure.base_acceleration[owner]
    elements = [contact.element for contact in contacts]
    rows = Rows(
        friction_rows=friction_rows,
        structure=j_structure,
        bodies=j_bodies,
        delassus=j_structure @ j_structure.T + (j_bodies / mass) @ j_bodies.T,
        limit=np.array(
            [_friction_force(scene, i, across[i]) for i in range(bodies)]
            + [_coefficient(damper.friction) * damper.normal_force for damper in scene.friction_damper]
        ),
        spring=np.array(
            [np.inf] * bodies
            + [np.inf if damper.stiffness is None else damper.stiffness for damper in scene.friction_damper]
            + [element.stiffness for element in elements]
        ),
        dashpot=np.array([0.0] * friction_rows + [element.dashpot for element in elements]),
        restitution=np.array([element.restitution for element in elements]),
        gap=np.array([contact.gap for contact in contacts]),
        before=before,
        after=after,
        rides=np.array([_rides(j_structure, j_bodies, friction_rows, r) for r in range(len(j_bodies))], np.bool_),
        floor=floor,
        mass=mass,
        weight=mass * along,
        stiffness=np.array(structure.stiffness),
        damping=np.array(structure.damping),
        proportional=bool(np.count_nonzero(structure.damping - np.diag(np.diag(structure.damping))) == 0),
        response=np.array(structure.response),
        force=np.array(structure.force, complex),
        alike=bool(np.all(base == base[:1])),
        inertia=-mass * base + 0j,
        table=complex(structure.table),
        omega=structure.omega,
        period=2 * np.pi / structure.omega,
    )
    return rows, *_initial_rows(scene, structure, rows)


def _contacts(scene: Scene, structure: LinearStructure) -> tuple[list[_Contact], np.ndarray]:
    """All gaps, cavity by cavity from left to right, and the cavity of each body (b,)."""
    owner = np.zeros(len(scene.damper), int)
    contacts = []
    for index, cavity in enumerate(scene.cavity):
        row = [i for i, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        owner[row] = index
        for before, after in itertools.pairwise([-1, *row, -1]) if row else ():
            wall = (after < 0) * structure.right[index] - (before < 0) * structure.left[index]
            pair = [scene.damper[i] for i in (before, after) if i >= 0]
            # two bodies of different restitution meet with the geometric mean
            restitution = float(np.prod([damper.restitution for damper in pair]) ** (1 / len(pair)))
            # the wall's mass is that of the structure's first mode, the same for every number of modes
            mobility = float(sum(1 / damper.mass for damper in pair) + (wall[:1] ** 2).sum())
            element = scene.contact.element(restitution, 1 / mobility, _yielding(structure, index, before, after))
            contacts.append(_Contact(before, after, wall, cavity.gap, element))
    return contacts, owner


def _yielding(structure: LinearStructure, cavity: int, before: int, after: int) -> float:
    """What the wall of a contact yields besides its modes, m/N; between two bodies the mean of the cavity's walls."""
    if structure.wall_flexibility is None:
        return 0.0
    left, right = structure.wall_flexibility[cavity]
    return float(left if before < 0 else right if after < 0 else 0.5 * (left + right))


def _initial_rows(scene: Scene, structure: LinearStructure, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    position = np.array([damper.position for damper in scene.damper])
    velocity = np.array([damper.velocity for damper in scene.damper])
    unloaded = np.zeros(rows.friction_rows - len(rows.mass))
    return row_motion(rows, position, velocity, structure.displacement, structure.velocity, unloaded)


def row_motion(
    rows: Rows, slip: np.ndarray, slip_velocity: np.ndarray, p: np.ndarray, rate: np.ndarray, elongation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity (r,) of every row, from slips (b,), modal coordinates (n,) and their rates.

    elongation: (friction dampers,) of the springs before the sliders, m.
    """
    # slips are relative to the floor; walls on other functionals start at their rest distance
    displacement = rows.bodies @ slip
    ends = np.count_nonzero(rows.bodies[rows.friction_rows :], axis=1) == 1
    displacement[rows.friction_rows :][ends] += rows.gap[ends] / 2
    absolute = slip_velocity + rows.floor @ rate
    speed = rows.structure @ rate + rows.bodies @ absolute
    moved = rows.structure @ p + rows.bodies @ (rows.floor @ p)
    speed[: len(slip)] = slip_velocity  # exact, so that a body at relative rest is known to be so
    moved[: len(slip)] = 0.0
    displacement += moved
    springs = np.isfinite(rows.spring[: rows.friction_rows])
    displacement[: rows.friction_rows][springs] = np.r_[np.zeros(len(slip)), elongation][springs]
    return displacement, speed


def _rides(structure: np.ndarray, bodies: np.ndarray, friction_rows: int, r: int) -> bool:
    slips = structure[: bodies.shape[1]]
    return r >= friction_rows and np.allclose(structure[r], bodies[r] @ slips, rtol=1e-14, atol=0)


def _friction_force(scene: Scene, index: int, gravity: float) -> float:
    damper = scene.damper[index]
    normal = damper.mass * gravity if damper.normal_load is None else damper.normal_load
    return _coefficient(damper.friction) * max(normal, 0.0)


def _coefficient(friction: float) -> float:
    """A coefficient of friction, zero where it is nothing beside the round-off of other forces."""
    return friction if friction > _SMOOTH else 0.0
