"""Periodic orbits, their multipliers and where they end, against closed forms derived by hand (reference/orbit_*.py).

Orbits are of order one, multipliers too: round-off is some 1e-15 of them, times their condition numbers of up to 1e3.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.reference.orbit_bouncing_ball import BouncingBall, beginning, doubling
from tests.reference.orbit_dry_friction import DryFriction
from tests.reference.orbit_gap_oscillator import GapOscillator
from tests.reference.orbit_impact_oscillator import ImpactOscillator
from tests.reference.orbit_upright_body import UprightBody
from tests.tools.closed_form_scenes import ball, scene
from tests.tools.tiers import cases
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits.continuation import BranchPath
from vanedamp.coupling.orbits.curve import CurvePoint
from vanedamp.coupling.orbits.newton import OrbitStatus, solve
from vanedamp.coupling.orbits.orbits import find_orbit, orbits
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.simulation import simulate

UNIT = {"model": "rigid", "mass": 1.0, "stiffness": 1.0}


def multipliers(derivative):
    """Eigenvalues in an order that round-off does not change between conjugates."""
    return np.sort_complex(np.round(np.linalg.eigvals(derivative), 12))


def repeats(data, state):
    """The passage of an orbit's state, which a run of the engine and the period map bring back to itself."""
    walked = period_map(data)
    short = data.replace({"time": {"periods": 1, "transient": 0}})
    response = simulate(short, start=walked.restart_of(state))
    assert response.status is Status.OK and response.final is not None
    assert walked.state_of(response.final) == pytest.approx(state, rel=1e-11, abs=1e-11)
    passage = walked(state)
    assert passage.status is PassageStatus.OK
    assert passage.state == pytest.approx(state, rel=1e-11, abs=1e-11)
    return passage


def bouncing(orbit: BouncingBall):
    """The ball in a cavity of 20 m, upright; its state is the height less half the cavity."""
    data = ball(orbit.restitution, orbit.acceleration, cavity=[{"name": "c", "gap": 20.0}], damper=[
        {"cavity": "c", "mass": 1.0, "restitution": orbit.restitution, "position": -10.0}
    ])  # fmt: skip
    return data, orbit.state - [10.0, 0.0]


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_a_ball_repeats_its_bounce(restitution):
    low, high = beginning(restitution), doubling(restitution)
    for share in (0.2, 0.8, 1.1):
        orbit = BouncingBall(restitution, low + share * (high - low))
        passage = repeats(*bouncing(orbit))
        assert passage.sequence == ("impact c.left.0",)
        assert passage.crossings[0].speed == pytest.approx(-orbit.approach, rel=1e-11)
        assert passage.derivative == pytest.approx(orbit.monodromy, rel=1e-9, abs=1e-9)
        assert np.linalg.det(passage.derivative) == pytest.approx(restitution**2, rel=1e-9)
        stable = np.abs(np.linalg.eigvals(passage.derivative)).max() < 1
        assert stable == (share < 1)


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_a_ball_doubles_its_period_where_holmes_has_it(restitution):
    """det(D + 1) = 0 of the engine's derivative; it crosses zero with a slope of order one."""

    def turned(acceleration):
        data, state = bouncing(BouncingBall(restitution, acceleration))
        return np.linalg.det(repeats(data, state).derivative + np.eye(2))

    published = doubling(restitution)
    assert brentq(turned, 0.95 * published, 1.05 * published, xtol=1e-13) == pytest.approx(published, abs=1e-8)


def stopped(force):
    """x'' + 0.1 x' + x = force sin t below a stop at 1."""
    return scene(
        structure=UNIT | {"damping": 0.1}, excitation={"frequency": 1 / (2 * math.pi), "force": force},
        stop=[{"side": "right", "gap": 1.0, "restitution": 0.8}],
    )  # fmt: skip


