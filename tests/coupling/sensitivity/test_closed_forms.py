"""Derivatives of motions by the numbers of their scenes against closed forms, in 40 digits (reference/orbit_numbers).

Relative to the larger of a derivative and of its result over its number.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.reference import orbit_numbers as exact
from tests.reference.orbit_bouncing_ball import BouncingBall, beginning, doubling
from tests.reference.orbit_dry_friction import DryFriction
from tests.reference.orbit_gap_oscillator import GapOscillator
from tests.tools.closed_form_scenes import ball, scene
from vanedamp.coupling.orbits.newton import OrbitStatus
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.orbit import Orbit

#: error allowed
CLOSE = 1e-10


def sensed(data, state, paths):
    """The sensitivity of the orbit through a state, which is one."""
    orbit = vd.find_orbit(data, period_map(data).restart_of(np.array(state)))
    assert orbit.status is OrbitStatus.OK
    assert orbit.state == pytest.approx(np.array(state), rel=1e-10, abs=1e-10)
    found = vd.sensitivity(orbit, paths)
    assert found.status == "ok", found.note
    return found


def agrees(found, slope, value, number):
    """Whether a derivative is the exact one, to CLOSE of it or of the result over the number."""
    assert found == pytest.approx(float(slope), rel=CLOSE, abs=CLOSE * abs(float(value) / number))


def compare(orbit, numbers, paths, results):
    """Compare all derivatives: paths are those of `numbers`, results: name in the closed form -> (P,) as found."""
    values, slopes = exact.derivatives(orbit, numbers)
    assert list(paths) == list(numbers)
    for name, derivative in results.items():
        for number, slope in zip(numbers, derivative, strict=True):
            agrees(slope, slopes[number][name], values[name], numbers[number])


def flown(gap=0.8, position=0.0, velocity=1.0, restitution=1.0):
    """A body between walls at rest, u' = velocity without force, for a second."""
    return scene(
        structure={"model": "prescribed", "displacement_amplitude": 1e-15}, excitation={"frequency": 1.0},
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": gap}], time={"periods": 1, "transient": 0},
        damper=[{"cavity": "c", "mass": 1.0, "restitution": restitution, "position": position, "velocity": velocity}],
    )  # fmt: skip


FLIGHT = ("cavity.c.gap", "damper.0.position", "damper.0.velocity")


def test_a_flight_ends_where_its_wall_is():
    """u' = 1 until u = q, with q half the gap: T = q, and dT/dq = 1."""
    found = vd.sensitivity(flown(), FLIGHT)
    assert found.status == "ok"
    assert found.impact_time == pytest.approx([0.4], rel=1e-12)
    assert 2 * found.impact_time_derivative[:, 0] == pytest.approx([1.0], rel=CLOSE)
    assert found.impact_time_derivative[:, 1:] == pytest.approx(np.array([[-1.0, -0.4]]), rel=CLOSE)
    assert found.impact_speed_derivative == pytest.approx(np.array([[0.0, 0.0, 1.0]]), abs=CLOSE)


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_reset_moves_the_end_back(restitution):
    """The distance u from the wall at p that a body has left, u' = e since the reset to 0: u(1) = e (1 - p).

    With e = 1 du(1)/dp = -1. In the slip, p - u, it is 1 + e.
    """
    found = vd.sensitivity(flown(restitution=restitution), (*FLIGHT, "damper.0.restitution"))
    place, rate = found.state[:2]
    assert 0.4 - place == pytest.approx(restitution * 0.6, rel=1e-12)
    assert rate == pytest.approx(-restitution, rel=1e-12)
    by_gap, by_position, by_velocity, by_restitution = found.state_derivative[0]
    assert 1.0 - 2 * by_gap == pytest.approx(-restitution, rel=CLOSE)
    assert by_position == pytest.approx(-restitution, rel=CLOSE)
    assert by_velocity == pytest.approx(-restitution, rel=CLOSE)
    assert by_restitution == pytest.approx(-0.6, rel=CLOSE)


