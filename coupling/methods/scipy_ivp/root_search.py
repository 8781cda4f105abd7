"""The first root of event functions over one step of an integrator, found with certainty on its interpolant.

Over a step an event function is a polynomial: a linear functional of the interpolant, and the excitation, which a
polynomial of degree 8 follows to round-off. Its Bernstein coefficients enclose it (Farin, Curves and Surfaces for
CAGD): without a negative one there is no root, and with one change of sign there is exactly one. Halving decides the
rest, so that roots that come in pairs are not missed, however close they lie.
"""

from __future__ import annotations

from collections.abc import Callable
from math import comb

import numpy as np
from scipy.optimize import brentq

_DEGREE = 8
#: where the functions are sampled, as fractions of the step
NODES = (1 - np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)) / 2
#: length of intervals that are halved no more, times the step
_SHORTEST = 1e-14
#: round-off of coefficients, times the size of the function in the step
_ROUND_OFF = 1e-14
_TINY = float(np.finfo(float).tiny)


def _from_samples(nodes: np.ndarray) -> np.ndarray:
    """Return the matrix that turns samples at the nodes into Bernstein coefficients."""
    n = len(nodes) - 1
    basis = [[comb(n, k) * x**k * (1 - x) ** (n - k) for k in range(n + 1)] for x in nodes]
    return np.linalg.inv(np.array(basis))


#: of a function, and of its quotient without a zero at x = 0, of one degree less, raised to the same degree
_RAISE = np.eye(_DEGREE + 1, _DEGREE) * (1 - np.arange(_DEGREE + 1) / _DEGREE)[:, None]
_RAISE[1:] += np.diag(np.arange(1, _DEGREE + 1) / _DEGREE)
_WHOLE = _from_samples(NODES).T
_DEFLATED = np.r_[np.zeros((1, _DEGREE + 1)), (_RAISE @ _from_samples(NODES[1:])).T]
_PLACES = np.r_[1.0, NODES[1:]]


def first_root(samples: np.ndarray, order: np.ndarray) -> tuple[float, int] | None:
    """Return the first x in (0, 1] at which one of several functions turns negative, and which; None without.

    samples: (functions, nodes) at NODES; order: (functions,) of the zero at x = 0 that a function leaves upwards; it is
    taken out of the function, so that round-off cannot find it again.
    """
    first = None
    zero = order > 0
    coefficients = np.where(zero[:, None], samples / _PLACES ** order[:, None] @ _DEFLATED, samples @ _WHOLE)
    # one that is not positive there begins with round-off
    near = np.flatnonzero(~(coefficients.min(axis=1) > 0))
    coefficients[zero, 0] = np.maximum(coefficients[zero, 0], _TINY)
    for k in near:
        polynomial = coefficients[k]
        limit = 1.0 if first is None else first[0]
        root = _first(polynomial, 0.0, 1.0, limit, _ROUND_OFF * float(np.abs(polynomial).max()))
        if root is not None and (first is None or root < first[0]):
            first = root, int(k)
    return first


def _first(b: np.ndarray, start: float, end: float, limit: float, noise: float) -> float | None:
    """Return the first root, before `limit`, of the polynomial with Bernstein coefficients b between start and end."""
    if b.min() > 0 or start > limit:
        return None
    if b[0] <= 0:
        return start
    if end - start < _SHORTEST or np.abs(b).max() <= noise:
        return end if b[-1] < 0 else None
    signs = np.sign(b[b != 0])
    if b[-1] < 0 and np.count_nonzero(np.diff(signs)) == 1:
        inside = brentq(_polynomial(b), 0.0, 1.0, xtol=1e-16, rtol=1e-15)
        return start + float(inside) * (end - start)
    left, right = _halves(b)
    middle = (start + end) / 2
    root = _first(left, start, middle, limit, noise)
    return _first(right, middle, end, limit, noise) if root is None else root


def _polynomial(b: np.ndarray) -> Callable[[float], float]:
    n = len(b) - 1
    weighted = [comb(n, k) * float(value) for k, value in enumerate(b)]

    def value(x: float) -> float:
        return sum(part * x**k * (1 - x) ** (n - k) for k, part in enumerate(weighted))

    return value


def _halves(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of both halves (de Casteljau)."""
    left, right, row = np.empty_like(b), np.empty_like(b), b
    for k in range(len(b)):
        left[k], right[-1 - k] = row[0], row[-1]
        row = (row[:-1] + row[1:]) / 2
    return left, right
