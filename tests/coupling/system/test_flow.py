"""The flow of the states of units, against the same equations solved by projectors (tests/reference/flows.py)."""

import numpy as np
import pytest

from tests.reference.flows import flow as reference
from tests.tools.sensitive_scenes import KINDS, scene_of
from vanedamp.coupling.derivatives.dynamics import Dynamics
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.segment import Walk

#: of rows that nearly depend on each other the shared flow has the square of the condition
ROUND_OFF = 1e-11
PERIODS, MOST_EVENTS = 4, 20000


@pytest.mark.parametrize("seed", range(len(KINDS)), ids=KINDS)
def test_generators_and_forces_of_every_state_that_a_run_meets(seed, tmp_path):
    _, scene = scene_of(seed, tmp_path)
    frame = Frame(scene)
    dynamics, system = Dynamics(frame, frame.sizes()), frame.system
    run = engine_run(system, start_of(scene, system), new_records(system, PERIODS, 0), True, MOST_EVENTS)
    met = {segment.state.tobytes() + segment.open_force.tobytes(): segment for segment in Walk(run, PERIODS)}
    assert met
    for segment in met.values():
        flow = dynamics.flow(segment.state, segment.open_force)
        X, forces = reference(system, segment.state, segment.open_force)
        # in units of energy: every entry has the order of the frequencies
        for found, exact in ((flow.X, dynamics.per[:, None] * X / dynamics.per), (flow.forces, forces / dynamics.per)):
            np.testing.assert_allclose(found, exact, rtol=0.0, atol=ROUND_OFF * (np.abs(exact).max() or 1.0))
