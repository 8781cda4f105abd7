"""Waveforms from outside the package: pulses and others that only values describe, and one that is a sum of sines.

The references are closed forms: a linear oscillator under steps of force, and a free body on an accelerated base.
"""

import json
import math
import os
import re
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from tests.commands.test_extensions import ROOT, install
from vanedamp.coupling.output_histories import histories
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.registration import WAVEFORMS, register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.transient import left_over
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.toml_input import STRICT, Fraction, InputError, Real, validate
from vanedamp.files.variants import Variants
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.report.forced_response import forced_responses


@register
@dataclass(frozen=True, config=STRICT)
class Pulses(Waveform):
    """1 from `start` to `stop`, as shares of the period, 1/2 at its jumps and 0 elsewhere."""

    start: Fraction = 0.25
    stop: Fraction = 0.5
    shape: Literal["pulses"] = "pulses"

    def values(self, angle):
        turn = np.round(angle / (2 * np.pi), 12)  # jumps fall on steps
        return np.heaviside(turn - self.start, 0.5) - np.heaviside(turn - self.stop, 0.5)


@dataclass(frozen=True, config=STRICT)
class Train(Pulses):
    """The same by another name, which an entry point registers."""

    shape: Literal["train"] = "train"


@register
@dataclass(frozen=True, config=STRICT)
class Measured(Waveform):
    """A table of values over the period, straight in between, times `factor`: as read from a file."""

    points: tuple[Real, ...]
    factor: Real = 1.0
    shape: Literal["measured"] = "measured"

    def values(self, angle):
        at = np.arange(len(self.points) + 1) / len(self.points)
        return self.factor * np.interp(angle / (2 * np.pi), at, [*self.points, self.points[0]])


@register
@dataclass(frozen=True, config=STRICT)
class Sine(Waveform):
    shape: Literal["sine by values"] = "sine by values"

    def values(self, angle):
        return np.sin(angle)


@register
@dataclass(frozen=True, config=STRICT)
class Odd(Waveform):
    """The first terms of a square wave; `least` is wrong above 1."""

    terms: int = 2
    least: int = 1
    shape: Literal["odd orders"] = "odd orders"

    @property
    def shares(self):
        return {order: 1 / order for order in range(self.least, 2 * self.terms, 2)}


@register
@dataclass(frozen=True, config=STRICT)
class Broken(Waveform):
    fault: Literal["nan", "short"]
    shape: Literal["broken"] = "broken"

    def values(self, angle):
        return np.zeros(3) if self.fault == "short" else np.full_like(angle, np.nan)


FREQUENCY, OWN, FORCE = 15.0, 2 * math.pi * 24.0, 3.0
STEPPING = [
    {"method": "moreau"}, {"method": "penalty"}, {"method": "penalty", "scheme": "newmark"},
    {"method": "penalty", "scheme": "hht"}, {"method": "cosim"}, {"method": "cosim", "exchange": "jacobi", "hold": 0},
]  # fmt: skip
by_method = pytest.mark.parametrize("solver", STEPPING, ids=lambda solver: " ".join(map(str, solver.values())))


