"""Reciprocals and linear equations of complex numbers, in place: compiled functions allocate nothing."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import strict


@strict
def reciprocal(z):
    """Return 1/z of a number whose square neither overflows nor underflows."""
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@strict
def solve(matrix, x, k):
    """Solve matrix y = x for the first k unknowns in place, by elimination with the largest pivot of each column.

    Returns False for a singular matrix.
    """
    for p in range(k):
        largest, pivot = 0.0, p
        for i in range(p, k):
            size = abs(matrix[i, p].real) + abs(matrix[i, p].imag)
            if size > largest:
                largest, pivot = size, i
        if largest == 0.0:
            return False
        if pivot != p:
            x[p], x[pivot] = x[pivot], x[p]
            for j in range(p, k):
                matrix[p, j], matrix[pivot, j] = matrix[pivot, j], matrix[p, j]
        scale = reciprocal(matrix[p, p])
        for i in range(p + 1, k):
            factor = matrix[i, p] * scale
            if factor != 0.0:
                x[i] -= factor * x[p]
                for j in range(p + 1, k):
                    matrix[i, j] -= factor * matrix[p, j]
        matrix[p, p] = scale
    for p in range(k - 1, -1, -1):
        total = x[p]
        for j in range(p + 1, k):
            total -= matrix[p, j] * x[j]
        x[p] = total * matrix[p, p]
    return True
