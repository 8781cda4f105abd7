"""From a scene to its system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.elements.element import Unit
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.system.body_loads import BodyLoads, binding, body_loads, centres
from vanedamp.coupling.system.cavities import check_directions, surface_labels
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of, forced_label, interface_row
from vanedamp.coupling.system.reduced_model_file import ring_in_file
from vanedamp.coupling.system.resonance import force_amplitude, force_shapes
from vanedamp.coupling.system.restitution import law_address
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.coupling.system.surfaces import Surface, heights, surfaces_of, walls_and_floor
from vanedamp.coupling.system.system import FLOOR, System, surface_code
from vanedamp.coupling.system.units import (
    Body,
    ElementParts,
    Law,
    check_friction,
    coefficient,
    contacts_of,
    element_units,
    friction_elements,
    layered,
)
from vanedamp.coupling.tangents.dual import active, array, scalar, values, vanishes, zeros

#: the moment after which contacts are checked again, in periods of the excitation or of the fastest contact
_MOMENT = 1e-6

#: loads (k, N) on the coordinates of a system, N, at angles omega t (k,) in [0, 2 pi)
Loads = Callable[[np.ndarray], np.ndarray]


class Coordinates(NamedTuple):
    """A motion at one time: coordinates (N,) and their rates."""

    q: np.ndarray
    v: np.ndarray


def assemble(scene: Scene, basis: ModalBasis | None = None) -> System:
    """Assemble the system of a scene. basis: modes of its structure, if not those that the scene names.

    Raises InputError for an unknown label, an unusable model, or bodies that do not fit together.
    """
    scene = unrolled(scene)
    basis = basis or basis_of(scene)
    n, omega, shares = len(basis.stiffness), 2 * np.pi * scene.frequency, scene.excitation.shares
    check_directions(scene, basis)
    forced = interface_row(basis, forced_label(scene), "excitation.at")
    bodies = _bodies(scene, n)
    surfaces = [_surfaces(scene, basis, index, bodies) for index in range(len(scene.cavity))]
    loads = body_loads(scene, basis)
    table = zeros(len(shares), dtype=complex)
    if isinstance(scene.structure, Prescribed):
        table = array(list(shares.values()), complex) * -1j * scene.structure.displacement_amplitude
    casing = _casing(scene, basis, bodies[-1].coordinates.stop if bodies else n)
    size = casing["casing"].shape[1]
    excited = _excitation(scene, basis, bodies, loads, forced, table, size)
    placed = _places(scene, basis, bodies, surfaces, loads, size)
    mass, holds = _mass(bodies, size), _holding(scene, loads)
    law = Law(scene.contact, basis, mass)
    contacts, elements = _contacts(scene, law, bodies, surfaces, placed, excited["load"][:, :n])
    for unit in contacts:
        if values(unit.closing):
            excited["weight"] = excited["weight"] - unit.closing * unit.normal
    rubbing = friction_elements(bodies, placed["floor"], holds, **casing)
    units = _columns([*contacts, *elements, *rubbing], size)
    massive = slice(size - len(units["tangential"]))
    # rows of sliders are not to be small compared with others
    pulled = (values(units["elongation"])[:, :n] ** 2).sum(axis=1)
    mobility = (values(units["J"])[:, massive] ** 2 / values(mass)[massive]).sum(axis=1)
    mass[massive.stop :] = 1 / (np.r_[mobility, pulled].max(initial=0.0) or 1.0)
    stiffness, damping = _stiffness(scene, basis, bodies, loads, placed["floor"], size)
    response = zeros(size)
    response[:n] = forced
    system = System(
        modes=n, bodies=len(bodies), contacts=len(contacts), mass=mass, stiffness=stiffness, damping=damping,
        scale=scalar(forced[0]) if isinstance(scene.structure, Rigid) else 1.0,
        squares=basis.stiffness.copy(), viscous=basis.damping.copy(), response=response, table=table,
        outputs=_by_sector(scene, basis),
        frequency=omega * np.array(list(shares)), omega=omega, period=2 * np.pi / omega, moment=0.0, speed=0.0,
        delassus=(values(units["J"]) / values(mass)) @ values(units["J"]).T,
        restitution_at=law_address(scene.contact, values(units["restitution"])[: len(contacts)]),
        in_plane=scene.planar, two_phases=scene.contact.two_phases, holds=holds, **casing, **excited, **placed, **units,
    )  # fmt: skip
    return system if active() is not None else with_scales(system)


# parts of a system by the names of its fields; n modes, N = size coordinates, b bodies


def _casing(scene: Scene, basis: ModalBasis, first: int) -> dict[str, Any]:
    """Return the friction dampers; their rows have all coordinates. first: number of the first slider's."""
    dampers, at = scene.friction_damper, forced_label(scene)
    rows = [
        interface_row(basis, damper.at or at, f"friction_damper[{number}].at")
        - (0.0 if damper.to is None else interface_row(basis, damper.to, f"friction_damper[{number}].to"))
        for number, damper in enumerate(dampers)
    ]
    grip = array([coefficient(damper.friction) * damper.normal_force for damper in dampers])
    spring = array([np.inf if damper.stiffness is None else damper.stiffness for damper in dampers])
    sliders = sum(element.sliders for _, _, element in scene.elements)
    casing = zeros((len(rows), first + sliders + np.count_nonzero((grip > 0.0) & np.isfinite(spring))))
    casing[:, : len(basis.stiffness)] = array(rows).reshape(len(rows), len(basis.stiffness))
    return {"casing": casing, "grip": grip, "casing_spring": spring}


