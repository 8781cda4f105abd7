"""The model hierarchy of one structure: the error of each model, and the smallest within a tolerance.

Forced responses. A Galerkin model leaves the residual R = W - Z T q_r, Z = K + i omega C - omega^2 M, and its
receptance the error R^T Z^-1 R: the residual, weighed once more with the response it would cause. The basis has the low
modes, so Z^-1 on residuals is their quasi-static response and its inertia; and K^-1 R lies in the next block of
quasi-static modes (block Krylov, Craig and Hale 1988). So the error is estimated by the residual's response in the
basis with two more such blocks, which is the difference of the two models' receptances. The blocks come from the
factors at hand, for as many solutions as the interface has coordinates each.

Contact. Bodies act on the structure by pulses, so an error of the pulse at the excitation frequency
(rom.contact_pulse) is an error of the force that changes the response.

Needs numpy and reduced models only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from vanedamp.files.errors import VanedampError
from vanedamp.rom.contact_pulse import WallContact, pulse, share_above
from vanedamp.rom.dense_modes import spectrum
from vanedamp.rom.reduced import NORMAL, ROTATION, ReducedModel
from vanedamp.rom.truncation import massless, with_attachment_modes

#: error of the rigid model from which the sentence says why
_NOT_RIGID = 0.5
_WITHOUT_RESIDUAL: dict[str, Any] = {
    "residual_flexibility": None, "residual_recovery": None, "output_residual": None,
}  # fmt: skip

#: receptances (f, k, k), m/N, at the interface of a model by frequencies, Hz: of the model, or of one that is held
Receptance = Callable[[ReducedModel, "Sequence[float] | np.ndarray"], np.ndarray]


class LadderError(VanedampError):
    """No model meets the tolerance, or the tolerance is out of range; the message names the remedy."""


@dataclass(frozen=True)
class Rung:
    """A model of the hierarchy with its estimated errors, relative: of the receptance, of the pulses of collisions.

    above: fraction of a collision's energy that modes beyond the model would take, which is not necessarily an error;
    attached: whether the model has residual attachment modes (ReducedModel.attached).
    """

    modes: int
    size: int
    receptance: float
    collision: float
    above: float = 0.0
    attached: bool = False

    @property
    def error(self) -> float:
        """Sum of the errors of receptance and collision."""
        return self.receptance + self.collision


@dataclass(frozen=True)
class Choice:
    """The smallest model within a tolerance, and why.

    rigid    error of the rigid model (the first mode with every interface coordinate moving as the response)
    ladder   the models of the hierarchy
    sentence for people
    """

    chosen: Rung
    tolerance: float
    rigid: float
    ladder: tuple[Rung, ...]
    sentence: str
    met: bool = True

    def to_json(self) -> dict[str, Any]:
        """Return plain data: `estimate` of the results."""
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
    receptance: Receptance = ReducedModel.receptance,
) -> np.ndarray:
    """Return the estimated relative error (f,) of a model's receptance matrix (Frobenius norm).

    richer: the same model with at least two blocks of quasi-static coordinates more. labels: the interface coordinates
    that count (default: all); forces: those at which forces act (default: the same). Rotations count as the
    displacements that they are at the radius of gyration of their patch.
    """
    return _errors(receptance(model, frequencies_hz), richer, frequencies_hz, labels, forces, receptance)


def worst_rungs(ladders: Sequence[Sequence[Rung]]) -> list[Rung]:
    """Return the largest errors of several hierarchies by number of modes, for the numbers that all of them have."""
    by_modes = [{rung.modes: rung for rung in ladder} for ladder in ladders]
    common = [modes for modes in by_modes[0] if all(modes in ladder for ladder in by_modes)]
    fields = [zip(*(astuple(ladder[modes]) for ladder in by_modes), strict=True) for modes in common]
    return [Rung(*(max(values) for values in columns)) for columns in fields]


def rigid_errors(
    richer: ReducedModel,
    frequencies_hz: Sequence[float] | np.ndarray,
    at: str,
    labels: Sequence[str] | None = None,
    forces: Sequence[str] | None = None,
) -> np.ndarray:
    """Return the same (f,) of the rigid model: the first natural mode, in which every coordinate moves as `at`.

    Only rotations, and transverse motions next to motions along a cavity, stand still.
    """
    first = richer.projected(
        linalg.eigh(richer.stiffness, richer.mass, subset_by_index=[0, 0])[1],
        fixed_interface_modes=0, free_modes=1, blocks=(), **_WITHOUT_RESIDUAL,
    )  # fmt: skip
    companions = {label + suffix for label in richer.interface for suffix in (NORMAL, ROTATION)}
    moves = (richer.lengths == 1.0) & [label not in companions for label in richer.interface]
    rigid = np.outer(moves, moves) * first.frf(frequencies_hz, at, at)[:, None, None]
    return _errors(rigid, richer, frequencies_hz, labels, forces)


def _errors(
    receptance: np.ndarray, richer: ReducedModel, frequencies_hz: Sequence[float] | np.ndarray,
    labels: Sequence[str] | None, forces: Sequence[str] | None, of: Receptance = ReducedModel.receptance,
) -> np.ndarray:  # fmt: skip
    """Return the relative errors (f,) of receptances (f, k, k) against a richer model's."""
    rows = [richer.interface.index(label) for label in labels or richer.interface]
    columns = [richer.interface.index(label) for label in forces or labels or richer.interface]
    lengths = np.outer(richer.lengths[rows], richer.lengths[columns])
    better = of(richer, frequencies_hz)[:, rows][:, :, columns]
    errors = lengths * (receptance[:, rows][:, :, columns] - better)
    return np.linalg.norm(errors, axis=(1, 2)) / np.linalg.norm(lengths * better, axis=(1, 2))


