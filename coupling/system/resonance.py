"""The exciting forces on the modes of a structure, and the resonance for which `resonance_amplitude` finds them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.rotation import Rotation, frequency_of, speed_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Ring, Rom, Structure
from vanedamp.coupling.system.engine_order import crossings
from vanedamp.coupling.system.modal_basis import (
    ModalBasis,
    basis_of,
    forced_label,
    interface_row,
    moved,
    structure_basis,
)
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.coupling.tangents.dual import active, array, solve, zeros
from vanedamp.coupling.tangents.opaque import changed, opaque, plain
from vanedamp.files.store import file_stamp
from vanedamp.files.toml_input import InputError

#: fraction of the largest product of response and loads below which loads do not excite a mode
_UNMOVED = 1e-9
#: entries of the matrices that are solved together
_TOGETHER = 1 << 22


def excitation_force(scene: Scene) -> float:
    """Return the amplitude of the exciting force, N, or the factor of several loads (resonance_amplitude resolved)."""
    if isinstance(scene.structure, Prescribed):
        return 0.0
    scene = unrolled(scene)
    basis = basis_of(scene)
    return force_amplitude(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))


class Resonance(NamedTuple):
    """A resonance without bodies: its mode (from 0), the number of modes, frequency (Hz), displacement of the
    response per newton (m/N; of several loads for their factor 1, m) and modal mass there (kg)."""

    mode: int
    modes: int
    frequency: float
    flexibility: float
    mass: float


def chosen_resonance(scene: Scene) -> Resonance:
    """Return the resonance that `resonance_amplitude` means: of the mode that responds most within `resonance_near`.

    With an engine order and a range it has the highest response along the order, at the speed where it is met. Of a
    ring it is that of the tuned one.
    Raises InputError for a structure without damping.
    """
    scene = _at_resonance(unrolled(scene))
    basis = basis_of(scene)
    return _chosen(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))


def force_shapes(scene: Scene, basis: ModalBasis, response: np.ndarray) -> np.ndarray:
    """Return the complex amplitudes (e, n) of the modal forces by harmonic, relative to a sine, for a level of 1.

    The level is a force, N, at the functional `response` (n,), or the factor of loads at several labels. Raises
    InputError for an unknown label.
    """
    shares = scene.excitation.shares
    if not scene.excitation.distributed:
        return array(list(shares.values()), complex)[:, None] * response
    shapes = zeros((len(shares), len(response)), dtype=complex)
    orders = list(shares)
    for key, load in scene.excitation.loads.items():
        row = interface_row(basis, load.at, f"{key}.at" if scene.excitation.load else key)
        if load.order in orders:  # one without force has no order
            shapes[orders.index(load.order)] += load.amplitude * row
    return shapes


def steady_motion(
    stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray, force: np.ndarray, omega: np.ndarray
) -> np.ndarray:
    """Return the complex modal coordinates (f, n) under modal forces (n,), or (f, n), at angular frequencies (f,).

    stiffness: (n,) of modes, or (n, n). Raises LinAlgError at a resonance without damping.
    """
    loads = np.broadcast_to(force, (len(omega), force.shape[-1]))[:, :, None]
    parts = np.array_split(np.arange(len(omega)), 1 + len(omega) * len(stiffness) ** 2 // _TOGETHER)
    return np.concatenate([_solved(stiffness, damping, mass, loads[rows], omega[rows]) for rows in parts])


def _solved(
    stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray, loads: np.ndarray, omega: np.ndarray
) -> np.ndarray:
    omega = omega[:, None, None]
    dynamic = (np.diag(stiffness) if stiffness.ndim == 1 else stiffness) + 1j * omega * damping - omega**2 * mass
    return np.asarray(np.linalg.solve(dynamic, loads)[:, :, 0])


def force_amplitude(scene: Scene, basis: ModalBasis, response: np.ndarray) -> float:
    """Return the amplitude of the exciting force at the functional `response` (n,) of the basis, N, or of several
    loads their factor."""
    excitation = scene.excitation
    if excitation.resonance_amplitude is None:
        return excitation.level
    if _along_order(scene) or _mistuned(scene):

        def flexibility(*parts: Any) -> float:
            names = ("structure", "excitation", "rotation")
            return chosen_resonance(changed(scene, **dict(zip(names, parts, strict=True)))).flexibility

        meant: float = opaque(flexibility, scene.structure, excitation, scene.rotation)
        return excitation.resonance_amplitude / meant
    if active() is None:
        return excitation.resonance_amplitude / _chosen(scene, basis, response).flexibility
    chosen = _chosen(*plain((scene, basis, response)))
    # at its highest, the response does not change with the frequency
    omega = 2 * np.pi * chosen.frequency
    dynamic = np.diag(basis.stiffness - omega**2) + 1j * omega * basis.damping
    force = force_shapes(scene, basis, response)[0] if excitation.distributed else response
    return excitation.resonance_amplitude / abs(response @ solve(dynamic, force))


def _at_resonance(scene: Scene) -> Scene:
    """Return a scene at the speed at which its engine order is in resonance, where that is sought over a range.

    A ring is then the tuned one: the level is one for all mistuned rings.
    """
    if _mistuned(scene):
        scene = changed(scene, structure=changed(scene.structure, mistuning=None))
    if not _along_order(scene):
        return scene
    excitation, at = scene.excitation, forced_label(scene)
    order, (low, high) = excitation.engine_order, scene.resonance_range
    assert order is not None
    structure = moved(scene.structure)
    stamp = file_stamp(structure.file) if isinstance(structure, Rom) else 0
    sine = {load.at: load.amplitude for load in excitation.loads.values() if load.order == 1} or {at: 1.0 + 0.0j}
    ends = speed_of(order, low), speed_of(order, high)
    speed = _resonant_speed(structure, at, tuple(sine.items()), order, *ends, stamp)
    near = replace(excitation, resonance_near=frequency_of(order, speed))
    return replace(scene, rotation=Rotation(speed=speed), excitation=near)


def _mistuned(scene: Scene) -> bool:
    return isinstance(scene.structure, Ring) and scene.structure.mistuning is not None


def _along_order(scene: Scene) -> bool:
    """Whether a resonance is sought over a range of an engine order."""
    near = scene.excitation.resonance_near
    return scene.excitation.engine_order is not None and isinstance(near, tuple) and near[0] != near[1]


@lru_cache(maxsize=64)
def _resonant_speed(
    structure: Structure, at: str, sine: tuple[tuple[str, complex], ...], order: float, low: float, high: float,
    _stamp: int,
) -> float:  # fmt: skip
    """Return the speed, rad/s, of the highest response along an engine order, without bodies: once for a sweep.

    sine: the forces that excite it, by their labels.
    """

    def response(speed: float) -> float:
        basis, omega = structure_basis(structure, speed), np.array([order * speed])
        _check_damped(basis)
        row = interface_row(basis, at, "excitation.at")
        force = np.zeros(len(row), complex)
        for label, amplitude in sine:
            force += amplitude * interface_row(basis, label, "excitation.load")
        motion = steady_motion(basis.stiffness, basis.damping, np.eye(len(row)), force, omega)
        return float(abs((motion @ row)[0]))

    def natural(speed: float) -> np.ndarray:
        return np.sqrt(structure_basis(structure, speed).stiffness) / (2 * np.pi)

    return max([low, high, *crossings(natural, partial(frequency_of, order), low, high)], key=response)


def _check_damped(basis: ModalBasis) -> None:
    if np.any(np.diag(basis.damping) <= 0):
        raise InputError(
            "excitation.resonance_amplitude: an undamped resonance has no amplitude; give damping or force"
        )


def _chosen(scene: Scene, basis: ModalBasis, response: np.ndarray) -> Resonance:
    _check_damped(basis)
    # each mode at the frequency of the range that is nearest to its own
    low, high = (2 * np.pi * frequency for frequency in scene.resonance_range)
    omega = np.clip(np.sqrt(basis.stiffness), low, high)
    dynamic = basis.stiffness - omega**2 + 1j * omega * np.diag(basis.damping)
    force = _sine(scene, basis, response)
    mode = int(np.argmax(np.abs(response * force) / np.abs(dynamic)))
    frequency, flexibility = _resonance(
        basis.stiffness.tobytes(), basis.damping.tobytes(), response.tobytes(), force.astype(complex).tobytes(), mode
    )
    return Resonance(mode, len(response), frequency, flexibility, float(1 / response[mode] ** 2))


def _sine(scene: Scene, basis: ModalBasis, response: np.ndarray) -> np.ndarray:
    """Return the modal forces (n,) that are to reach a resonance: loads of order 1, or a sine of amplitude 1."""
    if not scene.excitation.distributed:
        return response
    force: np.ndarray = force_shapes(scene, basis, response)[0]
    moved = np.abs(response * force).max()
    if not moved > _UNMOVED * np.linalg.norm(response) * np.linalg.norm(force):
        raise InputError(
            "excitation.resonance_amplitude: the loads of order 1 excite no mode that moves excitation.at; give "
            "load_factor"
        )
    return force


@lru_cache(maxsize=64)
def _resonance(stiffness_: bytes, damping_: bytes, response_: bytes, force_: bytes, mode: int) -> tuple[float, float]:
    """Return frequency (Hz) and height (m/N) of a mode's resonance: once for all frequencies of a sweep."""
    from scipy.optimize import minimize_scalar

    stiffness, response, force = np.frombuffer(stiffness_), np.frombuffer(response_), np.frombuffer(force_, complex)
    damping = np.frombuffer(damping_).reshape(len(stiffness), -1)
    resonance = np.sqrt(stiffness[mode])

    def negative(omega: float) -> float:
        motion = steady_motion(stiffness, damping, np.eye(len(response)), force, np.array([omega]))
        return -float(abs((motion @ response)[0]))

    width = min(1.5 * damping[mode, mode] / resonance, 0.5)
    bounds = (resonance * (1 - width), resonance * (1 + width))
    maximum = minimize_scalar(negative, bounds=bounds, method="bounded", options={"xatol": 1e-9 * resonance})
    return float(maximum.x) / (2 * np.pi), -float(maximum.fun)
