"""Jenkins elements of the engine: loops, decay and limits in closed form, and the reference integrator."""

import math

import numpy as np
import pytest

from tests.reference.comparison import follow
from tests.tools.closed_form_compliant_scenes import jenkins, jenkins_turns, scene
from tests.tools.random_scenes import random_jenkins
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate


def swung(size, limit, stiffness):
    """The response of a Jenkins element to six periods of a motion size cos(w t) that nothing can stop."""
    mass = 1e15
    case = scene(
        structure={"model": "rigid", "mass": mass, "stiffness": mass * (2 * math.pi) ** 2, "damping": 0.0},
        initial={"displacement": size},
        friction_damper=[{"normal_force": 2 * limit, "friction": 0.5, "stiffness": stiffness}],
        time={"periods": 6, "transient": 1},
    )
    return simulate(case, events=True)


@pytest.mark.parametrize(("limit", "stiffness"), [(2.0, 1e5), (30.0, 1e5), (1e-3, 10.0), (99.0, 1e5)])
def test_hysteresis_loop(limit, stiffness):
    """A motion X cos(w t) that nothing can stop encloses 4 R (X - R / k) in every period: Jenkins (1962)."""
    size = 1e-3
    response = swung(size, limit, stiffness)
    loop = 4 * limit * (size - limit / stiffness)
    assert response.energy["friction"] == pytest.approx(5 * loop, rel=1e-9)
    slips = [event for event in response.event_list if event.kind == "slip"]
    assert len(slips) == 12
    # from a turning point the spring goes over both limits, the first time only over one
    first = math.acos(1 - limit / stiffness / size) / (2 * math.pi)
    later = math.acos(1 - 2 * limit / stiffness / size) / (2 * math.pi)
    times = [first, *(0.5 * half + later for half in range(1, 12))]
    assert [event.time for event in slips] == pytest.approx(times, rel=1e-9)
    sticks = [event.time for event in response.event_list if event.kind == "stick"]
    assert sticks[:11] == pytest.approx(0.5 * np.arange(1, 12), rel=1e-9)
    assert {(event.side, event.damper) for event in response.event_list} == {("casing", 0)}


def test_turning_points_at_the_ends_of_periods():
    """A slider that stops there, to round-off, before or after the end: it slips twice a period, not once more."""
    for limit in np.linspace(5e-4, 4e-3, 60).tolist():
        kinds = [event.kind for event in swung(1e-3, limit, 10.0).event_list]
        # after the last end nothing, or one stick: it lies there to round-off
        assert kinds[:23] == 11 * ["slip", "stick"] + ["slip"], limit
        assert kinds[23:] in ([], ["stick"]), limit


@pytest.mark.parametrize(
    ("displacement", "limit", "stiffness"),
    [(2e-3, 2.0, 3e4), (5e-3, 5.0, 3e3), (-1e-3, 1.0, 1e5), (1e-3, 0.1, 1e4), (1e-3, 3.0, 1e7), (1e-3, 9.0, 1e4)],
)
def test_free_decay(displacement, limit, stiffness):
    """Turning points and their times: the exact piecewise solution."""
    turns = jenkins_turns(displacement, limit, stiffness, 8)
    for time, value in turns[1:]:
        # a section of the response at the turning point
        start = {"initial": {"displacement": displacement}, "excitation": {"frequency": 1 / time}}
        response = simulate(jenkins(limit, stiffness, **start, time={"periods": 1, "transient": 0}), events=True)
        assert response.section[-1] == pytest.approx([value, 0.0], rel=1e-9, abs=1e-9 * abs(displacement))
        assert response.energy_residual < 1e-12
    sticks = [event.time for event in response.event_list if event.kind == "stick"]
    assert sticks[: len(turns) - 2] == pytest.approx([time for time, _ in turns[1:-1]], rel=1e-9)


def test_decay_to_a_motion_without_slip():
    """Slips become ever smaller; in the end, forces stay within the limit, and nothing is lost any more."""
    start = {"initial": {"displacement": 2e-3}, "time": {"periods": 400, "transient": 399}}
    response = simulate(jenkins(2.0, 3e4, **start))
    assert response.status == Status.OK
    assert response.energy["friction"] == pytest.approx(0.0, abs=1e-9 * 2e-2)
    assert response.energy_residual < 1e-10


def test_an_element_that_never_slips_is_a_spring():
    """Unloaded at the initial displacement: free vibration about k x0 / (c + k)."""
    start, stiffness = 1e-3, 3e4
    case = jenkins(1e3, stiffness, initial={"displacement": start}, time={"periods": 5, "transient": 0})
    response = simulate(case, events=True, samples_per_period=16)
    centre = stiffness * start / (1e4 + stiffness)
    exact = centre + (start - centre) * np.cos(200.0 * response.time)
    assert response.displacement == pytest.approx(exact, abs=1e-15)
    assert response.event_list == []
    assert response.energy["friction"] == 0.0


