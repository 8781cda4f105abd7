"""Rainflow counting: the example of the standard, and peaks that no reduction may lose."""

from itertools import pairwise

import numpy as np
import pytest

from vanedamp.coupling.strength.counting import rainflow_cycles, turning_points
from vanedamp.files.toml_input import InputError

# ASTM E1049-85, figure 6 (A to I) with the cycles of its section 5.4.4: range, mean, count, in the order of counting
STANDARD = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
COUNTED = [(3, -0.5, 0.5), (4, -1, 0.5), (4, 1, 1), (8, 1, 0.5), (9, 0.5, 0.5), (8, 0, 0.5), (6, 1, 0.5)]


def test_example_of_the_standard():
    assert list(zip(*rainflow_cycles(STANDARD), strict=True)) == COUNTED


def test_example_of_the_standard_as_samples_of_a_smooth_history():
    """Half cosines between its peaks and valleys, with flat ones: neither ends nor flats change the count."""
    phase = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 40))
    legs = [a + (b - a) * phase for a, b in pairwise(STANDARD)]
    assert list(zip(*rainflow_cycles(np.concatenate(legs)), strict=True)) == COUNTED


def test_example_of_the_standard_for_repeating_histories():
    """Section 5.4.5: begun at its largest peak D, a repeating history has closed cycles only."""
    cycles = rainflow_cycles([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0], repeats=True)
    found = {}
    for size, count in zip(cycles.ranges, cycles.counts, strict=True):
        found[size] = found.get(size, 0.0) + count
    assert found == {3.0: 1.0, 4.0: 1.0, 7.0: 1.0, 9.0: 1.0}


def test_no_peak_is_lost():
    """Turning points against the definition, sample by sample, of whole numbers with many equal neighbours."""
    draw = np.random.default_rng(11)
    for _ in range(300):
        history = draw.integers(0, 4, draw.integers(1, 25)).astype(float)
        distinct = [history[0]]
        for value in history[1:]:
            if value != distinct[-1]:
                distinct.append(value)
        expected = [distinct[0]]
        for before, value, after in zip(distinct, distinct[1:], distinct[2:], strict=False):
            if (value - before) * (after - value) < 0.0:
                expected.append(value)
        if len(distinct) > 1:
            expected.append(distinct[-1])
        assert history[turning_points(history)].tolist() == expected


def test_half_cycles_add_up_to_the_ranges_passed():
    """Every counted cycle passes its range twice as a whole, once as a half: together all ranges between extremes."""
    history = np.random.default_rng(5).normal(size=4000)
    cycles = rainflow_cycles(history)
    assert 2.0 * cycles.counts @ cycles.ranges == pytest.approx(np.abs(np.diff(history)).sum(), rel=1e-12)
    assert cycles.ranges.max() == pytest.approx(np.ptp(history))


def test_a_constant_history_has_no_cycle():
    assert not rainflow_cycles(np.full(5, 3.0)).ranges.size
    assert not rainflow_cycles([3.0], repeats=True).ranges.size


@pytest.mark.parametrize("history", [[], [1.0, np.nan], [[1.0, 2.0]]])
def test_a_history_that_is_none_is_rejected(history):
    with pytest.raises(InputError, match=r"^history: expected finite values"):
        rainflow_cycles(history)
