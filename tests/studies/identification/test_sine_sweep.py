"""Histories of sine sweeps: the tracked response is the oscillator's, and what is no slow sweep is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from tests.studies.identification.oscillator import MASS, OMEGA, RATIO, SCENE, STIFFNESS, scene
from tests.studies.identification.test_study import write
from tests.tools.chirp import chirp_response
from vanedamp.coupling.scene.scene import Time
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.transients.ramp import ramp
from vanedamp.coupling.transients.ramp_course import courses, ramped, scene_at
from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.sine_sweep import track
from vanedamp.studies.identification.study import IdentificationStudy

HALF = RATIO * OMEGA / (2 * np.pi)
PEAK = 1.0 / (2 * RATIO * STIFFNESS)


def receptance(frequency):
    w = 2 * np.pi * frequency
    return 1.0 / (STIFFNESS - MASS * w**2 + 2j * RATIO * OMEGA * MASS * w)


def chirp(error, low=15.1, high=16.7, samples=20):
    """Time, force of 1 N and the displacement after a linear sweep so fast that the peak is off by an error."""
    rate = error * 2 * np.pi * HALF**2
    t = np.arange(0.0, (high - low) / rate, 1.0 / (samples * high))
    begin, speed = 2 * np.pi * low, 2 * np.pi * rate
    x, _ = chirp_response(STIFFNESS, 2 * RATIO * OMEGA, begin, speed, t, rest=False)
    return t, np.sin(begin * t + speed * t**2 / 2), x


@pytest.mark.parametrize("error", [0.02, 0.1, 0.3])
def test_the_closed_form_of_a_sweep(error):
    """What separates it from the steady response is about what the rate explains, and a fast sweep is told."""
    (run,) = track(*chirp(error), cycles=4)
    off = np.abs(run.response - receptance(run.frequency)).max() / PEAK
    assert run.error == pytest.approx(error, rel=0.2) and off == pytest.approx(run.error, rel=0.05)
    assert run.bandwidth == pytest.approx(2 * HALF, rel=0.15) and run.up and not len(run.jumps)
    assert any("too fast" in remark for remark in run.remarks()) == (error > 0.05)


def test_a_logarithmic_sweep_up_and_down_with_distortion_and_noise():
    """Against scipy's own integration: a force with harmonics, a constant and noise, silence before and after."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 400.0, 1 / 300)
    frequency = 14.5 * 1.2 ** (1.0 - np.abs(t / 200.0 - 1.0))
    phi = 2 * np.pi * np.cumsum(frequency) / 300
    force = 2.0 * np.sin(phi) + 0.1 * np.sin(3 * phi + 1) + 0.02
    system = signal.StateSpace([[0, 1], [-STIFFNESS / MASS, -2 * RATIO * OMEGA]], [[0], [1 / MASS]], [[1, 0]], [[0]])
    _, x, _ = signal.lsim(system, force, t)
    x = x + 0.01 * np.abs(x).max() * rng.standard_normal(len(x))
    quiet = np.zeros(900)
    given = [np.concatenate([quiet, part, quiet]) for part in (force + 0.02 * rng.standard_normal(len(t)), x)]
    runs = track(np.arange(len(given[0])) / 300, *given, cycles=16)
    assert [run.up for run in runs] == [True, False]
    for run in runs:
        settled = np.abs(run.frequency - 14.5) > 0.2
        assert run.frequency.min() < 14.8 and run.frequency.max() > 17.2
        assert np.abs(run.response - receptance(run.frequency))[settled].max() < (run.error + 0.02) * PEAK
        assert run.level == pytest.approx(2.0, rel=0.01)


def history(change=lambda t, force, x: (t, force, x), header="time_s,force_N,displacement_m", error=0.1):
    rows = np.column_stack(change(*chirp(error))).tolist()
    return "\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in rows)])


def sweep(folder, text, **options):
    (folder / "swept.csv").write_text(text)

    def change(data):
        del data["forced"]
        data["sine_sweep"] = [{"file": "swept.csv", "noise": 0.02, "cycles": 4} | options]

    shaken = SCENE | {"excitation": {"frequency": 15.9, "base_acceleration": 1.0}}
    return IdentificationStudy.load(write(folder, change, scene=shaken if "base" in text[:40] else None))


