"""The linear structure of a scene in its real modes: what every method of this package starts from.

Coordinates p are mass-normalised: p'' + D p' + diag(omega^2) p = loads; every displacement is a functional of p.
All motion is relative to the base. A prescribed motion is a structure without modes on a moving base.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from coupling.cavities import check_known, check_surfaces
from coupling.inputs import InputError
from coupling.model_file import file_stamp, reduced_model
from coupling.scene import Prescribed, Rigid, Rom, Scene
from modal.store import frozen
from rom.reduced import ReducedModel
from rom.spectrum import rounding

# share of a natural frequency that round-off of the stiffness may be worth
_FREQUENCY_ERROR = 1e-3


@dataclass(frozen=True)
class LinearStructure:
    """A structure with n real modes (n may be 0), excited at angular frequency `omega`.

    stiffness: (n,) squared undamped angular frequencies; damping: (n, n); response: (n,) functional of the response;
    floor, left, right: (cavities, n) functionals of the cavities' surfaces; casing: (friction dampers, n) functionals
    of what rubs on the casing; force: (n,) complex modal load and base_acceleration: (cavities,) complex acceleration
    of the base along each cavity, both amplitudes of exp(i omega t); gravity: (cavities, 2) along and across each
    cavity, m/s^2; displacement and velocity: (n,) initial state; table: complex displacement amplitude of the base that
    counts as response (prescribed motion); physical: displacement per modal coordinate of a rigid structure, whatever
    its mass; 1 for others.
    """

    omega: float
    stiffness: np.ndarray
    damping: np.ndarray
    response: np.ndarray
    floor: np.ndarray
    left: np.ndarray
    right: np.ndarray
    casing: np.ndarray
    force: np.ndarray
    base_acceleration: np.ndarray
    gravity: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    table: complex = 0.0
    physical: float = 1.0
    wall_flexibility: np.ndarray | None = None

    @property
    def modes(self) -> int:
        """Number of modes n."""
        return len(self.stiffness)


@dataclass(frozen=True)
class _ModalBasis:
    """Modes of a structure without bodies: squared frequencies, damping; load (n, 3) of a base acceleration.

    By label: functionals, directions and normals (zeros: unknown), residual flexibility.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    base: np.ndarray
    rows: dict[str, np.ndarray]
    directions: dict[str, np.ndarray]
    normals: dict[str, np.ndarray]
    flexibility: dict[str, float]


def linear_structure(scene: Scene) -> LinearStructure:
    """The structure of a scene with its excitation. Raises InputError for an unknown label or an unusable model."""
    omega = 2 * np.pi * scene.excitation.frequency
    cavities = len(scene.cavity)
    if isinstance(scene.structure, Prescribed):
        amplitude = -1j * scene.structure.displacement_amplitude
        none = np.zeros((cavities, 0))
        flat = np.zeros(0)
        return LinearStructure(
            omega, flat, np.zeros((0, 0)), flat, none, none, none, np.zeros((0, 0)), flat.astype(complex),
            np.full(cavities, -(omega**2) * amplitude), _gravity(scene, np.zeros((cavities, 3))), flat, flat,
            table=amplitude,
        )  # fmt: skip
    basis = _basis(scene)
    at = scene.excitation.at if isinstance(scene.structure, Rom) else "structure"
    response = _row(basis, at, "excitation.at")
    surfaces = np.array([_surfaces(basis, scene, index) for index in range(cavities)])
    if isinstance(scene.structure, Rom):
        _check_directions(basis, scene)
    left, right, floor = surfaces.reshape(cavities, 3, len(response)).swapaxes(0, 1)
    casing = [
        _row(basis, damper.at or at, f"friction_damper[{i}].at") if isinstance(scene.structure, Rom) else response
        for i, damper in enumerate(scene.friction_damper)
    ]
    along = np.reshape([basis.directions[label] for label in _floors(scene)], (-1, 3))
    base = -1j * (scene.excitation.base_acceleration or 0.0) * basis.directions[str(at)]
    force = -1j * response * _force_amplitude(scene, basis, response) - basis.base @ base
    # the initial state belongs to the rigid model, whose single mode has the functional `response`
    scale = 1 / response[0] if isinstance(scene.structure, Rigid) else 0.0
    displacement = np.full(len(response), scene.initial.displacement * scale)
    velocity = np.full(len(response), scene.initial.velocity * scale)
    return LinearStructure(
        omega, basis.stiffness, basis.damping, response, floor, left, right,
        np.reshape(casing, (len(casing), len(response))), force, along @ base, _gravity(scene, along), displacement,
        velocity,
        physical=float(response[0]) if isinstance(scene.structure, Rigid) else 1.0,
        wall_flexibility=_wall_flexibility(basis, scene),
    )  # fmt: skip


