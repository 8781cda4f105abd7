"""Frequency responses: as measured, from modes, and the poles (frequency, damping) that a measured one reveals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.modal.rational_fit import PoleFit, Rational

#: powers of i w that a response has over the displacement
QUANTITIES = {"receptance": 0, "mobility": 1, "accelerance": 2}
#: and their units per force
UNITS = {"receptance": "m/N", "mobility": "m/(N s)", "accelerance": "m/(N s^2)"}
# fraction of a damping ratio: a standard deviation above it means that the response does not determine the pole
_UNCERTAIN = 0.5
# fraction of the line spacing: with a narrower half-power bandwidth, less than two lines show half of a mode's peak
_NARROW = 0.5
# root mean square of the error over the response's: with a larger error, the fit does not describe it. Noise
# of a tenth of the peak over forty bandwidths leaves 0.41
_MISFIT = 0.5
# fraction of its misfit that a response read as decibels has at most where it is one in decibels; of linear responses,
# with noise up to a tenth of the peak, it is 0.9 and more
_DECIBELS = 0.5
# highest probability that noise explains a mode
_CHANCE = 1e-4


class FrfError(VanedampError):
    """A frequency response, or a band of it, that gives no poles; the message names the argument and the remedy."""


@dataclass(frozen=True, eq=False)
class Frf:
    """Frequency responses over one frequency axis.

    frequencies_hz  (n,) ascending, positive
    values          (k, n) complex, of a displacement, velocity or acceleration per force (or per any one excitation)
    quantity        "receptance", "mobility" or "accelerance"
    labels          (k,) names of the responses
    source          where they come from and how the file was read, in words
    """

    frequencies_hz: np.ndarray
    values: np.ndarray
    quantity: str = "receptance"
    labels: tuple[str, ...] = ()
    source: str = ""

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

    def peak_hz(self, low: float = 0.0, high: float = np.inf) -> float:
        """Return the frequency, Hz, of the largest value between two frequencies; nan where there is no line."""
        inside = (self.frequencies_hz >= low) & (self.frequencies_hz <= high)
        if not inside.any():
            return float("nan")
        return float(self.frequencies_hz[inside][np.argmax(np.abs(self.values[:, inside]).max(axis=0))])

    def band(self, low: float, high: float) -> Frf:
        """Return the part between two frequencies, Hz. Raises FrfError when it holds fewer than two lines."""
        inside = (self.frequencies_hz >= low) & (self.frequencies_hz <= high)
        if inside.sum() < 2:
            span = f"{self.frequencies_hz[0]:.6g} to {self.frequencies_hz[-1]:.6g} Hz"
            raise FrfError(f"band: {low:.6g} to {high:.6g} Hz holds {inside.sum()} lines; the response covers {span}")
        return Frf(self.frequencies_hz[inside], self.values[:, inside], self.quantity, self.labels, self.source)


@dataclass(frozen=True, eq=False)
class Poles:
    """Poles that a rational fit found, by ascending frequency.

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
        """Return the index of the pole nearest to a frequency."""
        return int(np.argmin(np.abs(self.frequencies_hz - frequency_hz)))


def identify(frf: Frf, count: int = 1) -> Poles:
    """Return natural frequencies and damping ratios of `count` modes in a response's band.

    A rational function with common conjugate poles and real terms for the modes below and above the band is fitted to
    all responses: vector fitting (Gustavsen and Semlyen 1999) finds the poles from anywhere, then least squares over
    the poles only, their residues eliminated (Golub and Pereyra 1973), which is unbiased under noise. Unlike a circle
    fit it separates modes that overlap. Poles stay conjugate, which scipy's AAA (1.15 or newer) does not provide.

    A pole is a mode when the band holds its half-power points, its half-power bandwidth 2 zeta f is at least half the
    spacing of the lines around it, its damping ratio is determined to better than half of it, the fit's error is less
    than half of the response, in the band and around the pole, and the fit is better than one with a mode less by more
    than noise would make it: noise passes with a probability below 1e-4 (`Rational.chance`).

    Raises FrfError for too few lines, and for poles that are no modes of the band.
    """
    lines = frf.frequencies_hz.size
    if count < 1 or 2 * lines < 4 * count + 4:
        raise FrfError(f"count: {count} modes need at least {2 * count + 2} frequency lines, there are {lines}")
    if not np.any(frf.values):
        raise FrfError("values: all are zero; a response without motion has no modes")
    if frf.frequencies_hz[0] <= 0.0:
        frf = frf.band(frf.frequencies_hz[1], frf.frequencies_hz[-1])
    s = 2j * np.pi * frf.frequencies_hz
    scale, size = np.abs(s).max(), np.abs(frf.values).max()
    problem = Rational(s / scale, frf.values / size, QUANTITIES[frf.quantity])
    fit = problem.fit(problem.relocated(count))
    order = np.argsort(np.abs(fit.poles))
    poles = fit.poles[order]
    fitted, residues = problem.solve(poles)
    result = Poles(
        frequencies_hz=frozen(np.abs(poles) * scale / (2 * np.pi)),
        damping_ratios=frozen(-poles.real / np.abs(poles)),
        deviations=frozen(_deviations(fit, scale)[order]),
        residues=frozen(residues * size * scale, complex),
        misfit=float(np.linalg.norm(fitted - problem.values) / np.linalg.norm(problem.values)),
        fitted=frozen(fitted * size, complex),
    )
    _check(result, frf)
    chance = problem.chance(fit)
    if chance > _CHANCE:
        raise FrfError(
            f"count: {count} poles fit the band {_span(frf)} hardly better than {count - 1}: noise does as well with a "
            f"probability of up to {min(chance, 1.0):.2g}; one of them is no mode of the band; ask for fewer modes"
        )
    _check_misfit(result, frf)
    return result


