"""One limit of this machine, in a process of its own on one thread.

    python -m benchmarks.limits.worker LIMIT SIZE

prints a number: seconds of one operation. LIMIT: exponential, product, division (of complex numbers, each of which
waits for the one before), multiply_add (of doubles, in a product of matrices), byte (read from memory).
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

import numpy as np
from numba import njit


@njit(error_model="numpy")
def _exponentials(count: int) -> complex:
    z = complex(1.0, 0.0)
    for _ in range(count):
        size, angle = math.exp(-1e-3 * z.real), 0.3 + 0.1 * z.imag
        z = complex(size * math.cos(angle), size * math.sin(angle))
    return z


@njit(error_model="numpy")
def _products(count: int) -> complex:
    z, turn = complex(1.0, 0.0), complex(0.6, 0.8)
    for _ in range(count):
        z = z * turn
    return z


@njit(error_model="numpy")
def _divisions(count: int) -> complex:
    z, turn = complex(1.0, 0.0), complex(0.6, 0.8)
    for _ in range(count):
        z = turn / z
    return z


def multiply_add(size: int) -> float:
    """Return the seconds of a multiplication with addition, in a product of square matrices of that size."""
    first = np.random.default_rng(0).random((size, size))
    return _least(lambda: first @ first) / size**3


def byte(size: int) -> float:
    """Return the seconds in which a byte comes from memory, in the product of two vectors of that length."""
    first, second = np.ones(size), np.ones(size)
    return _least(lambda: first @ second) / (16 * size)


def _compiled(function: Callable[[int], complex]) -> Callable[[int], float]:
    return lambda count: _least(lambda: function(count)) / count


LIMITS: dict[str, Callable[[int], float]] = {
    "exponential": _compiled(_exponentials), "product": _compiled(_products), "division": _compiled(_divisions),
    "multiply_add": multiply_add, "byte": byte,
}  # fmt: skip


def _least(task: Callable[[], object]) -> float:
    """Return the least of five processor times: what the machine can do at most. The first, which compiles, is none."""
    times = []
    for _ in range(6):
        started = time.process_time()
        task()
        times.append(time.process_time() - started)
    return min(times[1:])


if __name__ == "__main__":
    print(LIMITS[sys.argv[1]](int(sys.argv[2])))
