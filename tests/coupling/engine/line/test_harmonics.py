"""An excitation with several harmonics, against closed forms and other ways to the same motion.

Every method takes it: the engine's mode 0 is modes 0..e-1, one for each harmonic.
"""

import cmath
import math

import numpy as np
import pytest

from tests.coupling.methods.scipy_ivp.test_random_scenes import check
from tests.reference.comparison import compare_motion, follow
from tests.reference.integrator import with_horizon
from tests.tools.closed_form_scenes import ball
from tests.tools.random_scenes import random_reduced, random_scene
from tests.tools.tiers import cases, seeds
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel

# impacts that chaos leaves to compare, at least
LEAST = 10
# order, amplitude and phase in degrees
TWO = [{"order": 1, "amplitude": 0.8, "phase": 25.0}, {"order": 3, "amplitude": 1.3, "phase": -70.0}]
THREE = [*TWO, {"order": 2, "amplitude": 0.4}]
FREQUENCY, OMEGA = 15.0, 2 * math.pi * 15.0


def scene(harmonic, periods=10, transient=0, **tables):
    """A rigid structure of 1 kg, 16 Hz, without bodies unless `tables` say otherwise."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * math.pi * 16.0) ** 2, "damping_ratio": 0.05},
        "excitation": {"frequency": FREQUENCY, "force": 1.0},
        "time": {"periods": periods, "transient": transient},
    } | tables
    if harmonic is not None:
        data["excitation"] = data["excitation"] | {"harmonic": harmonic}
    return validate(Scene, data, "scene")


def bodies(*restitutions, friction=0.0):
    """Tables of bodies of 20 g in one cavity."""
    count = len(restitutions)
    return {
        "cavity": [{"name": "c", "gap": 2e-4}],
        "damper": [
            {"cavity": "c", "mass": 0.02, "restitution": value, "friction": friction,
             "position": 1e-4 * (2 * (k + 1) / (count + 1) - 1)}
            for k, value in enumerate(restitutions)
        ],
    }  # fmt: skip


def shares(harmonic):
    """Complex amplitudes by order of the sum of amplitude sin(order omega t + phase)."""
    return {part["order"]: cmath.rect(part["amplitude"], math.radians(part.get("phase", 0.0))) for part in harmonic}


def reduced(tmp_path, squares, rows, damping=0.0):
    """A scene's structure of modes with these squared frequencies; interface labels "a" and "b" with these rows."""
    model = ReducedModel.from_matrices(
        np.eye(len(squares)),
        np.diag(squares),
        dict(zip("ab", rows, strict=True)),
        damping=damping * np.eye(len(squares)),
    )
    model.save(tmp_path / "rom.h5")
    return {"model": "rom", "file": str(tmp_path / "rom.h5")}


# -- without bodies: closed forms


def test_steady_response_is_the_sum_of_the_harmonics():
    """Amplitude and phase of order 1, rms, peak, and the work that the dashpot takes, after a transient of e^-40."""
    case = scene(TWO, periods=200, transient=190)
    structure, response = case.structure, simulate(case)
    stiffness, damping = structure.stiffness, structure.viscous
    waves = {
        order: share / (stiffness - (order * OMEGA) ** 2 + 1j * order * OMEGA * damping)
        for order, share in shares(TWO).items()
    }
    assert response.status == Status.OK
    assert response.amplitude_harmonic == pytest.approx(abs(waves[1]), rel=1e-12)
    assert response.phase == pytest.approx(cmath.phase(waves[1]), abs=1e-12)
    assert response.amplitude_rms == pytest.approx(math.sqrt(sum(abs(w) ** 2 for w in waves.values()) / 2), rel=1e-12)
    angle = np.linspace(0, 2 * np.pi, 100_001)
    sampled = np.abs(sum((wave * np.exp(1j * order * angle)).imag for order, wave in waves.items())).max()
    # samples lie below the peak by at most the curvature times the square of half their distance
    lost = sum(order**2 * abs(wave) for order, wave in waves.items()) * (np.pi / 1e5) ** 2 / 2
    assert sampled - 1e-12 * sampled <= response.amplitude_max <= sampled + lost
    loss = 10 / FREQUENCY * damping * sum(abs(1j * order * OMEGA * wave) ** 2 / 2 for order, wave in waves.items())
    assert response.energy["viscous"] == pytest.approx(loss, rel=1e-11)
    assert response.energy_residual < 1e-12
    for curve in linear_responses(case):
        assert curve.amplitude(np.array([FREQUENCY]))[0] == pytest.approx(response.amplitude_max, rel=1e-12)