def natural_ladder(
    richer: ReducedModel,
    frequencies_hz: np.ndarray,
    labels: Sequence[str] | None = None,
    forces: Sequence[str] | None = None,
    collisions: Callable[[ReducedModel], Sequence[WallContact]] = lambda model: (),
    attached: bool = False,
    others: Sequence[Receptance] = (),
) -> list[Rung]:
    """Return the errors of models of 1, 2, 3, ... natural modes of a model against the whole, which is the last.

    collisions: the contacts, which may depend on the model, always in the same order; where a model
    has none but others do, contact has no meaning on it, and it is left out. attached: with attachment modes. others:
    receptances whose errors count as well.
    """
    squares, shapes = spectrum(richer.mass, richer.stiffness)
    rungs, pulses = [], []
    for model in _natural_models(richer, attached):
        modes = model.free_modes
        plain = model if attached else replace(model, **_WITHOUT_RESIDUAL)
        compared = (ReducedModel.receptance, *others)
        errors = [frf_errors(plain, richer, frequencies_hz, labels, forces, of) for of in compared]
        receptance = float(np.max(errors))
        met = collisions(model)
        pulses.append(_pulses(model, met, float(frequencies_hz.max())))
        above = [share_above(squares, richer.row(item.label) @ shapes, modes, item) for item in met]
        rungs.append(Rung(modes, model.size, receptance, 0.0, max(above, default=0.0), attached and modes < model.size))
    if not any(pulses):
        return rungs
    finest = np.array([transforms for transforms in pulses if transforms][-1])
    return [
        replace(rung, collision=float(np.abs(np.array(transforms) / finest - 1.0).max()))
        for rung, transforms in zip(rungs, pulses, strict=True)
        if transforms
    ]


def _natural_models(richer: ReducedModel, attached: bool) -> Iterator[ReducedModel]:
    for modes in range(max(1, richer.rigid_modes), richer.size):
        model = with_attachment_modes(richer, modes) if attached else massless(richer, modes)
        if model.size < richer.size:
            yield model
    yield massless(richer, richer.size)


def _pulses(model: ReducedModel, collisions: Sequence[WallContact], frequency_hz: float) -> list[complex]:
    squares, shapes = spectrum(model.mass, model.stiffness)
    return [pulse(squares, model.row(item.label) @ shapes, item, frequency_hz).transform for item in collisions]


def choose(ladder: Sequence[Rung], tolerance: float, rigid: float) -> Choice:
    """Return the smallest model from which on the error stays within the tolerance, or else the best one."""
    if not 0.0 < tolerance < 1.0:
        raise LadderError(f"tolerance: expected a relative error between 0 and 1, not {tolerance}")
    errors = np.array([rung.error for rung in ladder])
    late = np.maximum.accumulate(errors[::-1])[::-1]  # a small error by accident, with larger ones after it: ignored
    within = np.flatnonzero(late <= tolerance)
    chosen = ladder[int(within[0])] if within.size else ladder[int(np.argmin(errors))]
    what = "mode" if chosen.modes == 1 else "modes"
    if chosen.attached:
        extra = chosen.size - chosen.modes
        what += f" and {extra} attachment mode{'s' * (extra > 1)}"
    sentence = f"{chosen.modes} {what}: estimated error {_percent(chosen.error)}, rigid model {_percent(rigid)}"
    if rigid > _NOT_RIGID:
        sentence += " (its coordinates move alike, in one mode; here they do not, or higher modes answer as strongly)"
    elif rigid <= chosen.receptance:
        sentence += " (one natural mode answers forces as well here; more are for higher frequencies and for impacts)"
    if not within.size:
        sentence += f"; none within the tolerance of {_percent(tolerance)}, keep more modes"
    return Choice(chosen, tolerance, rigid, tuple(ladder), sentence, bool(within.size))


def frequency_grid(model: ReducedModel, low_hz: float, high_hz: float, points: int = 17) -> np.ndarray:
    """Return frequencies over a range, the damped resonances in it, and the edges of all half-power bands."""
    natural, shapes = model.natural_frequencies_hz, model.natural[1]
    losses = np.einsum("ij,ik,kj->j", shapes, model.damping, shapes)
    within = (natural >= low_hz) & (natural <= high_hz)
    width = model.damping_ratio or 1e-3
    # a mode without damping has no receptance at its own frequency
    near = np.concatenate(
        [natural[within] * (1.0 - width), natural[within & (losses > 0.0)], natural[within] * (1.0 + width)]
    )
    return np.unique(np.concatenate([np.linspace(low_hz, high_hz, points), near]))


def _percent(value: float) -> str:
    return f"{100.0 * value:.0f} %" if value > 1.0 else f"{100.0 * value:.2g} %"
