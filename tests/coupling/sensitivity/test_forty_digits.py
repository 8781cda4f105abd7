"""Derivatives by all numbers of scenes of sliders, along one direction, against a motion in 40 digits.

A direction changes every number at once, each by some part of its size: what is wrong in one of them shows.
"""

import numpy as np
import pytest

from tests.coupling.orbits.test_period_map import SCENES, begun, passed
from tests.reference.fixed_sequence import along
from tests.tools.sensitive_scenes import numbers_of
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits.period_map import PeriodMap

#: numbers that sliders at standstill do not feel, which the reference does not know
UNFELT = ("centrifugal_stiffness", "normal_motion", "rotation", "centrifugal_deg")


@pytest.mark.parametrize("name", SCENES)
def test_the_derivative_by_numbers_is_that_of_40_digits(name):
    walked, state = passed(*SCENES[name])
    made = walked.scene
    numbers = {
        path: size for path, (_, size) in numbers_of(made, False).items() if path.split(".")[-1] not in UNFELT
    }  # fmt: skip
    mapped = PeriodMap(made, walked.parameter, 1, walked.scale, numbers=tuple(numbers))
    passage = mapped(state)
    assert passage.status is PassageStatus.OK and passage.crossings
    direction = np.random.default_rng(len(name)).uniform(0.3, 1.0, len(numbers)) * list(numbers.values())
    law = (lambda s: lambda speed: 1 - s.contact.coefficient * speed**0.2) if made.contact.depends_on_speed else None
    moved = dict(zip(numbers, direction.tolist(), strict=True))
    exact = along(made, state, passage.crossings, begun(walked, state), moved, law) / mapped.scale
    error = np.abs(passage.by_number @ direction / mapped.scale - exact).max()
    # differences of sixth order find the slope of a restitution
    assert error < (1e-9 if law else 1e-10) * np.abs(exact).max()