def shaken(before, **excitation):
    """A base that moves by sin(omega t), whose first summit a body's first impact precedes by an angle, rad."""
    omega, gap, speed = 2 * math.pi, 8.0, 8.0
    time = (math.pi / 2 - before) / omega
    return scene(
        structure={"model": "prescribed", "displacement_amplitude": 1.0}, excitation={"frequency": 1.0} | excitation,
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": gap}], time={"periods": 1, "transient": 0},
        damper=[{"cavity": "c", "mass": 1.0, "restitution": 0.5, "velocity": speed - omega,
                 "position": gap / 2 - speed * time + math.sin(omega * time)}],
    )  # fmt: skip


@pytest.mark.parametrize("before", [3e-5, -3e-5, 1e-6])
def test_an_event_next_to_a_summit_does_not_move_the_summit(before):
    """The base has its amplitude, whatever the body does; its height at the impact, before^2/2 below, does not."""
    found = vd.sensitivity(shaken(before), ("structure.displacement_amplitude", "damper.0.position", "cavity.c.gap"))
    assert (found.status, found.note) == ("ok", "")
    assert math.pi / 2 - 2 * math.pi * found.impact_time[0] == pytest.approx(before, rel=1e-8)
    assert found.peak == pytest.approx([1.0], rel=1e-14)
    for derivative in (found.peak_derivative[0], found.derivatives["amplitude_max"]):
        assert derivative == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)


def test_two_summits_of_one_height_part():
    """sin(omega t) + 0.2 sin(2 omega t + phase) is as high as it is deep at phase 0: one of both grows, one shrinks."""
    found = vd.sensitivity(
        shaken(0.5, harmonic=[{"order": 2, "amplitude": 0.2, "phase": 0.0}]), ["excitation.harmonic.0.phase"]
    )
    assert found.status == "ok" and found.note.startswith("summits of one height part")


BALL = {
    "amplitude": "structure.displacement_amplitude", "frequency": "excitation.frequency",
    "gravity": "gravity.acceleration", "restitution": "damper.0.restitution",
}  # fmt: skip


def bouncing(restitution, share):
    """A ball between where its orbit begins and where it doubles; its numbers, its scene and its state."""
    orbit = BouncingBall(restitution, beginning(restitution) * (1 - share) + doubling(restitution) * share)
    data = ball(restitution, orbit.acceleration, cavity=[{"name": "c", "gap": 20.0}], damper=[
        {"cavity": "c", "mass": 1.0, "restitution": restitution, "position": -10.0}
    ])  # fmt: skip
    numbers = {"amplitude": data.structure.displacement_amplitude, "frequency": 1.0, "gravity": 10.0}
    return numbers | {"restitution": restitution}, data, orbit.state - [10.0, 0.0]


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_a_ball_on_a_table(restitution):
    numbers, data, state = bouncing(restitution, 0.6)
    found = sensed(data, state, (*BALL.values(), "cavity.c.gap", "damper.0.mass"))
    results = {
        "height": found.state_derivative[0], "rate": found.state_derivative[1],
        "time": found.impact_time_derivative[0], "speed": found.impact_speed_derivative[0],
    }  # fmt: skip
    compare(exact.ball, numbers, BALL, {name: slopes[:4] for name, slopes in results.items()})
    # the height is that over a floor at half the gap below; the mass does not matter
    assert found.state_derivative[:, 4] == pytest.approx([-0.5, 0.0], abs=CLOSE)
    assert found.state_derivative[:, 5] == pytest.approx([0.0, 0.0], abs=CLOSE)


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.8])
def test_the_border_of_doubling_moves_with_the_restitution(restitution):
    """det(D + 1) = 0 along orbits that the derivatives continue: a function of two numbers, whose slopes give one."""
    numbers, data, state = bouncing(restitution, 1.0)
    paths = (BALL["amplitude"], BALL["restitution"])
    found, slopes = sensed(data, state, paths), []
    for j, path in enumerate(paths):
        number = numbers[("amplitude", "restitution")[j]]

        def turned(change, j=j, path=path, number=number):
            walked = period_map(data.replace({path: number + change}))
            return np.linalg.det(walked(found.state + change * found.state_derivative[:, j]).derivative + np.eye(2))

        step = 2e-3 * number
        weights = zip((4 / 5, -1 / 5, 4 / 105, -1 / 280), (1, 2, 3, 4), strict=True)
        slopes.append(sum(w * (turned(i * step) - turned(-i * step)) for w, i in weights) / step)
    border = {"frequency": 1.0, "gravity": 10.0, "restitution": restitution}
    agrees(-slopes[1] / slopes[0], exact.derivatives(exact.doubling, border)[1]["restitution"]["amplitude"], 0, 1)


