"""Newton's method, branches and bifurcations, on period maps whose orbits are known in closed form."""

import math

import numpy as np
import pytest

from tests.tools import closed_maps as maps
from vanedamp.coupling.orbits.continuation import BranchPath
from vanedamp.coupling.orbits.curve import CurvePoint
from vanedamp.coupling.orbits.diagram import Diagram
from vanedamp.coupling.orbits.first_orbit import Start, Starts
from vanedamp.coupling.orbits.multipliers import indicators, multipliers
from vanedamp.coupling.orbits.newton import OrbitStatus, find_orbit, solve
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: special points are located to this share of the parameter, or of one
CLOSE = 1e-8
B = 0.3


def diagram(period_map, start, low, to, **table):
    """The branches over a range of the parameter."""
    table = Table(**{"from": low, "to": to, **table})
    found = Diagram(
        period_map.at(low), table, low, to, lambda: Starts([Start(np.array(start, float), 1)], "try others")
    )
    found.follow(lambda done, total: None)
    return found


def places(branch, kind):
    """The parameters of the special points of a kind."""
    return [point.parameter for point in branch.special if point.kind == kind]


def test_newton_converges_quadratically_and_keeps_its_map():
    orbit = find_orbit(maps.smooth(maps.henon, 2, value=0.2), np.array([1.0, 0.2]))
    x = (-(1 - B) + math.sqrt((1 - B) ** 2 + 0.8)) / 0.4
    assert orbit.status is OrbitStatus.OK and orbit.iterations <= 6 and orbit.stable
    assert orbit.state == pytest.approx([x, B * x], rel=1e-13)
    assert np.prod(orbit.multipliers) == pytest.approx(-B, rel=1e-13)


@pytest.mark.parametrize("start", [[1.0, 0.2, 0.7, 0.0], [0.6, -4.0, 2.0, 0.0]])
def test_neutral_coordinates_stay_where_they_are(start):
    orbit = find_orbit(maps.smooth(maps.resting, 4, value=0.25), np.array(start))
    assert orbit.status is OrbitStatus.OK and orbit.neutral == 3 and orbit.stable
    assert orbit.state == pytest.approx([0.5, *start[1:]], abs=1e-12)


def test_a_body_that_drifts_has_no_orbit():
    assert find_orbit(maps.smooth(maps.drifting, 2), np.array([0.3, 0.0])).status is OrbitStatus.NOT_CONVERGED


def test_an_orbit_that_the_sequence_forbids_is_a_status():
    orbit = find_orbit(maps.kinked(0.5, 1.5).at(0.1), np.array([-2.0]))
    assert orbit.status is OrbitStatus.FORBIDDEN


def test_a_start_that_the_engine_cannot_run_is_a_status():
    orbit = find_orbit(maps.smooth(maps.henon, 2, value=1.4), np.array([1e200, 0.0]))
    assert orbit.status is OrbitStatus.STOPPED and np.isnan(orbit.passage.state).all()


def test_multipliers_of_a_defective_neutral_pair():
    derivative = np.array([[1.0, 3.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -0.5]])
    values, neutral = multipliers(derivative)
    assert neutral == 2
    assert indicators(values, neutral).doubling == pytest.approx(0.5, rel=1e-12)


def test_fold_to_its_closed_form():
    (branch,) = diagram(maps.smooth(maps.henon, 2), [1.6, 0.5], -0.05, -0.3).branches
    assert places(branch, "fold") == pytest.approx([-((1 - B) ** 2) / 4], rel=CLOSE)
    assert branch.end == "the end of the parameter's range" and branch.parameter[-1] == pytest.approx(-0.05)
    after = np.arange(len(branch.parameter)) > branch.special[0].index
    assert branch.stable[~after].all() and not branch.stable[after].any()


def test_period_doublings_are_switched_to_their_closed_forms():
    found = diagram(maps.smooth(maps.henon, 2), [1.0, 0.3], 0.1, 1.0, switch=True)
    first, second, *_ = found.branches
    assert places(first, "period doubling") == pytest.approx([0.75 * (1 - B) ** 2], rel=CLOSE)
    assert second.periods == 2 and second.source == (0, 0)
    # the orbit of two periods doubles where the product of its multipliers' trace is -2: (1 - b)^2 + (1 + b)^2/4
    assert places(second, "period doubling") == pytest.approx([(1 - B) ** 2 + (1 + B) ** 2 / 4], rel=CLOSE)
    assert found.branches[2].periods == 4 and found.branches[2].source[0] == 1
    x, a = second.state[:, 0], second.parameter
    # both of its points are roots of a^2 x^2 - a (1 - b) x + (1 - b)^2 - a
    assert np.abs(a**2 * x**2 - a * (1 - B) * x + (1 - B) ** 2 - a).max() < 1e-9
    peaks = np.abs(np.stack([x, (1 - B) / a - x])).mean(axis=0)
    assert second.amplitude_mean == pytest.approx(peaks, rel=1e-9)


def test_symmetry_breaks_and_the_branch_beside_is_a_parabola():
    found = diagram(maps.smooth(maps.pitchfork, 2, mirror=True), [0.0, 0.0], -0.3, 0.7, switch=True)
    first, second = found.branches
    assert places(first, "pitchfork") == pytest.approx([0.0], abs=CLOSE) and first.symmetric.all()
    assert first.special[0].note == "symmetry breaks"
    assert np.abs(second.state[:, 0] ** 2 - second.parameter).max() < 1e-9
    assert not second.symmetric.any() and second.stable.all() and second.source == (0, 0)


