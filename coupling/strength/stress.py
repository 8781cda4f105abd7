"""Amplitudes of stress from its samples: one arithmetic for runs, ramps, ring-downs, orbits and linear curves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.response.spot_stress import SpotStress
from vanedamp.modal.algebra import von_mises

__all__ = ["MEASURES", "PeriodStress", "SpotStress", "period_stress", "scalar_stresses", "signs"]

_TINY = float(np.finfo(float).tiny)
#: of a product of two symmetric tensors by their six components
_TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


class PeriodStress(NamedTuple):
    """Stress within p periods at s spots, Pa: amplitudes (p, s, 8) of MEASURES, and means (p, s, 6)."""

    amplitude: np.ndarray
    mean: np.ndarray


def scalar_stresses(stress: np.ndarray) -> np.ndarray:
    """Return von Mises stress and the largest magnitude of a principal stress (2, ...) of stresses (6, ...), Pa.

    Components in the order of rom.recovery.COMPONENTS; principal stresses from the invariants in closed form (Smith
    1961, Communications of the ACM 4, 168).
    """
    xx, yy, zz, xy, yz, zx = stress
    equivalent, mean = von_mises(stress), (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx)
    radius = equivalent / 3.0
    angle = np.arccos(np.clip(determinant / np.maximum(2.0 * radius**3, _TINY), -1.0, 1.0)) / 3.0
    largest = mean + 2.0 * radius * np.cos(angle)
    smallest = mean + 2.0 * radius * np.cos(angle + 2.0 * np.pi / 3.0)
    return np.stack([equivalent, np.maximum(np.abs(largest), np.abs(smallest))])


def signs(stress: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return 1 or -1 (...) of stresses (6, ...): whether they go with or against a reference (6, ...).

    The sign of the principal stress of largest magnitude, which is usual, is round-off in pure shear.
    """
    return np.where(np.tensordot(_TWICE, stress * reference, 1) >= 0.0, 1.0, -1.0)


def period_stress(stress: np.ndarray, each: int) -> PeriodStress:
    """Return amplitudes and means of stresses (s, 6, p each + 2), Pa: p periods of samples, and one more at each end.

    Amplitudes of the stress about the mean of its period. Von Mises and principal stress count as negative where the
    stress goes against that of the period's largest von Mises stress. The extremes of a period lie on the parabolas
    through its largest and smallest sample and their neighbours.
    """
    places, count = len(stress), (stress.shape[-1] - 2) // each

    def throughout(of_periods: np.ndarray) -> np.ndarray:
        """Return values of periods (..., p) at their samples."""
        ends = [(0, 0)] * (of_periods.ndim - 1)
        return np.pad(np.repeat(of_periods, each, axis=-1), [*ends, (1, 1)], mode="edge")

    mean = stress[..., 1:-1].reshape(places, 6, count, each).mean(axis=-1)
    about = np.moveaxis(stress - throughout(mean), 1, 0)
    scalars = scalar_stresses(about)
    worst = 1 + scalars[0, :, 1:-1].reshape(places, count, each).argmax(axis=-1) + each * np.arange(count)
    sign = signs(about, throughout(np.take_along_axis(about, worst[None], axis=-1)))
    values = np.concatenate([about, sign * scalars])
    amplitude = 0.5 * (tops(values, each) + tops(-values, each))
    return PeriodStress(np.moveaxis(amplitude, (0, 1, 2), (2, 1, 0)), np.moveaxis(mean, -1, 0))


def every_other(stress: np.ndarray) -> np.ndarray:
    """Return stresses (..., n + 2) with half of their n samples, of which there is an even number."""
    half = stress[..., 1:-1:2]
    return np.concatenate([half[..., :1], half, half[..., -1:]], axis=-1)


def tops(values: np.ndarray, each: int) -> np.ndarray:
    """Return the largest value (..., p) of each period of values (..., p each + 2)."""
    inner = values[..., 1:-1].reshape(*values.shape[:-1], -1, each)
    middle = 1 + inner.argmax(axis=-1) + each * np.arange(inner.shape[-2])
    before, top, behind = (np.take_along_axis(values, middle + step, axis=-1) for step in (-1, 0, 1))
    bend = 2.0 * top - before - behind
    # a neighbour below zero is of the other sign: between them the value jumps
    smooth = (top >= before) & (top >= behind) & (before > 0.0) & (behind > 0.0) & (bend > 0.0)
    gain = (behind - before) ** 2 / (8.0 * np.where(smooth, bend, 1.0))
    return np.asarray(top + np.where(smooth, gain, 0.0))