STOPPED = {
    "mass": "structure.mass", "damping": "structure.damping", "stiffness": "structure.stiffness",
    "force": "excitation.force", "frequency": "excitation.frequency", "gap": "stop.0.gap",
    "restitution": "stop.0.restitution",
}  # fmt: skip


@pytest.mark.parametrize(("force", "damping"), [(0.5, 0.1), (1.0, 0.1), (2.0, 0.3)])
def test_an_oscillator_below_a_stop(force, damping):
    """x'' + c x' + k x = A sin W t, x <= g: all derivatives, and A dv/dA + g dv/dg = v of the speed of impact."""
    numbers = {"mass": 1.0, "damping": damping, "stiffness": 1.0, "force": force, "frequency": 1 / (2 * math.pi)}
    numbers |= {"gap": 1.0, "restitution": 0.8}
    data = stopped(numbers, damping=damping)
    values, _ = exact.derivatives(exact.impacts, numbers)
    found = sensed(data, [float(values["place"]), float(values["rate"])], tuple(STOPPED.values()))
    assert found.impact_speed == pytest.approx([float(values["speed"])], rel=1e-11)
    compare(exact.impacts, numbers, STOPPED, {
        "place": found.state_derivative[0], "rate": found.state_derivative[1],
        "time": found.impact_time_derivative[0], "speed": found.impact_speed_derivative[0],
    })  # fmt: skip
    by = dict(zip(STOPPED, found.impact_speed_derivative[0], strict=True))
    assert force * by["force"] + by["gap"] == pytest.approx(float(values["speed"]), rel=CLOSE)


def stopped(numbers, **damping):
    return scene(
        structure={"model": "rigid", "mass": numbers["mass"], "stiffness": numbers["stiffness"], **damping},
        excitation={"frequency": numbers["frequency"], "force": numbers["force"]},
        stop=[{"side": "right", "gap": numbers["gap"], "restitution": numbers["restitution"]}],
    )  # fmt: skip


def test_a_damping_ratio_stays_as_mass_and_stiffness_change():
    """c = 2 ratio sqrt(k m): its derivative, and what it adds to those by mass and stiffness."""
    numbers = {"mass": 1.3, "ratio": 0.07, "stiffness": 0.9, "force": 1.1, "frequency": 0.15, "gap": 1.0}
    numbers |= {"restitution": 0.6}

    def orbit(n):
        return exact.impacts(n | {"damping": 2 * n["ratio"] * exact.mp.sqrt(n["mass"] * n["stiffness"])})

    values, _ = exact.derivatives(orbit, numbers)
    paths = {("ratio" if name == "damping" else name): path for name, path in STOPPED.items()}
    paths["ratio"] = "structure.damping_ratio"
    state = [float(values["place"]), float(values["rate"])]
    found = sensed(stopped(numbers, damping_ratio=numbers["ratio"]), state, tuple(paths.values()))
    results = {"speed": found.impact_speed_derivative[0], "place": found.state_derivative[0]}
    compare(orbit, numbers, paths, results)


