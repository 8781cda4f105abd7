"""From a scene to the coordinates of its bodies in the plane, and to the contacts between them and their cavities.

Coordinates q = (p, bodies): modes of the structure, then of each body x along its cavity, and of one with extent y
across it and its tilt theta, all relative to the base. x and y count from where the bodies of a cavity stand side by
side on the floor, in the middle of the free travel. Tilts are small: a point (a, b) of a body, from its centre, moves
by (x - theta b, y + theta a). Behind the bodies come the sliders of Jenkins elements, friction dampers with a spring
before their slider: each is a coordinate without mass, which rests, or follows what draws it as far as the spring goes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.numerics.compiler.record import record
from vanedamp.coupling.scene.bodies import Cavity, Damper
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import base_acceleration, physical_scale
from vanedamp.coupling.system.body_loads import binding, body_loads, centres
from vanedamp.coupling.system.cavities import surface_labels
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of
from vanedamp.coupling.system.restitution import law_address
from vanedamp.coupling.system.surfaces import SIDES, Surface, flexibility, heights, surfaces_of
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

#: the moment after which contacts are looked at again, in periods of the excitation or of the fastest contact
_MOMENT = 1e-6
#: coefficients of friction below this are none
_SMOOTH = 1e-9


@record
class PlanarSystem(NamedTuple):
    """Matrices of a scene: N coordinates, e harmonics, u units, b bodies. Compiled functions take it as it is.

    A unit is a contact with its normal row and its slip, or, behind the contacts, a friction element with a constant
    limit, which has only a slip. The last j units are Jenkins elements, whose slip is that of their slider; the sliders
    are the last j coordinates. Rows (2u, N): normals first, then slips.
    """

    contacts: int
    mass: np.ndarray  # (N,) 1 for a mode; kg; kg m^2; of a slider, which has none, a scale
    stiffness: np.ndarray  # (N, N) without the springs of Jenkins elements
    damping: np.ndarray  # (N, N)
    load: np.ndarray  # (e, N) complex amplitudes
    weight: np.ndarray  # (N,)
    response: np.ndarray  # (N,)
    table: np.ndarray  # (e,) complex displacement of a base whose motion is the response, m
    frequency: np.ndarray  # (e,) rad/s
    period: float  # s
    moment: float  # after which what an instant leaves open is looked at again, s
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
    tangential: np.ndarray  # (j,) stiffness of the springs of Jenkins elements, N/m
    elongation: np.ndarray  # (j, N) of these springs
    two_phases: bool  # whether impacts have a phase of compression and one of expansion
    play: np.ndarray  # (u,) m, the scale of a contact's gap
    body: np.ndarray  # (u,) number of the unit's body
    surface: np.ndarray  # (u,) int: place of its name in SURFACES
    corner: np.ndarray  # (u,) int: 0 to 3, counted from the lower left one against the tilt; -1: none
    along: np.ndarray  # (b,) coordinate x of each body
    tilt: np.ndarray  # (b,) coordinate theta, -1: none
    floor: np.ndarray  # (b, N) motion of the cavity along itself, at the height of the body's centre
    turn: np.ndarray  # (b, N) rotation of the cavity
    rise: np.ndarray  # (b, N) motion of the floor across the cavity, below the body's centre
    height: np.ndarray  # (b,) of a body's centre above the floor, m; 0 where a slider has none
    cavity: np.ndarray  # (b,) number of the body's cavity
    neglected: (
        np.ndarray
    )  # (b,) shortening over the smallest play, per square of the tilt; nan for sliders, 0 for discs


#: names of what a unit touches
SURFACES = (*SIDES, "body", "stop", "casing")
LEFT, RIGHT, FLOOR, CEILING, BODY, STOP, CASING = range(len(SURFACES))


class PlanarMotion(NamedTuple):
    """Motion at time zero: coordinates (N,) and their rates."""

    q: np.ndarray
    v: np.ndarray


class _Unit(NamedTuple):
    normal: np.ndarray
    slip: np.ndarray
    rest: float
    friction: float
    element: Element
    play: float
    body: int
    surface: int
    corner: int = -1
    limit: float = 0.0


class _Body(NamedTuple):
    """A body: number, its coordinates in q, half length and height of its centre (both the radius of a disc)."""

    number: int
    damper: Damper
    x: int
    a: float
    b: float

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners of a block, against the tilt from the lower left one."""
        return (-self.a, -self.b), (self.a, -self.b), (self.a, self.b), (-self.a, self.b)


