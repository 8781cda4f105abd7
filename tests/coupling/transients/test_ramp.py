"""Run-up and run-down: against independent integrations, Lewis' closed form, steady states and unbroken runs."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vanedamp as vd
from tests.coupling.sweep.test_continuation import BISTABLE, DAMPING, EPS, RATIOS, one_to_one
from tests.coupling.system.test_loads import ring, travelling
from tests.tools.chirp import chirp_response
from tests.tools.processes import ROOT
from tests.tools.tiers import cases
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_amplitudes
from vanedamp.coupling.transients.lewis import peak_ratio
from vanedamp.coupling.transients.ramp import at_frequency, ramp
from vanedamp.coupling.transients.ramp_course import courses, ramped, scene_at
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main

MASS, RATIO, OMEGA, FORCE = 2.0, 0.005, 2 * np.pi * 100.0, 3.0
ONE_MODE = {
    "structure": {"model": "rigid", "mass": MASS, "stiffness": MASS * OMEGA**2, "damping_ratio": RATIO},
    "excitation": {"frequency": 95.0, "force": FORCE},
}
SLIDER = {"cavity": "c", "mass": 0.06, "friction": 0.3, "restitution": 0.6}
BODY = ONE_MODE | {"cavity": [{"name": "c", "gap": 2e-4}], "damper": [SLIDER]}
#: m of the steady response at resonance
STATIC = FORCE / (MASS * OMEGA**2)
ROTOR = {
    "structure": {"model": "rigid", "mass": MASS, "stiffness": 1e4, "damping": 2.0, "centrifugal_stiffness": 0.5},
    "excitation": {"engine_order": 4.0, "force": FORCE},
    "rotation": {"rpm": 100.0},
}


def scene(table: dict, data: dict = ONE_MODE, **further) -> Scene:
    return validate(Scene, {**data, **further, "ramp": table}, "x")


def staircase(run, mass, damping, stiffness, load, start=None):
    """States (p + 1, 2n) at the starts of the periods, by DOP853; load (n,); stiffness: (n, n) at a speed."""
    n = len(load)
    state = [np.zeros(2 * n) if start is None else start]
    inverse = np.linalg.inv(mass)
    for frequency, speed in zip(run.frequency, run.speed, strict=True):
        omega, elastic = 2 * np.pi * frequency, stiffness(speed)

        def rate(t, y, omega=omega, elastic=elastic):
            force = load * np.sin(omega * t) - damping @ y[n:] - elastic @ y[:n]
            return np.concatenate([y[n:], inverse @ force])

        found = solve_ivp(rate, (0, 1 / frequency), state[-1], method="DOP853", rtol=1e-12, atol=1e-16)
        state.append(found.y[:, -1])
    return np.array(state)


# the closed form


PASSAGES = [
    (0.01, 5.0, 0.5, 20.0), (0.001, 15.0, -0.3, 30.0), (0.05, 1.0, 20.0, 2.0), (0.0, 8.0, 0.3, 14.0),
    (1.5, 1.0, 0.5, 9.0),
]  # fmt: skip


@pytest.mark.parametrize(("ratio", "begin", "rate", "span"), PASSAGES)
def test_lewis_against_an_integration(ratio, begin, rate, span):
    """Up, down, undamped and overdamped, by DOP853 to 1e-13."""
    stiffness, damping, t = 100.0, 20 * ratio, np.linspace(0.0, span, 40)

    def motion(t, y):
        return y[1], np.sin(begin * t + rate * t**2 / 2) - damping * y[1] - stiffness * y[0]

    found = solve_ivp(motion, (0, span), [0, 0], method="DOP853", rtol=1e-13, atol=1e-17, t_eval=t).y
    for ours, theirs in zip(chirp_response(stiffness, damping, begin, rate, t), found, strict=True):
        assert np.abs(ours - theirs).max() < 1e-10 * np.abs(theirs).max()


def test_lewis_where_the_error_function_overflows():
    """A slow passage in 1000 digits: long before the resonance erfc has an exponent of a thousand."""
    mpmath = pytest.importorskip("mpmath")
    stiffness, damping, begin, rate = 100.0, 1.0, 2.0, 4e-3
    for t in (1700.0, 2100.0):
        with mpmath.workdps(1000):
            root, total = mpmath.sqrt(mpmath.mpf(damping) ** 2 / 4 - stiffness), 0
            kappa = mpmath.sqrt(mpmath.mpc(0, -mpmath.mpf(rate) / 2))
            for sign in (1, -1):
                value = -mpmath.mpf(damping) / 2 + sign * root
                low, high = (kappa * (s + (begin + 1j * value) / mpmath.mpf(rate)) for s in (0, mpmath.mpf(t)))
                inside = mpmath.exp(value * t + low**2) * (mpmath.erf(high) - mpmath.erf(low))
                total += sign * mpmath.sqrt(mpmath.pi) / (2 * kappa) * inside
            exact = float((total / (2 * root)).imag)
        (x,), _ = chirp_response(stiffness, damping, begin, rate, np.array([t]))
        assert abs(exact) > 1e-3
        # the phase of 13,000 rad is known to its round-off
        assert x == pytest.approx(exact, rel=1e-9)


def test_lewis_long_before():
    """A force that has acted long before leaves no trace of its start: that of rest has decayed."""
    t = np.linspace(4.0, 20.0, 30)
    from_rest = chirp_response(100.0, 2.0, -60.0, 3.0, t + 20.0)
    long_before = chirp_response(100.0, 2.0, -60.0, 3.0, t + 20.0, rest=False)
    for rest, before in zip(from_rest, long_before, strict=True):
        assert rest == pytest.approx(before, abs=1e-9 * np.abs(before).max())


def test_peaks_over_the_rate():
    """The peak of a lightly damped mode, from the whole response; its limits for slow and for quick passages."""
    stiffness, ratio = 1.0, 0.002
    for q in (0.3, 3.0, 30.0):
        rate, begin = q * ratio**2, 0.8
        t = np.linspace(0.0, (1.2 - begin) / rate, 400_001)
        peak = np.abs(chirp_response(stiffness, 2 * ratio, begin, rate, t)[0]).max()
        # start and the mode's other eigenvalue are worth a share of the frequency's width
        assert 2 * ratio * peak == pytest.approx(peak_ratio(np.array([q]))[0], rel=0.01)
    slow, quick = np.array([1e-3, 1e-2]), 1e8
    assert 1 - peak_ratio(slow) == pytest.approx(slow**2 / 2, rel=1e-2)
    # without damping the maximum of a Fresnel integral: |C + iS + (1 + i)/2| has its first, 1.6551, at t = 1.2172
    assert peak_ratio(np.array([quick]))[0] * np.sqrt(quick) == pytest.approx(np.sqrt(np.pi) * 1.65507, rel=1e-3)


# one mode


@pytest.mark.parametrize("rate", cases([16.0, 64.0, -20.0], fast=[64.0, -20.0]))
def test_against_an_independent_integration(rate):
    ends = (90.0, 112.0) if rate > 0 else (112.0, 90.0)
    found = ramp(scene({"from": ends[0], "to": ends[1], "rate": abs(rate)}))
    (run,) = found.runs
    damping, stiffness = np.diag([2 * RATIO * OMEGA * MASS]), np.diag([MASS * OMEGA**2])
    exact = staircase(run, np.diag([MASS]), damping, lambda _: stiffness, np.array([FORCE]))
    assert run.status == "ok" and run.direction == ("up" if rate > 0 else "down")
    for ours, theirs in ((run.displacement, exact[:, 0]), (run.velocity, exact[:, 1])):
        assert np.abs(ours - theirs).max() < 1e-9 * np.abs(theirs).max()
    assert run.energy_residual < 1e-12
    energy = run.energy
    assert energy["excitation"] == pytest.approx(energy["viscous"] + energy["stored"], rel=1e-10)
    stored = 0.5 * MASS * (run.velocity[-1] ** 2 + OMEGA**2 * run.displacement[-1] ** 2)
    assert energy["stored"] == pytest.approx(stored, rel=1e-10)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_staircase_is_of_first_order_beside_the_chirp(direction):
    """Period by period both have whole phases at the same instants; within, the staircase lags behind by at most
    pi rate T^2/4, in the mean by pi rate T^2/6: a shift in time, of which peaks know nothing.
    """
    ends = (90.0, 115.0)[:: int(direction)]
    apart = []
    for rate in (8.0, 32.0, 128.0):
        (run,) = ramp(scene({"from": ends[0], "to": ends[1], "rate": rate})).runs
        times = np.r_[run.time, run.time[-1] + 1 / run.frequency[-1]]
        mode = OMEGA**2, 2 * RATIO * OMEGA, 2 * np.pi * ends[0], 2 * np.pi * run.rate
        # samples of the chirp miss its peak by (pi/200)^2/2
        fine, _ = chirp_response(*mode, np.linspace(0.0, times[-1], 200 * len(times)))
        assert run.peak == pytest.approx(FORCE / MASS * np.abs(fine).max(), rel=3e-4)
        for ours, theirs in zip((run.displacement, run.velocity), chirp_response(*mode, times), strict=True):
            apart.append(np.abs(MASS / FORCE * ours - theirs).max() / np.abs(theirs).max())
            assert apart[-1] < 1.3 * np.pi / 6 * rate / 100.0**2
    order = np.log(np.array(apart[2:]) / np.array(apart[:-2])) / np.log(4.0)
    assert order == pytest.approx(1.0, abs=0.2)


def test_peaks_are_those_of_lewis():
    """Up a little lower, down a little higher than the envelope has it, by the order of the passage's width."""
    found = ramp(scene({"from": 85.0, "to": 115.0, "rate": [8.0, 24.0], "both": True}))
    assert [run.rate for run in found.runs] == [8.0, 24.0, -8.0, -24.0]
    for run in found.runs:
        q = found.lewis_rate(run)
        assert q == pytest.approx(2 * np.pi * abs(run.rate) / (RATIO * OMEGA) ** 2, rel=1e-3)
        assert found.share(run) == pytest.approx(peak_ratio(np.array([q]))[0], rel=0.01)
        assert (run.at_peak("frequency") - 100.0) * run.rate > 0.0
    assert found.tops["undamped_peak"] == pytest.approx(STATIC / (2 * RATIO), rel=1e-4)


