"""Waveforms: signals over a period, named in the table [excitation.waveform] of a scene (ours are in waveforms/).

A waveform is the time signal of one period, w(omega t), where a plain excitation has sin(omega t): frequency, level
(force, base acceleration) and place stay the excitation's. So a new excitation is one class, which need not know the
structure, and code that reads a level stays as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from vanedamp.files.toml_input import InputError

#: samples per period from which the Fourier series of a waveform is taken, and its terms
_SAMPLES, _TERMS = 4096, 32


class Waveform:
    """Base of the waveforms: a frozen dataclass whose `shape` names it in the scene, its fields the other keys.

    A class answers one of two questions. `shares`, if the signal is a finite sum of sines: such a sum is compiled to
    exponentials, and every method takes it. Otherwise `values`, at the angles of a method's time steps: only methods
    that take such steps can know this signal, and the others refuse it. A jump of it is resolved to a step.
    """

    #: the value of `shape` in the scene
    shape: str
    #: whether the signal has a duration of its own, which is the period then
    timed: ClassVar[bool] = False

    @property
    def duration(self) -> float:
        """Duration of a timed signal, s."""
        raise NotImplementedError(f"{type(self).__qualname__} has no duration")

    @property
    def least_steps(self) -> int:
        """Fewest steps a period that know the signal from its values."""
        return 0

    @property
    def shares(self) -> Mapping[int, complex] | None:
        """Complex amplitudes c_k by orders k > 0 of the signal sum Im(c_k exp(i k omega t)); None: no finite sum."""
        return None

    def values(self, angle: np.ndarray) -> np.ndarray:
        """Return the signal (k,) at angles omega t (k,) in [0, 2 pi), relative to the level of the excitation."""
        raise NotImplementedError(f"{type(self).__qualname__} has neither shares nor values")

    def harmonics(self) -> dict[int, complex]:
        """Return the shares by order, 1 first, which is there even if it has none. Raises InputError.

        A signal without shares has those of its Fourier series, the mean (order 0) last: they give the first harmonic,
        and the scales of transients and energies. They drive no run.
        """
        if self.shares is None:
            values = self.sampled(2 * np.pi * np.arange(_SAMPLES) / _SAMPLES)
            series = 2j * np.fft.rfft(values)[:_TERMS] / _SAMPLES
            return {order: complex(series[order]) for order in range(1, _TERMS)} | {0: complex(series[0]) / 2}
        shares = {1: 0.0 + 0.0j} | {order: complex(self.shares[order]) for order in sorted(self.shares)}
        for order, share in shares.items():
            if order != int(order) or order < 1 or not np.isfinite(share):
                raise InputError(
                    f"{self._place}: order {order} of its shares has {share}; expected order > 0, a number"
                )
        return shares

    def sampled(self, angle: np.ndarray) -> np.ndarray:
        """Return the values (k,) at angles (k,) in [0, 2 pi). Raises InputError for other than finite numbers."""
        values = np.asarray(self.values(angle), float)
        if values.shape != angle.shape or not np.isfinite(values).all():
            raise InputError(f"{self._place}: its values must be a finite number for each angle")
        return values

    @property
    def _place(self) -> str:
        return f'excitation.waveform: shape "{self.shape}"'