def scene(waveform, level="force", **tables):
    """An oscillator of 1 kg, undamped, for three periods from rest."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": OWN**2, "damping_ratio": 0.0},
        "excitation": {"frequency": FREQUENCY, level: FORCE},
        "gravity": {"acceleration": 0.0}, "time": {"periods": 3, "transient": 0}, "solver": {"method": "moreau"},
    } | tables  # fmt: skip
    if waveform is not None:
        data["excitation"] = data["excitation"] | {"waveform": waveform}
    return validate(Scene, data, "scene.toml")


def jumps(pulses, periods):
    """Times and signs of the jumps of a train of pulses."""
    times = [(n + turn) / FREQUENCY for n in range(periods) for turn in (pulses.start, pulses.stop)]
    return np.array(times), np.tile([1.0, -1.0], periods)


def oscillator(time, pulses, periods):
    """Displacement, m: each step of the force starts a cosine about its static displacement."""
    times, signs = jumps(pulses, periods)
    since = np.maximum(time[:, None] - times, 0.0)
    return FORCE / OWN**2 * ((1 - np.cos(OWN * since)) @ signs)


@by_method
def test_steps_of_force_on_an_oscillator(solver):
    """All methods are of second order in time, whose steps meet the jumps."""
    pulses, errors, counts = Pulses(0.2, 0.45), [], (200, 400, 800)
    for count in counts:
        options = solver | {"steps_per_period": count}
        response = simulate(
            scene({"shape": "pulses", "start": 0.2, "stop": 0.45}, solver=options), samples_per_period=40
        )
        assert response.status is Status.OK
        errors.append(np.abs(response.displacement - oscillator(response.time, pulses, 3)).max() * OWN**2 / FORCE)
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(2, abs=0.2)
    # a second-order method is off by some (Omega h)^2/12 of its phase, which grows over 2 pi 24/15 3 = 30
    assert errors[-1] < 30 * (OWN / FREQUENCY / 800) ** 2


@by_method
def test_a_body_out_of_reach_on_an_accelerated_base(solver):
    """It stays behind the base by the integrals of its acceleration, while the structure vibrates."""
    body = {"cavity": [{"name": "c", "gap": 1.0}], "damper": [{"cavity": "c", "mass": 0.1}]}
    solver = solver | {"steps_per_period": 800}
    made = scene({"shape": "pulses"}, "base_acceleration", solver=solver, **body)
    response = simulate(made, samples_per_period=40)
    times, signs = jumps(Pulses(), 3)
    behind = -FORCE / 2 * (np.maximum(response.time[:, None] - times, 0.0) ** 2 @ signs)
    x = -oscillator(response.time, Pulses(), 3)
    close = 30 * (OWN / FREQUENCY / 800) ** 2
    assert response.impacts_per_period == 0 and response.energy_residual < close
    np.testing.assert_allclose(response.displacement, x, rtol=0, atol=close * FORCE / OWN**2)
    np.testing.assert_allclose(response.body_displacement[:, 0], behind - x, rtol=0, atol=close * np.abs(behind).max())


def test_steady_response_of_a_damped_oscillator():
    """The first harmonic is that of the pulses times the receptance; the mean that of a static force."""
    zeta, pulses = 0.05, Pulses(0.1, 0.35)
    structure = {"model": "rigid", "mass": 1.0, "stiffness": OWN**2, "damping_ratio": zeta}
    made = scene(
        {"shape": "pulses", "start": 0.1, "stop": 0.35}, structure=structure, time={"periods": 100, "transient": 80},
        solver={"method": "moreau", "steps_per_period": 2000},
    )  # fmt: skip
    response, omega = simulate(made, samples_per_period=100), 2 * math.pi * FREQUENCY
    first = 2 * FORCE * math.sin(math.pi * (pulses.stop - pulses.start)) / math.pi
    receptance = 1 / (OWN**2 - omega**2 + 2j * zeta * OWN * omega)
    close = 10 * (OWN / FREQUENCY / 2000) ** 2
    assert response.status is Status.OK
    assert response.amplitude_harmonic == pytest.approx(first * abs(receptance), rel=close)
    # the sine of order 1 begins a quarter period before the middle of the pulse
    lag = 2 * math.pi * (0.25 - (pulses.start + pulses.stop) / 2)
    assert response.phase == pytest.approx(lag + float(np.angle(receptance)), abs=close)
    mean = response.displacement[-2000:].mean()
    assert mean == pytest.approx(FORCE / OWN**2 * (pulses.stop - pulses.start), rel=close)
    assert response.energy_residual < close


@pytest.mark.parametrize("solver", STEPPING[:4], ids=str)
def test_a_sine_by_its_values_is_the_sine(solver):
    """With impacts and friction, to round-off that the impacts multiply."""
    bodies = {
        "cavity": [{"name": "c", "gap": 2e-4}], "gravity": {"acceleration": 9.81},
        "time": {"periods": 6, "transient": 0},
        "damper": [{"cavity": "c", "mass": 0.02, "restitution": 0.6, "friction": 0.1, "position": -5e-5}],
        "solver": solver,
    }  # fmt: skip
    plain, ours = (simulate(scene(waveform, **bodies)) for waveform in (None, {"shape": "sine by values"}))
    assert plain.counters["impacts"] == ours.counters["impacts"] > 3
    for name in ("section", "slip", "slip_velocity", "peak"):
        expected = getattr(plain, name)
        np.testing.assert_allclose(
            getattr(ours, name), expected, rtol=0, atol=1e-8 * np.abs(expected).max(), err_msg=name
        )
    for name, value in plain.energy.items():
        assert ours.energy[name] == pytest.approx(value, rel=1e-8, abs=1e-8 * plain.energy["excitation"]), name


def test_a_table_of_values_that_a_sine_is_read_from():
    """Straight between 96 points, whose steps are a divisor of the method's: off by (2 pi / 96)^2 / 8."""
    points = np.sin(2 * np.pi * np.arange(96) / 96).tolist()
    ours, plain = simulate(scene({"shape": "measured", "points": points})), simulate(scene(None))
    largest = np.abs(plain.section[:, 0]).max()
    assert 0 < np.abs(ours.section - plain.section)[:, 0].max() < 3 * (2 * np.pi / 96) ** 2 * largest


