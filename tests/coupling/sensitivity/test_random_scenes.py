"""Derivatives of random scenes of every kind, of runs and of orbits, against differences of the engine.

`.venv/bin/python -m tests.tools.sensitivities` does the same for as many as wanted.
"""

import pytest

from tests.tools.sensitive_scenes import KINDS
from tests.tools.sensitivities import check
from tests.tools.tiers import cases

#: seeds of which a run or an orbit takes about a second, of every kind
SEEDS = (0, 20, 439, 22, 4, 24, 424, 444, 8, 47, 428, 68, 430, 70, 432, 34, 111, 169, 113)


@pytest.mark.parametrize("seed", cases(SEEDS, fast=SEEDS[::2]))
def test_no_derivative_is_off(seed, tmp_path):
    found = check(seed, tmp_path)
    assert any(each.compared for each in found)
    for each in found:
        assert not [error for error in each.errors if error.off], (each.kind, each.subject)


def test_a_body_that_rests_at_a_wall_is_not_said_to_leave_it(tmp_path):
    """A chatter makes derivatives large and small again: what round-off leaves of them is no motion of rows at rest."""
    for each in check(1001, tmp_path):
        assert not [error for error in each.errors if error.off], (each.kind, each.subject)


def test_the_seeds_are_of_every_kind():
    assert {KINDS[seed % len(KINDS)] for seed in SEEDS} == set(KINDS)
