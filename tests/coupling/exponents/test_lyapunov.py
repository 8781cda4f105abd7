"""Lyapunov exponents against closed forms, the determinants of impacts, and neighbouring motions of the engine."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.coupling.orbits.test_closed_forms import GAP, gapped, stopped
from tests.tools.closed_form_scenes import scene
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.exponents.lyapunov import MotionKind, lyapunov
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.scene import LEAST_EXPONENTS
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: above the Neimark-Sacker point of the closed form the symmetric motion becomes a torus, and further above chaos
BORDER = GAP.neimark_sacker(1.1, 1.2)


def settled(beyond):
    """A scene beyond the border, and a state in which it has settled."""
    orbit = replace(GAP, omega=BORDER + beyond)
    data = gapped(orbit)
    begin = period_map(data).restart_of(1.001 * orbit.state)
    return data, simulate(data.replace({"time": {"periods": 12000, "transient": 11900}}), start=begin).final


def oscillator(damping, frequency=0.21, **tables):
    structure = {"model": "rigid", "mass": 2.0, "stiffness": 3.0, "damping": damping}
    return scene(
        structure=structure, excitation={"frequency": frequency, "force": 1.0},
        time={"periods": 64, "transient": 32}, **tables,
    )  # fmt: skip


BODY = {"cavity": [{"name": "c", "gap": 100.0}], "damper": [{"cavity": "c", "mass": 0.1, "friction": 0.0}]}


@pytest.mark.parametrize(("tables", "neutral"), [({}, 0), (BODY, 2)])
def test_a_linear_oscillator_has_the_real_parts_of_its_eigenvalues(tables, neutral):
    """A body that floats beside it is neutral: two exponents of zero that do not count."""
    found = lyapunov(oscillator(0.4, **tables), 64)
    assert found.neutral == neutral and found.status is PassageStatus.OK
    assert found.exponents == pytest.approx([-0.1, -0.1], abs=1e-10)
    assert found.motion is MotionKind.PERIODIC and found.repeats == 1 and found.periods == 32


def test_a_fast_oscillator_has_no_neutral_direction():
    """In SI units displacement and velocity differ by 1e5, and derivatives of one by the other by 1e10."""
    structure = {"model": "rigid", "mass": 1.0, "stiffness": 1e10, "damping": 400.0}
    data = scene(
        structure=structure, excitation={"frequency": 1.2e4, "force": 1.0}, time={"periods": 600, "transient": 500}
    )
    found = lyapunov(data, 64)
    assert found.neutral == 0 and found.exponents == pytest.approx([-200.0, -200.0], rel=1e-8)


def test_an_overdamped_oscillator_has_two():
    found = lyapunov(oscillator(8.0), 64)
    assert found.exponents == pytest.approx([-2 + math.sqrt(2.5), -2 - math.sqrt(2.5)], abs=1e-10)


def test_a_body_that_sticks_is_no_direction():
    """Where it rests nothing changes, and a speed is lost at once."""
    tables = {"cavity": BODY["cavity"], "damper": [{"cavity": "c", "mass": 0.5, "friction": 50.0}]}
    found = lyapunov(oscillator(0.4, **tables), 64)
    assert found.neutral == 1
    assert found.exponents == pytest.approx([-0.08, -0.08, -math.inf], abs=1e-10)


def test_a_body_in_free_flight_on_a_shaker_has_none():
    shaker = {"model": "prescribed", "displacement_amplitude": 1e-3}
    found = lyapunov(scene(structure=shaker, excitation={"frequency": 1.0}, time={"periods": 9}, **BODY), 32)
    assert found.neutral == 2 and len(found.exponents) == 0 and math.isnan(found.largest)
    assert found.motion is MotionKind.PERIODIC and found.status is PassageStatus.OK


def test_an_undamped_oscillator_at_another_frequency_is_quasi_periodic():
    found = lyapunov(oscillator(0.0).replace({"initial.displacement": 0.3}), 300)
    assert found.repeats == 0 and found.motion is MotionKind.QUASI_PERIODIC
    assert np.abs(found.exponents).max() < 1e-12


def test_few_periods_do_not_tell_a_torus():
    data, start = settled(1e-3)
    assert lyapunov(data, 100, start).motion is MotionKind.UNDECIDED


def test_a_linear_motion_need_not_have_settled():
    """At resonance a decaying motion turns by nearly nothing per period: mean growths would take long to be right."""
    data = oscillator(0.04, math.sqrt(1.5) / (2 * math.pi)).replace({"time": {"periods": 10, "transient": 0}})
    found = lyapunov(data, 64)
    assert found.repeats == 0 and found.motion is MotionKind.PERIODIC
    assert found.exponents == pytest.approx([-0.01, -0.01], abs=1e-10)


@pytest.mark.parametrize("omega", [0.75, 1.05])
def test_a_periodic_motion_has_the_logarithms_of_its_multipliers(omega):
    orbit = replace(GAP, omega=omega)
    data = gapped(orbit)
    found = lyapunov(data, 400, period_map(data).restart_of(orbit.state * (1 + 1e-8)))
    assert found.motion is MotionKind.PERIODIC and found.repeats == 1
    expected = np.sort(np.log(np.abs(np.linalg.eigvals(orbit.half @ orbit.half))))[::-1] / orbit.period
    assert found.exponents == pytest.approx(expected, abs=1e-9)
    assert found.error < 1e-9


def test_a_run_on_an_unstable_orbit_is_not_called_periodic():
    """It repeats to round-off, and leaves: the exponent is that of the orbit, and positive."""
    orbit = replace(GAP, omega=BORDER + 0.02)
    data = gapped(orbit)
    found = lyapunov(data, 32, period_map(data).restart_of(orbit.state))
    assert found.repeats == 1 and found.motion is MotionKind.UNDECIDED
    multiplier = np.abs(np.linalg.eigvals(orbit.half @ orbit.half)).max()
    assert found.largest == pytest.approx(math.log(multiplier) / orbit.period, abs=1e-6) and multiplier > 1


def test_a_torus_beyond_a_neimark_sacker_point():
    """The largest exponent is zero; the next is twice the rate at which the unstable orbit is left, to first order."""
    data, start = settled(1e-3)
    found = lyapunov(data, 500, start)
    assert found.motion is MotionKind.QUASI_PERIODIC and found.repeats == 0
    assert abs(found.largest) < found.error + math.log(500) / 500 / found.period
    orbit = replace(GAP, omega=BORDER + 1e-3)
    leaves = math.log(np.abs(np.linalg.eigvals(orbit.half @ orbit.half)).max()) / orbit.period
    assert found.exponents[1] == pytest.approx(-2 * leaves, abs=found.confidence[1])
    assert found.exponents[1] < -found.confidence[1]


def test_chaos_agrees_with_neighbouring_motions_and_the_damping():
    """Neighbours, renormalised, use the engine only; elastic impacts keep volumes, which damping alone shrinks."""
    data = gapped(replace(GAP, restitution=1.0, omega=0.9))
    data, periods = data.replace({"damper.0.velocity": 0.5, "time": {"periods": 100, "transient": 50}}), 300
    # impacts may cease at last, after a time that hangs on the last bit: some start still has them
    for speed in np.linspace(0.5, 0.9, 9):
        start = simulate(data.replace({"damper.0.velocity": float(speed)})).final
        found = lyapunov(data, periods, start)
        if found.motion is MotionKind.CHAOTIC:
            break
    assert found.motion is MotionKind.CHAOTIC and found.largest > 3 * found.error
    assert found.exponents.sum() == pytest.approx(-GAP.damping / GAP.mass, abs=1e-10)

    map_ = period_map(data)
    state, small = map_.state_of(start), 1e-7
    apart, growth = np.full(4, 0.5), []
    while len(growth) < periods:  # chaos depends on the last bit: the same runs, as many periods as before in each
        more = min(max(LEAST_EXPONENTS, len(growth)), periods - len(growth))
        for after, _, _ in map_.each_period(state, more):
            other = map_(state + small * map_.scale * apart, False)
            apart = (other.state - after) / map_.scale / small
            growth.append(math.log(np.linalg.norm(apart)))
            apart, state = apart / np.linalg.norm(apart), after
    assert len(growth[periods // 10 :]) == 270  # directions align themselves before
    assert np.mean(growth[periods // 10 :]) / found.period == pytest.approx(found.largest, abs=0.2 * found.error)


def test_a_passage_without_derivative_leaves_no_exponent():
    """At the force at which an oscillator touches its stop, neighbours on either side part differently."""
    data = stopped(0.1)
    walked = period_map(data)
    found = lyapunov(data, 64, walked.restart_of(walked.linear_orbit()))
    assert found.status is PassageStatus.GRAZING and found.motion is MotionKind.UNDECIDED
    assert math.isnan(found.largest) and math.isnan(found.error) and found.to_json()["exponents"] == []


def test_the_start_is_the_end_of_the_run():
    data = gapped(replace(GAP, omega=1.05)).replace({"time": {"periods": 60, "transient": 20}})
    own, given = lyapunov(data, 32), lyapunov(data, 32, simulate(data).final)
    assert own.exponents == pytest.approx(given.exponents, abs=0.0)
    assert own.neutral == 2  # the body floats


@pytest.mark.parametrize(
    ("change", "periods", "words"),
    [
        ({}, 31, "at least 32"),
        ({"solver.method": "moreau"}, 32, "exact engine"),
        ({"solver.max_events": 1, "damper.0.velocity": 5.0}, 32, "ends early"),
    ],
)
def test_bad_input_is_one_line(change, periods, words):
    with pytest.raises(InputError, match=words) as caught:
        lyapunov(gapped(replace(GAP, omega=1.05)).replace(change), periods)
    assert "\n" not in str(caught.value)