def is_in_decibels(frf: Frf, poles: Poles) -> bool:
    """Return whether a response with the poles of `identify` fits far better with its magnitudes as decibels."""
    magnitude = np.abs(frf.values)
    linear = 10.0 ** ((magnitude - magnitude.max()) / 20.0) * np.exp(1j * np.angle(frf.values))
    try:
        converted = identify(Frf(frf.frequencies_hz, linear, frf.quantity), len(poles.frequencies_hz))
    except FrfError:
        return False
    return converted.misfit < _DECIBELS * poles.misfit


def _deviations(fit: PoleFit, scale: float) -> np.ndarray:
    """Return standard deviations (m, 2) of Hz and damping ratio, from the Jacobian; infinite where that is singular."""
    jacobian, poles = fit.jacobian, fit.poles
    size = np.linalg.norm(jacobian, axis=0)
    if not np.all(size > 0.0):
        return np.full((poles.size, 2), np.inf)
    _, values, right = np.linalg.svd(jacobian / size, full_matrices=False)
    if values[-1] <= values[0] * len(jacobian) * np.finfo(float).eps:
        return np.full((poles.size, 2), np.inf)
    freedom = max(len(jacobian) - jacobian.shape[1], 1)
    spread = np.sqrt(fit.misfit / freedom) * np.linalg.norm(right.T / values, axis=1) / size
    frequency, decay = spread.reshape(-1, 2).T
    # lightly damped: |s| moves with its imaginary part, the ratio with the logarithm of its real part
    return np.column_stack([frequency * scale / (2 * np.pi), decay * -poles.real / np.abs(poles)])


def _span(frf: Frf) -> str:
    return f"{frf.frequencies_hz[0]:.6g} to {frf.frequencies_hz[-1]:.6g} Hz"


def _check(poles: Poles, frf: Frf) -> None:
    """Reject poles that are no damped modes of the band, or that its lines do not resolve."""
    axis = frf.frequencies_hz
    span = _span(frf)
    for frequency, ratio, (_, deviation) in zip(
        poles.frequencies_hz, poles.damping_ratios, poles.deviations, strict=True
    ):
        pole = f"count: a fitted pole at {frequency:.6g} Hz with the damping ratio {ratio:.3g} +- {deviation:.2g}"
        if not (axis[0] <= frequency <= axis[-1] and ratio < 0.5):
            raise FrfError(f"{pole} is no mode of the band {span}; ask for fewer modes or another band")
        if not (axis[0] <= (1.0 - ratio) * frequency and (1.0 + ratio) * frequency <= axis[-1]):
            raise FrfError(
                f"{pole} is no mode of the band {span}, which does not hold its half-power points, "
                f"{(1.0 - ratio) * frequency:.6g} and {(1.0 + ratio) * frequency:.6g} Hz; widen or move the band"
            )
        after = int(np.clip(np.searchsorted(axis, frequency), 1, axis.size - 1))
        spacing = axis[after] - axis[after - 1]
        if 2.0 * ratio * frequency < _NARROW * spacing:
            raise FrfError(
                f"{pole} is no mode of the band {span} that its lines resolve: half-power bandwidth "
                f"{2.0 * ratio * frequency:.2g} Hz, line spacing {spacing:.3g} Hz; ask for fewer modes or measure "
                "finer lines"
            )
        if not deviation < _UNCERTAIN * ratio:
            raise FrfError(
                f"{pole} is no mode of the band {span} that its lines determine; ask for fewer modes or another band"
            )


def _check_misfit(poles: Poles, frf: Frf) -> None:
    """Reject a fit that misses the response as a whole or around one of its poles."""
    missed = {f"the band {_span(frf)}": poles.misfit}
    for frequency, ratio in zip(poles.frequencies_hz, poles.damping_ratios, strict=True):
        # wide enough for one line at the least bandwidth
        near = np.abs(frf.frequencies_hz - frequency) <= 2.0 * ratio * frequency
        error = np.linalg.norm((poles.fitted - frf.values)[:, near])
        missed[f"the peak at {frequency:.6g} Hz"] = float(error / np.linalg.norm(frf.values[:, near]))
    where, worst = max(missed.items(), key=lambda item: item[1])
    if not worst < _MISFIT:
        raise FrfError(
            f"values: the fit misses the response in {where} by {worst:.0%} of it, at most {_MISFIT:.0%} is taken; "
            "check what the columns are, narrow the band around the peak, or ask for more modes"
        )
