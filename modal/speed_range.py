"""Modes of a rotating structure at any speed of a range, from full solutions at a few speeds.

The modes at those speeds, joined, are a Ritz basis for all others (Balmes 1996, Mech. Syst. Signal Process. 10): a
dense problem of some dozen coordinates per speed instead of a sparse one. Frequencies are second-order in the error of
the shapes, and the error is estimated from the residual with the full matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from vanedamp.modal.algebra import added_by_speed, hermitian_part, orthogonal, orthonormal, speed_weights
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.modal.gyroscopic import GyroscopicModes, dense_modes, gyroscopic_modes
from vanedamp.modal.kept_solutions import Arrays, Keep, not_kept
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.rotating import RotatingMatrices

# part of a shape of unit length missing in the basis, above which it is added
_LACKING = 1e-10
# relative round-off of an eigenvalue, by which it is complex or differs from an equal one
_REAL = 1e-9
# least distance of a mode from the highest square solved for, relative to the latter
_NEAREST = 1e-3


class SpeedModes(NamedTuple):
    """Modes at one speed (rad/s), lowest first, in the coordinates of a Ritz basis of r fields.

    frequencies  (m,) rad/s
    shapes       (r, m) of unit length in the norm of the mass; complex with gyroscopic coupling
    """

    speed: float
    frequencies: np.ndarray
    shapes: np.ndarray


class SmallMatrices(NamedTuple):
    """Matrices of a rotating structure in r fields; complex ones are Hermitian, and `coupling` skew-Hermitian.

    stiffness  (r, r) each: K0, K1, H2, H3, ... of modal.rotating
    mass       (r, r)
    coupling   G; None: without it
    greatest   rad/s: W_g
    """

    stiffness: tuple[np.ndarray, ...]
    mass: np.ndarray
    coupling: np.ndarray | None
    greatest: float

    def stiffness_at(self, speed: float) -> np.ndarray:
        """Return the stiffness (r, r) at a speed, rad/s."""
        return hermitian_part(self.stiffness[0] + added_by_speed(speed, self.greatest, self.stiffness[1:]))

    def within(self, fields: np.ndarray) -> SmallMatrices:
        """Return the matrices in fewer fields (r, s), complex."""

        def of(matrix: np.ndarray) -> np.ndarray:
            return np.asarray(fields.conj().T @ matrix @ fields)

        coupling = None if self.coupling is None else of(self.coupling)
        return SmallMatrices(tuple(map(of, self.stiffness)), of(self.mass), coupling, self.greatest)


class SpeedRange:
    """A Ritz basis for the modes over a range of speeds; a context manager, which holds a factorisation.

    rotating    the structure, held against every rigid motion
    low, high   ends of the range, rad/s, where the first full solutions are made
    count       modes of interest: the lowest at every speed
    gyroscopic  whether they have the gyroscopic coupling
    keep        of full solutions

    solved      rad/s, speeds with full solutions so far
    basis       (n, r) fields over the free DOFs, mass-orthonormal
    small       the matrices in the basis

    Raises modal.rotating.UnstableError for a structure that is unstable at the maximum speed, and SolverError.
    """

    def __init__(
        self, rotating: RotatingMatrices, low: float, high: float, count: int, gyroscopic: bool, keep: Keep = not_kept
    ) -> None:
        standing, self.rotating, self.gyroscopic = rotating.standing, rotating, gyroscopic
        self._free = standing.free
        # further modes, so that falling ones are computed before they are among the lowest
        spare = max(3, count // 2)
        self.count = min(count + spare, self._free.size)
        self._solved_count = min(count + 2 * spare, self._free.size)
        named = [standing.stiffness, *rotating.by_speed, standing.mass]
        named += [rotating.gyroscopic] if gyroscopic else []
        self._operators = [standing.of_free(matrix) for matrix in named]
        self._mass = self._operators[1 + len(rotating.by_speed)]
        self._keep = keep
        self.basis = np.empty((self._free.size, 0))
        self._forces = [np.empty((self._free.size, 0)) for _ in self._operators]
        self._compliant = [forces.copy() for forces in self._forces]
        self.solved: list[float] = []
        self._highest: list[float] = []
        if low > 0.0:
            rotating.at(0.0)  # it is stable there as well, where `meetings` begins
        ends = {speed: self._solve(speed) for speed in (high, low)}  # the one that may be unstable first
        self._middle = float(np.sqrt(0.5 * (low**2 + high**2)))
        self._factor = factorize(standing.of_free(standing.stiffness + rotating.added(self._middle)))
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
        modes = self._modes.get(speed)
        if modes is None:
            modes = self._modes[speed] = self._ritz(speed)
        return modes

    def slopes(self, modes: SpeedModes) -> np.ndarray:
        """Return (m,) d omega / d speed of modes, those at standstill a little above it, where they differ from zero.

        From x^H (dK/dW + i omega G) x dW = x^H (2 omega M - i W G) x d omega.
        """
        speed = max(modes.speed, 1e-9 * max(self.solved))
        weights = speed_weights(speed, self.small.greatest, len(self.small.stiffness) - 1)
        forms = [_form(matrix, modes.shapes).real for matrix in self.small.stiffness[1:]]
        change = sum(2.0 * (power + 1) / speed * weights[power] * form for power, form in enumerate(forms))
        if self.gyroscopic:
            change = change + modes.frequencies * self._coupling(modes)
        return np.asarray(change / self._inertia(modes, speed))

    def neglected_error(self) -> float:
        """Return the largest relative error of the frequencies, due to terms neglected between the matrices' speeds."""
        rotating, shapes = self.rotating, np.zeros((self.count, self.rotating.standing.size))
        if rotating.neglected is None:
            return 0.0
        vectors = linalg.eigh(self.small.stiffness_at(0.5 * rotating.greatest), subset_by_index=[0, self.count - 1])[1]
        shapes[:, self._free] = (self.basis @ vectors).T
        return rotating.neglected_error(shapes)

    def meetings(self, order: float) -> list[tuple[int, float]]:
        """Return the modes and speeds, rad/s, at which a frequency equals an engine order's: `meetings`."""
        return meetings(self.small, order)

    def errors(self, speed: float) -> np.ndarray:
        """Return the estimated relative errors (m,) of the frequencies at a speed.

        The error of an eigenvalue is r^T (K - lambda M)^-1 r over the part that the basis lacks. It is bounded by
        the residual r in the norm of the inverse of the stiffness in mid-range, times the largest ratios of that
        stiffness to K, in the basis, and of K to K - lambda M: the missing part lies above the highest modes solved
        for at the neighbours. Rayleigh quotients of a stiffness that is linear in the squared speed lie above the line
        between these, others above it by the least ratio, in the basis, of K to the line between the stiffnesses of the
        neighbours. So no mode below that is missed, either.
        """
        modes = self.modes(speed)
        if self.basis.shape[1] == self._free.size:
            return np.zeros(self.count)
        omega, shapes = modes.frequencies, modes.shapes
        weights = speed_weights(speed, self.small.greatest, len(self.small.stiffness) - 1)
        terms = [shapes, *(weight * shapes for weight in weights), -(omega**2) * shapes]
        if self.gyroscopic:
            terms.append(1j * speed * omega * shapes)
        joined = np.vstack(terms)
        residual = np.abs(np.einsum("im,im->m", joined.conj(), self._gram @ joined))
        middle, here = (self.small.stiffness_at(at) for at in (self._middle, speed))
        residual /= linalg.eigh(here, middle, eigvals_only=True, subset_by_index=[0, 0])
        beyond = self._beyond(speed, here)
        ratio = beyond / np.maximum(beyond - omega**2, _NEAREST * beyond)
        return np.asarray(residual * ratio / (self._inertia(modes, speed) * omega))

    def _beyond(self, speed: float, here: np.ndarray) -> float:
        """Return a lower bound of squared frequencies that the basis lacks; here: the small stiffness at the speed."""
        order = np.argsort(self.solved)
        squares, highest = np.square(self.solved)[order], np.array(self._highest)[order]
        beyond = float(np.interp(speed**2, squares, highest))
        right = int(np.searchsorted(squares, speed**2))
        if len(self.small.stiffness) < 3 or not 0 < right < len(squares):
            return beyond
        low, high = squares[right - 1 : right + 1]
        ahead = (speed**2 - low) / (high - low)
        line = (1.0 - ahead) * self.small.stiffness_at(np.sqrt(low)) + ahead * self.small.stiffness_at(np.sqrt(high))
        return beyond * min(1.0, float(linalg.eigh(here, line, eigvals_only=True, subset_by_index=[0, 0])[0]))

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
        mass, bases = self._mass, [self.basis]
        residual = orthogonal(shapes[:, self._free].T, mass, bases)
        lacking = np.einsum("ij,ij->j", residual, mass @ residual) > _LACKING**2
        fields = orthonormal(residual[:, lacking], mass, bases)
        if not fields.shape[1]:
            return
        self.basis = np.hstack([self.basis, fields])
        for index, operator in enumerate(self._operators):
            forces = operator @ fields
            self._forces[index] = np.hstack([self._forces[index], forces])
            self._compliant[index] = np.hstack([self._compliant[index], self._factor.solve(forces)])
        projected = [self.basis.T @ forces for forces in self._forces]
        powers = 1 + len(self.rotating.by_speed)
        coupling = projected[-1] if self.gyroscopic else None
        self.small = SmallMatrices(tuple(projected[:powers]), projected[powers], coupling, self.rotating.greatest)
        self._gram = np.hstack(self._forces).T @ np.hstack(self._compliant)
        self._modes: dict[float, SpeedModes] = {}

    def _ritz(self, speed: float) -> SpeedModes:
        frequencies, vectors = ritz_modes(self.small, speed)
        return SpeedModes(speed, frequencies[: self.count], vectors[:, : self.count])

    def _coupling(self, modes: SpeedModes) -> np.ndarray:
        assert self.small.coupling is not None
        return np.asarray((1j * _form(self.small.coupling, modes.shapes)).real)

    def _inertia(self, modes: SpeedModes, speed: float) -> np.ndarray:
        """Return x^H (2 omega M - i W G) x of modes of unit length."""
        doubled = 2.0 * modes.frequencies
        return doubled - speed * self._coupling(modes) if self.gyroscopic else doubled


