"""Records of compiled functions: passed by their place, with lengths in their types where those are asked for."""

from typing import NamedTuple

import numpy as np
import pytest

from vanedamp.coupling.numerics.compiler.jit import entry, kernel
from vanedamp.coupling.numerics.compiler.record import lengths, record, record_with, sized_type


@record
class Inner(NamedTuple):
    """A record in another one."""

    weight: np.ndarray
    limit: float


@record_with(sizes=("rows",), free_axes=1)
class Outer(NamedTuple):
    """Numbers, arrays of all kinds, and a record."""

    rows: int
    law: int
    heavy: bool
    factor: float
    matrix: np.ndarray
    stack: np.ndarray
    phase: np.ndarray
    held: np.ndarray
    inner: Inner


@kernel
def _row(outer, i):
    total = 0.0
    for j in range(outer.matrix.shape[1]):
        total += outer.matrix[i, j] * outer.inner.weight[j]
    return total


@entry
def summed(outer, out, times):
    """Sum all of a record; writes to its arrays must be seen."""
    for i in range(outer.rows):
        outer.phase[i] += 1j * times
        out[i] = outer.factor * _row(outer, i) + outer.phase[i].imag + outer.stack[i % len(outer.stack), 1, 0]
        if outer.held[i]:
            out[i] = -out[i]
    return min(out[0], outer.inner.limit) + outer.law + (100.0 if outer.heavy else 0.0)


def example(rows=3, columns=2, stack=4, law=7, heavy=True):
    """Return a record with other numbers for other lengths."""
    rng = np.random.default_rng([rows, columns, stack])
    return Outer(
        rows, law, heavy, 0.5, rng.normal(size=(rows, columns)), rng.normal(size=(stack, 2, 3)),
        rng.normal(size=rows) + 0j, np.arange(rows) % 2 == 0, Inner(rng.normal(size=columns), 1e9),
    )  # fmt: skip


def expected(outer, times):
    """The same sum by numpy."""
    rows = np.arange(outer.rows)
    out = 0.5 * outer.matrix @ outer.inner.weight + outer.phase.imag + times
    out += outer.stack[rows % len(outer.stack), 1, 0]
    return np.where(outer.held, -out, out)


@pytest.mark.parametrize("sized", [False, True])
def test_fields_are_those_of_the_record(sized):
    """Numbers, arrays, records in records, with and without lengths in the type; writes to arrays last."""
    for rows, columns, stack, law, heavy in (
        (3, 2, 4, 7, True),
        (3, 2, 5, 8, False),
        (4, 3, 4, 9, True),
        (1, 1, 1, 0, True),
    ):
        outer = example(rows, columns, stack, law, heavy)
        out, want = np.zeros(rows), expected(outer, 2)
        call = summed.sized(outer, out, 2) if sized else summed
        last = call(outer, out, 2)
        assert out == pytest.approx(want, rel=1e-14)
        assert last == pytest.approx(want[0] + law + 100.0 * heavy, rel=1e-14)
        assert outer.phase.imag == pytest.approx(np.full(rows, 2.0))


def test_lengths_tell_sized_types_apart():
    """Free axes, numbers that are no lengths, and values are not in the type; what is a length is."""
    assert sized_type(example(3, 2, 4, 7)) == sized_type(example(3, 2, 9, 8, heavy=False))
    assert sized_type(example(3, 2)) != sized_type(example(3, 3))
    assert sized_type(example(3, 2)) != sized_type(example(2, 2))
    assert lengths(example(3, 2, 4)) == (3, None, None, None, (None, 2), (None, 2, 3), (None,), (None,), None)
    one, other = example(3, 2), example(2, 2)
    assert summed.sized(one, np.zeros(3), 1) is summed.sized(example(3, 2, 6), np.zeros(5), 2)
    assert summed.sized(one, np.zeros(3), 1) is not summed.sized(other, np.zeros(2), 1)


def test_wrong_fields_are_refused():
    """A field of another type is an error from Python, not a crash."""
    outer = example()
    with pytest.raises((TypeError, ValueError)):
        summed.sized(outer, np.zeros(3), 1)(outer._replace(matrix=None), np.zeros(3), 1)