def planar_system(scene: Scene, flat: System) -> PlanarSystem:
    """Assemble the scene. flat: its system with every body as a slider, which has the same loads.

    Raises InputError for what bodies with extent do not allow.
    """
    basis, n = basis_of(scene), flat.modes
    bodies, size = [], n
    for number, (damper, height) in enumerate(zip(scene.damper, heights(scene), strict=True)):
        if damper.shape == "auto":
            raise InputError(f'damper[{number}].shape: "auto" is still open; model_order.choices.choose settles it')
        bodies.append(_Body(number, damper, size, damper.half_extent[0], float(height)))
        size += 1 if damper.shape == "slider" else 3
    drawn = [row for row in range(len(bodies), flat.friction_rows) if flat.limit[row] > 0 and flat.spring[row] < np.inf]
    elongation = np.zeros((len(drawn), size + len(drawn)))
    elongation[:, :n], elongation[:, size:] = flat.J[drawn, :n], -np.eye(len(drawn))
    size += len(drawn)
    owner = [[cavity.name for cavity in scene.cavity].index(damper.cavity) for damper in scene.damper]
    cavities = [surfaces_of(scene, basis, index) for index in range(len(scene.cavity))]
    base = base_acceleration(scene, basis)
    mass, weight = np.ones(size), np.zeros(size)
    load = np.zeros((len(flat.frequency), size), complex)
    load[:, :n] = flat.load[:, :n]
    floor, turn, rise = np.zeros((3, len(bodies), size))
    centre, loads = centres(scene), body_loads(scene, basis)
    for body in bodies:
        k, x = body.number, body.x
        mass[x], weight[x], load[:, x] = body.damper.mass, flat.weight[n + k], flat.load[:, n + k]
        ground = cavities[owner[k]][FLOOR]
        floor[k, :n], turn[k, :n] = ground.motion(0.0, body.b)[0], ground.turn
        rise[k, :n] = ground.motion(float(centre[k]), 0.0)[1]
        if body.damper.shape != "slider":
            normal = basis.across(surface_labels(scene, owner[k])[2])
            mass[x + 1], weight[x + 1] = body.damper.mass, -body.damper.mass * float(loads.across[k])
            if normal is not None:
                load[:, x + 1] = -body.damper.mass * (base @ normal)
            mass[x + 2] = body.damper.moment_of_inertia
    units: list[_Unit] = []
    law = _Law(scene.contact, basis, mass)
    for index, cavity in enumerate(scene.cavity):
        inside = [body for body in bodies if owner[body.number] == index]
        units += _contacts(law, cavity, cavities[index], inside, centre, size)
    for row in range(flat.friction_rows, len(flat.J)):
        if not flat.J[row, n:].any():
            gap = np.zeros(size)
            gap[:n] = flat.J[row, :n]
            number = row - (len(flat.J) - len(scene.stop))
            units.append(
                _Unit(
                    gap, np.zeros(size), float(flat.rest[row]), 0.0,
                    Element(float(flat.restitution[row]), float(flat.spring[row]), float(flat.dashpot[row])),
                    float(flat.free_travel[row]), number, STOP,
                )
            )  # fmt: skip
    contacts = len(units)
    _check_friction(units, size, mass)
    sliders = dict(zip(drawn, np.eye(size)[size - len(drawn) :], strict=True))
    for row in sorted(range(flat.friction_rows), key=sliders.__contains__):
        if flat.limit[row] > 0.0 and not (row < len(bodies) and bodies[row].damper.shape != "slider"):
            functional = np.zeros(size)
            functional[:n] = flat.J[row, :n]
            if row < len(bodies):
                functional[bodies[row].x] = 1.0
            surface, number = (FLOOR, row) if row < len(bodies) else (CASING, row - len(bodies))
            limit = float(flat.limit[row])
            units.append(
                _Unit(
                    np.zeros(size), sliders.get(row, functional), 0.0, 0.0, Element(0.0), np.inf, number, surface,
                    limit=limit,
                )
            )  # fmt: skip
    J = np.reshape([unit.normal for unit in units] + [unit.slip for unit in units], (2 * len(units), size))
    stiffness, damping = np.zeros((size, size)), np.zeros((size, size))
    stiffness[:n, :n], damping[:n, :n] = np.diag(flat.stiffness[:n]), flat.damping[:n, :n]
    for body, spring, dashpot in zip(bodies, *binding(scene, loads), strict=True):
        if spring or dashpot:
            own = -floor[body.number]
            own[body.x] = 1.0
            stiffness += spring * np.outer(own, own)
            damping += dashpot * np.outer(own, own)
        stiffness[body.x, body.x] -= loads.gradient[body.number]
    response = np.zeros(size)
    response[:n] = flat.response[:n]
    pushed = np.abs(weight) * flat.period + (np.abs(load) / np.maximum(flat.frequency, flat.omega)[:, None]).sum(axis=0)
    column = lambda name: np.array([getattr(unit, name) for unit in units])  # noqa: E731
    elements = np.reshape([unit.element for unit in units], (len(units), 3)).astype(float)
    yields = np.isfinite(elements[:, 1])
    springs = np.r_[elements[yields, 1], flat.spring[drawn]]
    pulled = (elongation[:, :n] ** 2).sum(axis=1)
    mobility = np.r_[(J[: len(units)][yields] ** 2 / mass).sum(axis=1), pulled]
    fastest = np.sqrt((springs * mobility).max(initial=0.0))
    # rows of sliders are not to be small beside others
    massive = slice(size - len(drawn))
    mass[massive.stop :] = 1 / (np.r_[(J[:, massive] ** 2 / mass[massive]).sum(axis=1), pulled].max(initial=0.0) or 1.0)
    shortest = min(flat.period, 2 * np.pi / fastest) if fastest > 0.0 else flat.period
    return PlanarSystem(
        contacts=contacts, mass=mass, stiffness=stiffness, damping=damping, load=load, weight=weight,
        response=response, table=flat.table, frequency=flat.frequency, period=flat.period,
        moment=_MOMENT * shortest,
        speed=float((np.abs(J) @ (pushed / mass)).max(initial=0.0)), J=J,
        rest=column("rest").astype(float), delassus=(J / mass) @ J.T, friction=column("friction").astype(float),
        limit=column("limit").astype(float), restitution=elements[:, 0],
        restitution_at=law_address(scene.contact, elements[:contacts, 0]), spring=elements[:, 1],
        dashpot=elements[:, 2], tangential=flat.spring[drawn], elongation=elongation,
        two_phases=scene.contact.two_phases, play=column("play").astype(float), body=column("body").astype(np.int64),
        surface=column("surface").astype(np.int64), corner=column("corner").astype(np.int64),
        along=np.array([body.x for body in bodies], np.int64),
        tilt=np.array([-1 if body.damper.shape == "slider" else body.x + 2 for body in bodies], np.int64),
        floor=floor, turn=turn, rise=rise, height=np.array([body.b for body in bodies]),
        cavity=np.array(owner, np.int64),
        neglected=np.array([_neglected(body, scene.cavity[owner[body.number]]) for body in bodies]),
    )  # fmt: skip


