"""Runs with other numbers, one after the other, are those of scenes made with these, bit for bit."""

import numpy as np
import pytest

from tests.coupling.sweep.test_alike import _ONE, _RIGID
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep import runs as module
from vanedamp.coupling.sweep.runs import Runs
from vanedamp.files.toml_input import InputError, validate

_NUMBERS = {
    "excitation.frequency": (14.0, 18.0), "structure.damping_ratio": (0.005, 0.05), "cavity.c.gap": (2e-3, 8e-3),
    "damper.0.friction": (0.05, 0.3), "damper.0.restitution": (0.1, 0.9),
}  # fmt: skip
_SCENES = {
    "two bodies": _RIGID,
    "an open length": _ONE | {"time": {}},
    "until the mean is known": _ONE | {"time": {"periods": 700, "steady": "auto", "tolerance": 0.003}},
    "few events": _ONE | {"solver": {"max_events": 40}},
    "worn": _ONE | {"wear": {"rate": 1e-13, "area": 1e-6}},
}


@pytest.mark.parametrize("name", _SCENES)
def test_runs_are_those_of_their_scenes(name, monkeypatch):
    scene, rng, alone, found = validate(Scene, _SCENES[name], "scene"), np.random.default_rng(5), [], []
    monkeypatch.setattr(module, "simulate", lambda *args, **options: alone.append(1) or simulate(*args, **options))
    runs, before = Runs(scene, _NUMBERS), dict[str, float]()
    for number in range(8):
        numbers = {path: float(rng.uniform(*ends)) for path, ends in _NUMBERS.items()}
        start = found[-1].final if number % 2 else None
        if number % 4 == 3:
            numbers = {**before, "cavity.c.gap": 1.01 * before["cavity.c.gap"]}
        own, exact = runs.run(numbers, start), simulate(scene.replace(numbers), start=start)
        assert (own.status, own.classification) == (exact.status, exact.classification)
        assert (own.final is None) == (exact.final is None)
        if own.final is not None:
            assert own.final.to_list() == exact.final.to_list()
        for quantity in own.quantities:
            assert repr(getattr(own, quantity)) == repr(getattr(exact, quantity)), quantity
        found.append(own)
        before = numbers
    assert len(alone) == 0 or name == "worn"
    assert {"amplitude_mean", "amplitude_fixed", "phase", "impacts_per_period"} <= set(found[0].quantities)


def test_runs_together_are_those_one_by_one():
    """Some from starts, one of which is moved into a narrower cavity, with numbers that make scenes of one kind."""
    scene, rng = validate(Scene, _RIGID, "scene"), np.random.default_rng(8)
    points = [{path: float(rng.uniform(*ends)) for path, ends in _NUMBERS.items()} for _ in range(9)]
    for point in points:
        point["structure.damping_ratio"] = 0.02
    runs = Runs(scene, _NUMBERS)
    starts = [None, *(runs.run(point).final for point in points[1:])]
    for start, point in zip(starts[4:], points[4:], strict=True):
        point["cavity.c.gap"] = 1.5 * float(np.ptp(start.slip)) + 1e-4
    starts[6:8] = None, None
    alone = [Runs(scene, _NUMBERS).run(point, start) for point, start in zip(points, starts, strict=True)]
    together = runs.run_all(points, starts)
    assert len({one.amplitude_mean for one in alone}) > 5 and runs.run_all([], []) == []
    for one, other in zip(alone, together, strict=True):
        assert (one.status, one.classification) == (other.status, other.classification)
        assert one.final.to_list() == other.final.to_list()
        assert repr(one.amplitude_mean) == repr(other.amplitude_mean)
        assert repr(dict(one.quantities)) == repr(dict(other.quantities))


def test_numbers_that_make_no_scene_have_no_run():
    runs = Runs(validate(Scene, _ONE, "scene"), ["structure.mass"])
    assert runs.run({"structure.mass": -1.0}) is None and runs.scene({"structure.mass": -1.0}) is None


def test_a_start_that_does_not_fit_is_refused():
    one, two = (validate(Scene, tables, "scene") for tables in (_ONE, _RIGID))
    with pytest.raises(InputError, match="does not fit"):
        Runs(two, ["excitation.frequency"]).run({"excitation.frequency": 15.0}, simulate(one).final)