def receptance(scene: Scene, frequencies: np.ndarray, fixed: bool = False) -> np.ndarray:
    """Complex displacement of the response per newton at `excitation.at`, m/N, shape (f,).

    Without bodies, or (`fixed`) with every body glued to its cavity's floor.
    """
    basis = _basis(scene)
    at = scene.excitation.at if isinstance(scene.structure, Rom) else "structure"
    response = _row(basis, at, "excitation.at")
    mass = np.eye(len(response))
    if fixed:
        names = [cavity.name for cavity in scene.cavity]
        for damper in scene.damper:
            _, _, floor = _surfaces(basis, scene, names.index(damper.cavity))
            mass += damper.mass * np.outer(floor, floor)
    return _receptance(basis.stiffness, basis.damping, mass, response, 2 * np.pi * np.asarray(frequencies))


def excitation_force(scene: Scene) -> float:
    """Amplitude of the exciting force, N (resonance_amplitude resolved)."""
    if isinstance(scene.structure, Prescribed):
        return 0.0
    basis = _basis(scene)
    at = scene.excitation.at if isinstance(scene.structure, Rom) else "structure"
    return _force_amplitude(scene, basis, _row(basis, at, "excitation.at"))


class Resonance(NamedTuple):
    """A resonance without bodies: its mode from 0 of so many, frequency (Hz), displacement of the response per newton
    (m/N) and modal mass there (kg)."""

    mode: int
    modes: int
    frequency: float
    flexibility: float
    mass: float


def chosen_resonance(scene: Scene) -> Resonance:
    """The resonance that `resonance_amplitude` means: of the mode that responds most within `resonance_near`.

    Raises InputError for a structure without damping.
    """
    basis = _basis(scene)
    at = scene.excitation.at if isinstance(scene.structure, Rom) else "structure"
    return _chosen(scene, basis, _row(basis, at, "excitation.at"))


def _receptance(
    stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray, response: np.ndarray, omega: np.ndarray
) -> np.ndarray:
    dynamic = np.diag(stiffness) + 1j * omega[:, None, None] * damping - omega[:, None, None] ** 2 * mass
    loads = np.broadcast_to(response[:, None], (len(omega), len(response), 1))
    return np.linalg.solve(dynamic, loads)[:, :, 0] @ response


def _force_amplitude(scene: Scene, basis: _ModalBasis, response: np.ndarray) -> float:
    excitation = scene.excitation
    if excitation.resonance_amplitude is None:
        return excitation.force or 0.0
    return excitation.resonance_amplitude / _chosen(scene, basis, response).flexibility


def _chosen(scene: Scene, basis: _ModalBasis, response: np.ndarray) -> Resonance:
    if np.any(np.diag(basis.damping) <= 0):
        raise InputError(
            "excitation.resonance_amplitude: an undamped resonance has no amplitude; give damping or force"
        )
    # each mode at the frequency of the range that is nearest to its own
    low, high = (2 * np.pi * frequency for frequency in scene.excitation.resonance_range)
    omega = np.clip(np.sqrt(basis.stiffness), low, high)
    dynamic = basis.stiffness - omega**2 + 1j * omega * np.diag(basis.damping)
    mode = int(np.argmax(response**2 / np.abs(dynamic)))
    frequency, flexibility = _resonance(basis.stiffness.tobytes(), basis.damping.tobytes(), response.tobytes(), mode)
    return Resonance(mode, len(response), frequency, flexibility, float(1 / response[mode] ** 2))


@lru_cache(maxsize=64)
def _resonance(stiffness_: bytes, damping_: bytes, response_: bytes, mode: int) -> tuple[float, float]:
    """Frequency (Hz) and height (m/N) of a mode's resonance: once for all frequencies of a sweep."""
    stiffness, response = np.frombuffer(stiffness_), np.frombuffer(response_)
    damping = np.frombuffer(damping_).reshape(len(stiffness), -1)
    resonance = np.sqrt(stiffness[mode])

    def negative(omega: float) -> float:
        return -float(abs(_receptance(stiffness, damping, np.eye(len(response)), response, np.array([omega]))[0]))

    width = min(1.5 * damping[mode, mode] / resonance, 0.5)
    bounds = (resonance * (1 - width), resonance * (1 + width))
    found = minimize_scalar(negative, bounds=bounds, method="bounded", options={"xatol": 1e-9 * resonance})
    return float(found.x) / (2 * np.pi), -float(found.fun)