def on_structure(system: PlanarSystem) -> PlanarSystem:
    """Return the system whose slips of Jenkins elements are those of what draws them, in place of their sliders'."""
    if not len(system.tangential):
        return system
    J = system.J.copy()
    J[-len(system.tangential) :] += system.elongation
    return system._replace(J=J, delassus=(J / system.mass) @ J.T)


def _neglected(body: _Body, cavity: Cavity) -> float:
    """Return how much a tilt shortens a body, to second order, over the smallest play and the square of the tilt."""
    if body.damper.shape != "block":
        return np.nan if body.damper.shape == "slider" else 0.0
    return max(body.a, body.b) / 2 / min(cavity.gap, cavity.play or np.inf)


class _Law(NamedTuple):
    """The contact law at the walls of a structure, with the masses (N,) of the coordinates, modes first."""

    contact: ContactLaw
    basis: ModalBasis
    mass: np.ndarray

    def element(self, normal: np.ndarray, restitution: float, flexibility: float) -> Element:
        """Return the element of a contact from its normal row (N,) and the residual flexibility of its wall, m/N.

        The structure's mass is that of its first mode, the same for every number of modes.
        """
        mobility = normal**2 / self.mass
        mobility[1 : len(self.basis.stiffness)] = 0.0
        return self.contact.element(restitution, 1 / float(mobility.sum()), flexibility)