def test_slow_runs_tend_to_the_stationary_curve():
    """The amplitude is off by at most 0.57 times Lewis' rate q, max 2 eta/(1 + eta^2)^(5/2); its peak by q^2/2.

    What the mode's other eigenvalue adds is as much up as it takes away down.
    """
    apart, missing, q = [], [], []
    data = ONE_MODE | {"structure": {**ONE_MODE["structure"], "damping_ratio": 0.02}}
    for rate in (5.0, 10.0):
        found = ramp(scene({"from": 92.0, "to": 108.0, "rate": rate, "both": True, "start": "steady"}, data))
        run, _ = found.runs
        stationary = np.interp(run.frequency, found.curves["frequency"], found.curves["undamped"])
        apart.append(np.abs(run.amplitude - stationary).max() / found.tops["undamped_peak"])
        missing.append(np.mean([1 - found.share(run) for run in found.runs]))
        q.append(found.lewis_rate(run))
    assert found.warnings == ()
    assert apart == pytest.approx(0.5725 * np.array(q), rel=0.2)
    assert missing == pytest.approx(1 - peak_ratio(np.array(q)), rel=0.01)


def test_course():
    """Periods are those of the chirp's phase, as many as fit in, and the values their means."""
    one, two, back = courses(scene({"from": 90.0, "to": 110.0, "rate": [3.0, 300.0], "both": True}))[:3]
    for run, begin, sign in ((one, 90.0, 3.0), (two, 90.0, 300.0), (back, 110.0, -3.0)):
        assert run.rate == sign
        ends = run.time + 1 / run.frequency
        assert run.time[1:] == pytest.approx(ends[:-1], rel=1e-13)
        phase = begin * ends + sign * ends**2 / 2
        assert phase == pytest.approx(np.arange(1, len(ends) + 1), rel=1e-12)
        assert run.frequency == pytest.approx(begin + sign * (run.time + ends) / 2, rel=1e-12)
        left = abs(110.0 + 90.0 - begin - (begin + sign * ends[-1]))
        assert 0.0 <= left < abs(sign) / 90.0
    (counted,) = courses(scene({"from": 90.0, "to": 110.0, "periods": 500}))
    assert len(counted.time) == 500
    assert counted.rate * (counted.time[-1] + 1 / counted.frequency[-1]) == pytest.approx(20.0)