RUBBED = {
    "mass": "structure.mass", "stiffness": "structure.stiffness", "force": "excitation.force",
    "frequency": "excitation.frequency", "limit": "friction_damper.0.friction",
}  # fmt: skip


@pytest.mark.parametrize(
    ("ratio", "friction", "stops"),
    [(0.6, 0.2, False), (0.6, 0.5, False), (1.5, 0.3, False), (0.6, 0.7, True), (0.4, 0.6, True)],
)
def test_den_hartogs_amplitude(ratio, friction, stops):
    """Without stops and with them; the limit of friction is the coefficient times a normal force of 1 N."""
    known = DryFriction(ratio, friction, stops)
    numbers = {"mass": 1.0, "stiffness": 1.0, "force": 1.0, "frequency": ratio / (2 * math.pi), "limit": friction}
    orbit = exact.dry_friction
    if stops:
        slips, half = known._way.start / ratio * ratio, math.pi / ratio
        guess = known.amplitude, slips, slips + known._way.duration - half
        orbit = lambda n: exact.sticking(n, guess)  # noqa: E731
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0},
        excitation={"frequency": numbers["frequency"], "force": 1.0},
        friction_damper=[{"normal_force": 1.0, "friction": friction}],
    )  # fmt: skip
    found = sensed(data, known.at(0.0), (*RUBBED.values(), "friction_damper.0.normal_force"))
    assert found.peak == pytest.approx([known.amplitude], rel=1e-12)
    results = {"amplitude": found.peak_derivative[0], "place": found.state_derivative[0]}
    results |= {"rate": found.state_derivative[1]}
    compare(orbit, numbers, RUBBED, {name: slopes[:5] for name, slopes in results.items()})
    for slopes in results.values():  # the product counts
        assert slopes[5] == pytest.approx(friction * slopes[4], rel=CLOSE, abs=CLOSE)


JENKINS = STOPPED | {"element": "friction_damper.0.stiffness", "limit": "friction_damper.0.friction"}
del JENKINS["gap"], JENKINS["restitution"]


@pytest.mark.parametrize(("element", "limit", "frequency"), [(2.0, 0.6, 0.2), (0.8, 0.5, 0.17), (5.0, 0.4, 0.1)])
def test_a_spring_and_a_jenkins_element(element, limit, frequency):
    """Amplitude, state and elongation, which slip and stick once in each half period, by all numbers."""
    numbers = {"mass": 1.0, "damping": 0.05, "stiffness": 1.0, "force": 1.0, "frequency": frequency}
    numbers |= {"element": element, "limit": limit}
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.05},
        excitation={"frequency": frequency, "force": 1.0}, time={"periods": 300, "transient": 0},
        friction_damper=[{"normal_force": 1.0, "friction": limit, "stiffness": element}],
    )  # fmt: skip
    walked, run = period_map(data), vd.simulate(data)
    passage = walked(walked.state_of(run.final))
    (slips,) = [crossing.time for crossing in passage.crossings if crossing.name == "slips casing.0 left"]
    sticks = [crossing.time for crossing in passage.crossings if crossing.name == "sticks casing.0"]
    turns = max(time - (time > slips) / frequency for time in sticks)  # the last before
    orbit = lambda n: exact.jenkins(n, (passage.peaks[0], turns, slips))  # noqa: E731
    values, _ = exact.derivatives(orbit, numbers)
    state = [float(values[name]) for name in ("place", "rate", "elongation")]
    found = sensed(data, state, tuple(JENKINS.values()))
    assert found.peak == pytest.approx([float(values["amplitude"])], rel=1e-12)
    compare(orbit, numbers, JENKINS, {
        "amplitude": found.peak_derivative[0], "place": found.state_derivative[0],
        "rate": found.state_derivative[1], "elongation": found.state_derivative[2],
    })  # fmt: skip


