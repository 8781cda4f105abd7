"""From a scene to its system, and to the motion that it begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.system.body_loads import BodyLoads, binding, body_loads, centres
from vanedamp.coupling.system.cavities import check_directions, surface_labels
from vanedamp.coupling.system.loads import force_shapes
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of, forced_label, interface_row
from vanedamp.coupling.system.resonance import force_amplitude
from vanedamp.coupling.system.restitution import law_address
from vanedamp.coupling.system.shapes import shape_of
from vanedamp.coupling.system.surfaces import Surface, heights, surfaces_of, walls_and_floor
from vanedamp.coupling.system.system import FLOOR, STOP, SURFACES, System
from vanedamp.coupling.system.units import (
    Body,
    Law,
    check_friction,
    coefficient,
    contacts_of,
    friction_elements,
    stops_of,
)
from vanedamp.files.toml_input import InputError

#: the moment after which contacts are looked at again, in periods of the excitation or of the fastest contact
_MOMENT = 1e-6
#: relative tolerance of the play by which a contact may overlap at the start
_ROUND_OFF = 1e-12

#: loads (k, N) on the coordinates of a system, N, at angles omega t (k,) in [0, 2 pi)
Loads = Callable[[np.ndarray], np.ndarray]


class Motion(NamedTuple):
    """A motion at one time: coordinates (N,) and their rates."""

    q: np.ndarray
    v: np.ndarray


def assemble(scene: Scene, basis: ModalBasis | None = None) -> System:
    """Assemble the system of a scene. basis: modes of its structure, if not those that the scene names.

    Raises InputError for an unknown label, an unusable model, or bodies that do not fit together.
    """
    basis = basis or basis_of(scene)
    n, omega, shares = len(basis.stiffness), 2 * np.pi * scene.frequency, scene.excitation.shares
    check_directions(scene, basis)
    at = forced_label(scene)
    forced = interface_row(basis, at, "excitation.at")
    bodies = _bodies(scene, n)
    owner = [[cavity.name for cavity in scene.cavity].index(damper.cavity) for damper in scene.damper]
    surfaces = [_surfaces(scene, basis, index, bodies) for index in range(len(scene.cavity))]
    base, loads = base_acceleration(scene, basis), body_loads(scene, basis)
    table = np.zeros(len(shares), complex)
    if isinstance(scene.structure, Prescribed):
        table = np.array(list(shares.values())) * -1j * scene.structure.displacement_amplitude
    force = force_shapes(scene, basis, forced) * -1j * force_amplitude(scene, basis, forced) - base @ basis.base.T

    casing = [interface_row(basis, damper.at or at, f"friction_damper[{i}].at")
              for i, damper in enumerate(scene.friction_damper)]  # fmt: skip
    grip = np.array([coefficient(damper.friction) * damper.normal_force for damper in scene.friction_damper])
    spring = np.array([np.inf if damper.stiffness is None else damper.stiffness for damper in scene.friction_damper])
    jenkins = np.flatnonzero((grip > 0.0) & np.isfinite(spring))
    massive = bodies[-1].coordinates.stop if bodies else n
    size = massive + len(jenkins)
    on_casing = np.zeros((len(casing), size))
    on_casing[:, :n] = np.reshape(casing, (len(casing), n))
    elongation = on_casing[jenkins]
    elongation[:, massive:] = -np.eye(len(jenkins))

    mass, floor, turn, rise = np.ones(size), *np.zeros((3, len(bodies), size))
    for body, index in zip(bodies, owner, strict=True):
        ground = surfaces[index][FLOOR]
        mass[body.coordinates] = body.damper.mass
        if body.shape.extended:
            mass[body.x + 2] = body.damper.moment_of_inertia
        floor[body.number, :n] = ground.motion(0.0, body.b)[0] if body.b > 0.0 else ground.along
        rise[body.number, :n], turn[body.number, :n] = ground.motion(body.centre, 0.0)[1], ground.turn
    load, weight = np.zeros((len(shares), size), complex), np.zeros(size)
    load[:, :n] = force
    accelerated = _load_bodies(scene, basis, bodies, owner, base, table, loads, load, weight)

    law = Law(scene.contact, basis, mass)
    contacts = [unit for index, cavity in enumerate(scene.cavity) for unit in contacts_of(
        law, cavity, surfaces[index], [body for body in bodies if owner[body.number] == index]
    )]  # fmt: skip
    start = abs(scene.initial.displacement) + (abs(scene.initial.velocity) / np.sqrt(basis.stiffness[0]) if n else 0.0)
    contacts += stops_of(scene, law, np.abs(force).sum(axis=0) / basis.stiffness, start)
    check_friction(contacts, mass)
    holds = _holding(scene, loads)
    sliders = dict(zip(jenkins.tolist(), np.eye(size)[massive:], strict=True))
    units = [*contacts, *friction_elements(scene, bodies, floor, holds, on_casing, grip, sliders)]
    u = len(units)
    J = np.reshape([unit.normal for unit in units] + [unit.slip for unit in units], (2 * u, size))

    stiffness, damping = np.zeros((size, size)), np.zeros((size, size))
    stiffness[:n, :n], damping[:n, :n] = np.diag(basis.stiffness), basis.damping
    for body, pull, drag in zip(bodies, *binding(scene, loads), strict=True):
        if pull or drag:
            own = -floor[body.number]
            own[body.x] = 1.0
            stiffness += pull * np.outer(own, own)
            damping += drag * np.outer(own, own)
        stiffness[body.x, body.x] -= loads.gradient[body.number]
    elements = np.reshape([unit.element for unit in units], (u, 3)).astype(float)
    # rows of sliders are not to be small beside others
    pulled = (elongation[:, :n] ** 2).sum(axis=1)
    mobility = (J[:, :massive] ** 2 / mass[:massive]).sum(axis=1)
    mass[massive:] = 1 / (np.r_[mobility, pulled].max(initial=0.0) or 1.0)

    def column(name: str, kind: type = float) -> np.ndarray:
        return np.array([getattr(unit, name) for unit in units], kind)

    response = np.zeros(size)
    response[:n] = forced
    system = System(
        modes=n, bodies=len(bodies), contacts=len(contacts),
        scale=float(forced[0]) if isinstance(scene.structure, Rigid) else 1.0, mass=mass,
        stiffness=stiffness, damping=damping, squares=basis.stiffness, viscous=basis.damping, load=load, weight=weight,
        alike=bool(np.all(accelerated == accelerated[:, :1])), response=response, table=table,
        frequency=omega * np.array(list(shares)), omega=omega, period=2 * np.pi / omega, moment=0.0, speed=0.0, J=J,
        rest=column("rest"),
        delassus=(J / mass) @ J.T, friction=column("friction"), limit=column("limit"), restitution=elements[:, 0],
        restitution_at=law_address(scene.contact, elements[: len(contacts), 0]), spring=elements[:, 1],
        dashpot=elements[:, 2], tangential=spring[jenkins], elongation=elongation,
        two_phases=scene.contact.two_phases, play=column("play"), body=column("body", np.int64),
        other=column("other", np.int64), surface=column("surface", np.int64), corner=column("corner", np.int64),
        along=np.array([body.x for body in bodies], np.int64),
        tilt=np.array([body.x + 2 if body.shape.extended else -1 for body in bodies], np.int64),
        floor=floor, turn=turn, rise=rise, height=np.array([body.b for body in bodies]),
        cavity=np.array(owner, np.int64), holds=holds, neglected=_neglected(scene, bodies, owner),
        casing=on_casing, grip=grip, casing_spring=spring,
    )  # fmt: skip
    return _with_scales(system)


def at_frequency(system: System, frequency: float) -> System:
    """Return a system at another frequency of the excitation, Hz, which leaves the amplitudes of the loads."""
    omega = 2 * np.pi * frequency
    return _with_scales(system._replace(omega=omega, period=2 * np.pi / omega, frequency=omega * system.order))


def _with_scales(system: System) -> System:
    """Return a system with the moment and the speed that follow from the rest of it."""
    yields = np.isfinite(system.spring)
    mobility = (system.J[: len(yields)][yields] ** 2 / system.mass).sum(axis=1)
    pulled = (system.elongation[:, : system.modes] ** 2).sum(axis=1)
    springs = np.r_[system.spring[yields] * mobility, system.tangential * pulled]
    fastest = np.sqrt(springs.max(initial=0.0))
    shortest = min(system.period, 2 * np.pi / fastest) if fastest > 0.0 else system.period
    pushed = np.abs(system.weight) * system.period
    pushed += (np.abs(system.load) / np.maximum(system.frequency, system.omega)[:, None]).sum(axis=0)
    speed = (np.abs(system.J) @ (pushed / system.mass)).max(initial=0.0)
    return system._replace(moment=_MOMENT * shortest, speed=float(speed))


def _holding(scene: Scene, loads: BodyLoads) -> np.ndarray:
    """Return the friction (b,) that holds each body on its floor under its weight, at most, N."""
    pressed = [
        damper.mass * float(across) if damper.normal_load is None else damper.normal_load
        for damper, across in zip(scene.damper, loads.across, strict=True)
    ]
    bodies = zip(scene.damper, pressed, strict=True)
    return np.array([coefficient(damper.friction) * max(force, 0.0) for damper, force in bodies])


def _bodies(scene: Scene, first: int) -> list[Body]:
    """Return the bodies, whose coordinates begin with number `first`."""
    bodies: list[Body] = []
    places = zip(scene.damper, heights(scene), centres(scene), strict=True)
    for number, (damper, height, centre) in enumerate(places):
        bodies.append(Body(number, damper, first, damper.half_extent[0], float(height), float(centre)))
        first = bodies[-1].coordinates.stop
    return bodies


def _surfaces(scene: Scene, basis: ModalBasis, index: int, bodies: list[Body]) -> tuple[Surface, ...]:
    """Return the surfaces of a cavity: with their motion across and their rotation where a body feels these."""
    name = scene.cavity[index].name
    high = any(body.b > 0.0 for body in bodies if body.damper.cavity == name)
    return surfaces_of(scene, basis, index) if high or scene.planar else walls_and_floor(scene, basis, index)


def _load_bodies(
    scene: Scene, basis: ModalBasis, bodies: list[Body], owner: list[int], base: np.ndarray, table: np.ndarray,
    loads: BodyLoads, load: np.ndarray, weight: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Set the loads (e, N) and weights (N,) of the bodies. Return the base's accelerations along them (e, b)."""
    floors = [surface_labels(scene, index)[2] for index in owner]
    accelerated = base @ np.reshape([basis.directions[label] for label in floors], (-1, 3)).T
    for body, label in zip(bodies, floors, strict=True):
        k, x, mass = body.number, body.x, body.damper.mass
        load[:, x] = loads.gradient[k] * table - mass * accelerated[:, k]
        weight[x] = mass * loads.along[k]
        if body.shape.extended:
            weight[x + 1] = -mass * float(loads.across[k])
            normal = basis.across(label)
            if normal is not None:
                load[:, x + 1] = -mass * (base @ normal)
    return accelerated


