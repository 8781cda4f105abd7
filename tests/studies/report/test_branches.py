"""Pictures of orbits: their motion in time, and the runs of sweeps that belong beside their branches."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.coupling.sweep.test_continuation import BISTABLE, HALF_GAP
from tests.studies.report.test_report import charts
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.history import SAMPLES, orbit_history
from vanedamp.coupling.orbits.orbits import find_orbit, orbits
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import validate
from vanedamp.studies.kinds.orbits.borders import maps_of
from vanedamp.studies.kinds.orbits.page import joined
from vanedamp.studies.kinds.plot import plot
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect
from vanedamp.studies.report.sweep_beside import points_beside

#: beside the resonance, where the motion with two impacts per period is symmetric
FREQUENCY = 1.01 / (2 * np.pi)
HITTING = BISTABLE | {
    "excitation": {"frequency": FREQUENCY, "force": 1.0},
    "damper": [BISTABLE["damper"][0] | {"velocity": 30.0}],
    "time": {"periods": 1000, "transient": 900},
    "sweep": {},
}


@pytest.fixture(scope="module")
def hitting():
    """A scene whose body hits both walls once a period, and the end of its run."""
    scene = validate(Scene, HITTING, "scene")
    return scene, simulate(scene)


def test_history_is_the_motion_along_the_orbit(hitting):
    """It closes, has the structure's peak, is its own mirror image, and impacts reverse the body's speed."""
    scene, settled = hitting
    along = period_map(scene)
    history = orbit_history(along, along.state_of(settled.final))
    assert history.time[[0, -1]] == pytest.approx([0.0, 1 / FREQUENCY])
    half = SAMPLES // 2
    for name in ("displacement", "velocity", "slip", "slip_velocity"):
        values = getattr(history, name)
        scale = np.abs(values).max()
        # velocities beside an impact are differences to one side; all others are the same half a period later
        away = np.abs(history.time[:half, None] - np.ravel(history.impact_time) % (0.5 / FREQUENCY)).min(axis=1)
        kept = away > 4 * history.time[1]
        kept[0] = False
        np.testing.assert_allclose(values[:half][kept], -values[half:-1][kept], atol=1e-6 * scale)
    assert np.abs(history.displacement).max() == pytest.approx(settled.amplitude_mean, rel=1e-3)
    assert np.abs(history.slip).max() == pytest.approx(HALF_GAP, rel=0.02)
    assert history.velocity[0] == pytest.approx(settled.section[-1, 1], rel=5e-3)
    assert history.slip_velocity[0, 0] == pytest.approx(settled.slip_velocity[-1, 0], rel=5e-3)
    assert history.impact_body.tolist() == [0, 0]
    for impact in history.impact_time:
        after = np.searchsorted(history.time, impact)
        before, rebound = history.slip_velocity[after - 1, 0], history.slip_velocity[after, 0]
        assert rebound / before == pytest.approx(-0.7, rel=0.02)


def test_runs_beside_branches_are_those_of_the_same_scene(hitting):
    scene, _ = hitting
    gaps, speeds, frequencies = [100.0, 2 * HALF_GAP], [0.0, 30.0], [0.155, 0.158, 0.16]
    axes = {"cavity.c.gap": gaps, "excitation.frequency": frequencies, "damper.0.velocity": speeds}
    found = sweep(scene.replace({"sweep": axes, "time.periods": 1100, "time.transient": 1000}))
    x, amplitude = points_beside(scene, "excitation.frequency", found)
    np.testing.assert_array_equal(x, np.repeat(frequencies, 2))
    np.testing.assert_array_equal(amplitude, found.amplitude_mean[1].ravel())
    x, amplitude = points_beside(scene.replace({"excitation.frequency": 0.158}), "cavity.c.gap", found)
    np.testing.assert_array_equal(x, np.repeat(gaps, 2))
    np.testing.assert_array_equal(amplitude, found.amplitude_mean[:, 1].ravel())
    assert len(points_beside(scene, "damper.0.mass", found)[0]) == 0
    for other in ({"damper.0.mass": 0.006}, {"cavity.c.gap": 99.0}, {"cavity.c.name": "d", "damper.0.cavity": "d"}):
        assert len(points_beside(scene.replace(other), "excitation.frequency", found)[0]) == 0
    status = found.status.copy()
    status[1, 0, 1] = "undecided_contact"
    x, _ = points_beside(scene, "excitation.frequency", replace(found, status=status))
    np.testing.assert_array_equal(x, np.repeat(frequencies, 2)[1:])


@pytest.fixture(scope="module")
def followed(hitting):
    """The branch of two impacts per period from beside the resonance towards it, beyond its loss of symmetry."""
    scene, _ = hitting
    table = {"from": FREQUENCY, "to": 1.004 / (2 * np.pi), "step": 0.02, "max_step": 0.05}
    return orbits(scene.replace({"orbit": table}))


def test_branch_of_a_scene_loses_its_symmetry_in_a_pitchfork(hitting, followed):
    """A multiplier passes 1 there, on an orbit that is its own mirror image; the orbits beyond are unstable."""
    scene, _ = hitting
    (branch,) = followed.branches
    (pitchfork,) = (point for point in branch.special if point.kind == "pitchfork")
    assert pitchfork.note == "symmetry breaks"
    assert branch.symmetric.all()
    np.testing.assert_array_equal(branch.stable, branch.parameter > pitchfork.parameter)
    along = period_map(scene)
    for side, inside in ((1, True), (-1, False)):
        here = scene.replace({"excitation.frequency": pitchfork.parameter * (1 + side * 1e-6)})
        orbit = find_orbit(here, along.restart_of(pitchfork.state))
        distance = np.abs(orbit.multipliers - 1.0).min()
        nearest = orbit.multipliers[np.abs(orbit.multipliers - 1.0).argmin()]
        # 0.4 of the multiplier goes over a thousandth of the frequency
        assert 1e-5 < distance < 1e-2
        assert (nearest.real < 1.0) == inside


def test_report_shows_branches_over_the_points_of_sweeps(hitting, followed, tmp_path):
    scene, _ = hitting
    frequencies = np.linspace(1.0065, 1.01, 4) / (2 * np.pi)
    sweep(scene.replace({"sweep": {"excitation.frequency": frequencies.tolist()}})).save(tmp_path / "runs.h5")
    followed.save(tmp_path / "branch.h5")
    replace(followed, branches=followed.branches[:1]).save(tmp_path / "same.h5")
    write_report(collect([tmp_path]), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    found = charts(page)
    assert {"branches-0", "multipliers-0", "orbits-0"} <= set(found)
    assert "branches-1" not in found  # files of one scene share their charts
    (branch,) = followed.branches
    by_name = {trace["name"]: trace for trace in reversed(found["branches-0"])}  # the upper panel's come first
    runs = by_name["runs of runs.h5"]
    np.testing.assert_allclose(runs["x"], frequencies)
    order = np.argsort(branch.parameter)
    along = 1e6 * np.interp(runs["x"], branch.parameter[order], branch.amplitude_mean[order])
    # stable orbits are where runs end; between its points the branch is drawn as straight lines
    np.testing.assert_allclose(runs["y"], along, rtol=2e-2)
    stable, unstable = (by_name[f"branch 1, {kind}"] for kind in ("stable", "unstable"))
    assert (stable["line"]["dash"], unstable["line"]["dash"]) == ("solid", "dash")
    last = np.flatnonzero(branch.stable)[-1]
    np.testing.assert_allclose(np.asarray(stable["y"], float)[: last + 1], 1e6 * branch.amplitude_mean[: last + 1])
    np.testing.assert_allclose(np.asarray(unstable["x"], float)[last + 1 :], branch.parameter[last + 1 :])
    (special,) = (point for point in branch.special if point.kind == "pitchfork")
    mark = by_name["pitchfork"]
    assert mark["x"][0] == special.parameter
    low, high = sorted(1e6 * branch.amplitude_mean[[special.index, special.index + 1]])
    assert low < mark["y"][0] < high
    plane = next(trace for trace in found["multipliers-0"] if trace.get("legendgroup") == "branch 0")
    values = branch.multipliers.ravel()
    drawn = plane["x"] + 1j * np.asarray(plane["y"])
    np.testing.assert_allclose(np.angle(drawn), np.angle(values), atol=1e-12)
    np.testing.assert_allclose(
        np.abs(drawn), np.where(np.abs(values) > 1, 1 + np.log10(np.abs(values)), np.abs(values))
    )
    orbit = found["orbits-0"][0]
    assert max(orbit["y"]) == pytest.approx(1e6 * branch.amplitude_mean[branch.stable].max(), rel=1e-3)
    assert "pitchfork" in page
    assert "symmetry breaks" in page


def test_branches_of_several_files_are_numbered_through(followed):
    (branch,) = followed.branches
    second = replace(followed, branches=(branch, replace(branch, source_branch=0, source_special=0)), warnings=("w",))
    whole = joined([second, second, followed])
    assert isinstance(whole, Branches)
    assert [each.source for each in whole.branches] == [None, (0, 0), None, (2, 0), None]
    assert whole.warnings == ("w",)


def test_report_draws_borders_over_the_colours_of_a_sweep_with_their_axes(tmp_path):
    """The border of grazing of an oscillator below a stop, over force and gap; vd.plot has the same lines."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        "excitation": {"frequency": 1.2 / (2 * np.pi), "force": 0.4555}, "stop": [{"side": "right", "gap": 1.0}],
        "time": {"periods": 4, "transient": 2},
    }  # fmt: skip
    scene = validate(Scene, data, "scene")
    track = {"parameter": "stop.0.gap", "to": 1.02, "kinds": ["grazing"], "within": (0.45, 0.47)}
    table = {
        "parameter": "excitation.force", "to": 0.4565, "start": "linear", "max_points": 12, "step": 0.1,
        "min_step": 0.01, "max_step": 1.0,
    }  # fmt: skip
    orbits(scene.replace({"orbit": table | {"track": track}})).save(tmp_path / "borders.h5")
    axes = {"excitation.force": [0.45, 0.46], "stop.0.gap": [1.0, 1.01, 1.02]}
    sweep(scene.replace({"sweep": axes})).save(tmp_path / "runs.h5")
    sweep(scene.replace({"sweep": axes, "structure.damping": 0.2})).save(tmp_path / "other.h5")
    found = collect([tmp_path])
    write_report(found, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Borders over stop.0.gap" in page
    drawn = charts(page)["borders-0"]
    assert [trace["type"] for trace in drawn] == ["heatmap", "scatter"]
    figure = plot(Branches.load(tmp_path / "borders.h5"))
    (line,) = figure.data
    assert line.name == "grazing"
    assert np.asarray(line.x) == pytest.approx(0.4560701700396551 * np.asarray(line.y) / 1e6)
    two = {
        file.name: result.record
        for file, result in ((Path(file), result) for file, result in found.kinds["sweep"].items())
    }
    assert list(maps_of(Branches.load(tmp_path / "borders.h5"), two)) == ["runs.h5"]
