"""Lengths of loops that a processor runs several turns of at once."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import inlined

_LANES = 8


@inlined
def whole_vectors(count, length):
    """Return the count of modes rounded up to whole vectors, within the arrays' length: what is there is zero.

    Turns that fill no vector are made one by one, and take as long as many vectors. Few modes stay few.
    """
    return count if count <= _LANES else min((count + _LANES - 1) // _LANES * _LANES, length)
