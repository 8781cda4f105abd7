"""Derivatives of hybrid motion: linear flows between events, and saltation matrices across them.

The derivative of a passage is the product, in the order of time, of the propagators of its segments and the saltation
matrices of its events (Aizerman and Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth
Mechanical Systems, 2004, chapter 7).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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

    @cached_property
    def size(self) -> float:
        """The constant 1 as a state, so large that its column in `generator` is no larger than A."""
        load = max(np.abs(self.constant).max(initial=0.0), np.abs(self.wave).max(initial=0.0))
        return float(load / np.abs(self.A).max(initial=0.0)) or 1.0

    @cached_property
    def generator(self) -> np.ndarray:
        """A (K, K) of the states (u, 1, cosines, sines), the latter times `size`: the flow without its loads."""
        k, e = len(self.constant), len(self.frequency)
        whole = np.zeros((k + 1 + 2 * e, k + 1 + 2 * e))
        loads = np.hstack([self.constant[:, None], self.wave.real.T, -self.wave.imag.T])
        whole[:k, :k], whole[:k, k:] = self.A, loads / self.size
        turning, cosine, sine = np.diag(self.frequency), slice(k + 1, k + 1 + e), slice(k + 1 + e, None)
        whole[cosine, sine], whole[sine, cosine] = -turning, turning
        return whole

    def extended(self, state: np.ndarray, time: float) -> np.ndarray:
        """Return the state (K,) of `generator`."""
        turn = np.exp(1j * self.frequency * time)
        return np.concatenate([state, [self.size], self.size * turn.real, self.size * turn.imag])

    def propagate(self, state: np.ndarray, time: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the state (k,) after a duration and its derivative (k, k) with respect to the state before."""
        k, power = len(state), expm(self.generator * duration)
        return power[:k] @ self.extended(state, time), power[:k, :k]

    def least(
        self, functionals: np.ndarray, state: np.ndarray, time: float, duration: float, step: float
    ) -> tuple[float, int]:
        """Return the smallest minimum within a duration of functionals (m, K) of the extended state, and which it is.

        Minima between points a step apart, at most, are found by their slopes, where these pass through zero more
        than round-off; (inf, -1) without any.
        """
        steps = max(int(np.ceil(duration / step)), 2)
        step = duration / steps
        power, motion = expm(self.generator * step), np.empty((steps + 1, len(self.generator)))
        motion[0] = self.extended(state, time)
        for i in range(steps):
            motion[i + 1] = power @ motion[i]
        slopes = functionals @ self.generator
        value, slope = functionals @ motion.T, slopes @ motion.T
        noise = 1e-9 * np.abs(slopes) @ np.abs(motion).max(axis=0)
        side = np.where(np.abs(slope) > noise[:, None], np.sign(slope), 0.0)
        for i in range(1, steps):
            side[:, i] = np.where(side[:, i] == 0.0, side[:, i - 1], side[:, i])
        which, cell = np.nonzero((side[:, :-1] < 0.0) & (side[:, 1:] > 0.0))
        if not len(which):
            return np.inf, -1
        # where the slope's chord vanishes, for a choice; then Newton's method on the motion itself
        one, other = np.minimum(slope[which, cell], 0.0), slope[which, cell + 1]
        share = one / (one - other)
        best = int(np.argmin(value[which, cell] + 0.5 * one * share * step))
        row, at, low, high = int(which[best]), float(share[best] * step), 0.0, step
        for _ in range(8):
            now = expm(self.generator * at) @ motion[cell[best]]
            tilt, bend = float(slopes[row] @ now), float(slopes[row] @ self.generator @ now)
            low, high = (at, high) if tilt < 0.0 else (low, at)
            move = at - tilt / bend if bend > 0.0 else low
            if abs(move - at) <= 1e-12 * step:
                break
            at = move if low < move < high else 0.5 * (low + high)
        return float(functionals[row] @ now), row


def saltation(
    jump: np.ndarray, before: np.ndarray, after: np.ndarray, gradient: np.ndarray, speed: float
) -> np.ndarray:
    """Return the derivative (k, k) across an event: jump + (after - jump before) gradient^T / speed.

    jump: (k, k), derivative of the state after the event with respect to that before, at a fixed time; before, after:
    (k,) rates of the state on both sides; gradient: (k,) of the event function; speed: its whole rate before the event.
    """
    return kicked(jump, after - jump @ before, gradient, speed)


def kicked(jump: np.ndarray, kick: np.ndarray, gradient: np.ndarray, speed: float) -> np.ndarray:
    """Return the same from the kick (k,) after - jump before, where it is known better than as a difference."""
    return jump + np.multiply.outer(kick / speed, gradient)


def held(rows: np.ndarray) -> np.ndarray:
    """Return the orthogonal projector (k, k) onto the states (k,) where functionals (m, k) vanish, dependent or not."""
    if not len(rows):
        return np.eye(rows.shape[1])
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    _, sizes, right = np.linalg.svd(rows / length, full_matrices=False)
    basis = right[sizes > 1e-9]
    return np.eye(rows.shape[1]) - basis.T @ basis