def _row(basis: _ModalBasis, label: str | None, key: str) -> np.ndarray:
    try:
        return basis.rows[str(label)]
    except KeyError:
        raise InputError(f"{key}: no interface label '{label}'; it has {', '.join(basis.rows)}") from None


def _gravity(scene: Scene, along: np.ndarray) -> np.ndarray:
    """(cavities, 2) m/s^2 along and across cavities of directions (cavities, 3)."""
    return np.reshape([scene.gravity.components(direction) for direction in along], (len(along), 2))


def _floors(scene: Scene) -> list[str]:
    """The floors' labels."""
    rom = isinstance(scene.structure, Rom)
    return [str(cavity.labels()[2]) if rom else "structure" for cavity in scene.cavity]


def _check_directions(basis: _ModalBasis, scene: Scene) -> None:
    if scene.excitation.base_acceleration and not basis.base.any():
        raise InputError(
            "excitation.base_acceleration: the reduced model does not say how a base loads it (its base_load is zero); "
            "give it one, or excite by a force"
        )
    check_known(scene, basis.directions)
    check_surfaces(scene.cavity, basis.directions, basis.normals)


def _surfaces(basis: _ModalBasis, scene: Scene, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if isinstance(scene.structure, Rigid):
        return (basis.rows["structure"],) * 3
    left, right, floor = scene.cavity[index].labels()
    key = f"cavity[{index}]"
    return _row(basis, left, f"{key}.left"), _row(basis, right, f"{key}.right"), _row(basis, floor, f"{key}.floor")


def _wall_flexibility(basis: _ModalBasis, scene: Scene) -> np.ndarray:
    if isinstance(scene.structure, Rigid):
        return np.zeros((len(scene.cavity), 2))
    walls = [basis.flexibility[str(label)] for cavity in scene.cavity for label in cavity.labels()[:2]]
    return np.reshape(walls, (-1, 2))


def _basis(scene: Scene) -> _ModalBasis:
    structure = scene.structure
    if isinstance(structure, Rigid):
        # its one axis is that of the base's motion and of all cavities
        root, axis = np.sqrt(structure.mass), frozen([1.0, 0.0, 0.0])
        return _ModalBasis(
            frozen([structure.stiffness / structure.mass]), frozen([[structure.viscous / structure.mass]]),
            frozen([root * axis]), {"structure": frozen([1 / root])}, {"structure": axis}, {}, {},
        )  # fmt: skip
    assert isinstance(structure, Rom)
    return _rom_basis(structure, file_stamp(structure.file))


@lru_cache(maxsize=8)
def _rom_basis(structure: Rom, _stamp: int) -> _ModalBasis:
    return modal_basis(reduced_model(structure))


def modal_basis(model: ReducedModel) -> _ModalBasis:
    """Real modes of a reduced model.

    Raises InputError if the structure can move freely (no support), or if round-off of its stiffness alone moves the
    lowest natural frequency by more than a thousandth.
    """
    if model.rigid_modes:
        raise InputError("structure: the reduced model has rigid-body motion; support it before reduction")
    squares, shapes = model.natural
    # half of the relative error of the square
    errors = 0.5 * rounding(model.stiffness, shapes) / squares
    if errors.max() > _FREQUENCY_ERROR:
        worst = int(np.argmax(errors))
        raise InputError(
            f"structure: the natural frequency of {np.sqrt(squares[worst]) / (2 * np.pi):.4g} Hz is a difference of "
            f"stiffnesses so large that their round-off alone is worth {errors[worst]:.1e} of it; give the model in "
            "coordinates that keep soft and stiff motions apart, such as natural modes"
        )
    damping = shapes.T @ model.damping @ shapes
    damping = (damping + damping.T) / 2
    noise = np.abs(damping - np.diag(np.diag(damping))).max(initial=0.0)
    if noise < 1e-9 * np.abs(damping).max(initial=0.0):  # proportional damping: keep it exactly so
        damping = np.diag(np.diag(damping))
    rows = {label: frozen(model.row(label) @ shapes) for label in model.interface}
    directions = dict(zip(model.interface, model.directions, strict=True))
    unknown = np.zeros((len(model.interface), 3))
    normals = dict(zip(model.interface, unknown if model.normals is None else model.normals, strict=True))
    residual = model.residual_flexibility
    own = np.zeros(len(model.interface)) if residual is None else np.diag(residual)
    flexibility = dict(zip(model.interface, own.tolist(), strict=True))
    base = frozen(shapes.T @ model.base_load)
    return _ModalBasis(frozen(squares), frozen(damping), base, rows, directions, normals, flexibility)
