"""Frequency responses: as measured, from modes, and the poles (frequency, damping) that a measured one reveals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.optimize import least_squares

from modal.store import frozen

#: powers of i w that a response has over the displacement
QUANTITIES = {"receptance": 0, "mobility": 1, "accelerance": 2}
_RELOCATIONS = 30
# share of a damping ratio: a standard deviation above it means that the response does not determine the pole
_UNCERTAIN = 0.5


class FrfError(ValueError):
    """A frequency response, or a band of it, that gives no poles; the message names what and the remedy."""


@dataclass(frozen=True, eq=False)
class Frf:
    """Frequency responses over one frequency axis.

    frequencies_hz  (n,) ascending, positive
    values          (k, n) complex, of a displacement, velocity or acceleration per force (or per any one excitation)
    quantity        "receptance", "mobility" or "accelerance"
    labels          (k,) names of the responses
    """

    frequencies_hz: np.ndarray
    values: np.ndarray
    quantity: str = "receptance"
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        frequencies = frozen(self.frequencies_hz)
        values = frozen(np.atleast_2d(self.values), complex)
        if frequencies.ndim != 1 or values.shape[1:] != frequencies.shape:
            raise FrfError(f"values: {values.shape} values do not fit {frequencies.shape} frequencies")
        if not (np.all(np.isfinite(frequencies)) and np.all(np.isfinite(values))):
            raise FrfError("values: expected finite frequencies and values")
        if frequencies.size < 2 or frequencies[0] < 0.0 or np.any(np.diff(frequencies) <= 0.0):
            raise FrfError("frequencies_hz: expected at least two, ascending, not negative")
        if self.quantity not in QUANTITIES:
            raise FrfError(f"quantity: expected one of {', '.join(QUANTITIES)}, not {self.quantity!r}")
        labels = tuple(self.labels) or tuple(str(index) for index in range(len(values)))
        if len(labels) != len(values):
            raise FrfError(f"labels: {len(labels)} labels for {len(values)} responses")
        for name, value in (("frequencies_hz", frequencies), ("values", values), ("labels", labels)):
            object.__setattr__(self, name, value)

    def band(self, low: float, high: float) -> Frf:
        """The part between two frequencies, Hz. Raises FrfError when it holds fewer than two lines."""
        inside = (self.frequencies_hz >= low) & (self.frequencies_hz <= high)
        if inside.sum() < 2:
            span = f"{self.frequencies_hz[0]:.6g} to {self.frequencies_hz[-1]:.6g} Hz"
            raise FrfError(f"band: {low:.6g} to {high:.6g} Hz holds {inside.sum()} lines; the response covers {span}")
        return Frf(self.frequencies_hz[inside], self.values[:, inside], self.quantity, self.labels)


@dataclass(frozen=True, eq=False)
class Poles:
    """What a rational fit found, by ascending frequency.

    frequencies_hz  (m,) undamped natural frequencies |s| / 2 pi
    damping_ratios  (m,) -Re s / |s|
    deviations      (m, 2) standard deviations of frequency (Hz) and damping ratio, from the misfit
    residues        (k, m) complex, of the receptance-like response: sum of r/(iw - s) + conj(r)/(iw - conj(s))
    misfit          root mean square of the fit's error, relative to the response's
    fitted          (k, n) the fit at the response's frequencies
    """

    frequencies_hz: np.ndarray
    damping_ratios: np.ndarray
    deviations: np.ndarray
    residues: np.ndarray
    misfit: float
    fitted: np.ndarray

    def nearest(self, frequency_hz: float) -> int:
        """Index of the pole nearest to a frequency."""
        return int(np.argmin(np.abs(self.frequencies_hz - frequency_hz)))


def identify(frf: Frf, count: int = 1) -> Poles:
    """Natural frequencies and damping ratios of `count` modes in a response's band.

    A rational function with common conjugate poles and real terms for the modes below and above the band is fitted to
    all responses: vector fitting (Gustavsen and Semlyen 1999) finds the poles from anywhere, then least squares over
    the poles alone, their residues eliminated (Golub and Pereyra 1973), which is unbiased under noise. Unlike a circle
    fit it separates modes that overlap. Poles stay conjugate, which scipy's AAA (1.15 or newer) does not provide.

    Raises FrfError for too few lines, or poles that are no damped modes of the band or not determined by it.
    """
    lines = frf.frequencies_hz.size
    if count < 1 or 2 * lines < 4 * count + 4:
        raise FrfError(f"count: {count} modes need at least {2 * count + 2} frequency lines, there are {lines}")
    if frf.frequencies_hz[0] <= 0.0:
        frf = frf.band(frf.frequencies_hz[1], frf.frequencies_hz[-1])
    s = 2j * np.pi * frf.frequencies_hz
    scale = np.abs(s).max()
    problem = _Rational(s / scale, frf.values / np.abs(frf.values).max(), QUANTITIES[frf.quantity])
    start = problem.relocated(count)
    found = least_squares(
        lambda p: problem.misfit(p), np.column_stack([start.imag, np.log(-start.real)]).ravel(), x_scale="jac",
        method="trf", xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    poles = _unpacked(found.x)
    order = np.argsort(np.abs(poles))
    fitted, residues = problem.solve(poles[order])
    misfit = float(np.linalg.norm(fitted - problem.values) / np.linalg.norm(problem.values))
    result = Poles(
        frequencies_hz=frozen(np.abs(poles[order]) * scale / (2 * np.pi)),
        damping_ratios=frozen(-poles[order].real / np.abs(poles[order])),
        deviations=frozen(_deviations(found, poles, scale)[order]),
        residues=frozen(residues * np.abs(frf.values).max() * scale, complex),
        misfit=misfit,
        fitted=frozen(fitted * np.abs(frf.values).max(), complex),
    )
    _check(result, frf)
    return result


@dataclass(frozen=True, eq=False)
class _Rational:
    """Scaled fitting problem: values (k, n) at s (n,), the responses' power of s over the displacement."""

    s: np.ndarray
    values: np.ndarray
    power: int

    def basis(self, poles: np.ndarray, terms: bool = True) -> np.ndarray:
        """(n, 2 m + 2) real coefficients' functions: two for every pair of poles, and the modes outside the band."""
        first, second = 1.0 / (self.s[:, None] - poles), 1.0 / (self.s[:, None] - poles.conj())
        columns = [first + second, 1j * (first - second)]
        if not terms:
            return np.concatenate(columns, axis=1)
        # stiffness of the modes above, mass of the modes below
        outside = np.column_stack([np.ones_like(self.s), self.s**-2.0])
        functions: np.ndarray = np.concatenate([*columns, outside], axis=1) * self.s[:, None] ** self.power
        return functions

    def solve(self, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Best fit (k, n) and residues (k, m) for given poles."""
        functions = self.basis(poles)
        coefficients = np.linalg.lstsq(_real(functions), _real(self.values.T), rcond=None)[0]
        count = len(poles)
        return (functions @ coefficients).T, (coefficients[:count] + 1j * coefficients[count : 2 * count]).T

    def misfit(self, parameters: np.ndarray) -> np.ndarray:
        """(2 n k,) real and imaginary parts of the best fit's error."""
        return _real((self.solve(_unpacked(parameters))[0] - self.values).T).ravel()

    def relocated(self, count: int) -> np.ndarray:
        """(count,) poles by vector fitting, from lightly damped ones spread over the band."""
        low, high = np.abs(self.s[0]), np.abs(self.s[-1])
        spread = low + (high - low) * (np.arange(count) + 0.5) / count
        poles = (-0.01 + 1j) * spread
        for _ in range(_RELOCATIONS):
            poles = self._relocate(poles)
        return poles

    def _relocate(self, poles: np.ndarray) -> np.ndarray:
        """Zeros of the denominator that makes the fit linear; flipped into the left half plane."""
        own, common, count = self.basis(poles), self.basis(poles, terms=False), len(poles)
        blocks, targets = [], []
        for values in self.values:
            # what the response's own coefficients cannot fit is left to the common denominator
            rows = _real(np.concatenate([own, -values[:, None] * common], axis=1))
            triangle = linalg.qr(np.column_stack([rows, _real(values[:, None])]), mode="r")[0][: rows.shape[1] + 1]
            width = own.shape[1]
            blocks.append(triangle[width:, width:-1])
            targets.append(triangle[width:, -1])
        weights = np.linalg.lstsq(np.concatenate(blocks), np.concatenate(targets), rcond=None)[0]
        rotation = np.zeros((2 * count, 2 * count))
        for index, pole in enumerate(poles):
            at = [index, count + index]
            rotation[np.ix_(at, at)] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        gains = np.concatenate([2.0 * np.ones(count), np.zeros(count)])
        zeros = np.linalg.eigvals(rotation - np.outer(gains, weights))
        upper = zeros[np.argsort(zeros.imag)][count:]
        frequencies = np.maximum(np.abs(upper.imag), 1e-3 * np.abs(self.s[0]))
        return -np.maximum(np.abs(upper.real), 1e-7 * frequencies) + 1j * frequencies


def _real(values: np.ndarray) -> np.ndarray:
    """Real over imaginary parts."""
    return np.concatenate([values.real, values.imag])


def _unpacked(parameters: np.ndarray) -> np.ndarray:
    frequency, decay = parameters.reshape(-1, 2).T
    return np.asarray(-np.exp(decay) + 1j * frequency)


def _deviations(found: object, poles: np.ndarray, scale: float) -> np.ndarray:
    """(m, 2) standard deviations of Hz and damping ratio, from the Jacobian at the solution."""
    jacobian, residual = found.jac, found.fun  # type: ignore[attr-defined]
    freedom = max(residual.size - jacobian.shape[1], 1)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * (residual @ residual) / freedom
    frequency, decay = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(-1, 2).T
    # lightly damped: |s| moves with its imaginary part, the ratio with the logarithm of its real part
    return np.column_stack([frequency * scale / (2 * np.pi), decay * -poles.real / np.abs(poles)])


def _check(poles: Poles, frf: Frf) -> None:
    low, high = frf.frequencies_hz[0], frf.frequencies_hz[-1]
    for frequency, ratio, (_, deviation) in zip(
        poles.frequencies_hz, poles.damping_ratios, poles.deviations, strict=True
    ):
        if not (low <= frequency <= high and 0.0 < ratio < 0.5 and deviation < _UNCERTAIN * ratio):
            raise FrfError(
                f"count: a fitted pole at {frequency:.6g} Hz with the damping ratio {ratio:.3g} +- {deviation:.2g} is "
                f"no mode of the band {low:.6g} to {high:.6g} Hz; ask for fewer modes or another band"
            )
