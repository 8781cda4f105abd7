"""Runs that would neither end nor heed an interrupt: compiled functions return to Python, and give up at last."""

import subprocess
import sys

import numpy as np
import pytest

from tests.tools.planar import open_run
from tests.tools.processes import environment
from vanedamp.coupling.engine.line.event_driven import EngineRun
from vanedamp.coupling.methods import time_stepping
from vanedamp.coupling.numerics.codes import SEGMENTS, STEPS
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.files.toml_input import validate


def on_a_track(radius):
    """A disc on a track whose frequency grows with the centrifugal load, by the root of the radius."""
    return validate(Scene, {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
        "excitation": {"frequency": 15.9, "force": 2.0}, "rotation": {"rpm": 600.0},
        "cavity": [{"name": "c", "gap": 1e-3, "play": 1e-4, "radius": radius}],
        "damper": [{
            "cavity": "c", "mass": 0.05, "friction": 0.3, "restitution": 0.6, "shape": "disc", "radius": 5e-3,
            "track_radius": 0.02,
        }],
        "time": {"periods": 2, "transient": 0},
    }, "scene")  # fmt: skip


def test_a_mode_too_fast_for_the_excitation_is_refused():
    assert simulate(on_a_track(1.0)).status is Status.OK
    assert simulate(on_a_track(1e12)).status is Status.ILL_CONDITIONED


def counted(function, calls):
    def call(*arguments):
        calls.append(1)
        return function(*arguments)

    return call


def test_segments_with_many_turns_are_cut():
    """Two periods of 89,000 radians each: their integrals follow every turn."""
    calls, run = [], open_run(on_a_track(1e7), 2, 10**6)
    run._run = counted(run._run, calls)
    assert run.advance_to(2) is Status.OK
    angle = run.system.period * run.flows.fastest.max()
    assert angle == pytest.approx(2 * np.pi * 62.832 * np.sqrt(1e7 / 0.02) / (2 * np.pi * 15.9), rel=0.3)
    assert run.state.counters[SEGMENTS] >= 2 * angle / 3e4
    assert len(calls) > 4


@pytest.fixture
def resting():
    """A run of a body that never moves: a segment is a period."""
    scene = validate(Scene, {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
        "excitation": {"frequency": 15.9, "force": 1e-3},
        "cavity": [{"name": "c", "gap": 1e-3}],
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.3, "restitution": 0.6, "normal_load": 1.0}],
        "time": {"periods": 10_000, "transient": 0},
    }, "scene")  # fmt: skip
    system = assemble(scene)
    line, start = line_system(system), start_of(scene, system)
    return EngineRun(system, line, start, new_records(system, 10_000, 0), False, 10**6)


def test_runs_of_sliders_return_now_and_then(resting):
    calls = []
    resting._run = counted(resting._run, calls)
    assert resting.advance_to(10_000) is Status.OK
    assert resting.state.counters[SEGMENTS] >= 10_000
    assert len(calls) >= 3


def stepped(method, body, steps, periods=3):
    """A run of a stepping method, with events and samples."""
    scene = validate(Scene, {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
        "excitation": {"frequency": 15.9, "force": 2.0},
        "cavity": [{"name": "c", "gap": 1e-3} | ({"play": 1e-4} if body else {})],
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.3, "restitution": 0.6} | (body or {"normal_load": 0.1})],
        "solver": {"steps_per_period": steps, "penetration": 0.5} | method,
        "time": {"periods": periods, "transient": 0},
    }, "scene")  # fmt: skip
    return simulate(scene, events=True, samples_per_period=100)


BLOCK = {"shape": "block", "length": 8e-3, "height": 3e-3}


@pytest.mark.parametrize(
    ("method", "body"),
    [
        ({"method": "moreau"}, {}), ({"method": "penalty"}, {}), ({"method": "penalty", "scheme": "hht"}, {}),
        ({"method": "cosim", "substeps": 3}, {}), ({"method": "moreau"}, BLOCK), ({"method": "penalty"}, BLOCK),
    ],
    ids=["moreau", "penalty", "hht", "cosim", "moreau of a block", "penalty of a block"],
)  # fmt: skip
def test_a_period_of_many_steps_is_cut(method, body, monkeypatch):
    """Cut anywhere within their periods, runs are the same."""
    whole = stepped(method, body, 2000)
    monkeypatch.setattr(time_stepping, "_SLICE", 1234)
    lengths, march = [], time_stepping.SteppedRun.advance_to

    def watched(run, periods):
        inner = run.march

        def count(log, until, *limits):
            lengths.append(until - int(run.motion.counters[STEPS]))
            return inner(log, until, *limits)

        run.march = count
        return march(run, periods)

    monkeypatch.setattr(time_stepping.SteppedRun, "advance_to", watched)
    cut = stepped(method, body, 2000)
    assert len(lengths) > 6
    assert max(lengths) <= 1234
    assert whole.counters["impacts"] > 0
    for name in ("peak", "section", "time", "displacement"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name))
    assert list(cut.event_list) == list(whole.event_list)


_GIVEN_UP = """
import sys
from tests.coupling.engine.line.test_endless_runs import on_a_track
from tests.tools.input_files import SCENE
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.engine.line import event_functions
from vanedamp.coupling.engine.plane import event_functions as planar
import tomllib
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate

slider = tomllib.loads(SCENE) | {"time": {"periods": 2, "transient": 0}}
del slider["sweep"]
for most in (1000, 0):
    event_functions.MOST = planar.MOST = most
    print(simulate(validate(Scene, slider, "slider")).status.value, simulate(on_a_track(1.0)).status.value)
"""


def test_a_search_without_end_is_given_up():
    """In plain Python, where the most evaluations of one search can be set."""
    done = subprocess.run(
        [sys.executable, "-c", _GIVEN_UP], env=environment(NUMBA_DISABLE_JIT="1"), capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.splitlines() == ["ok ok", "ill_conditioned ill_conditioned"]
