"""Scenes of blocks and discs that once broke a law, or stopped."""

import numpy as np
import pytest

from tests.tools.planar import ledger, planar_run, still_table
from tests.tools.planar_laws import check_laws
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET
from vanedamp.coupling.response.records import IMPACT
from vanedamp.coupling.response.response import Status

G = 9.81


def test_a_flow_in_which_contacts_hold_all():
    """The spring of a body that its wall holds stretches nothing."""
    table = still_table()
    table["gravity"] |= {"orientation_deg": 90.0}
    slider = {"mass": 0.1, "stiffness": 0.5, "position": -0.5, "restitution": 0.0}
    run = planar_run(table, slider, periods=1)
    assert run.status is Status.OK
    assert run.state.q[0] == pytest.approx(-0.5, abs=1e-12)


@pytest.mark.parametrize("restitution", [0.6, 0.9, 1.0])
@pytest.mark.parametrize("tilt", [-0.04, 0.04])
def test_an_oblique_impact_brings_no_energy(restitution, tilt):
    """One corner with friction: that its slip ends could make Newton's law bring energy (Kane's paradox)."""
    block = {
        "shape": "block", "length": 0.6, "height": 0.2, "mass": 1.0, "friction": 0.8, "restitution": restitution,
        "lift": 0.01, "lift_velocity": -0.3, "velocity": 0.12, "tilt": tilt, "tilt_rate": 1.5 * np.sign(tilt),
    }  # fmt: skip
    lowered = 0
    for speed in np.linspace(-1.0, 1.0, 9):
        run = planar_run(still_table(gravity=0.0), block | {"velocity": speed}, periods=1, events=1)
        (impact,) = run.events(IMPACT)
        lowered += impact[4] < -(1 - 1e-9) * restitution * impact[3]
        energy = 0.5 * run.system.mass @ run.state.v**2
        assert run.state.ledger[1:5].sum() >= -1e-14 * energy
    assert lowered > 0 or restitution < 1.0


@pytest.mark.parametrize("seed", [
    pytest.param(22, id="an impact of a wedged block, which has no solution with its coefficient"),
    pytest.param(123, id="the same between floor and ceiling"),
    pytest.param(2634, id="a wedged block slips: no forces, but impulses hold it"),
    pytest.param(1926, id="the same right after an impact"),
    pytest.param(1213, id="ties of contacts that depend on each other"),
    pytest.param(1144, id="shared friction changes normal forces, and with them what begins to slip"),
    pytest.param(1, id="shared friction would make a contact pull"),
    pytest.param(48, id="a second gap closes at the event of another contact"),
    pytest.param(171, id="a chatter ends while another contact slips"),
    pytest.param(75, id="a chatter ends and no state changes"),
    pytest.param(118, id="a force of round-off at the end of contact"),
    pytest.param(1724, id="a closed gap with a speed of round-off"),
    pytest.param(12595, id="contacts that depend on each other take two of their solutions by halves"),
    pytest.param(10930, id="the least of several possible forces would make a contact pull"),
    pytest.param(20864, id="three blocks in a corner share forces in many ways"),
    pytest.param(21998, id="an impact of a wedged block in a row, which no restitution lets part"),
    pytest.param(28789, id="the same while other contacts touch with speeds of round-off"),
    pytest.param(29676, id="the end of a chatter of a wedged block"),
    pytest.param(30171, id="the same with coefficients that differ"),
])  # fmt: skip
def test_scenes_that_broke_a_law(seed):
    worst, code = check_laws(seed)
    assert worst.steps > 0
    assert code in (DONE, EVENT_BUDGET)


def test_a_wedged_block_whose_slip_ends_a_moment_later():
    """Its slip is round-off, and in its direction no forces are possible: it stops, and slips the other way."""
    worst, code = check_laws(14899, longest=20)
    assert worst.steps == 20
    assert code == EVENT_BUDGET


def test_a_block_at_rest_in_a_corner():
    """Gravity presses it on floor and wall: three reactions too many, and it stays."""
    table = still_table()
    table["gravity"] |= {"orientation_deg": 30.0}
    block = {"shape": "block", "length": 0.1, "height": 0.1, "mass": 1.0, "friction": 0.3, "position": -0.5}
    run = planar_run(table, block, periods=2)
    assert run.status is Status.OK
    np.testing.assert_allclose(run.state.v, 0.0, atol=1e-12)
    assert abs(ledger(run)) <= 1e-12 * G
