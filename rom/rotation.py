"""Reduction of a rotating structure: its stiffness on one basis that holds from standstill to a maximum speed.

The basis joins Craig-Bampton bases at several speeds, each from one factorisation. The constraint modes at
standstill move the interface; at other speeds these modes, and the fixed-interface and quasi-static modes there,
differ by motions that leave the interface at rest. A basis of these differences, orthogonal to the modes at standstill
in strain energy, is added to the constraint modes: every smaller model (rom.truncation) keeps it. The stiffness is
almost linear in the squared speed, so that a few speeds are enough, spaced evenly in its square.

The error between the speeds of the basis is estimated halfway (in the square), by the gain of the model from
the basis of that speed, which is exact there but for the modes cut off at every speed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import column_signs, orthogonal, orthonormal, symmetric_part
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.rom.bases import craig_bampton
from vanedamp.rom.bases.craig_bampton import Basis
from vanedamp.rom.bases.projection import Factorize, ReductionError, superlu
from vanedamp.rom.checks import ReducedModelError
from vanedamp.rom.error_estimate import frequency_grid, frf_errors
from vanedamp.rom.interface import Interface
from vanedamp.rom.reduced import ReducedModel

if TYPE_CHECKING:
    from vanedamp.modal.rotating import RotatingMatrices

# fraction of a field's strain energy that the modes at standstill must not have; the error of a squared frequency by it
_OWN_SHARE = 1e-10
# relative error of natural frequencies between the speeds of the basis
_FREQUENCY = 1e-5
# speeds of the basis, standstill and the maximum among them
_MOST_SPEEDS = 6


@dataclass(frozen=True, eq=False)
class SpeedBases:
    """Craig-Bampton bases of a rotating structure by speed (rad/s), each from one factorisation when it is wanted.

    modes           fixed-interface modes of each
    quasi_static    blocks of quasi-static modes of each
    characteristic  characteristic constraint modes of patches of kind "full"
    """

    rotating: RotatingMatrices
    interface: Interface
    modes: int
    factorize: Factorize = superlu
    quasi_static: int = 1
    characteristic: int = 6
    _bases: dict[float, Basis] = field(default_factory=dict)

    def at(self, speed: float) -> Basis:
        """Return the basis at a speed. Raises ReductionError as bases.craig_bampton.reduce does."""
        if speed not in self._bases:
            self._bases[speed] = craig_bampton.basis_of(
                self._matrices(speed), self.interface, self.modes, self.factorize, self.quasi_static,
                self.characteristic,
            )  # fmt: skip
        return self._bases[speed]

    def model_at(self, speed: float) -> ReducedModel:
        """Return the model of one speed only, with all modes and blocks."""
        return craig_bampton.reduced_model(self._matrices(speed), self.interface, self.at(speed), {"speed": speed})

    def model(
        self, speeds: Sequence[float], modes: int, origin: dict[str, Any], keep_recovery: bool = False
    ) -> ReducedModel:
        """Return the model of the joined bases of speeds, standstill first, with so many modes and one block of each.

        It holds up to the last of the speeds. Raises ReductionError if the structure is unstable there.
        """
        standing, interface = self.rotating.standing, self.interface
        joined = self._joined(speeds, modes)
        basis = interface.motions @ joined.fields
        projected = [symmetric_part(basis.T @ (matrix @ basis)) for matrix in self.rotating.by_speed]
        model = replace(
            craig_bampton.reduced_model(standing, interface, joined, origin, keep_recovery),
            centrifugal_stiffness=projected[0],
            higher_stiffness=np.array(projected[1:]) if projected[1:] else None,
            rotation_axis=self.rotating.axis,
            rotation_point=self.rotating.point,
            greatest_speed=speeds[-1],
        )
        try:
            model.at_speed(speeds[-1])
        except ReducedModelError as error:
            raise ReductionError(str(error)) from None
        return model

    def neglected(self, model: ReducedModel, speeds: Sequence[float], modes: int, count: int) -> float:
        """Return the relative error of the lowest frequencies, due to terms neglected between the matrices' speeds.

        model: `model` of the same speeds and modes.
        """
        if self.rotating.neglected is None:
            return 0.0
        shapes = model.at_speed(0.5 * self.rotating.greatest).natural[1][:, :count]
        fields = self.interface.motions @ (self._joined(speeds, modes).fields @ shapes)
        return self.rotating.neglected_error(np.asarray(fields).T)

    def _matrices(self, speed: float) -> SystemMatrices:
        standing = self.rotating.standing
        return replace(standing, stiffness=standing.stiffness + self.rotating.added(speed))

    def _joined(self, speeds: Sequence[float], modes: int) -> Basis:
        """Return the basis at standstill, with the differences of the others from it, after the constraint modes."""
        stiffness, mass, _ = self.interface.restrict(self.rotating.standing)
        count = len(self.interface.labels)
        first = self.at(speeds[0])
        constraint, blocks, fixed = first.constraint, first.blocks[:1], first.fixed[:, :modes]
        bases = [orthonormal(np.hstack([constraint[:, count:], *blocks, fixed]), stiffness)]
        energy = np.einsum("ij,ij->j", constraint[:, :count], stiffness @ constraint[:, :count])
        fields = []
        for speed in speeds[1:]:
            basis = self.at(speed)
            motions = np.hstack([basis.constraint[:, count:], *basis.blocks[:1], basis.fixed[:, :modes]])
            fields.append((basis.constraint - constraint)[:, :count] / np.sqrt(energy))
            fields.append(motions / np.sqrt(np.einsum("ij,ij->j", motions, stiffness @ motions)))
        residual = orthogonal(np.hstack(fields), stiffness, bases)
        shares, vectors = np.linalg.eigh(residual.T @ (stiffness @ residual))
        independent = residual @ (vectors[:, shares > _OWN_SHARE] / np.sqrt(shares[shares > _OWN_SHARE]))
        turned = (
            linalg.eigh(independent.T @ (stiffness @ independent), independent.T @ (mass @ independent))[1]
            if independent.size
            else np.eye(0)
        )
        added = independent @ turned
        return Basis(np.hstack([constraint, added * column_signs(added)]), blocks, fixed)


def reduce_rotating(
    bases: SpeedBases,
    greatest_speed: float,
    modes: int | None = None,
    tolerance: float = 0.01,
    frequencies: Callable[[ReducedModel], np.ndarray] | None = None,
    keep_recovery: bool = False,
) -> ReducedModel:
    """Reduce a rotating structure with one basis from standstill to a maximum speed, rad/s.

    modes        fixed-interface modes kept (default: all of the bases)
    tolerance    relative error of the interface's receptance between the speeds of the basis; natural frequencies in
                 that range have 1e-5
    frequencies  Hz, at which the receptance is compared, of a model at its speed (default: up to 1.5 times its first)
    keep_recovery  keep the basis, to reconstruct full displacements

    Speeds are added to the basis until the estimated error is within the tolerance, or there are six; the estimate
    is `rotation` of the provenance. The structure is stable at the maximum speed. Raises ReductionError.
    """
    if not greatest_speed > 0.0:
        raise ReductionError(f"greatest_speed: expected a speed above 0 rad/s, not {greatest_speed:g}")
    modes = bases.modes if modes is None else modes
    frequencies = frequencies or (lambda model: frequency_grid(model, 0.0, 1.5 * model.natural_frequencies_hz[0]))
    origin: dict[str, Any] = {"basis": "craig-bampton", "modes": modes, "quasi_static": min(1, bases.quasi_static)}
    speeds, errors = [0.0, greatest_speed], {}
    while True:
        model = bases.model(speeds, modes, origin, keep_recovery)
        errors = {
            middle: _errors(model, bases.model(sorted([*speeds, middle]), modes, origin), middle, frequencies)
            for middle in (math.sqrt((low**2 + high**2) / 2) for low, high in itertools.pairwise(speeds))
        }
        worst = max(errors, key=lambda speed: max(errors[speed][0] / _FREQUENCY, errors[speed][1] / tolerance))
        met = errors[worst][0] <= _FREQUENCY and errors[worst][1] <= tolerance
        if met or len(speeds) == _MOST_SPEEDS:
            break
        speeds = sorted([*speeds, worst])
    frequency, receptance = (max(values) for values in zip(*errors.values(), strict=True))
    fastest = model.at_speed(greatest_speed)
    count = max(1, int(np.count_nonzero(fastest.natural_frequencies_hz <= frequencies(fastest)[-1])))
    neglected = bases.neglected(model, speeds, modes, count)
    estimate = {
        "greatest_speed": greatest_speed, "speeds": speeds, "checked": sorted(errors), "frequency": frequency,
        "receptance": receptance, "met": met, "neglected": neglected,
        "sentence": _sentence(speeds, sorted(errors), frequency, receptance, met, neglected),
    }  # fmt: skip
    return replace(model, provenance=dict(model.provenance) | {"rotation": estimate})


def _errors(
    model: ReducedModel, richer: ReducedModel, speed: float, frequencies: Callable[[ReducedModel], np.ndarray]
) -> tuple[float, float]:
    """Return relative errors at a speed against a richer model: of natural frequencies in the range, of receptance."""
    model, richer = model.at_speed(speed), richer.at_speed(speed)
    grid = frequencies(richer)
    better = richer.natural_frequencies_hz
    count = max(1, int(np.count_nonzero(better <= grid[-1])))
    natural = np.abs(model.natural_frequencies_hz[:count] / better[:count] - 1.0)
    return float(natural.max()), float(frf_errors(model, richer, grid).max())


def _sentence(
    speeds: Sequence[float], checked: Sequence[float], frequency: float, receptance: float, met: bool,
    neglected: float,
) -> str:  # fmt: skip
    joined, between = (", ".join(f"{speed:.4g}" for speed in values) for values in (speeds, checked))
    sentence = (
        f"basis of the speeds {joined} rad/s: estimated error at {between} rad/s {100 * frequency:.1g} % of natural "
        f"frequencies, {100 * receptance:.1g} % of the receptance"
    )
    if not met:
        sentence += "; beyond the tolerance, lower the greatest speed or keep more modes"
    if not neglected:
        return sentence
    return (
        f"{sentence}; {100 * neglected:.1g} % of natural frequencies for the shape between standstill and "
        f"{speeds[-1]:.4g} rad/s"
    )
