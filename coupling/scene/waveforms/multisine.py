"""Periodic noise: sines at neighbouring orders, with a given spectrum and crest factor.

The crest factor, the largest value over the root mean square, depends on the phases. From random ones the way leads to
aligned phases, which have the largest, or down: to the phases of Schroeder (IEEE Trans. Inf. Theory 16, 1970), and from
there to those that make the norm L_p least for growing p (Guillaume et al., IEEE Trans. Instrum. Meas. 40, 1991).
Somewhere on the way the signal has the crest factor that was asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.sines import peaks
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Whole

#: half of the exponents p of the norms, in turn, and the iterations of each
_HALF_NORMS, _ITERATIONS = (2, 4, 8, 16, 32, 64, 128), 200
#: least samples per period and order for a norm
_SAMPLES = 8

Order = Annotated[Whole, Field(gt=0, le=10_000)]


@dataclass(frozen=True, config=STRICT)
class Multisine(Waveform):
    """Periodic noise: sines at the orders from the lowest to the highest, multiples of the frequency."""

    orders: tuple[Order, Order]
    """lowest and highest order of the sines, multiples of the frequency"""
    spectrum: Literal["flat", "pink"] | tuple[NonNegative, ...] = "flat"
    """"flat": equal amplitudes; "pink": in proportion to 1/sqrt(order); or a list of relative amplitudes, one for each
    order [-]"""
    crest_factor: Positive | None = None
    """largest value over root mean square (default: that of random phases) [-]"""
    seed: Annotated[Whole, Field(ge=0)] = 0
    """seed of the random phases"""
    level: Literal["rms", "peak"] = "rms"
    """what the level of the excitation is: "rms", the signal's root mean square; "peak", its largest value"""
    shape: Literal["multisine"] = "multisine"
    """"multisine": periodic noise"""

    def __post_init__(self) -> None:
        lowest, highest = self.orders
        if lowest > highest:
            raise ValueError(f"orders: expected [lowest, highest], not [{lowest}, {highest}]")
        if isinstance(self.spectrum, tuple):
            if len(self.spectrum) != highest - lowest + 1:
                raise ValueError(
                    f"spectrum: expected {highest - lowest + 1} amplitudes, one for each order from {lowest} to "
                    f"{highest}, not {len(self.spectrum)}"
                )
            if not any(self.spectrum):
                raise ValueError("spectrum: expected an amplitude above 0")
        _ = self.shares  # a crest factor may be out of reach

    @property
    def shares(self) -> Mapping[int, complex]:
        """Complex amplitudes by orders."""
        return _shares(self.orders, self.spectrum, self.crest_factor, self.seed, self.level)


@lru_cache(maxsize=16)
def _shares(
    orders: tuple[int, int], spectrum: str | tuple[float, ...], crest_factor: float | None, seed: int, level: str
) -> dict[int, complex]:
    """Return the components of a multi-sine, as its fields say. Raises ValueError for a crest factor out of reach."""
    order = np.arange(orders[0], orders[1] + 1)
    size = np.asarray(spectrum) if isinstance(spectrum, tuple) else {"flat": order**0.0, "pink": order**-0.5}[spectrum]
    order, size = order[size > 0], size[size > 0]
    size = size * np.sqrt(2) / np.linalg.norm(size)  # of root mean square 1
    phase = _phases(order, size, crest_factor, 2 * np.pi * np.random.default_rng(seed).random(len(order)))
    scale = 1.0 if level == "rms" else _crest(order, size, phase)
    # Im(share exp(i k angle)) is Re(size exp(i phase) exp(i k angle))
    shares = 1j * size * np.exp(1j * phase) / scale
    return {int(k): complex(share) for k, share in zip(order, shares, strict=True)}


def _phases(order: np.ndarray, size: np.ndarray, target: float | None, random: np.ndarray) -> np.ndarray:
    """Return phases (e,) with a crest factor, of cosines of amplitudes `size` (e,); random ones if it is None."""
    if target is None:
        return random
    best, least = random, _crest(order, size, random)
    if target >= least:
        most = float(size.sum())
        if target > most:
            raise ValueError(f"crest_factor: {target:g} is out of reach; that of this spectrum is {most:.6g} at most")
        return _between(order, size, random, np.zeros(len(order)), target)
    for phase in _flatter(order, size, random):
        reached = _crest(order, size, phase)
        if reached <= target:
            return _between(order, size, best, phase, target)
        if reached < least:
            best, least = phase, reached
    raise ValueError(f"crest_factor: {target:g} is not reached; the phases found bring it down to {least:.4f}")


def _crest(order: np.ndarray, size: np.ndarray, phase: np.ndarray) -> float:
    """Return the largest value of the signal, whose root mean square is 1."""
    return float(peaks((size * np.exp(1j * phase))[:, None], order)[0])


def _between(order: np.ndarray, size: np.ndarray, one: np.ndarray, other: np.ndarray, target: float) -> np.ndarray:
    """Return phases on the way from one set to another with a crest factor between theirs, or equal to one."""
    from scipy.optimize import brentq

    way = (other - one + np.pi) % (2 * np.pi) - np.pi

    def missed(share: float) -> float:
        return _crest(order, size, one + share * way) - target

    ends = missed(0.0), missed(1.0)
    if ends[0] * ends[1] >= 0.0:  # one of the ends is it, but for round-off
        return one if abs(ends[0]) < abs(ends[1]) else one + way
    return np.asarray(one + brentq(missed, 0.0, 1.0, xtol=1e-12) * way)


def _flatter(order: np.ndarray, size: np.ndarray, random: np.ndarray) -> Iterator[np.ndarray]:
    """Yield phases whose crest factors are lower and lower as a rule: Schroeder's, then phases of growing norms."""
    from scipy.optimize import minimize

    power = size**2 / (size**2).sum()
    phase = -2 * np.pi * np.concatenate([[0.0], np.cumsum(np.cumsum(power))[:-1]])
    yield phase
    if _crest(order, size, random) < _crest(order, size, phase):
        phase = random
    count = 1 << int(np.ceil(np.log2(_SAMPLES * order.max())))
    for half in _HALF_NORMS:
        phase = minimize(_norm, phase, (order, size, count, half), "L-BFGS-B", True, options={"maxiter": _ITERATIONS}).x
        yield phase


def _norm(phase: np.ndarray, order: np.ndarray, size: np.ndarray, count: int, half: int) -> tuple[float, np.ndarray]:
    """Return the logarithm of the norm L_p of the signal at `count` angles, p = 2 half, and its derivative (e,)."""
    waves, spectrum = size * np.exp(1j * phase), np.zeros(count // 2 + 1, complex)
    spectrum[order] = waves / 2
    signal = np.fft.irfft(spectrum, count, norm="forward")
    largest = np.abs(signal).max()
    scaled = signal / largest
    total = (scaled ** (2 * half)).sum()
    weight = np.fft.rfft(scaled ** (2 * half - 1))[order].conj() / (total * largest)
    return float(np.log(largest) + np.log(total / count) / (2 * half)), (1j * waves * weight).real.copy()