def _neglected(scene: Scene, bodies: list[Body], owner: list[int]) -> np.ndarray:
    """Return the shortening (b,) of each body over the smallest play, per square of its tilt; nan for sliders."""
    plays = [min(scene.cavity[index].gap, scene.cavity[index].play or np.inf) for index in owner]
    return np.array([
        body.shape.shortening(body.a, body.b) / play for body, play in zip(bodies, plays, strict=True)
    ])  # fmt: skip


def base_acceleration(scene: Scene, basis: ModalBasis) -> np.ndarray:
    """Return the complex amplitudes (e, 3) of the base's acceleration in the model's axes, m/s^2."""
    excitation, direction = scene.excitation, basis.directions[forced_label(scene)]
    if excitation.base_direction is not None:
        direction = np.array(excitation.base_direction) / np.linalg.norm(excitation.base_direction)
    share = np.array(list(excitation.shares.values()))[:, None]
    if isinstance(scene.structure, Prescribed):
        frequency = 2 * np.pi * scene.frequency * np.array(list(excitation.shares))[:, None]
        return np.asarray(-(frequency**2) * (share * -1j * scene.structure.displacement_amplitude) * direction)
    return np.asarray(share * (excitation.base_acceleration or 0.0) * -1j * direction)


def loads_of(scene: Scene, signal: Waveform) -> Loads:
    """Return the loads of the scene's excitation with a signal in place of its sine."""
    level = -assemble(with_sine(scene)).load[0].imag  # Re(load exp(i omega t)) = level sin(omega t)
    return lambda angle: np.outer(signal.sampled(angle), level)