def test_another_frequency_leaves_the_rest_of_the_system():
    """In place of a new assembly, which it must equal."""
    data = BODY | {"excitation": {"frequency": 95.0, "force": 3.0, "harmonic": [{"order": 3, "amplitude": 0.5}]}}
    given = validate(Scene, data, "x")
    changed, made = at_frequency(assemble(given), 97.0), assemble(given.replace({"excitation.frequency": 97.0}))
    for name in made._fields:
        np.testing.assert_allclose(getattr(changed, name), getattr(made, name), rtol=1e-15)


# bodies

ROUGH, WIDE = {**SLIDER, "friction": 1.0}, {"name": "c", "gap": 1e-2}
BLOCK = {**SLIDER, "shape": "block", "length": 0.012, "height": 0.01}
CASES = {
    "sticks and slips": (BODY | {"damper": [ROUGH], "cavity": [WIDE]}, 100.0),
    "impacts": (BODY, 100.0),
    "chatters": (BODY | {"damper": [{**SLIDER, "friction": 0.0}], "gravity": {"orientation_deg": 60.0}}, 97.0),
    "is compressed": (BODY | {"contact": {"law": "compliant", "stiffness": 2e6}}, 100.0),
    "tilts": (BODY | {"cavity": [{"name": "c", "gap": 2e-4, "play": 1e-4}], "damper": [BLOCK]}, 100.0),
    "tilts on springs": (
        BODY | {
            "cavity": [{"name": "c", "gap": 2e-4, "play": 1e-4}], "damper": [BLOCK],
            "contact": {"law": "compliant", "stiffness": 1e7},
        }, 100.0,
    ),
    "spring before a slider": (
        ONE_MODE | {"friction_damper": [{"normal_force": 1.0, "friction": 0.5, "stiffness": 2e5}]}, 100.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_contacts_go_on_over_the_ends_of_periods(case):
    """A ramp that hardly changes is one unbroken run, whatever contacts do at the ends of periods.

    Until the motions of a chaotic case part: a difference of 1e-12 grows by less than 3 a period here.
    """
    data, frequency = CASES[case]
    given, periods = validate(Scene, data, "x").replace({"excitation.frequency": frequency}), 24
    table = {"from": frequency, "to": frequency * (1 + 1e-13), "periods": periods}
    (run,) = ramp(scene(table, given.to_dict())).runs
    whole = simulate(given.replace({"time": {"periods": periods, "transient": 0}}), events=True)
    assert run.status == "ok" and whole.status == "ok"
    assert run.amplitude == pytest.approx(whole.peak, rel=1e-4)
    assert run.displacement == pytest.approx(whole.section[:, 0], abs=1e-4 * run.peak)
    assert sum(run.impacts) == sum(event.kind == "impact" for event in whole.event_list)
    for name in ("excitation", "viscous", "friction", "impact", "contact", "stored"):
        assert run.energy[name] == pytest.approx(whole.energy[name], abs=1e-4 * run.energy["excitation"])
    assert run.energy_residual < 1e-9
    assert run.energy["rotation"] == 0.0


@pytest.mark.parametrize("ends", [(95.0, 103.0), (103.0, 95.0)])
def test_impacts_against_an_independent_integration(ends):
    """A body without friction between its walls: DOP853 that stops at each impact, over the same staircase."""
    mass, restitution, gap = SLIDER["mass"], SLIDER["restitution"], 2e-4
    data = BODY | {"damper": [{**SLIDER, "friction": 0.0, "position": 3e-5}]}
    (run,) = ramp(scene({"from": ends[0], "to": ends[1], "rate": 25.0}, data)).runs

    def motion(t, y, omega):
        return y[1], (FORCE * np.sin(omega * t) - 2 * RATIO * OMEGA * MASS * y[1]) / MASS - OMEGA**2 * y[0], y[3], 0.0

    walls = [lambda t, y, _: gap / 2 + y[2] - y[0], lambda t, y, _: gap / 2 - y[2] + y[0]]
    for wall in walls:
        wall.terminal, wall.direction = True, -1
    state, found, impacts = np.array([0.0, 0.0, 3e-5, 0.0]), [0.0], 0
    for frequency in run.frequency:
        time, omega = 0.0, 2 * np.pi * frequency
        while time < 1 / frequency:
            part = solve_ivp(
                motion, (time, 1 / frequency), state, "DOP853", args=(omega,), events=walls, rtol=1e-12, atol=1e-16
            )  # fmt: skip
            time, state = part.t[-1], part.y[:, -1]
            if part.status == 1:
                impulse = (1 + restitution) * (state[3] - state[1]) / (1 / MASS + 1 / mass)
                state[1], state[3] = state[1] + impulse / MASS, state[3] - impulse / mass
                impacts += 1
        found.append(state[0])
    assert run.impacts.sum() == impacts > 20
    assert np.abs(run.displacement - found).max() < 1e-6 * np.abs(found).max()


def test_a_body_that_stays_at_rest():
    """Below its friction a body is carried along: stuck in every period until it slides, and never when it slides."""
    data = BODY | {"damper": [ROUGH], "cavity": [WIDE]}
    found = ramp(scene({"from": 80.0, "to": 103.0, "rate": 40.0}, data))
    (run,) = found.runs
    (stuck,) = run.stuck.T
    slides = np.flatnonzero(~stuck)[0]
    assert 5 < slides < len(stuck) - 20 and not stuck[-5:].all()
    # it sticks while its floor's acceleration stays below that of friction
    assert run.amplitude[:slides].max() * (2 * np.pi * run.frequency[slides]) ** 2 < 1.1 * 9.81
    assert run.impacts.sum() == 0
    assert run.energy["friction"] > 0.0


@pytest.mark.parametrize(("periods", "within"), [(900, 0.1), pytest.param(15000, 0.02, marks=pytest.mark.slow)])
def test_hysteresis_over_the_jumps(periods, within):
    """Slow runs follow the branches of sweeps, each beyond the resonance on another one than the run back.

    A body that begins at rest floats until the structure's amplitude reaches half the gap, and one that comes from the
    resonance goes on to hit both walls: both in closed form (tests/coupling/sweep/test_continuation.py).
    """
    table = {"from": RATIOS[0] / (2 * np.pi), "to": RATIOS[-1] / (2 * np.pi), "periods": periods, "both": True}
    data = {name: value for name, value in BISTABLE.items() if name != "sweep"}
    runs = ramp(scene({**table, "start": "steady"}, data)).runs
    assert [run.rate > 0.0 for run in runs] == [True, False]
    for run in runs:
        assert run.status == "ok"
        ratios = 2 * np.pi * run.frequency
        before = ratios < 0.987 if run.rate > 0.0 else ratios > 1.015
        behind = (ratios > 1.015) & (ratios < 1.027) if run.rate > 0.0 else (ratios < 0.987) & (ratios > 0.977)
        assert run.impacts[before].sum() == 0 and run.impacts[behind].mean() == pytest.approx(2.0, rel=0.05)
        floating = 1 / np.abs(1 - (1 - EPS) * ratios[before] ** 2 + 2j * DAMPING * ratios[before])
        assert run.amplitude[before] == pytest.approx(floating, rel=within)
        hitting = np.array([one_to_one(ratio) for ratio in ratios[behind][::25]])
        means = np.array([run.amplitude[behind][place : place + 25].mean() for place in range(0, behind.sum(), 25)])
        assert means[:-1] == pytest.approx(hitting[:-1], rel=within)


# speed of rotation


def test_run_up_of_a_rotor():
    """Engine order and centrifugal stiffness by DOP853; where the stiffness steps, it does work."""
    given = scene({"quantity": "rpm", "from": 90.0, "to": 260.0, "rate": 16.0}, ROTOR)
    found = ramp(given)
    (run,) = found.runs
    assert run.frequency == pytest.approx(4.0 * run.speed / (2 * np.pi), rel=1e-14)
    structure = given.structure
    exact = staircase(
        run, np.diag([MASS]), np.diag([2.0]), lambda speed: np.diag([1e4 + 0.5 * speed**2]), np.array([FORCE])
    )
    assert np.abs(run.displacement - exact[:, 0]).max() < 1e-9 * np.abs(exact[:, 0]).max()
    stiffness = np.array([structure.stiffness_at(speed) for speed in run.speed])
    work = 0.5 * np.sum(np.diff(stiffness) * run.displacement[1:-1] ** 2)
    assert run.energy["rotation"] == pytest.approx(work, rel=1e-8)
    energy = run.energy
    assert energy["excitation"] + energy["rotation"] == pytest.approx(energy["viscous"] + energy["stored"], rel=1e-8)
    assert run.energy_residual < 1e-10
    # the frequency leaves that of the structure at a rate that its stiffness slows down
    assert found.share(run) == pytest.approx(peak_ratio(np.array([found.lewis_rate(run)]))[0], rel=0.02)
    # the resonance 4 speed = sqrt((k + speed^2 c)/m)
    resonance = np.sqrt(1e4 / (16 * MASS - 0.5))
    assert found.tops["undamped_peak_frequency"] == pytest.approx(4 * resonance / (2 * np.pi), rel=1e-3)


def test_level_of_the_resonance_along_an_engine_order():
    """One force for all speeds: that with which the stationary peak has the given height."""
    table = {"quantity": "rpm", "from": 120.0, "to": 220.0, "rate": 40.0}
    given = scene(table, ROTOR | {"excitation": {"engine_order": 4.0, "resonance_amplitude": 2e-3}})
    found = ramp(given)
    assert found.tops["undamped_peak"] == pytest.approx(2e-3, rel=1e-3)
    base = ramped(given)
    loads = [assemble(scene_at(base, given.ramp, rpm)).load for rpm in (120.0, 171.0, 220.0)]
    assert np.ptp(loads, axis=0) == pytest.approx(0.0, abs=1e-12)
    (forced,) = ramp(scene(table, ROTOR)).runs
    scaled = FORCE / (np.abs(loads[0]).max() * np.sqrt(MASS)) * found.runs[0].amplitude
    assert scaled == pytest.approx(forced.amplitude, rel=1e-9)


def test_speed_at_a_constant_frequency():
    """The frequency stays, and the structure's own passes it."""
    data = ROTOR | {"excitation": {"frequency": 11.7, "force": FORCE}}
    found = ramp(scene({"quantity": "speed", "from": 0.0, "to": 70.0, "rate": 7.0}, data))
    (run,) = found.runs
    assert np.ptp(run.frequency) == 0.0
    assert run.speed == pytest.approx(7.0 * (run.time + 0.5 / 11.7), rel=1e-12)
    exact = staircase(
        run, np.diag([MASS]), np.diag([2.0]), lambda speed: np.diag([1e4 + 0.5 * speed**2]), np.array([FORCE])
    )
    assert np.abs(run.displacement - exact[:, 0]).max() < 1e-9 * np.abs(exact[:, 0]).max()
    assert found.tops["undamped_peak"] == pytest.approx(FORCE / (2.0 * 2 * np.pi * 11.7), rel=1e-9)
    assert found.share(run) == pytest.approx(peak_ratio(np.array([found.lewis_rate(run)]))[0], rel=0.05)


def test_a_body_that_is_spun_up_sticks():
    """Its normal load grows with the squared speed, in steps at which nothing that is stored changes."""
    data = ROTOR | {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": 3e4, "damping": 20.0},
        "excitation": {"frequency": 15.0, "force": 40.0},
        "cavity": [{"name": "c", "gap": 0.2, "radius": 0.3}],
        "damper": [{**SLIDER, "friction": 0.5}],
    }
    (run,) = ramp(scene({"quantity": "speed", "from": 2.0, "to": 30.0, "rate": 4.0}, data)).runs
    (stuck,) = run.stuck.T
    assert run.status == "ok" and run.energy_residual < 1e-10
    assert not stuck[:20].any() and stuck[-5:].all()
    assert abs(run.energy["rotation"]) < 1e-10 * run.energy["excitation"]
    # it slides for the last time where friction still falls short of the floor's acceleration
    last = int(np.flatnonzero(~stuck)[-1])
    holds = 0.5 * 0.3 * run.speed[last] ** 2
    assert holds == pytest.approx(run.amplitude[last] * (2 * np.pi * 15.0) ** 2, rel=0.1)


MATRICES = {
    "mass": np.diag([1.0, 0.5]), "stiffness": 1e4 * np.array([[2.0, -1.0], [-1.0, 1.0]]),
    "damping": np.array([[3.0, -1.0], [-1.0, 2.0]]),
}  # fmt: skip
ADDED = np.array([[3.0, 0.4], [0.4, 1.0]])


def rotor_of_two_modes(folder, **changes):
    """A scene's data with a reduced model that rotates."""
    model = ReducedModel.from_matrices(
        MATRICES["mass"], MATRICES["stiffness"], {"tip": [0.0, 1.0], "root": [1.0, 0.0]}, damping=MATRICES["damping"]
    )
    turning = {"rotation_axis": np.array([0.0, 0.0, 1.0]), "rotation_point": np.zeros(3), "greatest_speed": 100.0}
    replace(model, centrifugal_stiffness=ADDED, **turning).save(folder / "rotor.h5")
    return ROTOR | {
        "structure": {"model": "rom", "file": str(folder / "rotor.h5"), **changes},
        "excitation": {"engine_order": 2.0, "force": FORCE, "at": "tip"},
    }


def test_reduced_model_over_the_speed(tmp_path):
    """Its modes change from period to period; in physical coordinates nothing jumps."""
    table = {"quantity": "speed", "from": 20.0, "to": 70.0, "rate": 40.0}
    (run,) = ramp(scene(table, rotor_of_two_modes(tmp_path))).runs
    assert run.status == "ok" and run.energy_residual < 1e-10
    mass, stiffness, damping = (MATRICES[name] for name in ("mass", "stiffness", "damping"))
    exact = staircase(run, mass, damping, lambda speed: stiffness + speed**2 * ADDED, np.array([0.0, FORCE]))
    assert np.abs(run.displacement - exact[:, 1]).max() < 1e-8 * np.abs(exact[:, 1]).max()
    assert np.abs(run.velocity - exact[:, 3]).max() < 1e-8 * np.abs(exact[:, 3]).max()
    work = 0.5 * np.einsum("p,pi,ij,pj->", np.diff(run.speed**2), exact[1:-1, :2], ADDED, exact[1:-1, :2])
    assert run.energy["rotation"] == pytest.approx(work, rel=1e-6)


def test_modes_that_do_not_hold_the_motion_leave_the_ledger_open(tmp_path):
    """One natural mode of two, whose shape changes with the speed."""
    table = {"quantity": "speed", "from": 20.0, "to": 70.0, "rate": 40.0}
    (run,) = ramp(scene(table, rotor_of_two_modes(tmp_path, modes=1, natural=True))).runs
    assert run.status == "energy_not_balanced"


# what cannot be

TABLE = {"structure": {"model": "prescribed", "displacement_amplitude": 1e-4}, "excitation": {"frequency": 9.0}}
SOFTENED = ROTOR | {"structure": ROTOR["structure"] | {"centrifugal_stiffness": -1.0}}
UP = {"from": 90.0, "to": 110.0, "rate": 5.0}
REFUSED = [
    ({"from": 90.0, "to": 110.0}, {}, "give one of rate (Hz a second) and periods"),
    ({"from": 90.0, "to": 90.0, "rate": 1.0}, {}, "to (90) must differ"),
    ({"from": 0.0, "to": 90.0, "rate": 1.0}, {}, "frequencies above zero"),
    ({"from": 90.0, "to": 110.0, "rate": -1.0}, {}, "ramp.rate"),
    ({"from": 90.0, "to": 110.0, "rate": []}, {}, "ramp.rate"),
    ({"from": 90.0, "to": 110.0, "rate": 1e6}, {}, "in less than one period"),
    ({"from": 90.0, "to": 110.0, "rate": 1e-9}, {}, "take a higher rate"),
    ({"from": 90.0, "to": 110.0, "rate": [3e-4] * 4}, {}, "periods of the excitation together"),
    ({"from": 90.0, "to": 110.0, "periods": 10**400}, {}, "ramp.periods: expected a whole number up to"),
    (UP, TABLE, "jump"),
    (UP, {"solver": {"method": "moreau"}}, 'run-ups are those of the exact engine, not of "moreau"'),
    (UP | {"quantity": "speed"}, {}, "[rotation], which is missing"),
    (UP, ROTOR, 'take "speed" or "rpm"'),
    (UP | {"quantity": "rpm", "from": 0.0}, ROTOR, "at standstill"),
    (UP | {"quantity": "speed", "to": 400.0}, SOFTENED, "unstable from 100 rad/s on"),
    (
        UP | {"quantity": "rpm"}, ROTOR | {"excitation": {"frequency": 11.0, "resonance_amplitude": 1e-4}},
        "give excitation.engine_order",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("table", "further", "said"), REFUSED, ids=[entry[2] for entry in REFUSED])
def test_refusals_are_one_line(table, further, said):
    with pytest.raises(InputError) as error:
        ramp(scene(table, ONE_MODE | further))
    assert said in str(error.value) and "\n" not in str(error.value)


def test_a_scene_without_the_table_is_refused():
    with pytest.raises(InputError, match="ramp: missing"):
        ramp(validate(Scene, ONE_MODE, "x"))


@pytest.mark.parametrize(
    ("over_speed", "start"),
    cases(itertools.product([False, True], ["rest", "steady"]), fast=[(False, "steady"), (True, "rest")]),
)
def test_a_wave_around_a_ring(over_speed, start, tmp_path):
    """Of both modes with one nodal diameter the response feels one only: the other is no gap in the ledger."""
    structure, model = ring(tmp_path)
    excitation, ends = {"frequency": 104.0, "at": "tip0", "load": travelling(1)}, {"from": 110.0, "to": 140.0}
    further = {"gravity": {"acceleration": 0.0}, "time": {"periods": 400, "transient": 300}}
    if over_speed:
        excitation |= {"frequency": None, "engine_order": 3.0}
        ends = {"quantity": "speed", "from": 2 * np.pi / 3 * 110.0, "to": 2 * np.pi / 3 * 140.0}
        further["rotation"] = {"speed": 200.0}
        # it turns, and the speed does not change it
        turning = {"rotation_axis": np.array([0.0, 0.0, 1.0]), "rotation_point": np.zeros(3), "greatest_speed": 400.0}
        replace(model, centrifugal_stiffness=np.zeros((4, 4)), **turning).save(structure["file"])
    (run,) = ramp(
        scene(ends | {"periods": 40, "start": start}, {"structure": structure, "excitation": excitation, **further})
    ).runs
    assert run.status == "ok" and run.energy_residual < 1e-10
    assert abs(run.energy["rotation"]) < 1e-10 * run.energy["excitation"]
    if start == "rest":
        loads = np.array([2.0 * np.exp(-0.5j * np.pi * blade) for blade in range(4)])
        state = np.zeros(8)
        for frequency, displacement in zip(run.frequency, run.displacement[1:], strict=True):
            omega = 2 * np.pi * frequency

            def rate(t, y, omega=omega):
                return np.r_[
                    y[4:], (loads * np.exp(1j * omega * t)).imag - model.damping @ y[4:] - model.stiffness @ y[:4]
                ]

            state = solve_ivp(rate, (0, 1 / frequency), state, method="DOP853", rtol=1e-11, atol=1e-16).y[:, -1]
            assert displacement == pytest.approx(state[0], abs=1e-8 * run.peak)


def test_a_resonance_without_damping_that_a_point_of_the_curve_meets():
    """The stationary amplitude is infinite there, to the last bit of the frequency, and the ramp's is not."""
    undamped = ONE_MODE | {"structure": {"model": "rigid", "mass": 1.0, "stiffness": 4.0, "damping_ratio": 0.0}}
    undamped |= {"excitation": {"frequency": 1 / np.pi, "force": 1.0}}
    given = scene({"from": 0.5 / np.pi, "to": 1.5 / np.pi, "periods": 5}, undamped)
    assert 2 * np.pi * (1 / np.pi) == 2.0  # the middle of the range is the resonance
    found = ramp(given)
    assert found.runs[0].status == "ok" and np.isfinite(found.runs[0].peak)
    assert found.tops["undamped_peak"] == np.inf and np.isnan(found.share(found.runs[0]))
    assert linear_amplitudes(given, np.array([0.1, 1 / np.pi]))[0][1] == np.inf


def test_a_run_that_ends_early_says_so():
    """Its record holds the periods before, and what it has kept balances."""
    given = scene({"from": 95.0, "to": 105.0, "rate": 20.0}, BODY | {"solver": {"max_events": 60}})
    (run,) = ramp(given).runs
    assert run.status == "event_budget"
    assert 0 < len(run.time) < 40 and len(run.displacement) == len(run.time) + 1
    assert run.energy_residual < 1e-10


def test_a_start_that_is_not_steady_is_a_warning():
    data = ONE_MODE | {"time": {"periods": 20, "transient": 10}}
    found = ramp(scene({**UP, "to": 92.0, "start": "steady"}, data))
    assert "not_steady" in found.warnings[0]


# the record and the command


def test_record(tmp_path):
    xarray = pytest.importorskip("xarray")
    calls = []
    found = vd.ramp(
        scene({"from": 98.0, "to": 102.0, "rate": [10.0, 20.0], "both": True}, BODY), lambda *at: calls.append(at)
    )
    periods = sum(len(run.time) for run in found.runs)
    assert calls[0][1] == periods and calls[-1] == (periods, periods)
    found.save(tmp_path / "ramp.h5")
    again = Ramp.load(tmp_path / "ramp.h5")
    assert again.to_json() == found.to_json() and again.scene == found.scene
    for one, other in zip(again.runs, found.runs, strict=True):
        for name in ("time", "frequency", "speed", "amplitude", "impacts", "stuck", "displacement", "velocity"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    with xarray.open_dataset(tmp_path / "ramp.h5", engine="h5netcdf") as data:
        assert data["amplitude"].dims == ("period",) and data["amplitude"].attrs["units"] == "m"
        assert data["energy"].sel(work="viscous").values == pytest.approx([run.energy["viscous"] for run in found.runs])
        assert data["stuck"].dims == ("period", "damper") and data["rate"].attrs["units"] == "Hz/s"
    assert set(found.to_xarray()) >= {"peak", "linear_undamped", "frequency"}


def test_command_and_report(tmp_path, capsys):
    text = (ROOT / "docs" / "examples" / "ramp.toml").read_text()
    assert "rate = [50.0, 200.0, 1000.0, 5000.0]" in text
    text = text.replace("rate = [50.0, 200.0, 1000.0, 5000.0]", "rate = [2000.0, 5000.0]").replace(
        "num = 81", "num = 3"
    )
    (tmp_path / "ramp.toml").write_text(text.replace("periods = 2500\ntransient = 2000", "periods = 60\ntransient = 0"))
    arguments = [str(tmp_path / "ramp.toml"), "-o", str(tmp_path / "ramp.h5")]
    assert main(["ramp", *arguments, "--json", str(tmp_path / "ramp.json")]) == 0
    printed = capsys.readouterr().out.splitlines()
    runs = json.loads((tmp_path / "ramp.json").read_text())["runs"]
    assert [run["direction"] for run in runs] == ["up", "up", "down", "down"]
    assert all(run["status"] == "ok" and 0.1 < run["peak_share"] < 0.6 for run in runs)
    for line, run in zip(printed[1:5], runs, strict=True):
        rate, direction, peak, frequency, share, status = line.split()
        assert float(frequency) == pytest.approx(run["peak_frequency"], rel=1e-5)
        assert (float(rate), direction, status) == (abs(run["rate"]), run["direction"], "ok")
        assert float(peak) == pytest.approx(run["peak"], rel=1e-4)
        assert float(share) == pytest.approx(run["peak_share"], abs=1e-4)
    assert main(["sweep", str(tmp_path / "ramp.toml"), "-o", str(tmp_path / "sweep.h5"), "--workers", "1"]) == 0
    assert (
        main(["report", str(tmp_path / "ramp.h5"), str(tmp_path / "sweep.h5"), "-o", str(tmp_path / "page.html")]) == 0
    )
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Run-up and run-down" in page and "steady state (sweep.h5)" in page and "(Lewis)" in page
    assert f"{runs[0]['peak_share']:.3f}" in page


def test_bad_input_ends_with_one_line(tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text('[structure]\nmodel = "rigid"\nmass = 1.0\nstiffness = 1e4\ndamping_ratio = 0.01\n'
                    "[excitation]\nfrequency = 15.0\nforce = 1.0\n")  # fmt: skip
    assert main(["ramp", str(path)]) == BAD_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "ramp: missing" in said


def test_interrupted_runs_resume_and_give_the_same_file(tmp_path):
    table = {"from": 98.0, "to": 102.0, "rate": [20.0, 40.0], "both": True}
    given, file, calls = scene(table, BODY), tmp_path / "r.h5.partial", []
    ramp(given).save(tmp_path / "whole.h5")

    def interrupted(done, total):
        if done > 0.7 * total:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ramp(given, interrupted, checkpoint=file)
    resumed = ramp(given, lambda *call: calls.append(call), checkpoint=file)
    resumed.save(tmp_path / "resumed.h5")
    assert calls[0][0] > 1 and len(calls) < calls[-1][1] == calls[-1][0]
    assert (tmp_path / "resumed.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
    with pytest.raises(InputError, match="the checkpoint of another scene; nothing was done to it"):
        ramp(scene(table | {"to": 103.0}, BODY), checkpoint=file)