def test_base_acceleration_has_the_harmonics_of_the_force():
    """The inertia of the base on 1 kg is a force against it; the other way round is half a turn of every phase."""
    turned = [part | {"phase": part["phase"] + 180.0} for part in TWO]
    driven = simulate(scene(TWO))
    shaken = simulate(scene(turned, excitation={"frequency": FREQUENCY, "base_acceleration": 1.0}))
    assert np.abs(driven.section - shaken.section).max(axis=0) == pytest.approx(
        0, abs=1e-12 * np.abs(driven.section).max()
    )


@pytest.mark.parametrize("detuning", [0.0, 1e-9, 1e-5, 5e-4])
def test_third_harmonic_at_an_undamped_modes_own_frequency(tmp_path, detuning):
    """It makes the mode grow as t exp(3 i omega t), from rest; the first harmonic leaves it in step."""
    rate, rows = np.array([0.37 * OMEGA, 3 * OMEGA * (1 + detuning)]), np.array([[1.0, 0.7], [1.0, -0.4]])
    structure = reduced(tmp_path, rate**2, rows)
    case = scene(TWO, structure=structure, excitation={"frequency": FREQUENCY, "force": 1.0, "at": "a"})
    response = simulate(case, samples_per_period=16)
    time, x = response.time, np.zeros(len(response.time))
    for order, share in shares(TWO).items():
        w = order * OMEGA
        for own, row in zip(rate, rows[0], strict=True):
            # from rest: q = Im of the force's phasor times the convolution of sin(own t)/own with exp(i w t)
            ahead, behind = (_growth(1j * w, sign * 1j * own, time) for sign in (1, -1))
            x += row**2 * (share * (ahead - behind) / (2j * own)).imag
    assert response.status == Status.OK
    assert np.abs(response.displacement - x).max() < 1e-12 * np.abs(x).max()
    assert response.energy_residual < 1e-12
    assert np.ptp(response.peak) > 0.5 * response.peak.max()  # it grows
    # peaks are at least what samples see
    assert np.all(response.peak >= np.abs(x).reshape(-1, 16).max(axis=1) * (1 - 1e-12))


def test_figures_beside_a_mode_that_the_third_harmonic_drives(tmp_path):
    """Integrals of products with the driven mode, with a body that slides and one that flies, against solve_ivp."""
    rate, rows = np.array([0.37 * OMEGA, 3 * OMEGA]), np.array([[1.0, 0.7], [1.0, -0.4]])
    tables = bodies(0.6, 0.6)
    tables["cavity"] = [{"name": "c", "gap": 0.2, "floor": "b"}]
    tables["damper"][0] |= {"friction": 0.002, "position": -0.04, "velocity": 0.02}
    tables["damper"][1] |= {"position": 0.04, "velocity": 0.01}
    excitation = {"frequency": FREQUENCY, "force": 1.0, "at": "a"}
    case = scene(THREE, structure=reduced(tmp_path, rate**2, rows), excitation=excitation, **tables)
    exact, other = simulate(case), simulate(case.replace({"solver": {"method": "solve_ivp", "rtol": 1e-11}}))
    for name in ("amplitude_rms", "amplitude_harmonic", "attached_mass_fraction"):
        assert getattr(exact, name) == pytest.approx(getattr(other, name), rel=1e-6), name
    assert exact.phase == pytest.approx(other.phase, abs=1e-6)
    largest = max(map(abs, exact.energy.values()))
    for name, value in exact.energy.items():
        assert value == pytest.approx(other.energy[name], abs=1e-7 * largest), name
    assert exact.energy_residual < 1e-12