@pytest.mark.parametrize("force", [0.5, 1.0, 2.0])
def test_an_oscillator_below_a_stop_repeats_its_impact(force):
    """The closed form has the force A cos t: phase 0 of the engine's sine is its 3/2 pi."""
    orbit = ImpactOscillator(k=1.0, c=0.1, A=force, w=1.0, d=1.0, e=0.8)
    begin = 1.5 * math.pi if orbit.phase < 1.5 * math.pi else -0.5 * math.pi
    assert orbit.phase < begin < orbit.phase + 2 * math.pi
    passage = repeats(stopped(force), orbit.state(begin))
    assert passage.sequence == ("impact stop.0",)
    assert passage.derivative == pytest.approx(orbit.monodromy(begin), abs=1e-9)
    assert multipliers(passage.derivative) == pytest.approx(multipliers(orbit.monodromy(begin)), abs=1e-9)
    assert np.linalg.det(passage.derivative) == pytest.approx(0.8**2 * math.exp(-0.1 * 2 * math.pi), rel=1e-9)


@pytest.mark.parametrize(("share", "hits"), [(1 - 1e-9, False), (1 + 1e-9, True)])
def test_an_oscillator_grazes_its_stop_at_the_force_of_its_damping(share, hits):
    """Without contact the amplitude at resonance is force over damping: with more than the gap the passage hits."""
    walked = period_map(stopped(0.1 * share))
    passage = walked(walked.linear_orbit())
    assert ("impact stop.0" in passage.sequence) == hits


GAP = GapOscillator(mass=1.0, damping=0.1, stiffness=1.0, body=0.1, half_gap=8.0, restitution=0.6, force=1.0, omega=1.0)


def gapped(orbit: GapOscillator):
    return scene(
        structure={"model": "rigid", "mass": orbit.mass, "stiffness": orbit.stiffness, "damping": orbit.damping},
        excitation={"frequency": orbit.omega / (2 * math.pi), "force": orbit.force},
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 2 * orbit.half_gap}],
        damper=[{"cavity": "c", "mass": orbit.body, "restitution": orbit.restitution}],
    )  # fmt: skip


@pytest.mark.parametrize("larger", [True, False])
@pytest.mark.parametrize("omega", [0.75, 0.9, 1.0, 1.05, 1.25])
def test_a_body_in_a_gap_has_the_orbit_of_masri_and_caughey(omega, larger):
    orbit = replace(GAP, omega=omega, larger=larger)
    exists = larger or omega != 1.0  # the slower one passes a wall at 1.0
    assert orbit.inside == exists
    if not exists:
        return
    passage = repeats(gapped(orbit), orbit.state)
    assert sorted(passage.sequence) == ["impact c.left.0", "impact c.right.0"]
    assert [abs(crossing.speed) for crossing in passage.crossings] == pytest.approx([orbit.approach] * 2, rel=1e-11)
    assert multipliers(passage.derivative) == pytest.approx(multipliers(orbit.half @ orbit.half), rel=1e-9, abs=1e-9)
    product = orbit.restitution**4 * math.exp(-orbit.damping * orbit.period / orbit.mass)
    # small beside its terms where one multiplier is large: its round-off is that of the condition
    rounded = 100 * np.finfo(float).eps * np.linalg.cond(passage.derivative)
    assert np.linalg.det(passage.derivative) == pytest.approx(product, rel=max(1e-9, rounded))


def test_the_symmetric_motion_is_stable_within_its_limits():
    """Two pitchforks around the resonance, a Neimark-Sacker point above: the engine's derivative has them too."""

    def derivative(omega):
        orbit = replace(GAP, omega=omega)
        return repeats(gapped(orbit), orbit.state).derivative

    def pitchfork(omega):  # of the mirrored half periods H it is det(H - 1) det(H + 1), and only the latter passes zero
        return np.linalg.det(derivative(omega) - np.eye(4))

    def spiral(omega):
        return np.abs(np.linalg.eigvals(derivative(omega))).max() - 1

    for low, high in ((0.8, 0.9), (0.92, 1.0)):
        assert brentq(pitchfork, low, high, xtol=1e-13) == pytest.approx(GAP.pitchfork(low, high), abs=1e-8)
    limit = GAP.neimark_sacker(1.1, 1.2)
    assert brentq(spiral, 1.1, 1.2, xtol=1e-13) == pytest.approx(limit, abs=1e-8)
    for omega, stable in ((limit - 1e-6, True), (limit + 1e-6, False)):
        assert (np.abs(np.linalg.eigvals(derivative(omega))).max() < 1) == stable


