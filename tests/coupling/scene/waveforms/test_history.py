"""Force histories from CSV files, against the exact solution of a mode under piecewise linear loads."""

import math

import numpy as np
import pytest
from scipy.signal import lsim

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import InputError, validate

OWN, RATIO, ROWS, DURATION = 2 * math.pi * 24.0, 0.03, 50, 0.2
STEPPING = [
    {"method": "moreau"}, {"method": "penalty"}, {"method": "penalty", "scheme": "newmark"}, {"method": "cosim"},
]  # fmt: skip


def measured(closed=True):
    """Times and values of a rough signal; closed: it ends as it began."""
    rng = np.random.default_rng(5)
    time, value = np.linspace(0.0, DURATION, ROWS + 1), rng.standard_normal(ROWS + 1)
    value[-1] = value[0] if closed else value[0] + 2.0
    return time, value


def write(path, time, value):
    lines = [f"{t!r},{v!r}" for t, v in zip(time.tolist(), value.tolist(), strict=True)]
    path.write_text("\n".join(["time,value", *lines]) + "\n")
    return str(path)


def scene(file, level="force", periods=2, **tables):
    data = {
        "structure": {"model": "rigid", "mass": 1.5, "stiffness": 1.5 * OWN**2, "damping_ratio": RATIO},
        "excitation": {level: 3.0, "waveform": {"shape": "history", "file": file}},
        "gravity": {"acceleration": 0.0}, "time": {"periods": periods, "transient": 0}, "solver": {"method": "moreau"},
    } | tables  # fmt: skip
    return validate(Scene, data, "scene.toml")


def exact(time, value, periods, load=2.0):
    """Displacements at the rows of all periods: lsim is exact for loads that are straight between them."""
    whole = np.concatenate([time[:-1] + k * DURATION for k in range(periods)] + [[periods * DURATION]])
    force = np.concatenate([np.tile(value[:-1], periods), value[-1:]])
    system = ([[0.0, 1.0], [-(OWN**2), -2 * RATIO * OWN]], [[0.0], [load]], [[1.0, 0.0]], [[0.0]])
    return lsim(system, force, whole)[1]


@pytest.mark.parametrize("level, sign", [("force", 2.0), ("base_acceleration", -3.0)])
@pytest.mark.parametrize("solver", STEPPING, ids=lambda solver: " ".join(solver.values()))
def test_second_order_of_all_methods_with_steps(tmp_path, solver, level, sign):
    """A load of 3 N on 1.5 kg, or 3 m/s^2 of the base against it; rows fall on steps.

    Co-simulation solves the structure exactly under loads that are straight within a step.
    """
    time, value = measured()
    file, expected = write(tmp_path / "h.csv", time, value), exact(time, value, 2, sign)[:-1]
    errors, counts = [], (200, 400, 800)
    for count in counts:
        made = scene(file, level, solver=solver | {"steps_per_period": count})
        response = simulate(made, samples_per_period=ROWS)
        assert response.status is Status.OK and response.frequency == pytest.approx(1 / DURATION, rel=1e-12)
        errors.append(np.abs(response.displacement - expected).max() / np.abs(expected).max())
    if solver["method"] == "cosim":
        assert max(errors) < 1e-11
        return
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.2)
    assert errors[-1] < 5e-3


def test_rows_between_steps_and_a_jump_at_the_end(tmp_path):
    """73 intervals of unequal length, jumping back at the period's end: resolved to a step, so of first order."""
    rng = np.random.default_rng(2)
    time = DURATION * np.concatenate([[0.0], np.sort(rng.random(72)), [1.0]])
    value = np.cumsum(rng.standard_normal(74))
    file = write(tmp_path / "h.csv", time, value)
    # the reference walks through all rows with a state-transition matrix of its own
    state, found = np.zeros(2), []
    for _ in range(2):
        found.append(state[0])
        for k in range(73):
            state = _ramp(state, time[k + 1] - time[k], 2.0 * value[k], 2.0 * value[k + 1])
    for count, close in ((2000, 2e-3), (16000, 3e-4)):
        made = scene(file, solver={"method": "moreau", "steps_per_period": count})
        section = simulate(made).section[:, 0]
        assert np.abs(section - [*found, state[0]]).max() < close * np.abs(found).max() * 3


def _ramp(state, step, first, last):
    """State (x, x') after a step of x'' + 2 zeta w x' + w^2 x = a load straight from `first` to `last`."""
    slope = (last - first) / step
    # particular solution x = a + b t
    b = slope / OWN**2
    a = (first - 2 * RATIO * OWN * b) / OWN**2
    damped, decay = OWN * math.sqrt(1 - RATIO**2), math.exp(-RATIO * OWN * step)
    x, rate = state[0] - a, state[1] - b
    cos, sin = math.cos(damped * step), math.sin(damped * step)
    sine = (rate + RATIO * OWN * x) / damped
    position = decay * (x * cos + sine * sin)
    speed = -RATIO * OWN * position + decay * damped * (sine * cos - x * sin)
    return np.array([position + a + b * step, speed + b])


def test_times_that_do_not_begin_at_zero(tmp_path):
    time, value = measured(closed=False)
    one, other = (simulate(scene(write(tmp_path / f"{at}.csv", time + at, value))) for at in (0.0, 16.0))
    np.testing.assert_allclose(other.section, one.section, rtol=0, atol=1e-9 * np.abs(one.section).max())