def _growth(one, other, t):
    """(exp(one t) - exp(other t))/(one - other) of imaginary rates."""
    middle, half = (one + other) * t / 2, (one - other).imag * t / 2
    return t * np.exp(middle) * np.sinc(half / np.pi)


def test_every_method_without_contacts():
    """Second order; co-simulation's structure is exact, solve_ivp keeps its tolerance."""
    exact = simulate(scene(TWO))
    solvers = {
        "moreau": {}, "penalty": {}, "newmark": {"method": "penalty", "scheme": "newmark"}, "cosim": {},
    }  # fmt: skip
    for method, options in solvers.items():
        errors = []
        for count in (64, 128):
            solver = {"method": method, "steps_per_period": count} | options
            errors.append(np.abs(simulate(scene(TWO, solver=solver)).section - exact.section)[:, 0].max())
        if method == "cosim":
            assert max(errors) < 1e-11 * exact.amplitude_max
        else:
            assert errors[0] < 0.1 * exact.amplitude_max
            assert 3.5 < errors[0] / errors[1] < 4.5, method
    other = simulate(scene(TWO, solver={"method": "solve_ivp", "rtol": 1e-11}))
    assert np.abs(other.section - exact.section)[:, 0].max() < 1e-8 * exact.amplitude_max


# -- with bodies: independent ways


def test_one_body_with_friction_follows_the_reference():
    response = follow(scene(TWO, **bodies(0.6, friction=0.3)), 12)
    assert response.counters["impacts"] >= 20


@pytest.mark.parametrize("structure, seed", cases([("rigid", 1), ("rigid", 2), ("prescribed", 0)], fast=[("rigid", 1)]))
def test_two_bodies_in_a_shared_cavity_follow_the_reference(structure, seed):
    """But for the energies: that of several impacts at once is more than the reference's ledger knows."""
    drawn = random_scene(seed, structure, 2, shared=True)
    drawn = drawn.replace({"excitation.harmonic": THREE, "time": {"periods": 3, "transient": 0}})
    reference, end = with_horizon(drawn, 3)
    response = simulate(drawn, samples_per_period=64)
    compare_motion(drawn, response, reference, end, bodies=2e-7)
    assert response.energy_residual < 1e-10


@pytest.mark.parametrize("seed", seeds(2, fast=[0]))
def test_three_modes_follow_the_reference(tmp_path, seed):
    drawn = random_scene(seed, "rom", 2).replace({"excitation.harmonic": TWO})
    follow(drawn, 8, random_reduced(seed, 3), tmp_path)


@pytest.mark.parametrize("restitutions", [pytest.param((0.6,), marks=pytest.mark.slow), (0.8, 0.7)])
def test_solve_ivp_finds_the_same_impacts(restitutions):
    case = scene(TWO, periods=6, **bodies(*restitutions, friction=0.2))
    assert check(case) >= LEAST
    assert simulate(case).energy_residual < 1e-10


def test_moreau_converges_to_the_exact_engine():
    """First order over impacts: at the first of them, before chaos, every halving of the step halves the error."""
    case = scene(TWO, periods=2, **bodies(0.6))
    exact = simulate(case)
    assert exact.counters["impacts"] >= 2
    errors = []
    for steps in (2000, 4000, 8000, 16000):
        response = simulate(case.replace({"solver": {"method": "moreau", "steps_per_period": steps}}))
        errors.append(np.abs(response.slip - exact.slip).max() / 2e-4)
    assert errors[-1] < 1e-2
    assert errors[-1] < 0.3 * errors[0]