def _form(matrix: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return x^H A x (m,) of shapes (r, m)."""
    return np.asarray(np.einsum("im,im->m", shapes.conj(), matrix @ shapes))


def ritz_modes(small: SmallMatrices, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (rad/s) and vectors of all modes at a speed, within a mass-orthonormal basis."""
    stiffness = small.stiffness_at(speed)
    if small.coupling is not None:
        return dense_modes(stiffness, speed * small.coupling)
    values, vectors = linalg.eigh(stiffness)
    return np.sqrt(values), vectors


def meetings(small: SmallMatrices, order: float) -> list[tuple[int, float]]:
    """Return the modes, lowest first from 0, and speeds, rad/s, at which a frequency is an engine order's, k W.

    (K0 + s (K1 + i k G - k^2 M) + s^2 K2 + ...) x = 0 is polynomial in the squared speed s. Where it is linear, its
    eigenvalues turn negative one after the other, each once: the i-th speed belongs to the i-th lowest mode. Otherwise
    1 / s is an eigenvalue of the companion matrix of K0^-1 times the others (Tisseur and Meerbergen 2001, SIAM Rev.
    43), and the mode is counted at its speed; speeds beyond the greatest are left out.
    """
    inertia = order**2 * small.mass - small.stiffness[1]
    if small.coupling is not None:
        inertia = inertia - 1j * order * small.coupling
    if len(small.stiffness) == 2:
        values = linalg.eigh(hermitian_part(inertia), hermitian_part(small.stiffness[0]), eigvals_only=True)
        return list(enumerate((1.0 / np.sqrt(values[values > 0.0][::-1])).tolist()))
    size, scale = len(inertia), small.greatest**2
    root = linalg.solve_triangular(
        linalg.cholesky(hermitian_part(small.stiffness[0]), lower=True), np.eye(size), lower=True
    )
    rows = [root @ term @ root.conj().T for term in (scale * inertia, *(-matrix for matrix in small.stiffness[2:]))]
    companion = np.vstack([np.hstack(rows), np.eye(size * (len(rows) - 1), size * len(rows))])
    inverses = linalg.eigvals(companion)
    real = (np.abs(inverses.imag) <= _REAL * np.abs(inverses)) & (inverses.real > 1.0 - _REAL)
    met: list[tuple[int, float]] = []
    for speed in np.sqrt(scale / np.sort(inverses[real].real)[::-1]).tolist():
        lower = np.count_nonzero(ritz_modes(small, speed)[0] < order * speed * (1.0 - _REAL))
        equal = sum(earlier >= speed * (1.0 - _REAL) for _, earlier in met)
        met.append((int(lower) + equal, speed))
    return met