def _by_sector(scene: Scene, basis: ModalBasis) -> np.ndarray:
    """Return the functionals (N, n) of the response in every sector of a ring; (0, n) for other structures."""
    ring, name = ring_in_file(scene.structure), forced_label(scene).partition("@")[0]
    sectors = range(0 if ring is None else ring.sectors)
    rows = [interface_row(basis, f"{name}@{sector}", "excitation.at") for sector in sectors]
    matrix: np.ndarray = array(rows).reshape(len(rows), len(basis.stiffness))
    return matrix


def _excitation(
    scene: Scene, basis: ModalBasis, bodies: list[Body], loads: BodyLoads, forced: np.ndarray, table: np.ndarray,
    size: int,
) -> dict[str, Any]:  # fmt: skip
    """Return loads and weights. forced: (n,) functional of excitation.at; table: (e,) displacements of the base, m."""
    n, base = len(basis.stiffness), base_acceleration(scene, basis)
    load, weight = zeros((len(table), size), dtype=complex), zeros(size)
    amplitude = force_amplitude(scene, basis, forced)
    load[:, :n] = force_shapes(scene, basis, forced) * -1j * amplitude - base @ basis.base.T
    floors = [surface_labels(scene, scene.cavity_of(body.damper))[2] for body in bodies]
    accelerated = base @ np.reshape([basis.directions[label] for label in floors], (-1, 3)).T
    for body, label in zip(bodies, floors, strict=True):
        k, x, mass = body.number, body.x, body.damper.mass
        load[:, x] = loads.gradient[k] * table - mass * accelerated[:, k]
        weight[x] = mass * loads.along[k]
        if body.shape.extended:
            weight[x + 1] = -mass * loads.across[k]
            normal = basis.across(label)
            if normal is not None:
                load[:, x + 1] = -mass * (base @ normal)
    return {"load": load, "weight": weight, "alike": bool(np.all(values(accelerated) == values(accelerated)[:, :1]))}


