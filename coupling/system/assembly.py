"""From a scene to its system, and to the motion that it begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.system.body_loads import body_loads
from vanedamp.coupling.system.cavities import check_directions
from vanedamp.coupling.system.constraints import constraints_of
from vanedamp.coupling.system.loads import force_shapes
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of, forced_label, interface_row
from vanedamp.coupling.system.resonance import force_amplitude
from vanedamp.coupling.system.restitution import law_address
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError

#: loads (k, N) on the coordinates of a system, N, at angles omega t (k,) in [0, 2 pi)
Loads = Callable[[np.ndarray], np.ndarray]


class InitialMotion(NamedTuple):
    """Motion at time zero: modal coordinates (n,) and their rates, displacements (r,) and velocities of the rows."""

    p: np.ndarray
    p_rate: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray


def assemble(scene: Scene, basis: ModalBasis | None = None) -> System:
    """Assemble the system of a scene. basis: modes of its structure, if not those that the scene names.

    Raises InputError for an unknown label or an unusable model.
    """
    basis = basis or basis_of(scene)
    omega, n, shares = 2 * np.pi * scene.frequency, len(basis.stiffness), scene.excitation.shares
    frequency = omega * np.array(list(shares))
    check_directions(scene, basis)
    at = forced_label(scene)
    response = interface_row(basis, at, "excitation.at")
    base = base_acceleration(scene, basis)
    table = np.zeros((len(shares), 1), complex)
    if isinstance(scene.structure, Prescribed):
        table = np.array(list(shares.values()))[:, None] * -1j * scene.structure.displacement_amplitude
    shapes = force_shapes(scene, basis, response)
    force = shapes * -1j * force_amplitude(scene, basis, response) - base @ basis.base.T
    made = constraints_of(scene, basis, at)
    travel = made.free_travel.copy()
    if scene.stop:  # whose gap may be none: how far their place moves counts as well
        stops, begun = slice(len(travel) - len(scene.stop), None), scene.initial
        reach = np.abs(made.J[stops, :n]) @ (np.abs(force).sum(axis=0) / basis.stiffness)
        reach += abs(begun.displacement) + abs(begun.velocity) / np.sqrt(basis.stiffness[0]) + np.finfo(float).tiny
        travel[stops] = np.maximum(travel[stops], reach)
    on_structure, on_bodies = made.J[:, :n], made.J[:, n:]
    mass = np.array([damper.mass for damper in scene.damper])
    along = np.reshape([basis.directions[label] for label in made.floors], (-1, 3))
    accelerated, loads = base @ along.T, body_loads(scene, basis)
    bodies = len(mass)
    damping = np.zeros((n + bodies, n + bodies))
    damping[:n, :n] = basis.damping
    return System(
        modes=n, bodies=bodies, friction_rows=made.friction_rows, mass=np.concatenate([np.ones(n), mass]),
        stiffness=np.concatenate([basis.stiffness, np.zeros(bodies)]), damping=damping,
        proportional=bool(np.count_nonzero(basis.damping - np.diag(np.diag(basis.damping))) == 0),
        load=np.hstack([force, loads.gradient * table - mass * accelerated]) + 0j,
        weight=np.concatenate([np.zeros(n), mass * loads.along]),
        alike=bool(np.all(accelerated == accelerated[:, :1])),
        response=np.concatenate([response, np.zeros(bodies)]), table=table.ravel(), frequency=frequency,
        omega=omega, period=2 * np.pi / omega, floor=made.floor, J=made.J, rest=made.rest,
        delassus=on_structure @ on_structure.T + (on_bodies / mass) @ on_bodies.T, limit=made.limit,
        spring=made.spring, dashpot=made.dashpot, restitution=made.restitution,
        restitution_at=law_address(scene.contact, made.restitution[made.friction_rows :]), free_travel=travel,
        left_body=made.left_body, right_body=made.right_body, moves_with_floor=made.moves_with_floor,
    )  # fmt: skip


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


def initial_motion(scene: Scene, system: System) -> InitialMotion:
    """Return the motion that a scene begins with."""
    n = system.modes
    scale = physical_scale(scene, system)  # an initial state is that of a rigid structure: others have none
    p, p_rate = np.full(n, scene.initial.displacement / scale), np.full(n, scene.initial.velocity / scale)
    slip = np.array([damper.position for damper in scene.damper])
    speed = np.array([damper.velocity for damper in scene.damper])
    unloaded = np.zeros(system.friction_rows - system.bodies)
    motion = InitialMotion(p, p_rate, *row_motion(system, slip, speed, p, p_rate, unloaded))
    for index, gap in enumerate(motion.displacement[len(system.J) - len(scene.stop) :]):
        if gap < 0.0:
            raise InputError(f"initial.displacement: the structure would begin {-gap:g} m beyond stop[{index}]")
    return motion


def physical_scale(scene: Scene, system: System) -> float:
    """Return the displacement per modal coordinate of a rigid structure, which has only one; 1 for others."""
    return float(system.response[0]) if isinstance(scene.structure, Rigid) else 1.0


def row_motion(
    system: System, slip: np.ndarray, slip_velocity: np.ndarray, p: np.ndarray, p_rate: np.ndarray,
    elongation: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return displacement and velocity (r,) of every row, from slips (b,), modal coordinates (n,) and their rates.

    elongation: (friction dampers,) of the springs before the sliders, m.
    """
    b, friction = system.bodies, system.friction_rows
    # slips are relative to the floor, so that a body at relative rest is known to be so
    on_structure, on_bodies = system.of_structure.J, system.of_bodies.J
    displacement = on_bodies @ slip + system.rest
    speed = on_structure @ p_rate + on_bodies @ (slip_velocity + system.floor @ p_rate)
    moved = on_structure @ p + on_bodies @ (system.floor @ p)
    speed[:b], moved[:b] = slip_velocity, 0.0
    displacement += moved
    springs = np.isfinite(system.spring[b:friction])
    displacement[b:friction][springs] = elongation[springs]
    return displacement, speed