def test_two_symmetric_motions_meet_where_they_end():
    """At the fold their speeds of approach meet, and multipliers that leave one in either direction."""
    fold = GAP.fold(1.25, 1.4)
    beyond, near = replace(GAP, omega=fold + 1e-9), replace(GAP, omega=fold - 1e-9)
    assert not beyond.inside and near.inside and replace(near, larger=False).inside
    speeds, nearest = [], []
    for larger in (True, False):
        orbit = replace(near, larger=larger)
        found = np.linalg.eigvals(repeats(gapped(orbit), orbit.state).derivative)
        speeds.append(orbit.approach)
        nearest.append(found[np.argmin(np.abs(found - 1))].real - 1)
    # like the root of the distance
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-3)
    assert nearest[0] < 0 < nearest[1] or nearest[1] < 0 < nearest[0]
    assert nearest[0] == pytest.approx(-nearest[1], rel=1e-2)


@pytest.mark.parametrize("omega", [0.75, 1.05])
def test_the_structure_feels_the_mass_of_the_impacts(omega):
    """Harmonics of 200 periods on a stable orbit are those of the closed form's two impulses a period."""
    orbit = replace(GAP, omega=omega)
    data = gapped(orbit).replace({"time": {"periods": 200, "transient": 100}})
    response = simulate(data, start=period_map(data).restart_of(orbit.state))
    assert response.classification == "periodic-1"
    assert response.amplitude_harmonic == pytest.approx(abs(orbit.harmonic), rel=1e-9)
    assert response.attached_mass_fraction == pytest.approx(orbit.attached, rel=1e-9)


def test_a_light_body_is_attached_as_theurich_and_krack_have_it():
    """Their formula, 8 theta (theta - 1) / (pi xi)^2, is the closed form's limit: the error is of the body's order."""
    errors = []
    for body in (0.01, 0.001, 0.0001):
        orbit = replace(GAP, body=body, damping=0.02, omega=0.98, half_gap=20.0)
        assert orbit.inside
        rho = 2 / math.pi * (1 - orbit.restitution) / (1 + orbit.restitution)
        xi = abs(orbit.harmonic) / orbit.half_gap
        theta = (1 + math.sqrt((1 + rho**2) * xi**2 - rho**2)) / (1 + rho**2)
        errors.append(abs(orbit.attached - 8 * theta * (theta - 1) / (math.pi * xi) ** 2))
    assert errors[1] < 0.2 * errors[0] and errors[2] < 0.2 * errors[1]
    assert errors[2] < 1e-3


def rubbing(orbit: DryFriction):
    return scene(
        structure=UNIT | {"damping": 0.0}, excitation={"frequency": orbit.r / (2 * math.pi), "force": 1.0},
        friction_damper=[{"normal_force": orbit.R, "friction": 1.0}],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("ratio", "friction", "stops"),
    [(0.6, 0.2, False), (0.6, 0.5, False), (1.5, 0.3, False), (0.6, 0.7, True), (0.4, 0.6, True)],
)
def test_dry_friction_has_the_orbits_of_den_hartog(ratio, friction, stops):
    """Without stops both turns are events; with stops it sticks for a while at each, and a multiplier is zero."""
    orbit = DryFriction(ratio, friction, stops)
    assert orbit.lawful
    passage = repeats(rubbing(orbit), orbit.at(0.0))
    assert passage.peaks == pytest.approx([orbit.amplitude], rel=1e-12)
    kinds = [name.split()[0] for name in passage.sequence]
    assert kinds == (["sticks", "slips"] * 2 if stops else ["turns"] * 2)
    assert multipliers(passage.derivative) == pytest.approx(np.sort_complex(orbit.multipliers), abs=1e-9)
    if stops:
        assert np.abs(multipliers(passage.derivative)).min() < 1e-12