def test_a_body_is_thrown_by_the_history(tmp_path):
    """A sine in fine rows is the sine, impacts included: straight pieces are off by (2 pi / 400)^2 / 8."""
    time = np.linspace(0.0, DURATION, 401)
    file = write(tmp_path / "sine.csv", time, np.sin(2 * np.pi * time / DURATION))
    body = {"cavity": [{"name": "c", "gap": 1e-5}], "damper": [{"cavity": "c", "mass": 0.05, "restitution": 0.6}]}
    solver = {"method": "moreau", "steps_per_period": 4000}
    ours = simulate(scene(file, solver=solver, **body))
    excitation = {"frequency": 1 / DURATION, "force": 3.0}
    plain = simulate(scene(file, solver=solver, excitation=excitation, **body))
    assert ours.counters["impacts"] >= 3
    assert np.abs(ours.section - plain.section)[:, 0].max() < 1e-3 * np.abs(plain.section[:, 0]).max()


def test_a_frequency_is_checked_against_the_file(tmp_path):
    file = write(tmp_path / "h.csv", *measured())
    waveform = {"shape": "history", "file": file}
    assert scene(file, excitation={"frequency": 5.0, "force": 1.0, "waveform": waveform}).frequency == 5.0
    off = scene(file, excitation={"frequency": 6.0, "force": 1.0, "waveform": waveform})
    message = r'^excitation.frequency: shape "history" lasts 0.2 s, a period of 5 Hz, not 6; leave the frequency out$'
    with pytest.raises(InputError, match=message):
        simulate(off)
    with pytest.raises(InputError, match=r"^scene.toml: excitation: engine_order: the period is that of shape = \"his"):
        scene(file, excitation={"engine_order": 2.0, "force": 1.0, "waveform": waveform}, rotation={"speed": 10.0})


def test_who_does_not_take_it(tmp_path):
    file = write(tmp_path / "h.csv", *measured())
    for method in ("exact", "solve_ivp"):
        with pytest.raises(InputError) as refused:
            simulate(scene(file, solver={"method": method}))
        assert str(refused.value) == (
            'excitation.waveform: shape "history" is no sum of sines and is for solver.method moreau or penalty or '
            f"cosim, not {method}"
        )
    with pytest.raises(InputError, match=r"^excitation.waveform: linear curves are those of sums of sines"):
        linear_responses(scene(file))
    few = scene(file, solver={"method": "moreau", "steps_per_period": 40})
    message = r'^solver.steps_per_period: 40 miss rows of shape "history"; take at least 50$'
    with pytest.raises(InputError, match=message):
        simulate(few)
    with pytest.raises(InputError, match=message):
        sweep(few.replace({"sweep": {"excitation.force": [1.0, 2.0]}}))


def test_a_file_beside_the_scene(tmp_path):
    write(tmp_path / "force.csv", *measured())
    (tmp_path / "scene.toml").write_text(
        '[structure]\nmodel = "rigid"\nmass = 1.5\nstiffness = 4e4\ndamping_ratio = 0.1\n[excitation]\nforce = 1.0\n'
        '[excitation.waveform]\nshape = "history"\nfile = "force.csv"\n[solver]\nmethod = "moreau"\n'
        "[time]\nperiods = 3\ntransient = 1\n"
    )
    made = Scene.load(tmp_path / "scene.toml")
    assert made.files == [str(tmp_path / "force.csv")]
    found = simulate(made)
    # twice the force, twice the motion: the file's, as without bodies all is linear
    twice = simulate(made.replace({"excitation.force": 2.0}))
    assert found.amplitude_max > 0.0
    np.testing.assert_allclose(twice.peak, 2.0 * found.peak, rtol=1e-9)


HEADER = "time,value\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file"),
        ("", "is empty; expected the header time,value, then rows"),
        (HEADER, "expected at least 3 rows below the header, not 0"),
        (HEADER + "0,1\n1,2\n", "expected at least 3 rows below the header, not 2"),
        ("0,1\n1,2\n2,1\n", "line 1: expected the header time,value, not 0,1"),
        (HEADER + "0,1\n1,2,3\n2,1\n", "line 3: expected 2 values, not 3"),
        (HEADER + "0,1\n1,inf\n2,1\n", "line 3: value: expected a finite number (got 'inf')"),
        (HEADER + "0,1\nnan,2\n2,1\n", "line 3: time: expected a finite number (got 'nan')"),
        (HEADER + "0,1\n# later\n2,2\n1,1\n", "line 5: time: expected more than 2 s, that of the row before"),
        (HEADER + "0,1\n1e300,2\n2e300,1\n", "line 3: time: expected a number up to 1e+40 in SI units (got '1e300')"),
        (HEADER + "0,1\n1e-320,2\n2e-320,1\n", "time: expected a period from 1e-40 to 1e+40 s, not 1.99998e-320"),
        (HEADER + "0,1\n0,2\n1,1\n", "line 3: time: expected more than 0 s, that of the row before"),
    ],
)  # fmt: skip
def test_wrong_files(tmp_path, text, message):
    file = tmp_path / "h.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError) as refused:
        simulate(scene(str(file)))
    line = str(refused.value)
    assert line.startswith(str(file)) and line.removeprefix(f"{file}: ") == message


def test_a_file_that_is_no_text(tmp_path):
    (tmp_path / "h.csv").write_bytes(b"\xff\xfe\x00\x01time")
    with pytest.raises(InputError, match=r"h\.csv: not a CSV table: damaged, or of another format"):
        simulate(scene(str(tmp_path / "h.csv")))