def test_a_finite_sum_of_sines_runs_with_every_method():
    """It is compiled to the same exponentials as the same list of harmonics."""
    listed = [{"order": 1, "amplitude": 1.0}, {"order": 3, "amplitude": 1 / 3}]
    excitation = {"frequency": FREQUENCY, "force": FORCE, "harmonic": listed}
    for solver in ({"method": "exact"}, {"method": "solve_ivp"}, {"method": "moreau"}):
        ours = simulate(scene({"shape": "odd orders"}, solver=solver))
        same = simulate(scene(None, solver=solver, excitation=excitation))
        np.testing.assert_allclose(ours.section, same.section, rtol=1e-12, atol=1e-12 * np.abs(same.section).max())
    curves = [
        linear_responses(made)[0].amplitude(np.array([FREQUENCY]))
        for made in (scene({"shape": "odd orders"}), scene(None, excitation=excitation))
    ]
    assert curves[0] == pytest.approx(curves[1], rel=1e-12)


def test_transient_of_a_static_force():
    """A constant is a waveform, too: what is left of its steady displacement decays with the structure."""
    structure = {"model": "rigid", "mass": 1.0, "stiffness": OWN**2, "damping_ratio": 0.02}
    made = scene({"shape": "measured", "points": [1.0]}, structure=structure)
    assert left_over(made, 4) == pytest.approx(math.exp(-0.02 * OWN * 4 / FREQUENCY), rel=0.02**2)


@pytest.mark.parametrize("solver", [{"method": "exact"}, {"method": "solve_ivp"}])
def test_methods_without_steps_of_their_own_refuse_in_one_sentence(solver):
    with pytest.raises(InputError) as refused:
        simulate(scene({"shape": "pulses"}, solver=solver))
    with pytest.raises(InputError, match=r'^excitation.waveform: shape "pulses" is no sum of sines and'):
        sweep(scene({"shape": "pulses"}, solver=solver, sweep={"excitation.force": [1.0, 2.0]}))
    assert str(refused.value) == (
        'excitation.waveform: shape "pulses" is no sum of sines and is for solver.method moreau or penalty or cosim, '
        f"not {solver['method']}"
    )


def test_what_needs_harmonics_refuses(tmp_path):
    model = ReducedModel.from_matrices(np.eye(2), np.diag([1e4, 1e5]), {"a": np.ones(2)}, damping=np.eye(2))
    replace(model, outputs=("s",), output_rows=np.ones((1, 2))).save(tmp_path / "rom.h5")
    structure = {"model": "rom", "file": str(tmp_path / "rom.h5")}
    excitation = {"frequency": FREQUENCY, "force": 1.0, "at": "a", "waveform": {"shape": "pulses"}}
    with pytest.raises(InputError, match=r"^excitation.waveform: linear curves are those of sums of sines"):
        linear_responses(scene({"shape": "pulses"}))
    with pytest.raises(InputError, match=r'^structure.modes: "auto" weighs errors at the frequencies of sines'):
        simulate(scene(None, structure=structure | {"modes": "auto"}, excitation=excitation))
    with pytest.raises(InputError, match=r'^excitation.waveform: shape "pulses" is no sum of sines .* not exact$'):
        histories(scene(None, structure=structure, excitation=excitation, solver={"method": "exact"}), ["s"])
    of_steps = histories(scene(None, structure=structure, excitation=excitation), ["s"], 20)
    assert np.abs(of_steps.values).max() > 0