CLUSTER = {"mass": 0.15696, "stiffness": 3.6046e7}
UPRIGHT = UprightBody(
    mass=CLUSTER["mass"], damping=2 * 0.002 * math.sqrt(CLUSTER["mass"] * CLUSTER["stiffness"]),
    stiffness=CLUSTER["stiffness"], body=0.02 * CLUSTER["mass"], restitution=0.5, gravity=9.81, force=0.2,
    frequency=2340.0,
)  # fmt: skip


def test_the_period_of_an_upright_body_doubles_at_a_frequency_of_forty_digits():
    """A body of 2 % on a wall of the rigid cluster: the orbit, its derivative, and where a multiplier is -1."""
    gap, rest = 1e-4, np.array([0.0, 0.0, 5e-5, 0.0])
    data = scene(
        structure=CLUSTER | {"model": "rigid", "damping": UPRIGHT.damping},
        excitation={"frequency": UPRIGHT.frequency, "force": UPRIGHT.force},
        gravity={"acceleration": UPRIGHT.gravity, "orientation_deg": 90.0}, cavity=[{"name": "c", "gap": gap}],
        damper=[{"cavity": "c", "mass": UPRIGHT.body, "restitution": UPRIGHT.restitution, "position": -gap / 2}],
    )  # fmt: skip
    walked = period_map(data)

    def turned(frequency):
        state, derivative = replace(UPRIGHT, frequency=frequency).orbit()
        begin = np.array(state.tolist(), float).ravel() - rest
        passage = walked.at(frequency)(begin)
        assert passage.sequence == ("impact c.left.0",)
        assert np.abs((passage.state - begin) / walked.scale).max() < 1e-11
        exact = np.array(derivative.tolist(), float) * walked.scale / walked.scale[:, None]
        found = passage.derivative * walked.scale / walked.scale[:, None]
        assert found == pytest.approx(exact, rel=1e-9, abs=1e-9)
        return np.linalg.det(found + np.eye(4))

    reference = UPRIGHT.doubling(2338.0, 2345.0)
    assert brentq(turned, 2338.0, 2345.0, xtol=1e-11) == pytest.approx(float(reference), rel=1e-8)


#: long steps, for branches of few points
COARSE = {"step": 0.05, "max_step": 0.25}


def branch_of(data, state, **table):
    """The branch over a number of a scene through the orbit of a state, with its one structure and one body."""
    place, rate, slip, slip_rate = state
    begun = {
        "initial": {"displacement": place, "velocity": rate}, "damper.0.position": slip, "damper.0.velocity": slip_rate,
        "time": {"periods": 1, "transient": 0}, "orbit": COARSE | table,
    }  # fmt: skip
    (branch,) = orbits(data.replace(begun)).branches
    return branch


def places(branch, kind):
    return [2 * math.pi * point.parameter for point in branch.special if point.kind == kind]


def frequencies(low, high):
    return {"from": low / (2 * math.pi), "to": high / (2 * math.pi)}


def lie_on(branch, both=False):
    """Every point of a branch over the frequency is a closed form's; both: of either speed of approach."""
    for frequency, state, values, stable in zip(
        branch.parameter, branch.state, branch.multipliers, branch.stable, strict=True
    ):
        known = [replace(GAP, omega=2 * math.pi * frequency, larger=larger) for larger in (True, *[False] * both)]
        orbit = min(known, key=lambda orbit: float(np.abs(orbit.state - state).max()))
        # at a fold frequency and state are a double root of each other
        assert state == pytest.approx(orbit.state, abs=1e-9 if orbit is known[0] and not both else 1e-6)
        if not both:
            assert np.sort_complex(np.round(values, 9)) == pytest.approx(multipliers(orbit.half @ orbit.half), abs=1e-8)
            assert stable == (np.abs(orbit.multipliers).max() < 1)