def hartog(stiffness=None):
    """Den Hartog's mass with r = 0.6 and R = 0.2 F, of a Coulomb element or, with a stiffness, a Jenkins element."""
    element = {"normal_force": 2.0, "friction": 0.1} | ({"stiffness": stiffness} if stiffness else {})
    return scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.0},
        excitation={"frequency": 0.6 * 100 / (2 * math.pi), "force": 1.0},
        friction_damper=[element],
        time={"periods": 3000, "transient": 2900},
    )


def test_a_stiff_spring_is_den_hartogs_friction():
    """Den Hartog (1931): X c / F = 1.55060285; a Jenkins element tends to it as its spring becomes stiff.

    At a turning point friction reverses within the time for 2 R / k of travel from rest, which goes like k^(-1/2).
    """
    r, ratio = 0.6, 0.2
    v, u = 1 / (1 - r**2), math.sin(math.pi / r) / (r * (1 + math.cos(math.pi / r)))
    limit = math.sqrt(v**2 - (ratio * u) ** 2)
    stiffness = np.array([1e6, 1e7, 1e8, 1e9])
    errors = []
    for spring in stiffness:
        response = simulate(hartog(spring))
        assert response.status == Status.OK
        assert response.energy_residual < 1e-10
        errors.append(abs(response.amplitude_max * 1e4 - limit))
    assert simulate(hartog()).amplitude_max * 1e4 == pytest.approx(limit, rel=1e-6)
    assert np.polyfit(np.log(stiffness), np.log(errors), 1)[0] == pytest.approx(-0.5, abs=0.02)
    assert errors[-1] < 1e-3


@pytest.mark.parametrize(("limit", "stiffness"), [(0.3, 3e4), (0.2, 1e5), (0.5, 5e3)])
def test_steady_vibration_loses_a_loop_a_period(limit, stiffness):
    """The ledger's friction is 4 R (X - R / k) a period, with the response's own X; the force makes up for it."""
    case = jenkins(
        limit, stiffness,
        excitation={"frequency": 0.9 * 100 / (2 * math.pi), "force": 1.0},
        time={"periods": 2000, "transient": 1900},
    )  # fmt: skip
    response = simulate(case, events=True)
    loop = 4 * limit * (response.amplitude_max - limit / stiffness)
    assert response.amplitude_max > 1.5 * limit / stiffness
    assert response.energy["friction"] == pytest.approx(100 * loop, rel=1e-9)
    assert response.energy["excitation"] == pytest.approx(100 * loop, rel=1e-9)
    assert response.energy_residual < 1e-10


def test_two_equal_elements_are_one():
    """Half the limit and half the stiffness twice: the same motion, and each element loses its half."""
    start = {"initial": {"displacement": 3e-3}, "time": {"periods": 6, "transient": 0}}
    one = simulate(jenkins(2.0, 3e4, **start), samples_per_period=16)
    half = {"normal_force": 10.0, "friction": 0.1, "stiffness": 1.5e4}
    two = simulate(jenkins(**start, friction_damper=[half, half]), samples_per_period=16)
    assert two.displacement == pytest.approx(one.displacement, abs=1e-12)
    assert two.energy["friction"] == pytest.approx(one.energy["friction"], rel=1e-9)
    assert two.energy_residual < 1e-12


FEW = [
    ("rigid", 0, "newton", 1, 0),
    ("rom", 0, "newton", 2, 0),
    ("rigid", 1, "newton", 1, 2),
    ("rigid", 1, "compliant", 1, 3),
]
MANY = [
    (structure, bodies, law, elements, seed)
    for structure, bodies, law, elements, count in [
        ("rigid", 0, "newton", 1, 10),
        ("rigid", 0, "newton", 2, 5),
        ("rom", 0, "newton", 1, 5),
        ("rom", 0, "newton", 2, 5),
        ("rigid", 1, "newton", 1, 8),
        ("rom", 2, "newton", 2, 5),
        ("rigid", 1, "compliant", 1, 5),
        ("rom", 2, "compliant", 2, 5),
    ]
    for seed in range(10, 10 + count)
]


@pytest.mark.parametrize(("structure", "bodies", "law", "elements", "seed"), FEW)
def test_motion_equals_dop853(structure, bodies, law, elements, seed, tmp_path):
    case, reduced = random_jenkins(seed, structure, bodies, law, elements)
    follow(case, 3, reduced, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "bodies", "law", "elements", "seed"), MANY)
def test_motion_equals_dop853_at_length(structure, bodies, law, elements, seed, tmp_path):
    case, reduced = random_jenkins(seed, structure, bodies, law, elements)
    follow(case, 8, reduced, tmp_path)