def _places(
    scene: Scene, basis: ModalBasis, bodies: list[Body], surfaces: list[tuple[Surface, ...]], loads: BodyLoads,
    size: int,
) -> dict[str, Any]:  # fmt: skip
    """Return where the bodies are, and how their cavities move."""
    n, owner = len(basis.stiffness), [scene.cavity_of(body.damper) for body in bodies]
    floor, turn, rise = zeros((3, len(bodies), size))
    for body, index in zip(bodies, owner, strict=True):
        ground = surfaces[index][FLOOR]
        floor[body.number, :n] = ground.motion(0.0, body.b)[0] if body.b > 0.0 else ground.along
        rise[body.number, :n], turn[body.number, :n] = ground.motion(body.centre, 0.0)[1], ground.turn
    plays = [min(scene.cavity[index].gap, scene.cavity[index].play or np.inf) for index in owner]
    shortening = [body.damper.shaped("shortening") for body in bodies]
    return {
        "along": np.array([body.x for body in bodies], np.int64),
        "tilt": np.array([body.x + 2 if body.shape.extended else -1 for body in bodies], np.int64),
        "floor": floor, "turn": turn, "rise": rise, "height": array([body.b for body in bodies]),
        "cavity": np.array(owner, np.int64),
        "neglected": array([short / play for short, play in zip(shortening, plays, strict=True)]),
    }  # fmt: skip


def _mass(bodies: list[Body], size: int) -> np.ndarray:
    """Return the masses (N,) of the coordinates; sliders' masses are still open."""
    mass = zeros(size) + 1.0
    for body in bodies:
        mass[body.coordinates] = body.damper.mass
        if body.shape.extended:
            mass[body.x + 2] = body.damper.moment_of_inertia
    return mass


def _contacts(
    scene: Scene, law: Law, bodies: list[Body], surfaces: list[tuple[Surface, ...]], placed: dict[str, Any],
    force: np.ndarray,
) -> tuple[list[Unit], list[Unit]]:  # fmt: skip
    """Return the contacts, cavity by cavity, then of elements; and the elements' friction elements.

    placed: where the bodies are; force: (e, n) on the modes. Raises InputError.
    """
    contacts: list[Unit] = []
    for index, cavity in enumerate(scene.cavity):
        single = contacts_of(law, cavity, surfaces[index], [bodies[k] for k in scene.bodies_in(cavity)])
        contacts += [layer for unit in single for layer in layered(scene.contact, unit)]
    squares, begun = law.basis.stiffness, scene.initial
    start = abs(begun.displacement) + (abs(begun.velocity) / np.sqrt(squares[0]) if len(squares) else 0.0)
    reach = np.abs(values(force)).sum(axis=0) / values(squares)
    parts = ElementParts(law, forced_label(scene), reach, start, placed["floor"], placed["along"], scene.speed)
    elements = list(element_units(scene, parts))
    contacts += [unit for unit in elements if unit.normal.any()]
    if active() is None:
        check_friction(contacts, law.mass)
    return contacts, [unit for unit in elements if not unit.normal.any()]


def _columns(units: list[Unit], size: int) -> dict[str, Any]:
    """Return the units as arrays."""
    # arrays of their own, as all in a system: the compiled functions are compiled for the layout of their arguments
    elements = [unit.element for unit in units]
    J = array([unit.normal for unit in units] + [unit.slip for unit in units]).reshape(2 * len(units), size)
    sprung = np.flatnonzero([values(unit.tangential) < np.inf for unit in units])
    slider, slips, rests = np.full(len(units), -1), len(units) + sprung, np.eye(size)[size - len(sprung) :]
    slider[sprung], elongation = np.arange(len(sprung)), J[slips] - rests
    J[slips] = rests
    columns: dict[str, Any] = {
        name: np.array([getattr(unit, name) for unit in units], np.int64) for name in ("body", "other", "corner")
    }
    columns |= {name: array([getattr(unit, name) for unit in units]) for name in ("rest", "friction", "limit", "play")}
    return columns | {
        "surface": np.array([surface_code(unit.side) for unit in units], np.int64), "J": J,
        "restitution": array([element.restitution for element in elements]),
        "spring": array([element.stiffness for element in elements]),
        "dashpot": array([element.dashpot for element in elements]), "slider": slider, "elongation": elongation,
        "tangential": array([units[r].tangential for r in sprung]),
    }  # fmt: skip


