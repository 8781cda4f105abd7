"""The linear structure of a scene in its real modes: what every method of this package starts from.

Coordinates p are mass-normalised: p'' + D p' + diag(omega^2) p = loads; every displacement is a functional of p.
All motion is relative to the base. A prescribed motion is a structure without modes on a moving base.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid, Rom
from vanedamp.coupling.system.cavities import check_known, check_surfaces
from vanedamp.coupling.system.modal_basis import _basis, _ModalBasis, _row, _surfaces, _wall_flexibility
from vanedamp.coupling.system.resonance import _force_amplitude
from vanedamp.files.toml_input import InputError


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