def test_a_branch_of_broken_symmetry_ends_where_it_joins_its_mirror_image():
    x = math.sqrt(0.5)
    (branch,) = diagram(maps.smooth(maps.pitchfork, 2, mirror=True), [x, 0.2 * x], 0.5, -0.5).branches
    assert branch.end == "joins a branch of symmetric orbits"
    assert branch.special[-1].parameter == pytest.approx(0.0, abs=CLOSE)
    assert [point.kind for point in branch.special] == ["pitchfork", "end"]


def test_neimark_sacker_point_to_its_closed_form():
    (branch,) = diagram(maps.smooth(maps.delayed_logistic, 2), [0.3, 0.3], 1.5, 2.3).branches
    assert places(branch, "neimark-sacker") == pytest.approx([2.0], rel=CLOSE)
    assert [point.kind for point in branch.special] == ["neimark-sacker", "end"]
    assert np.array_equal(branch.stable, branch.parameter < 2.0)


def test_a_fold_beside_bodies_that_rest_anywhere():
    (branch,) = diagram(maps.smooth(maps.resting, 4), [0.7, 0.2, 0.1, 0.0], 0.5, -0.5).branches
    assert places(branch, "fold") == pytest.approx([0.0], abs=CLOSE)
    assert [point.kind for point in branch.special] == ["fold", "end"]
    assert np.abs(branch.state[:, 1:] - [0.2, 0.1, 0.0]).max() < 1e-12


@pytest.mark.parametrize(("right", "end"), [(-0.5, 1.0), (1.5, -1.0), (-1.5, 1.0)], ids=["kink", "fold", "flip"])
def test_a_change_of_sequence_bends_the_branch_or_turns_it_back(right, end):
    (branch,) = diagram(maps.kinked(0.5, right), [-2.0], -1.0, 1.0).branches
    (change,) = [point for point in branch.special if point.kind == "sequence"]
    assert change.parameter == pytest.approx(0.0, abs=CLOSE) and "sticks 0 begins" in change.note
    assert branch.parameter[-1] == pytest.approx(end)
    closed = branch.parameter / (1 - np.where(branch.sequence == "", 0.5, right))
    assert branch.state[:, 0] == pytest.approx(closed, abs=1e-9)
    assert ("turns" in change.note) == (right > 1)


def test_a_branch_that_nothing_continues_ends_at_the_place_and_says_so():
    (branch,) = diagram(maps.cliff(), [0.0], 0.0, 1.0).branches
    assert "no orbit found beyond" in branch.end
    assert branch.special[-1].kind == "end" and branch.special[-1].parameter == pytest.approx(0.3, rel=CLOSE)


@pytest.mark.slow
def test_grazing_of_the_impact_oscillator():
    """Its linear response reaches the stop at A = c."""
    (branch,) = diagram(maps.ImpactOscillator(), [0.0, 0.5], 0.05, 0.2, max_points=30).branches
    assert places(branch, "grazing")[:1] == pytest.approx([0.1], rel=CLOSE)
    linear = branch.sequence == ""
    decay = np.exp(-0.05 * 2 * np.pi)
    assert np.abs(branch.multipliers[linear]) == pytest.approx(decay, rel=1e-12)
    assert branch.state[linear, 1] == pytest.approx(branch.parameter[linear] / 0.1, rel=1e-9)


def test_a_branch_of_one_impact_keeps_the_product_of_its_multipliers():
    """It is e^2 times the free decay, whatever the orbit."""
    x = np.array([0.66, 0.74])
    (branch,) = diagram(maps.ImpactOscillator(), x, 0.15, 0.11).branches
    assert branch.end == "the end of the parameter's range"
    assert np.prod(branch.multipliers, axis=1) == pytest.approx(0.8**2 * np.exp(-0.1 * 2 * np.pi), rel=1e-9)


def test_a_closed_branch_ends_where_it_began():
    """The orbits lie on a circle of state and parameter; the branch begins at its top."""
    table = Table(**{"from": -1.5, "to": 1.5, "max_points": 800})
    problem = OrbitProblem.along(maps.smooth(maps.isola, 1), -1.5, 3.0)
    start = problem.pack(np.array([1.0]), 0.0)
    row = np.array([0.0, 1.0])
    followed = BranchPath(table, CurvePoint(problem, solve(problem, start, row), row))
    while not followed.end:
        followed.advance()
    branch = followed.branch
    assert branch.end == "closed: back at its first orbit"
    assert places(branch, "fold") == pytest.approx([1.0, -1.0], rel=CLOSE)
    assert np.abs(branch.state[:, 0] ** 2 + branch.parameter**2 - 1).max() < 1e-9


def test_a_parameter_that_makes_no_scene_ends_the_branch():
    (branch,) = diagram(maps.smooth(maps.henon, 2, lowest=0.25), [1.0, 0.3], 0.5, 0.0).branches
    assert branch.end == "scene: value: 0.25 is the least"
    assert branch.parameter[-1] == pytest.approx(0.25, rel=1e-4)


def test_a_start_without_orbit_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"no orbit of 1 excitation period.* at excitation.frequency = 0.1.*sequence"):
        diagram(maps.kinked(0.5, 1.5), [-2.0], 0.1, 1.0)


def test_bounds_of_points():
    (branch,) = diagram(maps.smooth(maps.henon, 2), [1.0, 0.3], 0.0, 1.4, max_points=7).branches
    assert len(branch.parameter) == 7 and branch.end == "max_points (7) reached"
