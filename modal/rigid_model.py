"""From one mode to the rigid model, and from a fatigue strength to its excitation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.modal.records.modes import Modes

FATIGUE_SHARE = 0.7


class CalibrationError(VanedampError):
    """A mode or a strength that gives no rigid model; the message names the quantity and the remedy."""


@dataclass(frozen=True)
class RigidModel:
    """The mode as one mass on a spring, seen at one interface coordinate: m x'' + d x' + c x = force there.

    mass, stiffness, damping  kg, N/m, N s/m
    damping_ratio             of the mode
    at                        label of the interface coordinate
    frequency_hz              of the undamped mode
    base_mass                 kg: load there for an acceleration of the base of 1 m/s^2 against its direction, of either
                              sign; None: not known
    """

    mass: float
    stiffness: float
    damping: float
    damping_ratio: float
    at: str
    frequency_hz: float
    base_mass: float | None = None

    def resonance_force(self, amplitude: float) -> float:
        """Force amplitude, N, that brings the resonance to a displacement amplitude, m: d w_1 X = 2 zeta c X."""
        return 2.0 * self.damping_ratio * self.stiffness * amplitude


def rigid_model(
    modes: Modes, mode: int, functional: np.ndarray, at: str, damping_ratio: float, inertia: np.ndarray | None = None
) -> RigidModel:
    """Return the rigid model of a mode at the interface coordinate u = functional^T q, with functional (N,).

    inertia: (N,) M r of the translation r of every node with the base. m = phi^T M phi / (w^T phi)^2, c = w_1^2 m,
    d = 2 zeta w_1 m, base mass phi^T M r / w^T phi. Raises CalibrationError when the mode does not move
    the interface coordinate, or has no frequency.
    """
    shape, frequency = modes.shapes[mode], modes.angular_frequencies[mode]
    displacement = float(functional @ shape)
    if not _moves(displacement, functional, shape):
        described = f"mode {mode} ({modes.frequencies_hz[mode]:.5g} Hz)"
        raise CalibrationError(f"at: {described} does not move {at!r}; name another interface coordinate")
    if frequency <= 0.0:
        raise CalibrationError(f"mode: mode {mode} is a rigid motion without stiffness; hold the structure")
    mass = 1.0 / displacement**2
    return RigidModel(
        mass=mass,
        stiffness=float(frequency**2) * mass,
        damping=2.0 * damping_ratio * float(frequency) * mass,
        damping_ratio=damping_ratio,
        at=at,
        frequency_hz=float(modes.frequencies_hz[mode]),
        base_mass=None if inertia is None else float(inertia @ shape) / displacement,
    )


@dataclass(frozen=True)
class ModalCavityMotion:
    """How one mode moves a cavity, as a rigid model of that mode includes it.

    along          displacement along the cavity, for unit displacement at the rigid model's interface coordinate
    normal_motion  displacement across, for unit displacement along
    rotation       rad/m, the same of the rotation
    """

    along: float
    normal_motion: float
    rotation: float


def cavity_motion(shape: np.ndarray, motion: np.ndarray, functional: np.ndarray) -> ModalCavityMotion | None:
    """Return how a mode's shape (N,) moves a cavity; None where it does not move along it.

    motion: functionals (N, 3) of the motion along, across and of the rotation, or (N, 2) without a rotation;
    functional: (N,) of the rigid model's interface coordinate, which the mode moves.
    """
    along = motion_along(shape, motion[:, 0], functional)
    if along is None:
        return None
    normal_motion, *rotation = (motion[:, 1:].T @ shape / (motion[:, 0] @ shape)).tolist()
    return ModalCavityMotion(along, normal_motion, *(rotation or [0.0]))


def motion_along(shape: np.ndarray, along: np.ndarray, functional: np.ndarray) -> float | None:
    """Return the motion of a functional (N,) in a mode, for unit displacement of the other; None where it rests."""
    displacement = float(along @ shape)
    return displacement / float(functional @ shape) if _moves(displacement, along, shape) else None


def _moves(displacement: float, functional: np.ndarray, shape: np.ndarray) -> bool:
    """Whether a patch moves: its displacement is then of the order of the shape's."""
    return abs(displacement) >= 1e-9 * np.abs(functional).sum() * np.abs(shape).max() and displacement != 0.0


def fatigue_amplitude(stress_per_amplitude: float, fatigue_strength: float, share: float = FATIGUE_SHARE) -> float:
    """Return the displacement amplitude, m, of an interface coordinate at a fraction of the fatigue strength.

    stress_per_amplitude  Pa/m, largest von Mises stress of the mode over its displacement of that coordinate. Sharp
                          corners are singular points of elasticity: their stress grows with mesh refinement
    fatigue_strength      Pa
    """
    for name, value in (
        ("stress_per_amplitude", stress_per_amplitude), ("fatigue_strength", fatigue_strength), ("share", share)
    ):  # fmt: skip
        if not (math.isfinite(value) and value > 0.0):
            raise CalibrationError(f"{name}: expected a positive number, not {value}")
    return share * fatigue_strength / stress_per_amplitude