@pytest.mark.parametrize(
    ("waveform", "message"),
    [
        ({"shape": "pulse"}, "excitation.waveform.shape: must be one of .*'pulses', 'measured', 'sine by values'.*"),
        ({"start": 0.1}, "excitation.waveform.shape: must be one of .*pulses, measured, sine by values.*"),
        ({"shape": "pulses", "start": -0.1}, r"excitation.waveform.start: should be greater than or equal to 0 .*"),
        ({"shape": "pulses", "begin": 0.1}, "excitation.waveform.begin: unknown key; known: shape, start, stop"),
        ({"shape": "measured"}, "excitation.waveform.points: missing; it is required here"),
        ("pulses", r"excitation.waveform: expected a table, headed \[excitation.waveform\]"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused_in_one_line(waveform, message):
    with pytest.raises(InputError, match=f"^scene.toml: {message}$"):
        scene(waveform)


def test_wrong_combinations_are_refused():
    with pytest.raises(InputError, match=r"^scene.toml: excitation: give one of harmonic and waveform$"):
        harmonic = [{"order": 2, "amplitude": 1.0}]
        scene(None, excitation={"frequency": 1.0, "harmonic": harmonic, "waveform": {"shape": "pulses"}})
    table = {"model": "prescribed", "displacement_amplitude": 1e-3}
    excitation = {"frequency": 1.0, "waveform": {"shape": "pulses"}}
    with pytest.raises(InputError, match=r"excitation.waveform: a prescribed motion takes a sum of sines"):
        scene(None, structure=table, excitation=excitation)
    assert scene(None, structure=table, excitation=excitation | {"waveform": {"shape": "odd orders"}}).moved


@pytest.mark.parametrize(
    ("waveform", "message"),
    [
        ({"shape": "broken", "fault": "nan"}, 'shape "broken": its values must be a finite number for each angle'),
        ({"shape": "broken", "fault": "short"}, 'shape "broken": its values must be a finite number for each angle'),
        ({"shape": "odd orders", "least": -1}, 'shape "odd orders": order -1 of its shares has '),
    ],
)
def test_what_a_waveform_must_not_answer_is_refused(waveform, message):
    with pytest.raises(InputError, match=f"^excitation.waveform: {message}"):
        simulate(scene(waveform))


def test_what_is_no_waveform_is_not_registered():
    with pytest.raises(
        ExtensionError, match="is no waveform: derive a dataclass from Waveform, with a default of `shape`"
    ):
        WAVEFORMS.register(dict)


NOTHING = Variants("part", Waveform, "shape", "vanedamp.nowhere")


@dataclass(frozen=True, config=STRICT)
class Table:
    part: Annotated[Waveform, NOTHING]


def test_a_table_without_any_variants_says_where_they_come_from():
    reason = "t: part: there is no part; other packages add them (entry points vanedamp.nowhere)"
    with pytest.raises(InputError, match=f"^{re.escape(reason)}$"):
        validate(Table, {"part": {"shape": "any"}}, "t")
    with pytest.raises(InputError, match=r"^t: parts: unknown key; did you mean 'part'\?$"):
        validate(Table, {"parts": {"shape": "any"}}, "t")


def test_sweep_over_a_parameter_of_the_waveform():
    """In this process and in others; the linear curves, which have no closed form, are left out."""
    made = scene(
        {"shape": "pulses"}, sweep={"excitation.waveform.stop": [0.3, 0.5], "excitation.frequency": [14.0, 15.0]}
    )
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = [sweep(made), sweep(made, executor=pool)]
    single = simulate(scene({"shape": "pulses", "stop": 0.3}))
    for result in found:
        assert (result.status == "ok").all() and np.isnan(result.amplitude_undamped).all()
        assert result.amplitude_mean[0, 1] == single.amplitude_mean != result.amplitude_mean[1, 1]
        for response in forced_responses(result):
            assert "; none without bodies to compare with;" in response.sentence


SCENE = """
[structure]
model = "rigid"
mass = 1.0
stiffness = {stiffness!r}
damping_ratio = 0.0
[excitation]
frequency = 15.0
force = 3.0
[excitation.waveform]
shape = "train"
stop = 0.4
[gravity]
acceleration = 0.0
[time]
periods = 3
transient = 0
[solver]
method = "{method}"
"""


def test_a_package_adds_one_by_an_entry_point(tmp_path):
    """The command line finds it, and says in one line what the exact engine does not take."""
    install(tmp_path / "site", "acme_train", f"[vanedamp.waveforms]\ntrain = {__name__}:Train\n")
    finished = {}
    for method in ("moreau", "exact"):
        (tmp_path / "scene.toml").write_text(SCENE.format(stiffness=OWN**2, method=method))
        path = os.pathsep.join([str(tmp_path / "site"), str(ROOT)])
        finished[method] = subprocess.run(
            [sys.executable, "-m", "vanedamp", "run", "scene.toml", "--json", "-"], cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False,
        )  # fmt: skip
    assert (finished["moreau"].returncode, finished["moreau"].stderr) == (0, "")
    ours = simulate(scene({"shape": "pulses", "stop": 0.4}))
    assert json.loads(finished["moreau"].stdout)["amplitude_max"] == pytest.approx(ours.amplitude_max, rel=1e-12)
    assert finished["exact"].returncode != 0 and finished["exact"].stderr.count("\n") == 1
    assert 'excitation.waveform: shape "train" is no sum of sines' in finished["exact"].stderr
