"""Modes of a rotating structure at any speed of a range, from full solutions at a few speeds.

The modes at those speeds, joined, are a Ritz basis for all others (Balmes 1996, Mech. Syst. Signal Process. 10): a
dense problem of some dozen coordinates a speed in place of a sparse one. Frequencies are second-order in the error of
the shapes, and the error is estimated from the residual with the full matrices.
"""

from __future__ import annotations

from types import TracebackType
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.algebra import orthogonal, orthonormal, symmetric_part
from vanedamp.modal.eigen import Modes, factorize, solve_modes
from vanedamp.modal.rotating import RotatingMatrices

# shares of the unit length of a shape: what the basis lacks of it for a field more, and momenta that are round-off
_LACKING, _NO_MOMENTUM = 1e-10, 1e-8


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

    rotating    the structure; its stiffness must be positive (semi-)definite up to the greatest speed
    low, high   ends of the range, rad/s, where the first full solutions are made
    count       modes of interest: the lowest at every speed
    gyroscopic  whether they have the gyroscopic coupling

    Raises modal.rotating.UnstableError for a structure that is unstable at the greatest speed, and SolverError.
    """

    def __init__(self, rotating: RotatingMatrices, low: float, high: float, count: int, gyroscopic: bool) -> None:
        standing, self.rotating, self.gyroscopic = rotating.standing, rotating, gyroscopic
        self._free = standing.free
        # modes beyond the last of interest, so that those that come down are known before they are among the lowest
        spare = max(3, count // 2)
        self.count = min(count + spare, self._free.size)
        self._solved_count = min(count + 2 * spare, self._free.size)
        named = [standing.stiffness, rotating.centrifugal_stiffness, standing.mass]
        named += [rotating.gyroscopic] if gyroscopic else []
        self._operators = [sparse.csr_array(matrix[self._free][:, self._free]) for matrix in named]
        self._basis = np.empty((self._free.size, 0))
        self._forces = [np.empty((self._free.size, 0)) for _ in self._operators]
        self._compliant = [forces.copy() for forces in self._forces]
        self.solved: list[float] = []
        first = self._solve(high)  # the greatest speed first: it is the one that may be unstable
        stiffness, centrifugal, mass = self._operators[:3]
        # a structure with free motions has a regular matrix, too
        straining = first.angular_frequencies[first.frequencies_hz > 0.0]
        self._shift = float(straining[0] ** 2) if straining.size else 1.0
        self._middle = 0.5 * (low**2 + high**2)
        self._factor = factorize(sparse.csr_array(stiffness + self._middle * centrifugal + self._shift * mass))
        self._join(high, first)
        self.add(low)

    def __enter__(self) -> SpeedRange:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._factor.destroy()

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
        inertia = self._inertia(modes, speed)
        return np.divide(change, inertia, out=np.zeros_like(change), where=inertia > 0.0)

    def errors(self, speed: float) -> np.ndarray:
        """Return the estimated relative errors (m,) of the frequencies at a speed.

        The error of an eigenvalue is r^T (K - lambda M)^-1 r over the modes that the basis lacks. It is bounded by the
        residual r in the norm of the inverse of A = K + shift M at the middle of the range, times the largest ratios of
        that to A at the speed, in the basis, and of A to K - lambda M, at the next Ritz value.
        """
        modes = self.modes(speed)
        if self._basis.shape[1] == self._free.size:
            return np.zeros(self.count)
        omega, shapes = modes.frequencies, modes.shapes
        parts = [shapes, speed**2 * shapes, -(omega**2) * shapes]
        if self.gyroscopic:
            parts.append(1j * speed * omega * shapes)
        joined = np.vstack(parts)
        residual = np.abs(np.einsum("im,im->m", joined.conj(), self._gram @ joined))
        middle, here = (self._stiffness(squared) + self._shift * np.eye(len(shapes)) for squared in (self._middle, speed**2))
        residual /= linalg.eigh(here, middle, eigvals_only=True, subset_by_index=[0, 0])
        beyond = self._ceilings.get(speed)
        ratio = 1.0 if beyond is None else (beyond + self._shift) / np.maximum(beyond - omega**2, 1e-3 * beyond)
        scale = np.maximum(omega, np.sqrt(self._shift))
        return np.asarray(residual * ratio / (self._inertia(modes, speed) * scale))

    def _solve(self, speed: float) -> Modes:
        return solve_modes(self.rotating.at(speed), self._solved_count)

    def _join(self, speed: float, modes: Modes) -> None:
        self.solved.append(speed)
        mass, known = self._operators[2], [self._basis]
        rest = orthogonal(modes.shapes[:, self._free].T, mass, known)
        lacking = np.einsum("ij,ij->j", rest, mass @ rest) > _LACKING**2
        fields = orthonormal(rest[:, lacking], mass, known)
        if not fields.shape[1]:
            return
        self._basis = np.hstack([self._basis, fields])
        for place, operator in enumerate(self._operators):
            forces = operator @ fields
            self._forces[place] = np.hstack([self._forces[place], forces])
            self._compliant[place] = np.hstack([self._compliant[place], self._factor.solve(forces)])
        self._small = [self._basis.T @ forces for forces in self._forces]
        self._gram = np.hstack(self._forces).T @ np.hstack(self._compliant)
        self._known: dict[float, SpeedModes] = {}
        self._ceilings: dict[float, float] = {}

    def _ritz(self, speed: float) -> SpeedModes:
        values, vectors = linalg.eigh(self._stiffness(speed**2))
        frequencies = np.sqrt(np.maximum(values, 0.0))
        if self.gyroscopic:
            frequencies, vectors = self._turning(speed, frequencies, vectors)
        if len(frequencies) > self._solved_count:
            self._ceilings[speed] = float(frequencies[self._solved_count] ** 2)
        return SpeedModes(speed, frequencies[: self.count], vectors[:, : self.count])

    def _stiffness(self, squared_speed: float) -> np.ndarray:
        return symmetric_part(self._small[0] + squared_speed * self._small[1])

    def _turning(self, speed: float, still: np.ndarray, modes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return frequencies and complex shapes with the gyroscopic coupling, from the modes without it.

        omega (s, p) = [[0, S], [S, i W G]] (s, p) with S the root of the stiffness and p = omega x: a Hermitian
        problem, whose frequencies are real by construction.
        """
        coupling = modes.T @ self._small[3] @ modes
        zero, root = np.zeros_like(coupling), np.diag(still)
        pencil = np.block([[zero, root], [root, 0.5j * speed * (coupling - coupling.T)]])
        values, vectors = linalg.eigh(pencil)
        size = len(still)  # the others are their negatives
        strains, momenta = vectors[:size, size:], vectors[size:, size:]
        shapes = np.where(np.linalg.norm(momenta, axis=0) > _NO_MOMENTUM, momenta, strains)
        return np.maximum(values[size:], 0.0), modes @ (shapes / np.linalg.norm(shapes, axis=0))

    def _form(self, place: int, modes: SpeedModes) -> np.ndarray:
        shapes = modes.shapes
        return np.einsum("im,im->m", shapes.conj(), self._small[place] @ shapes)

    def _coupling(self, modes: SpeedModes) -> np.ndarray:
        return np.asarray((1j * self._form(3, modes)).real)

    def _inertia(self, modes: SpeedModes, speed: float) -> np.ndarray:
        """Return x^H (2 omega M - i W G) x of modes of unit length."""
        doubled = 2.0 * modes.frequencies
        return doubled - speed * self._coupling(modes) if self.gyroscopic else doubled