@pytest.mark.slow
def test_a_branch_loses_its_symmetry_and_wins_it_back_where_the_closed_form_does():
    """On the way an impact passes the start of the period, where the state jumps and the branch goes on."""
    begin = replace(GAP, omega=0.98)
    branch = branch_of(gapped(begin), begin.state, **frequencies(0.98, 0.82))
    assert branch.end == "the end of the parameter's range"
    limits = [GAP.pitchfork(0.92, 1.0), GAP.pitchfork(0.8, 0.9)]
    assert places(branch, "pitchfork") == pytest.approx(limits, rel=1e-8)
    assert len(places(branch, "sequence")) == 1
    assert branch.symmetric.all()
    lie_on(branch)


@pytest.mark.slow
def test_a_branch_turns_where_two_symmetric_motions_meet():
    begin = replace(GAP, omega=1.13)
    branch = branch_of(gapped(begin), begin.state, **frequencies(1.13, 1.4))
    assert branch.end == "the end of the parameter's range"
    assert places(branch, "fold") == pytest.approx([GAP.fold(1.25, 1.4)], rel=1e-8)
    assert places(branch, "neimark-sacker")[0] == pytest.approx(GAP.neimark_sacker(1.13, 1.2), rel=1e-8)
    lie_on(branch, both=True)


def test_a_branch_keeps_its_sequence_while_both_of_its_impacts_come_to_graze():
    """A state that is away from its orbit by the cube of their speed has another sequence."""
    grazes = brentq(lambda omega: 1 / abs(1 - omega**2 + 0.1j * omega) - GAP.half_gap, 0.9, 1.0, xtol=1e-14)
    unit = grazes / (2 * math.pi)
    orbit = replace(GAP, omega=0.999 * grazes, larger=False)
    problem = OrbitProblem.along(period_map(gapped(orbit)), 0.999 * unit, 0.00095 * unit)
    row = problem.row()
    zero = solve(problem, problem.pack(orbit.state, 0.999 * unit), row)
    path = BranchPath(Table(**{"from": 0.999 * unit, "to": 0.99995 * unit}), CurvePoint(problem, zero, row))
    while not path.end:
        path.advance()
    assert path.end == path.edge and [named.kind for named in path.branch.special] == ["end"]
    for frequency, state in zip(path.branch.parameter, path.branch.state, strict=True):
        assert state == pytest.approx(replace(orbit, omega=2 * math.pi * frequency).state, abs=1e-6)


@pytest.mark.parametrize(
    ("restitution", "phase", "longest"),
    cases(
        [
            (0.3, 0.0, 0.05),
            (0.3, 20.0, 0.25),
            (0.5, 20.0, 0.05),
            (0.5, 20.0, 0.25),
            (0.8, 20.0, 0.25),
            (0.8, 60.0, 0.05),
        ],
        fast=[(0.5, 20.0, 0.25)],
    ),
)
def test_a_branch_of_a_ball_doubles_and_turns_where_holmes_has_it(restitution, phase, longest):
    """Where two orbits meet the impact is at phase 0 of the sine, which is the start of the period or not.

    Long steps would lead to the other orbit before the fold.
    """
    unit = 10.0 / (2 * math.pi) ** 2
    begins, doubles = beginning(restitution), doubling(restitution)
    orbit = BouncingBall(restitution, 0.5 * (begins + doubles))
    data, _ = bouncing(orbit)
    position, velocity = orbit.at(phase / 360.0) - [10.0, 0.0]
    data = data.replace({
        "damper.0.position": position, "damper.0.velocity": velocity, "time": {"periods": 1, "transient": 0},
        "excitation.harmonic": [{"order": 1, "amplitude": 1.0, "phase": phase}],
    })  # fmt: skip
    for to in (0.95 * begins, 1.1 * doubles):
        table = {"parameter": "structure.displacement_amplitude", "from": unit * orbit.acceleration, "to": unit * to}
        (branch,) = orbits(data.replace({"orbit": {"step": 0.05, "max_step": longest} | table})).branches
        if to > orbit.acceleration:
            (found,) = [point.parameter for point in branch.special if point.kind == "period doubling"]
            assert found == pytest.approx(unit * doubles, rel=1e-8)
            continue
        (fold,) = [point for point in branch.special if point.kind == "fold"]
        assert fold.parameter == pytest.approx(unit * begins, rel=1e-8)
        assert not {point.kind for point in branch.special} & {"grazing", "pitchfork"}
        assert branch.end == "the end of the parameter's range" and branch.parameter[-1] == branch.parameter[0]
        after = np.arange(len(branch.parameter)) > fold.index
        assert after.any()
        for parameter, values, beyond in zip(branch.parameter, branch.multipliers, after, strict=True):
            other = BouncingBall(restitution, max(parameter / unit, begins), late=not beyond)
            assert values.sum().real == pytest.approx(other.trace, abs=1e-6)
        # but for the points next to the fold, whose multipliers are 1 to the root of round-off
        assert np.count_nonzero(branch.stable == after) <= 2


