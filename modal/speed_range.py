"""Modes of a rotating structure at any speed of a range, from full solutions at a few speeds.

The modes at those speeds, joined, are a Ritz basis for all others (Balmes 1996, Mech. Syst. Signal Process. 10): a
dense problem of some dozen coordinates a speed in place of a sparse one. Frequencies are second-order in the error of
the shapes, and the error is estimated from the residual with the full matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.algebra import hermitian_part, orthogonal, orthonormal, symmetric_part
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.modal.gyroscopic import GyroscopicModes, dense_modes, gyroscopic_modes
from vanedamp.modal.kept_solutions import Arrays, Keep, not_kept
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.rotating import RotatingMatrices

# of the unit length of a shape: missing part of it for which the basis gains a field
_LACKING = 1e-10
# of the highest square that was solved for: the least distance of a mode from it
_NEAREST = 1e-3


class SpeedModes(NamedTuple):
    """Modes at one speed (rad/s), lowest first, in the coordinates of a Ritz basis of r fields.

    frequencies  (m,) rad/s
    shapes       (r, m) of unit length in the norm of the mass; complex with gyroscopic coupling
    """

    speed: float
    frequencies: np.ndarray
    shapes: np.ndarray


class SpeedRange:
    """A Ritz basis for the modes over a range of speeds; a context manager, which holds a factorisation.

    rotating    the structure, held against every rigid motion
    low, high   ends of the range, rad/s, where the first full solutions are made
    count       modes of interest: the lowest at every speed
    gyroscopic  whether they have the gyroscopic coupling
    keep        of full solutions

    solved      rad/s, speeds with full solutions so far
    basis       (n, r) fields over the free DOFs, mass-orthonormal
    small       K0, K1, M and, with gyroscopic coupling, G in the basis

    Raises modal.rotating.UnstableError for a structure that is unstable at the maximum speed, and SolverError.
    """

    def __init__(
        self, rotating: RotatingMatrices, low: float, high: float, count: int, gyroscopic: bool, keep: Keep = not_kept
    ) -> None:
        standing, self.rotating, self.gyroscopic = rotating.standing, rotating, gyroscopic
        self._free = standing.free
        # modes beyond the last of interest, so that those that come down are known before they are among the lowest
        spare = max(3, count // 2)
        self.count = min(count + spare, self._free.size)
        self._solved_count = min(count + 2 * spare, self._free.size)
        named = [standing.stiffness, rotating.centrifugal_stiffness, standing.mass]
        named += [rotating.gyroscopic] if gyroscopic else []
        self._operators = [standing.of_free(matrix) for matrix in named]
        self._keep = keep
        self.basis = np.empty((self._free.size, 0))
        self._forces = [np.empty((self._free.size, 0)) for _ in self._operators]
        self._compliant = [forces.copy() for forces in self._forces]
        self.solved: list[float] = []
        self._highest: list[float] = []
        if low > 0.0:
            rotating.at(0.0)  # it is stable there as well, where `meetings` begins
        ends = {speed: self._solve(speed) for speed in (high, low)}  # the one that may be unstable first
        stiffness, centrifugal, _ = self._operators[:3]
        self._middle = 0.5 * (low**2 + high**2)
        self._factor = factorize(sparse.csr_array(stiffness + self._middle * centrifugal))
        for speed, modes in ends.items():
            self._join(speed, modes)

    def __enter__(self) -> SpeedRange:
        return self

    def __exit__(self, *_: object) -> None:
        self._factor.destroy()

    @property
    def whole(self) -> bool:
        """Whether the modes are all that the structure has."""
        return self.count == self._free.size

    def add(self, speed: float) -> None:
        """Solve the full structure at a speed and join its modes to the basis."""
        self._join(speed, self._solve(speed))

    def modes(self, speed: float) -> SpeedModes:
        """Return the modes at a speed."""
        known = self._known.get(speed)
        if known is None:
            known = self._known[speed] = self._ritz(speed)
        return known

    def slopes(self, modes: SpeedModes) -> np.ndarray:
        """Return (m,) d omega / d speed of modes, those at standstill a little above it, where they differ from zero.

        From x^H (2 W K1 + i omega G) x dW = x^H (2 omega M - i W G) x d omega.
        """
        speed = max(modes.speed, 1e-9 * max(self.solved))
        change = 2.0 * speed * self._form(1, modes).real
        if self.gyroscopic:
            change = change + modes.frequencies * self._coupling(modes)
        return np.asarray(change / self._inertia(modes, speed))

    def meetings(self, order: float) -> np.ndarray:
        """Return the speeds, rad/s, at which a frequency equals an engine order's: `meetings`."""
        return meetings(self.small, order)

    def errors(self, speed: float) -> np.ndarray:
        """Return the estimated relative errors (m,) of the frequencies at a speed.

        The error of an eigenvalue is r^T (K - lambda M)^-1 r over the part that the basis lacks. It is bounded by
        the residual r in the norm of the inverse of the stiffness in mid-range, times the largest ratios of that
        stiffness to K, in the basis, and of K to K - lambda M: the missing part lies above the highest modes solved
        for at the neighbours and, its Rayleigh quotients being linear in the squared speed, above the line between
        these. So no mode below that line is missed, either.
        """
        modes = self.modes(speed)
        if self.basis.shape[1] == self._free.size:
            return np.zeros(self.count)
        omega, shapes = modes.frequencies, modes.shapes
        parts = [shapes, speed**2 * shapes, -(omega**2) * shapes]
        if self.gyroscopic:
            parts.append(1j * speed * omega * shapes)
        joined = np.vstack(parts)
        residual = np.abs(np.einsum("im,im->m", joined.conj(), self._gram @ joined))
        middle, here = (self._stiffness(squared) for squared in (self._middle, speed**2))
        residual /= linalg.eigh(here, middle, eigvals_only=True, subset_by_index=[0, 0])
        solved = np.argsort(self.solved)
        beyond = np.interp(speed**2, np.square(self.solved)[solved], np.array(self._highest)[solved])
        ratio = beyond / np.maximum(beyond - omega**2, _NEAREST * beyond)
        return np.asarray(residual * ratio / (self._inertia(modes, speed) * omega))

    def _solve(self, speed: float) -> Arrays:
        """Return frequencies (Hz) and shapes of the modes of the full structure at a speed."""

        def solved() -> Arrays:
            modes: Modes | GyroscopicModes
            if self.gyroscopic:
                modes = gyroscopic_modes(self.rotating, speed, self._solved_count)
            else:
                modes = solve_modes(self.rotating.at(speed), self._solved_count)
            return {"frequency": modes.frequencies_hz, "shape": modes.shapes}

        return self._keep(solved)

    def _join(self, speed: float, modes: Arrays) -> None:
        self.solved.append(speed)
        self._highest.append(float(2.0 * np.pi * modes["frequency"][-1]) ** 2)
        shapes = modes["shape"]
        shapes = np.vstack([shapes.real, shapes.imag]) if self.gyroscopic else shapes
        mass, known = self._operators[2], [self.basis]
        rest = orthogonal(shapes[:, self._free].T, mass, known)
        lacking = np.einsum("ij,ij->j", rest, mass @ rest) > _LACKING**2
        fields = orthonormal(rest[:, lacking], mass, known)
        if not fields.shape[1]:
            return
        self.basis = np.hstack([self.basis, fields])
        for place, operator in enumerate(self._operators):
            forces = operator @ fields
            self._forces[place] = np.hstack([self._forces[place], forces])
            self._compliant[place] = np.hstack([self._compliant[place], self._factor.solve(forces)])
        self.small = [self.basis.T @ forces for forces in self._forces]
        self._gram = np.hstack(self._forces).T @ np.hstack(self._compliant)
        self._known: dict[float, SpeedModes] = {}

    def _ritz(self, speed: float) -> SpeedModes:
        frequencies, vectors = ritz_modes(self.small, speed)
        return SpeedModes(speed, frequencies[: self.count], vectors[:, : self.count])

    def _stiffness(self, squared_speed: float) -> np.ndarray:
        return symmetric_part(self.small[0] + squared_speed * self.small[1])

    def _form(self, place: int, modes: SpeedModes) -> np.ndarray:
        shapes = modes.shapes
        return np.einsum("im,im->m", shapes.conj(), self.small[place] @ shapes)

    def _coupling(self, modes: SpeedModes) -> np.ndarray:
        return np.asarray((1j * self._form(3, modes)).real)

    def _inertia(self, modes: SpeedModes, speed: float) -> np.ndarray:
        """Return x^H (2 omega M - i W G) x of modes of unit length."""
        doubled = 2.0 * modes.frequencies
        return doubled - speed * self._coupling(modes) if self.gyroscopic else doubled


def ritz_modes(small: Sequence[np.ndarray], speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (rad/s) and vectors of all modes at a speed, within a mass-orthonormal basis.

    small: K0, K1, M and, with gyroscopic coupling, G in the basis; Hermitian, and G skew-Hermitian.
    """
    stiffness = hermitian_part(small[0] + speed**2 * small[1])
    if len(small) > 3:
        return dense_modes(stiffness, speed * small[3])
    values, vectors = linalg.eigh(stiffness)
    return np.sqrt(values), vectors


def meetings(small: Sequence[np.ndarray], order: float) -> np.ndarray:
    """Return the speeds, rad/s, at which a frequency equals an engine order's, omega = order * W, ascending.

    small: as in `ritz_modes`. (K0 + W^2 (K1 + i order G - order^2 M)) x = 0 is linear in the squared speed. Its
    eigenvalues turn negative one after the other, each once: the i-th speed belongs to the i-th lowest mode.
    """
    inertia = order**2 * small[2] - small[1]
    if len(small) > 3:
        inertia = inertia - 1j * order * small[3]
    values = linalg.eigh(hermitian_part(inertia), hermitian_part(small[0]), eigvals_only=True)
    return np.asarray(1.0 / np.sqrt(values[values > 0.0][::-1]))
