"""Steady states of a sweep over starts: each run ends in one of two motions known in closed form; pictures of them."""

from dataclasses import replace

import numpy as np
import pytest

from tests.coupling.sweep.test_continuation import BISTABLE, DAMPING, EPS, HALF_GAP, one_to_one
from tests.studies.report.test_report import charts
from tests.tools.changed import changed
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.steady_states import is_start, steady_states
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import validate
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect

RATIOS = np.array([0.97, 0.98, 1.01, 1.02])
FREQUENCIES = (RATIOS / (2 * np.pi)).tolist()
POSITIONS, VELOCITIES = [-30.0, -20.0, 0.0, 10.0, 60.0], [-30.0, -10.0, 0.0, 30.0]
BASIN = {"damper.0.velocity": VELOCITIES, "excitation.frequency": FREQUENCIES, "damper.0.position": POSITIONS}


def over(axes):
    return sweep(validate(Scene, BISTABLE | {"time": {"periods": 1000, "transient": 900}, "sweep": axes}, "scene"))


@pytest.fixture(scope="module")
def basin():
    return over(BASIN)


def test_runs_end_where_closed_forms_have_them(basin):
    """A body at rest within the play of the structure's motion floats for ever; all others come to hit both walls.

    Without friction nothing slows a body down but impacts, so that one which floats with a speed meets a wall. The
    structure floats at its linear amplitude A, and a body at rest at p stays free of contact if A < half the gap - |p|,
    from rest with the structure's transient as well, which beside the resonance at most doubles A.
    """
    found = steady_states(basin)
    assert found.starts == ("damper.0.velocity", "damper.0.position")
    assert found.parameters == ("excitation.frequency",)
    linear = 1 / np.abs(1 - (1 - EPS) * RATIOS**2 + 2j * DAMPING * RATIOS)
    for at, ratio in enumerate(RATIOS):
        states, label = found.states[at], found.label[:, at]
        floats = [state for state in states if state.impacts_per_period == 0]
        (hits,) = (state for state in states if state.motion == "periodic-1, 2 impacts per period")
        # the closed form has one harmonic of the structure
        assert hits.amplitude_mean == pytest.approx(one_to_one(ratio), rel=6e-3)
        for speed, row in zip(VELOCITIES, label, strict=True):
            for position, number in zip(POSITIONS, row, strict=True):
                if speed == 0.0 and 2.0 * linear[at] + abs(position) < HALF_GAP:
                    assert states[number] in floats
                if speed != 0.0 or linear[at] + abs(position) > HALF_GAP:
                    assert states[number] not in floats
        if floats:
            assert floats[0].amplitude_mean == pytest.approx(linear[at], rel=1e-6)
    assert (found.count[[0, 3]] == 2).all()
    assert sum(state.runs for states in found.states for state in states) == found.label.size


def test_states_are_told_apart_by_what_does_not_depend_on_the_last_period(basin):
    """Means that differ by less than the tolerance, or than confidence intervals of motions without period, are one."""
    amplitude = np.broadcast_to([1.0, 1.004, 1.008, 1.05, 2.0], basin.shape)
    plain = {
        name: np.broadcast_to(value, basin.shape)
        for name, value in {
            "attached_mass_fraction": 1.0, "impacts_per_period": 2.0, "classification": "periodic-2", "status": "ok",
            "amplitude_mean_confidence": 0.04,
        }.items()
    }  # fmt: skip
    by_position = lambda record, **options: steady_states(record, **options).label[0, 0].tolist()  # noqa: E731
    periodic = changed(basin, amplitude_mean_dynamic=amplitude, **plain)
    assert by_position(periodic) == [0, 0, 0, 1, 2]
    assert by_position(periodic, tolerance=0.001) == [0, 1, 2, 3, 4]
    chaotic = replace(periodic, classification=np.full(basin.shape, "non-periodic", object))
    assert by_position(chaotic) == [0, 0, 0, 0, 1]
    impacts = changed(periodic, impacts_per_period=np.broadcast_to([2.0, 2.0, 3.0, 2.0, 2.0], basin.shape))
    assert sorted(set(by_position(impacts))) == [0, 1, 2, 3]
    other = plain["classification"].copy()
    other[..., 1] = "periodic-4"
    assert by_position(replace(periodic, classification=other)) == [0, 1, 0, 2, 3]
    failed = plain["status"].astype(object)
    failed[..., 4] = "event_budget"
    bad = steady_states(replace(periodic, status=failed))
    assert bad.label[0, 0].tolist() == [0, 0, 0, 1, -1]
    assert (bad.count == 2).all()
    assert (steady_states(replace(periodic, status=np.full(basin.shape, "error: x", object))).count == 0).all()


def test_starts_are_told_from_parameters():
    for path in ("damper.0.position", "damper.velocity", "initial.displacement", "continuation.direction"):
        assert is_start(path)
    for path in ("excitation.frequency", "cavity.c.gap", "damper.0.mass", "structure.mass", "time.periods"):
        assert not is_start(path)


def test_report_shows_basins_and_how_many_states_there_are(basin, tmp_path):
    basin.save(tmp_path / "basin.h5")
    gaps = [100.0, 140.0, 180.0, 220.0]
    counted = over({"cavity.c.gap": gaps, "excitation.frequency": FREQUENCIES, "damper.0.velocity": [0.0, 30.0]})
    counted.save(tmp_path / "counted.h5")
    starts = replace(
        basin, axes={path: basin.axes[path] for path in BASIN if path != "excitation.frequency"}, peaks={},
        **{name: getattr(basin, name)[:, 0] for name in ("status", "classification")},
        quantities={name: values[:, 0] for name, values in basin.quantities.items()},
    )  # fmt: skip
    starts.save(tmp_path / "starts.h5")
    write_report(collect([tmp_path]), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    found = charts(page)
    # a sweep of starts only has no curves
    curves = {"summary-0", "response-0", "mistuning-0", "energy-0"}
    assert set(found) == curves | {"map-0", "basins-0", "basins-1", "states-0"}
    write_report(collect([tmp_path / "starts.h5"]), tmp_path / "starts.html")
    assert set(charts((tmp_path / "starts.html").read_text(encoding="utf-8"))) == {"basins-0"}
    assert not any("starts" in name for trace in found["response-0"] for name in trace["meta"]["curves"])
    states = steady_states(basin)
    panels = [trace for trace in found["basins-0"] if trace["type"] == "heatmap"]
    legend = [trace["name"] for trace in found["basins-0"] if trace["type"] == "scatter"]
    assert len(panels) == len(RATIOS)
    assert legend[0] == "periodic-1, 2 impacts per period"
    for at, trace in enumerate(panels):
        drawn = np.reshape(trace["z"], (len(VELOCITIES), len(POSITIONS)))
        for name, number in zip(legend, range(1, 10), strict=False):
            own = [place for place, state in enumerate(states.states[at]) if state.motion == name]
            np.testing.assert_array_equal(drawn == number, np.isin(states.label[:, at], own))
    (counts,) = found["states-0"]
    np.testing.assert_array_equal(np.reshape(counts["z"], (4, 4)), steady_states(counted).count)
