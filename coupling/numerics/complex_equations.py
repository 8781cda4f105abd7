"""Complex division and linear equations, the same to the last bit in all callers."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import strict


@strict
def quotient(a, b):
    """Return a/b of complex numbers without overflow (Smith 1962)."""
    if abs(b.real) >= abs(b.imag):
        ratio = b.imag / b.real
        size = b.real + b.imag * ratio
        return complex((a.real + a.imag * ratio) / size, (a.imag - a.real * ratio) / size)
    ratio = b.real / b.imag
    size = b.imag + b.real * ratio
    return complex((a.real * ratio + a.imag) / size, (a.imag * ratio - a.real) / size)


@strict
def solve(matrix, x):
    """Replace x (k,) by the solution of matrix (k, k), which is overwritten. Return whether there is one."""
    k = len(x)
    for c in range(k):
        best, size = c, 0.0
        for r in range(c, k):
            found = abs(matrix[r, c].real) + abs(matrix[r, c].imag)
            if found > size:
                best, size = r, found
        if size == 0.0:
            return False
        if best != c:
            x[c], x[best] = x[best], x[c]
            for j in range(c, k):
                matrix[c, j], matrix[best, j] = matrix[best, j], matrix[c, j]
        for r in range(c + 1, k):
            factor = quotient(matrix[r, c], matrix[c, c])
            if factor.real != 0.0 or factor.imag != 0.0:
                x[r] -= factor * x[c]
                for j in range(c + 1, k):
                    matrix[r, j] -= factor * matrix[c, j]
    for c in range(k - 1, -1, -1):
        for j in range(c + 1, k):
            x[c] -= matrix[c, j] * x[j]
        x[c] = quotient(x[c], matrix[c, c])
    return True
