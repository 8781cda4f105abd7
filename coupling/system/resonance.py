"""The resonance that `resonance_amplitude` speaks of, and the force for it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of, forced_label, interface_row
from vanedamp.files.toml_input import InputError


def excitation_force(scene: Scene) -> float:
    """Return the amplitude of the exciting force, N (resonance_amplitude resolved)."""
    if isinstance(scene.structure, Prescribed):
        return 0.0
    basis = basis_of(scene)
    return force_amplitude(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))


class Resonance(NamedTuple):
    """A resonance without bodies: its mode (from 0), the number of modes, frequency (Hz), displacement of the
    response per newton (m/N) and modal mass there (kg)."""

    mode: int
    modes: int
    frequency: float
    flexibility: float
    mass: float


def chosen_resonance(scene: Scene) -> Resonance:
    """Return the resonance that `resonance_amplitude` means: of the mode that responds most within `resonance_near`.

    Raises InputError for a structure without damping.
    """
    basis = basis_of(scene)
    return _chosen(scene, basis, interface_row(basis, forced_label(scene), "excitation.at"))


def receptance_of(
    stiffness: np.ndarray, damping: np.ndarray, mass: np.ndarray, response: np.ndarray, omega: np.ndarray
) -> np.ndarray:
    dynamic = np.diag(stiffness) + 1j * omega[:, None, None] * damping - omega[:, None, None] ** 2 * mass
    loads = np.broadcast_to(response[:, None], (len(omega), len(response), 1))
    return np.linalg.solve(dynamic, loads)[:, :, 0] @ response


def force_amplitude(scene: Scene, basis: ModalBasis, response: np.ndarray) -> float:
    """Return the amplitude of the exciting force at the functional `response` (n,) of the basis, N."""
    excitation = scene.excitation
    if excitation.resonance_amplitude is None:
        return excitation.force or 0.0
    return excitation.resonance_amplitude / _chosen(scene, basis, response).flexibility


def _chosen(scene: Scene, basis: ModalBasis, response: np.ndarray) -> Resonance:
    if np.any(np.diag(basis.damping) <= 0):
        raise InputError(
            "excitation.resonance_amplitude: an undamped resonance has no amplitude; give damping or force"
        )
    # each mode at the frequency of the range that is nearest to its own
    low, high = (2 * np.pi * frequency for frequency in scene.resonance_range)
    omega = np.clip(np.sqrt(basis.stiffness), low, high)
    dynamic = basis.stiffness - omega**2 + 1j * omega * np.diag(basis.damping)
    mode = int(np.argmax(response**2 / np.abs(dynamic)))
    frequency, flexibility = _resonance(basis.stiffness.tobytes(), basis.damping.tobytes(), response.tobytes(), mode)
    return Resonance(mode, len(response), frequency, flexibility, float(1 / response[mode] ** 2))


@lru_cache(maxsize=64)
def _resonance(stiffness_: bytes, damping_: bytes, response_: bytes, mode: int) -> tuple[float, float]:
    """Return frequency (Hz) and height (m/N) of a mode's resonance: once for all frequencies of a sweep."""
    stiffness, response = np.frombuffer(stiffness_), np.frombuffer(response_)
    damping = np.frombuffer(damping_).reshape(len(stiffness), -1)
    resonance = np.sqrt(stiffness[mode])

    def negative(omega: float) -> float:
        return -float(abs(receptance_of(stiffness, damping, np.eye(len(response)), response, np.array([omega]))[0]))

    width = min(1.5 * damping[mode, mode] / resonance, 0.5)
    bounds = (resonance * (1 - width), resonance * (1 + width))
    found = minimize_scalar(negative, bounds=bounds, method="bounded", options={"xatol": 1e-9 * resonance})
    return float(found.x) / (2 * np.pi), -float(found.fun)