def test_a_branch_ends_at_the_end_of_its_range_just_after_an_impact_passes_the_start():
    restitution = 0.5
    begins, doubles = beginning(restitution), doubling(restitution)
    orbit, passes = (
        BouncingBall(restitution, 0.5 * (begins + doubles)),
        BouncingBall(restitution, 0.6 * doubles + 0.4 * begins),
    )
    data, unit = bouncing(orbit)[0], 10.0 / (2 * math.pi) ** 2
    position, velocity = orbit.at(passes.phase / (2 * math.pi)) - [10.0, 0.0]
    data = data.replace({
        "damper.0.position": position, "damper.0.velocity": velocity, "time": {"periods": 1, "transient": 0},
        "excitation.harmonic": [{"order": 1, "amplitude": 1.0, "phase": math.degrees(passes.phase)}],
    })  # fmt: skip
    table = {"parameter": "structure.displacement_amplitude", "from": unit * orbit.acceleration}
    end = BouncingBall(restitution, 1.003 * passes.acceleration)
    (branch,) = orbits(data.replace({"orbit": {"step": 0.05} | table | {"to": unit * end.acceleration}})).branches
    assert "at the start of the period" in branch.special[0].note
    assert branch.parameter[-1] == unit * end.acceleration and branch.end == "the end of the parameter's range"
    assert branch.multipliers[-1].sum().real == pytest.approx(end.trace, abs=1e-8)


def test_the_branch_without_contact_grazes_where_its_amplitude_is_the_gap():
    table = {"parameter": "excitation.force", "from": 0.05, "to": 0.2, "start": "linear", "step": 0.1, "max_step": 0.5}
    (branch,) = orbits(stopped(0.05).replace({"orbit": table | {"min_step": 0.05, "max_points": 20}})).branches
    (place, *_) = [point.parameter for point in branch.special if point.kind == "grazing"]
    assert place == pytest.approx(0.1, rel=1e-8)


@pytest.mark.parametrize(("ratio", "friction", "stops"), [(0.6, 0.2, False), (0.6, 0.7, True), (0.4, 0.6, True)])
def test_newtons_method_finds_den_hartogs_orbit_from_the_end_of_a_run(ratio, friction, stops):
    """A run of five periods from rest; the map of sliding motion is smooth, that of sticking has lost a dimension."""
    orbit = DryFriction(ratio, friction, stops)
    data = rubbing(orbit).replace({"time": {"periods": 5, "transient": 0}})
    found = find_orbit(data)
    assert found.status is OrbitStatus.OK
    assert found.iterations < 6
    assert found.state == pytest.approx(orbit.at(0.0), abs=1e-11)
    assert np.sort_complex(found.multipliers) == pytest.approx(np.sort_complex(orbit.multipliers), abs=1e-9)