def _stiffness(
    scene: Scene, basis: ModalBasis, bodies: list[Body], loads: BodyLoads, floor: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping (N, N) of structure and bodies on springs, dashpots and tracks."""
    n = len(basis.stiffness)
    stiffness, damping = zeros((size, size)), zeros((size, size))
    stiffness[:n, :n], damping[:n, :n] = np.diag(basis.stiffness), basis.damping
    for body, pull, drag in zip(bodies, *binding(scene, loads), strict=True):
        if pull or drag:
            shape = -floor[body.number]
            shape[body.x] = 1.0
            stiffness += pull * np.outer(shape, shape)
            damping += drag * np.outer(shape, shape)
        stiffness[body.x, body.x] -= loads.gradient[body.number]
    return stiffness, damping


def at_frequency(system: System, frequency: float) -> System:
    """Return a system at another frequency of the excitation, Hz, which leaves the amplitudes of the loads."""
    omega = 2 * np.pi * frequency
    return with_scales(system._replace(omega=omega, period=2 * np.pi / omega, frequency=omega * system.order))


def with_scales(system: System) -> System:
    """Return a system with the moment and the speed that follow from the rest of it (System)."""
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


def pressing(scene: Scene, loads: BodyLoads | None = None) -> list[float]:
    """Return the force (b,) that presses each body on its floor, N; negative: off it."""
    across = (body_loads(scene, basis_of(scene)) if loads is None else loads).across
    return [
        damper.mass * pull if damper.normal_load is None else damper.normal_load
        for damper, pull in zip(scene.damper, across, strict=True)
    ]


def _holding(scene: Scene, loads: BodyLoads) -> np.ndarray:
    """Return the friction (b,) that holds each body on its floor under its weight, at most, N."""
    forces = []
    for damper, force in zip(scene.damper, pressing(scene, loads), strict=True):
        friction = coefficient(damper.friction)
        # the equations know it of bodies that only slide: of others it need not turn
        force = values(force) if damper.form.extended else force
        forces.append(0.0 if vanishes(friction) else friction * max(force, 0.0))
    return array(forces)


def _bodies(scene: Scene, first: int) -> list[Body]:
    """Return the bodies, whose coordinates begin with number `first`."""
    bodies: list[Body] = []
    places = zip(scene.damper, heights(scene), centres(scene), strict=True)
    for number, (damper, height, centre) in enumerate(places):
        bodies.append(Body(number, damper, first, damper.half_extent[0], height, centre))
        first = bodies[-1].coordinates.stop
    return bodies


def _surfaces(scene: Scene, basis: ModalBasis, index: int, bodies: list[Body]) -> tuple[Surface, ...]:
    """Return the surfaces of a cavity: with their motion across and their rotation where a body needs these."""
    high = any(bodies[k].b > 0.0 for k in scene.bodies_in(scene.cavity[index]))
    return surfaces_of(scene, basis, index) if high or scene.planar else walls_and_floor(scene, basis, index)


def base_acceleration(scene: Scene, basis: ModalBasis) -> np.ndarray:
    """Return the complex amplitudes (e, 3) of the base's acceleration in the model's axes, m/s^2."""
    excitation, direction = scene.excitation, basis.directions[forced_label(scene)]
    if excitation.base_direction is not None:
        direction = np.array(excitation.base_direction) / np.linalg.norm(excitation.base_direction)
    share = array(list(excitation.shares.values()), complex)[:, None]
    if isinstance(scene.structure, Prescribed):
        frequency = 2 * np.pi * scene.frequency * np.array(list(excitation.shares))[:, None]
        return -(frequency**2) * (share * -1j * scene.structure.displacement_amplitude) * direction
    return share * (excitation.base_acceleration or 0.0) * -1j * direction


def loads_of(scene: Scene, signal: Waveform) -> Loads:
    """Return the loads of the scene's excitation with a signal instead of its sine."""
    sine = replace(scene.excitation, waveform=None, frequency=scene.frequency, engine_order=None)
    level = -assemble(replace(scene, excitation=sine)).load[0].imag  # Re(load exp(i omega t)) = level sin(omega t)
    return lambda angle: np.outer(signal.sampled(angle), level)


def place_sliders(system: System, q: np.ndarray, elongation: np.ndarray) -> None:
    """Place the sliders in q (N,) so that their springs have an elongation (j,), m."""
    q[len(q) - len(elongation) :] += system.elongation @ q - elongation