@pytest.mark.parametrize(
    ("header", "factors", "options"),
    [
        ("time_s,force_N,displacement_m", (1.0, 1.0, 1.0), {}),
        ("t [ms],Kraft [kN],Weg [mm]", (1e3, 1e-3, 1e3), {}),
        ("t,base acc [g],x [mm]", (1.0, -1 / 9.80665, 1e3), {"relative": True}),
    ],
)
def test_a_file_becomes_a_forced_response(tmp_path, header, factors, options):
    text = history(lambda *rows: [factor * row for factor, row in zip(factors, rows, strict=True)], header)
    measured = sweep(tmp_path, text, **options).measured[0]
    amplitude, phase = (channel.values for channel in measured.channels)
    assert measured.measure == "amplitude_harmonic" and set(measured.direction) == {"up"} and len(measured.at) == 30
    found = amplitude * np.exp(1j * phase) * (-1.0 if options else 1.0)
    assert np.abs(found - receptance(measured.at)).max() < 0.11 * PEAK
    ((path, level),) = measured.levels.items()
    assert path == ("excitation.base_acceleration" if options else "excitation.force")
    assert level == pytest.approx(1.0, rel=1e-3) and "up at" in measured.source


def test_accelerations_become_displacements(tmp_path):
    """Absolute ones less those of the base: here the base moves as the force of a mass of 1 kg does, the other way."""

    def accelerations(t, force, x):
        relative = force - 2 * RATIO * OMEGA * np.gradient(x, t) - STIFFNESS * x
        return t, -force, relative - force

    text = history(accelerations, "t [s],base acc [m/s^2],acc [m/s^2]")
    measured = sweep(tmp_path, text, relative=False).measured[0]
    found = -measured.channels[0].values * np.exp(1j * measured.channels[1].values)
    assert np.abs(found - receptance(measured.at)).max() < 0.11 * PEAK


def test_a_jump_is_left_out():
    """Two curves with a jump between them, as of a hardening structure: no point lies between both."""
    t, force, x = chirp(0.05)
    (run,) = track(t, force, np.where(np.arange(len(t)) < 0.5 * len(t), x, 0.1 * x), cycles=4)
    assert len(run.jumps) and run.jumps[0] == pytest.approx(15.9, abs=0.05)
    ratio = np.abs(run.response / receptance(run.frequency))
    assert np.minimum(np.abs(ratio - 1.0), np.abs(ratio - 0.1)).max() < 0.05


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        (
            history(header="time_s,force_N,force_2"),
            {},
            "unknown column 'force_2'; expected time_s, force_N or base_accel",
        ),
        (history(lambda t, f, x: (t**2, f, x)), {}, "swept.csv: time: expected equidistant samples"),
        (history(lambda t, f, x: (t[::4], f[::4], x[::4])), {}, "samples a cycle at"),
        (history(lambda t, f, x: (t, 0 * f, x)), {}, "the excitation or the response is zero"),
        (history(lambda t, f, x: (t, np.sin(100 * t), x)), {}, "no run up or down of 20 windows"),
        (history(), {"cycles": 500}, "no run up or down of 20 windows of 500 cycles"),
        (
            history(lambda t, f, x: (t, x**3 * np.sin(7 * t**2), x)),
            {},
            "is no slow sine sweep: its phase runs backwards",
        ),
        (history(), {"relative": True}, "relative: is for a base_acceleration; leave it out"),
        (history(header="t,base_acceleration_m_s2,x_m"), {}, "relative to the base? Give true or false"),
        (history(), {"set": {"excitation.force": 2.0}}, "excitation.force is a column of the file; leave it out"),
        (history(), {"noise": 2.0}, "sine_sweep[0].noise"),
    ],
)
def test_histories_that_are_no_sweep(tmp_path, text, options, told):
    with pytest.raises(InputError) as error:
        sweep(tmp_path, text, **options)
    assert told in str(error.value) and "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("bodies", [[], [{"cavity": "c1", "mass": 0.02, "friction": 0.2, "restitution": 0.6}]])
def test_a_ramp_of_the_engine(bodies):
    """Its largest displacements, period by period, are the tracked amplitudes, also with impacts."""
    table = {"from": 15.2, "to": 16.6, "rate": [0.02]}
    one, state, parts = scene(damper=bodies, ramp=table), None, []
    run, (course,), base = ramp(one).runs[0], courses(one), ramped(one)
    for begin, frequency, value in zip(course.time, course.frequency, course.value.tolist(), strict=True):
        period = replace(scene_at(base, one.ramp, value), time=Time(periods=1, transient=0))
        response = simulate(period, samples_per_period=32, start=state)
        state, part = response.final, np.arange(32) / 32
        parts.append([begin + part / frequency, 0.5 * np.sin(2 * np.pi * part), response.displacement[:32]])
    time, force, x = np.concatenate(parts, axis=1)
    even = np.arange(time[0], time[-1], 1 / 512)
    (tracked,) = track(even, np.interp(even, time, force), np.interp(even, time, x), cycles=8)
    peaks = np.interp(tracked.time, run.time[: len(run.amplitude)], run.amplitude)
    assert np.abs(tracked.response) * tracked.level == pytest.approx(peaks, abs=0.01 * peaks.max())
    assert (run.impacts.sum() > 1000) == bool(bodies)
