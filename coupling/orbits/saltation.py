"""Derivatives of hybrid motion: linear flows between events, and saltation matrices across them.

The derivative of a passage is the product, in the order of time, of the propagators of its segments and the saltation
matrices of its events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
Mechanical Systems, 2004, chapter 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True, eq=False)
class LinearFlow:
    """A flow u' = A u + constant + Re sum_h wave_h exp(i frequency_h t) of states (k,).

    A: (k, k) 1/s; constant: (k,); wave: (e, k) complex; frequency: (e,) rad/s.
    """

    A: np.ndarray
    constant: np.ndarray
    wave: np.ndarray
    frequency: np.ndarray

    def rate(self, state: np.ndarray, time: float) -> np.ndarray:
        """Return u' (k,) in a state at a time."""
        turning = np.exp(1j * self.frequency * time) @ self.wave
        rate: np.ndarray = self.A @ state + self.constant + turning.real
        return rate

    def drift(self, time: float) -> np.ndarray:
        """Return the rate (k,) at which u' changes by the time only, the state held."""
        drift: np.ndarray = ((1j * self.frequency * np.exp(1j * self.frequency * time)) @ self.wave).real
        return drift

    def propagate(self, state: np.ndarray, time: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state (k,) after a duration and its derivative (k, k) with respect to the state before."""
        k, turn = len(state), np.exp(1j * self.frequency * time)
        # constant and harmonics are states as well, so large that their columns are no larger than A
        size = max(np.abs(self.constant).max(initial=0.0), np.abs(self.wave).max(initial=0.0))
        size = size / max(np.abs(self.A).max(initial=0.0), 1.0 / max(duration, 1e-300)) or 1.0
        e = len(self.frequency)
        whole = np.zeros((k + 1 + 2 * e, k + 1 + 2 * e))
        whole[:k, :k], whole[:k, k] = self.A, self.constant / size
        whole[:k, k + 1 : k + 1 + e], whole[:k, k + 1 + e :] = self.wave.real.T / size, -self.wave.imag.T / size
        turning = np.diag(self.frequency)
        whole[k + 1 : k + 1 + e, k + 1 + e :], whole[k + 1 + e :, k + 1 : k + 1 + e] = -turning, turning
        power = expm(whole * duration)
        return power[:k] @ np.r_[state, size, size * turn.real, size * turn.imag], power[:k, :k]


def held(rows: np.ndarray) -> np.ndarray:
    """Return the orthogonal projector (k, k) onto the states (k,) where functionals (m, k) vanish, dependent or not."""
    if not len(rows):
        return np.eye(rows.shape[1])
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, right = np.linalg.svd(rows / length, full_matrices=False)
    basis = right[sizes > 1e-9]
    return np.eye(rows.shape[1]) - basis.T @ basis