def test_a_ball_flies_from_a_table_of_two_harmonics():
    """It rests until the table's acceleration is -g, then flies: the time of its landing by bisection."""
    harmonic, ratio = [{"order": 2, "amplitude": 0.3, "phase": -40.0}], 1.6
    case = ball(0.5, ratio, periods=60, excitation={"frequency": 1.0, "harmonic": harmonic})
    case = case.replace({"time": {"periods": 2, "transient": 0}})
    response, amplitude = simulate(case, events=True), ratio * 10.0 / (2 * np.pi) ** 2

    def table(t, p):
        """Derivative p of the table's displacement."""
        parts = {1: 1.0} | shares(harmonic)
        return amplitude * sum(
            (share * (2j * np.pi * order) ** p * np.exp(2j * np.pi * order * t)).imag for order, share in parts.items()
        )

    left = _root(lambda t: table(t, 2) + 10.0, 0.0, 1.0)

    def height(t):
        return table(left, 0) + table(left, 1) * (t - left) - 5.0 * (t - left) ** 2 - table(t, 0)

    down = _root(height, left + 0.05, left + 1.0)
    events = {event.kind: event for event in reversed(response.event_list)}
    assert events["detach"].time == pytest.approx(left, abs=1e-12)
    assert events["impact"].time == pytest.approx(down, abs=1e-11)
    speed = table(left, 1) - 10.0 * (down - left) - table(down, 1)
    assert events["impact"].relative_velocity_before == pytest.approx(speed, rel=1e-10)
    assert response.energy_residual < 1e-10


def _root(function, low, high):
    """The first sign change between low and high, to round-off."""
    grid = np.linspace(low, high, 2001)
    values = np.array([function(t) for t in grid])
    first = int(np.argmax(values[1:] * values[:-1] < 0))
    low, high, sign = grid[first], grid[first + 1], np.sign(values[first])
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sign * function(middle) > 0 else (low, middle)
    return low


# -- the table


def test_order_one_of_amplitude_one_is_the_sine():
    tables = bodies(0.6, friction=0.3)
    plain, named = (
        simulate(scene(harmonic, **tables), events=True) for harmonic in (None, [{"order": 1, "amplitude": 1.0}])
    )
    assert named.section.tobytes() == plain.section.tobytes()
    assert named.event_list == plain.event_list
    assert named.energy == plain.energy


def test_half_a_turn_of_odd_orders_is_the_mirror_image():
    mirrored = [part | {"phase": part["phase"] + 180.0} for part in TWO]
    one, other = (simulate(scene(harmonic, **bodies(0.6))) for harmonic in (TWO, mirrored))
    assert np.abs(one.section + other.section).max() < 1e-9 * np.abs(one.section).max()


def test_order_three_by_itself_is_a_sine_of_three_times_the_frequency():
    tables = bodies(0.6)
    slow = [{"order": 1, "amplitude": 0.0}, {"order": 3, "amplitude": 1.0}]
    third = simulate(scene(slow, periods=2, excitation={"frequency": FREQUENCY / 3, "force": 1.0}, **tables))
    sine = simulate(scene(None, periods=6, **tables))
    assert third.counters["impacts"] == sine.counters["impacts"] >= 5
    assert np.abs(third.section - sine.section[::3]).max() < 1e-9 * np.abs(sine.section).max()
    for name, value in sine.energy.items():
        assert third.energy[name] == pytest.approx(value, abs=1e-9 * max(map(abs, sine.energy.values())))


def test_an_amplitude_is_swept_by_its_path():
    case = scene(TWO, periods=4, sweep={"excitation.harmonic.1.amplitude": [0.0, 1.3]})
    found = sweep(case)
    assert found.amplitude_max[1] == pytest.approx(simulate(scene(TWO, periods=4)).amplitude_max, rel=1e-12)
    assert found.amplitude_max[0] == pytest.approx(simulate(scene(TWO[:1], periods=4)).amplitude_max, rel=1e-12)


@pytest.mark.parametrize(
    "harmonic, line",
    [
        ([{"order": 0, "amplitude": 1.0}], "excitation.harmonic[0].order"),
        ([{"order": 1.5, "amplitude": 1.0}], "excitation.harmonic[0].order"),
        ([{"order": 2}], "excitation.harmonic[0].amplitude"),
        ([{"order": 2, "amplitude": -1.0}], "excitation.harmonic[0].amplitude"),
        ([{"order": 2, "amplitude": 1.0}, {"order": 2, "amplitude": 0.5}], "harmonic[1].order: 2 is given twice"),
    ],
)
def test_wrong_input_is_one_line(harmonic, line):
    with pytest.raises(InputError) as error:
        scene(harmonic)
    assert line in str(error.value) and "\n" not in str(error.value)
