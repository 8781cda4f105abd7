"""The ladder of models of one structure: the error of each, and the smallest that a tolerance needs.

Forced responses. A Galerkin model leaves the residual R = W - Z T q_r, Z = K + i omega C - omega^2 M, and its
receptance the error R^T Z^-1 R: the residual, weighed once more with the response it would cause. The basis has the low
modes, so Z^-1 on residuals is their quasi-static response and its inertia; and K^-1 R lies in the next block of
quasi-static modes (block Krylov, Craig and Hale 1988). So the error is estimated by the residual's response in the
basis with two more such blocks, which is the difference of the two models' receptances. The blocks come from the
factors at hand, for as many solutions as the interface has coordinates each.

Contact. A collision of duration pi / omega_c is a half sine of force. It leaves mode j of the wall the energy
(phi_j p S(omega_j))^2 / 2, p the impulse and S the pulse's spectrum, 1 at low frequency and falling with
(omega_c / omega)^2 above the contact's frequency omega_c = sqrt(k_c (1/m_1 + 1/m_i)). What the modes above the cut
would take, relative to the energy of the approach, is what the smaller model cannot know.

Needs numpy and reduced models alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from rom.reduced import ReducedModel


class LadderError(ValueError):
    """No model meets the tolerance, or the question is not one; the message tells what would help."""


@dataclass(frozen=True)
class Collision:
    """Contacts of a body with walls of the structure.

    labels       interface coordinates of the walls
    mass         kg, of the body
    stiffness    N/m, of the contact
    restitution  1
    """

    labels: tuple[str, ...]
    mass: float
    stiffness: float
    restitution: float


@dataclass(frozen=True)
class Rung:
    """A model of the ladder with its estimated errors: modes, coordinates, of the receptance, of the collisions."""

    modes: int
    size: int
    receptance: float
    collision: float

    @property
    def error(self) -> float:
        """The two together."""
        return self.receptance + self.collision


@dataclass(frozen=True)
class Choice:
    """The smallest model within a tolerance, and why.

    rigid    error of the rigid model (the first mode with every interface coordinate moving as the response)
    ladder   what was compared
    sentence for people
    """

    chosen: Rung
    tolerance: float
    rigid: float
    ladder: tuple[Rung, ...]
    sentence: str
    met: bool = True

    def to_json(self) -> dict[str, Any]:
        """Plain data: `estimate` of the results."""
        return {
            **asdict(self.chosen), "error": self.chosen.error, "tolerance": self.tolerance, "met": self.met,
            "rigid": self.rigid, "sentence": self.sentence, "ladder": [asdict(rung) for rung in self.ladder],
        }  # fmt: skip


def frf_errors(
    model: ReducedModel,
    richer: ReducedModel,
    frequencies_hz: Sequence[float] | np.ndarray,
    labels: Sequence[str] | None = None,
    forces: Sequence[str] | None = None,
) -> np.ndarray:
    """(f,) estimated error of a model's receptance matrix (Frobenius norm), relative.

    richer: the same model with at least two blocks of quasi-static coordinates more. labels: the interface coordinates
    that count (default: all); forces: those at which forces act (default: the same).
    """
    rows = [richer.interface.index(label) for label in labels or richer.interface]
    columns = [richer.interface.index(label) for label in forces or labels or richer.interface]
    better = richer.receptance(frequencies_hz)[:, rows][:, :, columns]
    errors = model.receptance(frequencies_hz)[:, rows][:, :, columns] - better
    return np.linalg.norm(errors, axis=(1, 2)) / np.linalg.norm(better, axis=(1, 2))


def rigid_errors(
    richer: ReducedModel,
    frequencies_hz: Sequence[float] | np.ndarray,
    at: str,
    labels: Sequence[str] | None = None,
    forces: Sequence[str] | None = None,
) -> np.ndarray:
    """(f,) the same of the rigid model: the first natural mode, in which every coordinate moves as `at`."""
    first = richer.projected(
        linalg.eigh(richer.stiffness, richer.mass, subset_by_index=[0, 0])[1],
        fixed_interface_modes=0, free_modes=1, blocks=(),
    )  # fmt: skip
    rigid = replace(
        first, selection=np.tile(first.row(at), (len(first.interface), 1)), residual_flexibility=None,
        residual_recovery=None, output_residual=None,
    )  # fmt: skip
    return frf_errors(rigid, richer, frequencies_hz, labels, forces)


def contact_frequency(model: ReducedModel, label: str, stiffness: float, mass: float) -> float:
    """Hz, of a body of that mass (kg) on a contact (N/m) with a wall that has the mass of the first natural mode."""
    first = float((model.row(label) @ linalg.eigh(model.stiffness, model.mass, subset_by_index=[0, 0])[1])[0] ** 2)
    return math.sqrt(stiffness * (first + 1.0 / mass)) / (2.0 * math.pi)


def pulse_spectrum(ratio: np.ndarray | float) -> np.ndarray:
    """|Fourier transform| of a half sine of unit impulse at ratio = omega / omega_c: cos(pi r / 2) / (1 - r^2)."""
    r = np.asarray(ratio, dtype=float)
    near = np.abs(r - 1.0) < 1e-6
    safe = np.where(near, 0.0, r)
    return np.where(near, math.pi / 4.0, np.abs(np.cos(math.pi * safe / 2.0) / (1.0 - safe**2)))


def collision_share(model: ReducedModel, modes: int, collision: Collision) -> float:
    """Share of a collision's energy that natural modes beyond the first `modes` would take; the worst wall.

    The impulse is that of an isolated collision with restitution at the mass of the first natural mode; the energy,
    that of its approach and of the modes above the first.
    """
    squares, shapes = linalg.eigh(model.stiffness, model.mass)
    omegas = np.sqrt(np.maximum(squares, 0.0))
    worst = 0.0
    for label in collision.labels:
        row = model.row(label) @ shapes
        reduced = 1.0 / (row[0] ** 2 + 1.0 / collision.mass)
        spectrum = pulse_spectrum(omegas / math.sqrt(collision.stiffness / reduced))
        impulse = (1.0 + collision.restitution) * reduced  # of a unit speed of approach
        energy = 0.5 * (row * impulse * spectrum) ** 2
        worst = max(worst, float(energy[modes:].sum() / (0.5 * reduced + energy[1:].sum())))
    return worst


def compliance_error(model: ReducedModel, frequency_hz: float, collision: Collision) -> float:
    """How much of a period a collision's duration is wrong by, when its wall lacks the residual flexibility of a model.

    A flexibility G in series lengthens the contact's half period by G k_c / 2 of itself.
    """
    assert model.residual_flexibility is not None
    worst = 0.0
    for label in collision.labels:
        index = model.interface.index(label)
        lost = 0.5 * collision.stiffness * float(model.residual_flexibility[index, index])
        duration = 0.5 / contact_frequency(model, label, collision.stiffness, collision.mass)
        worst = max(worst, lost * duration * frequency_hz)
    return worst


def natural_ladder(
    richer: ReducedModel,
    frequencies_hz: np.ndarray,
    labels: Sequence[str] | None = None,
    forces: Sequence[str] | None = None,
    collisions: Callable[[ReducedModel], Sequence[Collision]] = lambda model: (),
    residual: bool = False,
) -> list[Rung]:
    """Models of 1, 2, 3, ... natural modes of a model, with the errors of each against the whole.

    collisions: the contacts, which may depend on the model with so many modes. residual: the contacts have the
    flexibility that the modes lack (a massless boundary); otherwise it is lost.
    """
    rungs = []
    for modes in range(_least(richer), richer.size + 1):
        model = richer.massless(modes)
        plain = replace(model, residual_flexibility=None, residual_recovery=None, output_residual=None)
        receptance = float(frf_errors(plain, richer, frequencies_hz, labels, forces).max())
        share = 0.0
        for collision in collisions(model):
            lost = 0.0 if residual else compliance_error(model, float(frequencies_hz.max()), collision)
            share = max(share, collision_share(richer, modes, collision) + lost)
        rungs.append(Rung(modes, modes, receptance, share))
    return rungs


def _least(model: ReducedModel) -> int:
    """The fewest natural modes of a model: one, or its rigid motions."""
    return max(1, model.rigid_modes)


def choose(ladder: Sequence[Rung], tolerance: float, rigid: float) -> Choice:
    """The smallest rung from which on the error stays within the tolerance, or the best one if none does."""
    if not 0.0 < tolerance < 1.0:
        raise LadderError(f"tolerance: expected a relative error between 0 and 1, not {tolerance}")
    errors = np.array([rung.error for rung in ladder])
    late = np.maximum.accumulate(errors[::-1])[::-1]  # a small error by accident, with larger ones after it, is none
    within = np.flatnonzero(late <= tolerance)
    chosen = ladder[int(within[0])] if within.size else ladder[int(np.argmin(errors))]
    what = "mode" if chosen.modes == 1 else "modes"
    sentence = f"{chosen.modes} {what}: estimated error {_percent(chosen.error)}, rigid model {_percent(rigid)}"
    if not within.size:
        sentence += f"; none within the tolerance of {_percent(tolerance)}, keep more modes"
    return Choice(chosen, tolerance, rigid, tuple(ladder), sentence, bool(within.size))


def grid(model: ReducedModel, low_hz: float, high_hz: float, points: int = 17) -> np.ndarray:
    """Frequencies over a range, with the resonances inside and the edges of their half-power band."""
    natural = model.natural_frequencies_hz
    inside = natural[(natural >= low_hz) & (natural <= high_hz)]
    width = model.damping_ratio or 1e-3
    near = np.concatenate([inside * factor for factor in (1.0 - width, 1.0, 1.0 + width)])
    return np.unique(np.concatenate([np.linspace(low_hz, high_hz, points), near]))


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g} %"