@pytest.mark.parametrize("ratio", [1e-3, 1e-4, 1e-6])
def test_a_motion_with_little_damping_is_at_no_fold(ratio):
    """Multipliers are as close to 1 as 2 pi zeta; amplitudes are F / |k - m w^2 + 2 i zeta w| with k = m = 1."""
    omega = 0.9
    scene = vd.Scene.of(
        {"structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": ratio},
         "excitation": {"frequency": omega / (2 * math.pi), "force": 1.0}}, "scene"
    )  # fmt: skip
    orbit = vd.find_orbit(replace(scene, orbit=Orbit(start="linear")))
    found = vd.sensitivity(orbit, ["structure.stiffness", "structure.mass"])
    assert orbit.stable and found.status == "ok", found.note
    dynamic = 1.0 - omega**2 + 2j * ratio * omega
    # the damping ratio stays: c = 2 zeta sqrt(k m)
    turned = np.array([1.0 + 1j * ratio * omega, -(omega**2) + 1j * ratio * omega])
    exact = -(turned / dynamic).real / abs(dynamic)
    assert found.derivatives["amplitude_harmonic"] == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(("away", "status"), [(1e-3, "ok"), (1e-5, "ok"), (1e-14, "fold")])
def test_derivatives_next_to_a_fold(away, status):
    """Two orbits meet there as roots do: the speed of approach turns by the root of the distance."""
    gap = GapOscillator(1.0, 0.1, 1.0, body=0.1, half_gap=8.0, restitution=0.6, force=1.0, omega=1.0)
    omega = gap.fold(1.25, 1.4) * (1.0 - away)
    own = replace(gap, omega=omega)
    scene = vd.Scene.of(
        {"structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
         "excitation": {"frequency": omega / (2 * math.pi), "force": 1.0}, "gravity": {"acceleration": 0.0},
         "cavity": [{"name": "c", "gap": 16.0}], "damper": [{"cavity": "c", "mass": 0.1, "restitution": 0.6}],
         "orbit": {"periods": 1}}, "scene"
    )  # fmt: skip
    passages = period_map(scene)
    orbit = vd.find_orbit(scene, passages.restart_of(own.state))
    found = vd.sensitivity(orbit, ["excitation.frequency"])
    assert found.status == status
    if status == "ok":
        step = 1e-3 * away * omega
        one, two = (
            replace(gap, omega=omega + k * step).approach - replace(gap, omega=omega - k * step).approach
            for k in (1, 2)
        )  # fmt: skip
        exact = 2 * math.pi * (8 * one - two) / (12 * step)
        assert np.abs(found.impact_speed_derivative[:, 0]) == pytest.approx([abs(exact)] * 2, rel=1e-4)


def test_a_stuck_friction_damper_leaves_the_mean_position_open():
    """X is F over the dynamic stiffness with the damper's spring; the largest |x| has the offset at which it rests."""
    stuck = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.05},
        excitation={"frequency": 12.0, "force": 1.0}, initial={"displacement": 3e-5, "velocity": 0.0},
        friction_damper=[{"normal_force": 100.0, "friction": 0.5, "stiffness": 1e3}],
        time={"periods": 200, "transient": 150}, orbit={"periods": 1},
    )  # fmt: skip
    found = vd.sensitivity(vd.find_orbit(stuck, vd.simulate(stuck).final), ["excitation.force", "structure.stiffness"])
    omega = 24.0 * np.pi
    X = 1.0 / abs(1.1e4 - omega**2 + 1j * 2.0 * 0.05 * 100.0 * omega)
    assert found.status == "ok" and found.derivatives["amplitude_harmonic"][0] == pytest.approx(X, rel=1e-9)
    # by every number: also by those that no move of the orbit was tried beside
    assert np.isnan(found.derivatives["amplitude_max"]).all() and np.isnan(found.peak_derivative).all()
    assert "amplitude_max" in found.note and "rests" in found.note