def with_sine(scene: Scene) -> Scene:
    """Return the scene with a sine in place of its waveform."""
    plain = replace(scene.excitation, waveform=None, frequency=scene.frequency, engine_order=None)
    return replace(scene, excitation=plain)


def initial_motion(scene: Scene, system: System) -> Motion:
    """Return the motion that a scene begins with. Raises InputError for what would overlap a surface or a stop."""
    n, size = system.modes, len(system.mass)
    q, v = np.zeros(size), np.zeros(size)
    # an initial state is that of a rigid structure: others have none
    q[:n], v[:n] = scene.initial.displacement / system.scale, scene.initial.velocity / system.scale
    for k, damper in enumerate(scene.damper):
        x, shape = system.along[k], shape_of(damper)
        q[x] = damper.position + system.floor[k] @ q
        v[x] = damper.velocity + system.floor[k] @ v
        if shape.extended:
            # a tilted block stands on its corner unless it is lifted higher
            lifted = damper.lift + shape.rise(damper.half_extent[0], damper.tilt)
            q[x + 1 : x + 3] = lifted + system.rise[k] @ q, damper.tilt + system.turn[k] @ q
            v[x + 1 : x + 3] = damper.lift_velocity + system.rise[k] @ v, damper.tilt_rate + system.turn[k] @ v
    place_sliders(system, q, np.zeros(len(system.tangential)))
    gaps = system.rest + system.J[: len(system.rest)] @ q
    for unit in range(system.contacts):
        if gaps[unit] < -_ROUND_OFF * system.play[unit]:
            if system.surface[unit] == STOP:
                raise InputError(
                    f"initial.displacement: the structure would begin {-gaps[unit]:.3g} m beyond "
                    f"stop[{system.body[unit]}]"
                )
            raise InputError(
                f"damper[{system.body[unit]}]: begins {-gaps[unit]:.3g} m beyond the cavity's "
                f"{SURFACES[system.surface[unit]]}; change position, lift or tilt"
            )
    return Motion(q, v)


def place_sliders(system: System, q: np.ndarray, elongation: np.ndarray) -> None:
    """Place the sliders of Jenkins elements in q (N,) so that their springs have an elongation (j,), m."""
    sliders = slice(len(q) - len(elongation), None)
    q[sliders] += system.elongation @ q - elongation