def _contacts(
    law: _Law, cavity: Cavity, surfaces: tuple[Surface, ...], bodies: list[_Body], centre: np.ndarray, size: int
) -> list[_Unit]:
    """Contacts in a cavity, from left to right, in each body's walls, floor and ceiling."""
    units: list[_Unit] = []
    length = 2 * sum(body.a for body in bodies)
    for place, body in enumerate(bodies):
        if place == 0:
            units += _at_walls(law, cavity, surfaces, body, LEFT, -cavity.gap / 2 - length / 2, size)
        if place == len(bodies) - 1:
            units += _at_walls(law, cavity, surfaces, body, RIGHT, cavity.gap / 2 + length / 2, size)
        if body.damper.shape != "slider":
            for surface in (FLOOR, CEILING):
                units += _at_floor(law, cavity, surfaces, body, surface, float(centre[body.number]), size)
        if place + 1 < len(bodies):
            units += _between(law, cavity, surfaces, body, bodies[place + 1], size)
    return units


def _point(body: _Body, a: float, b: float, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Motion (N,) along and across of point (a, b) of a body."""
    along, across = np.zeros(size), np.zeros(size)
    along[body.x] = 1.0
    if body.damper.shape != "slider":
        along[body.x + 2], across[body.x + 1], across[body.x + 2] = -b, 1.0, a
    return along, across


def _at_walls(
    law: _Law, cavity: Cavity, surfaces: tuple[Surface, ...], body: _Body, surface: int, wall: float, size: int
) -> list[_Unit]:
    """Contacts with the left or the right wall, at `wall` (m) along the cavity."""
    sign = 1.0 if surface == LEFT else -1.0
    if body.damper.shape == "slider":
        points = [(-1, 0.0, 0.0)]
    elif body.damper.shape == "disc":
        points = [(-1, -sign * body.a, 0.0)]
    else:
        wanted = (0, 3) if surface == LEFT else (1, 2)
        points = [(corner, *body.corners[corner]) for corner in wanted]
    units = []
    for corner, a, b in points:
        along, across = _point(body, a, b, size)
        extended, moving = body.damper.shape != "slider", surfaces[surface]
        moved_along, moved_across = moving.motion(wall, body.b + b)
        # a slider without a height meets the wall where the wall's motion is known
        along[: len(moving.along)] -= moved_along if body.b > 0.0 else moving.along
        across[: len(moving.along)] -= moved_across
        lever = 0.0 if moving.y is None or not body.b else moving.y - body.b - b
        units.append(
            _Unit(
                sign * along,
                across * extended,
                cavity.gap / 2,
                body.damper.friction * extended,
                law.element(sign * along, body.damper.restitution, flexibility(law.basis, moving, True, lever)),
                cavity.gap,
                body.number,
                surface,
                corner,
            )
        )  # fmt: skip
    return units


def _at_floor(
    law: _Law, cavity: Cavity, surfaces: tuple[Surface, ...], body: _Body, surface: int, centre: float, size: int
) -> list[_Unit]:
    """Contacts with floor or ceiling of a body whose centre is at `centre` (m) along the cavity."""
    below, play = surface == FLOOR, cavity.play or 0.0
    sign = 1.0 if below else -1.0
    if body.damper.shape == "disc":
        points = [(-1, 0.0, -sign * body.b)]
    else:
        points = [(corner, *body.corners[corner]) for corner in ((0, 1) if below else (2, 3))]
    units = []
    for corner, a, b in points:
        along, across = _point(body, a, b, size)
        moved_along, moved_across = surfaces[surface].motion(centre + a, 0.0 if below else 2 * body.b + play)
        along[: len(moved_along)] -= moved_along
        across[: len(moved_across)] -= moved_across
        from_place = surfaces[surface].x
        lever = 0.0 if from_place is None else centre + a - from_place
        units.append(
            _Unit(
                sign * across,
                along,
                0.0 if below else play,
                body.damper.friction,
                law.element(
                    sign * across, body.damper.restitution, flexibility(law.basis, surfaces[surface], False, lever)
                ),
                play,
                body.number,
                surface,
                corner,
            )
        )  # fmt: skip
    return units


def _check_friction(units: list[_Unit], size: int, mass: np.ndarray) -> None:
    """Raise InputError for a friction with which a single contact may jam or have two motions (Painleve 1895)."""
    for unit in units:
        normal = (unit.normal**2 / mass).sum()
        coupled = abs((unit.normal * unit.slip / mass).sum())
        if unit.friction > 0.0 and unit.friction * coupled >= normal:
            raise InputError(
                f"damper[{unit.body}].friction: {unit.friction:g} lets the body jam at the {SURFACES[unit.surface]}; "
                f"with its length, height and inertia a corner has a unique motion only below {normal / coupled:.4g}"
            )


def _between(
    law: _Law, cavity: Cavity, surfaces: tuple[Surface, ...], left: _Body, right: _Body, size: int
) -> list[_Unit]:
    """Contacts of two neighbours: blocks face to face at the ends of the common height, discs at one point."""
    shapes = {left.damper.shape, right.damper.shape}
    if shapes == {"slider"}:
        heights = [0.0]
    elif "slider" in shapes:
        raise InputError(
            f"damper[{right.number}].shape: a slider and a body with extent share cavity '{cavity.name}'; a slider has "
            "no height at which they could touch: give it a shape"
        )
    elif shapes == {"block"}:
        heights = [0.0, 2 * min(left.b, right.b)]
    else:
        round_one, other = (left, right) if left.damper.shape == "disc" else (right, left)
        if other.damper.shape == "disc" and abs(left.b - right.b) > 1e-12 * left.b:
            raise InputError(
                f"damper[{right.number}].radius: discs side by side in cavity '{cavity.name}' must have one radius"
            )
        if round_one.b > 2 * other.b:
            raise InputError(
                f"damper[{round_one.number}].radius: the disc touches its neighbour in cavity '{cavity.name}' above "
                "the neighbour's face; it must not exceed the neighbour's height"
            )
        heights = [round_one.b]
    coefficients = left.damper.restitution, right.damper.restitution
    friction = 0.0 if shapes == {"slider"} else (left.damper.friction * right.damper.friction) ** 0.5
    units, yields = [], 0.5 * sum(flexibility(law.basis, surfaces[side], True) for side in (LEFT, RIGHT))
    for height in heights:
        right_along, right_across = _point(right, -right.a, height - right.b, size)
        left_along, left_across = _point(left, left.a, height - left.b, size)
        normal = right_along - left_along
        units.append(
            _Unit(
                normal,
                (right_across - left_across) * (friction > 0.0),
                0.0,
                friction,
                law.element(normal, law.contact.pair_restitution(*coefficients), yields),
                cavity.gap,
                left.number,
                BODY,
            )
        )  # fmt: skip
    return units


def planar_motion(scene: Scene, flat: System, system: PlanarSystem) -> PlanarMotion:
    """The motion that a scene begins with. Raises InputError for what would overlap a surface or a stop."""
    n, size = flat.modes, len(system.mass)
    q, v = np.zeros(size), np.zeros(size)
    scale = physical_scale(scene, flat)
    q[:n], v[:n] = scene.initial.displacement / scale, scene.initial.velocity / scale
    for k, damper in enumerate(scene.damper):
        x = system.along[k]
        q[x] = damper.position + system.floor[k] @ q
        v[x] = damper.velocity + system.floor[k] @ v
        if damper.shape != "slider":
            lifted = damper.half_extent[0] * abs(damper.tilt) if damper.shape == "block" else 0.0
            # a tilted block stands on its corner unless it is lifted higher
            q[x + 1 : x + 3] = damper.lift + lifted + system.rise[k] @ q, damper.tilt + system.turn[k] @ q
            v[x + 1 : x + 3] = damper.lift_velocity + system.rise[k] @ v, damper.tilt_rate + system.turn[k] @ v
    place_sliders(system, q, np.zeros(len(system.tangential)))
    gaps = system.rest + system.J[: len(system.rest)] @ q
    for unit in range(system.contacts):
        if gaps[unit] < -1e-12 * system.play[unit]:
            if system.surface[unit] == STOP:
                raise InputError(
                    f"initial.displacement: the structure would begin {-gaps[unit]:.3g} m beyond "
                    f"stop[{system.body[unit]}]"
                )
            raise InputError(
                f"damper[{system.body[unit]}]: begins {-gaps[unit]:.3g} m beyond the cavity's "
                f"{SURFACES[system.surface[unit]]}; change position, lift or tilt"
            )
    return PlanarMotion(q, v)


def place_sliders(system: PlanarSystem, q: np.ndarray, elongation: np.ndarray) -> None:
    """Place the sliders of Jenkins elements in q (N,) so that their springs have an elongation (j,), m."""
    sliders = slice(len(q) - len(elongation), None)
    q[sliders] += system.elongation @ q - elongation
