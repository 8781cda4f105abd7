"""Derivatives of random scenes of every kind, of runs and of orbits, against differences of the engine.

`.venv/bin/python -m tests.tools.sensitivities` does the same for as many as wanted.
"""

import pytest

from tests.tools.sensitive_scenes import KINDS
from tests.tools.sensitivities import check


@pytest.mark.parametrize("kind", range(len(KINDS)), ids=[kind.replace(" ", "-") for kind in KINDS])
def test_no_derivative_is_off(kind, tmp_path):
    found = [each for seed in (kind, kind + len(KINDS)) for each in check(seed, tmp_path)]
    assert found
    for each in found:
        assert not [error for error in each.errors if error.off], (each.kind, each.subject)


def test_the_kinds_have_runs_and_orbits(tmp_path):
    """Seeds of the plainest kinds, by name: a derivative by all numbers was compared of each."""
    found = [each for kind in ("slider", "prescribed", "viscoelastic") for each in check(KINDS.index(kind), tmp_path)]
    assert {each.subject for each in found if each.compared > 10} == {"run", "orbit"}
