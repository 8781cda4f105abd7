"""The linear responses that a damped one is compared with: without bodies, and with every body glued to its floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import minimize_scalar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.resonance import receptance_of
from vanedamp.coupling.system.system import System

#: frequencies over a range, and around each resonance in half-power widths: between two of them no maximum hides
_EVEN, _AROUND = 201, np.linspace(-3.0, 3.0, 25)
#: local maxima that are refined; the others are lower
_REFINED = 3


class LinearPeak(NamedTuple):
    """Largest amplitude over a range: its frequency (Hz), height (m), and the half-power width 2 zeta f there (Hz).

    The height is infinite where a resonance without damping lies in the range.
    """

    frequency: float
    amplitude: float
    width: float


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """A linear structure with n modes under its excitation.

    stiffness (n,), damping (n, n), mass (n, n), load (n,) complex and response (n,) in modal coordinates; table:
    complex displacement of a prescribed motion, m.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    mass: np.ndarray
    load: np.ndarray
    response: np.ndarray
    table: complex

    def amplitude(self, frequencies: np.ndarray) -> np.ndarray:
        """Amplitudes of the response (f,), m, at frequencies (f,) in Hz."""
        omega = 2 * np.pi * np.asarray(frequencies, float)[:, None, None]
        dynamic = np.diag(self.stiffness) + 1j * omega * self.damping - omega**2 * self.mass
        loads = np.broadcast_to(self.load[:, None], (len(omega), len(self.load), 1))
        return np.abs(np.linalg.solve(dynamic, loads)[:, :, 0] @ self.response + self.table)

    def peak(self, low: float, high: float) -> LinearPeak:
        """The largest amplitude from low to high, Hz, to round-off; at one of the two where no resonance is higher."""
        natural, widths = self._resonances()
        inside = (natural >= low) & (natural <= high)
        for frequency in natural[inside & (widths == 0.0)]:
            return LinearPeak(float(frequency), math.inf, 0.0)
        near = (natural[:, None] + widths[:, None] * _AROUND).ravel()
        grid = np.unique(np.concatenate([np.linspace(low, high, _EVEN), np.clip(near, low, high)]))
        heights = self.amplitude(grid)
        padded = np.concatenate([[-1.0], heights, [-1.0]])
        tops = np.flatnonzero((heights >= padded[:-2]) & (heights >= padded[2:]))
        tops = tops[np.argsort(heights[tops], kind="stable")[::-1][:_REFINED]]
        amplitude, frequency = max(self._refined(grid, heights, int(top)) for top in tops)
        width = float(widths[np.argmin(np.abs(natural - frequency))]) if len(natural) else 0.0
        return LinearPeak(frequency, amplitude, width)

    def _refined(self, grid: np.ndarray, heights: np.ndarray, top: int) -> tuple[float, float]:
        """Height and frequency of the maximum around a point of the grid; that point where it is an edge's."""
        found = float(heights[top]), float(grid[top])
        if 0 < top < len(grid) - 1:
            refined = minimize_scalar(
                lambda frequency: -float(self.amplitude(np.array([frequency]))[0]),
                bounds=(grid[top - 1], grid[top + 1]), method="bounded", options={"xatol": 1e-9 * grid[top]},
            )  # fmt: skip
            found = max(found, (-float(refined.fun), float(refined.x)))
        return found

    def _resonances(self) -> tuple[np.ndarray, np.ndarray]:
        """Natural frequencies and half-power widths (n,), Hz."""
        squares, shapes = eigh(np.diag(self.stiffness), self.mass) if len(self.load) else (self.load.real, self.mass)
        widths = np.einsum("ik,ij,jk->k", shapes, self.damping, shapes) / (2 * np.pi)
        return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), widths


def linear_responses(scene: Scene) -> tuple[LinearResponse, LinearResponse]:
    """Without bodies, and with every body glued to its cavity's floor. Raises InputError."""
    system = assemble(scene)
    modes, bodies = system.of_structure, system.of_bodies
    glued_load = modes.load + system.floor.T @ bodies.load
    free, glued = (
        LinearResponse(modes.stiffness, modes.damping, mass, load, modes.response, system.table)
        for mass, load in ((np.diag(modes.mass), modes.load), (glued_mass(system), glued_load))
    )
    return free, glued


def glued_mass(system: System) -> np.ndarray:
    """Modal mass matrix (n, n) of the structure with every body glued to its floor."""
    mass: np.ndarray = np.diag(system.of_structure.mass) + (system.floor.T * system.of_bodies.mass) @ system.floor
    return mass


def receptance(scene: Scene, frequencies: np.ndarray, fixed: bool = False) -> np.ndarray:
    """Complex displacement of the response per newton at `excitation.at`, m/N, shape (f,).

    Without bodies, or (`fixed`) with every body glued to its cavity's floor.
    """
    system = assemble(scene)
    modes, mass = system.of_structure, glued_mass(system) if fixed else np.eye(system.modes)
    return receptance_of(modes.stiffness, modes.damping, mass, modes.response, 2 * np.pi * np.asarray(frequencies))
