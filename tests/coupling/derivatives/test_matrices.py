"""Small matrices of compiled functions against numpy's."""

import numpy as np
import pytest

from vanedamp.coupling.derivatives.matrices import empty, inverse_of_rows, new_room, product
from vanedamp.coupling.numerics.compiler.jit import counting_entry


@counting_entry
def solved(room, rows, right, inverse, found):
    empty(room)
    kept = inverse_of_rows(room, rows)
    times = product(room, kept, right)
    for i in range(len(inverse)):
        for k in range(inverse.shape[1]):
            inverse[i, k] = kept[i, k]
        for k in range(found.shape[1]):
            found[i, k] = times[i, k]


@pytest.mark.parametrize("shape", [(0, 3), (1, 4), (3, 5), (5, 3), (7, 7)])
@pytest.mark.parametrize("dependent", [False, True])
def test_rows_of_any_lengths_may_depend_on_each_other(shape, dependent):
    rng, (m, n) = np.random.default_rng(shape), shape
    rows = rng.normal(size=shape)
    if dependent and m > 2:
        rows[2], rows[1] = rows[0] - 3.0 * rows[1], rows[1]
    length = 10.0 ** rng.uniform(-6, 6, m)
    right, inverse, found = rng.normal(size=(m, 2)), np.zeros((n, m)), np.zeros((n, 2))
    solved(new_room(1000), rows * length[:, None], right * length[:, None], inverse, found)
    size = np.linalg.norm(rows, axis=1)
    expected = np.linalg.pinv(rows / size[:, None], rcond=1e-9) / size if m else inverse
    np.testing.assert_allclose(inverse * length, expected, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found, expected @ right, rtol=1e-11, atol=1e-11)


def test_room_that_is_short_is_noticed():
    room = new_room(30)
    solved(room, np.eye(3), np.eye(3), np.zeros((3, 3)), np.zeros((3, 3)))
    assert room.used[2] == 1
