"""Orbits of scenes: branches, their files, interruptions, the command, and what is refused."""

import json
import math
import tomllib

import numpy as np
import pytest
import tomli_w

import vanedamp as vd
from tests.tools.processes import ROOT
from vanedamp.coupling.orbits.diagram import Diagram
from vanedamp.coupling.orbits.first_orbit import of_run
from vanedamp.coupling.orbits.newton import OrbitStatus
from vanedamp.coupling.orbits.orbits import _Search
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.cli import main

BAD_INPUT = 2
#: x'' + 0.1 x' + x = A cos t with a stop at 1: the linear response A/0.1 grazes it at A = 0.1
STOP = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "excitation": {"frequency": 1 / (2 * math.pi), "force": 0.09},
    "stop": [{"side": "right", "gap": 1.0, "restitution": 0.8}],
    "time": {"periods": 400, "transient": 300},
    "orbit": {"parameter": "excitation.force", "from": 0.09, "to": 0.101, "step": 0.1, "max_step": 0.2},
}
#: the demonstration's structure with its narrowest gap: two impacts per period off the resonance
BODY = {
    "structure": {"model": "rigid", "mass": 0.012, "stiffness": 0.012 * (200 * math.pi) ** 2, "damping_ratio": 0.0016},
    "excitation": {"frequency": 102.0, "resonance_amplitude": 1e-3},
    "cavity": [{"name": "c1", "gap": 1e-4}],
    "damper": [{"cavity": "c1", "mass": 0.00024, "friction": 0.4, "restitution": 0.7}],
    "time": {"periods": 4000, "transient": 1000},
    "orbit": {"from": 102.0, "to": 101.4, "step": 0.005},
}


def scene(base, **changes):
    return validate(vd.Scene, base | changes, "scene.toml")


def table(base, **changes):
    return {"orbit": base["orbit"] | changes}


@pytest.fixture(scope="module")
def grazing():
    """The branch that grazes a stop."""
    return vd.orbits(scene(STOP))


def test_a_branch_through_grazing_turns_back_and_folds_again(grazing):
    (branch,) = grazing.branches
    first, second, end = branch.special
    assert (first.kind, second.kind, end.kind) == ("grazing", "fold", "end")
    assert first.parameter == pytest.approx(0.1, rel=1e-8) and "the branch turns" in first.note
    assert second.parameter < first.parameter and branch.parameter[-1] == pytest.approx(0.101)
    impacts = branch.impacts_per_period > 0
    assert set(branch.impacts_per_period) == {0.0, 1.0} and not impacts[: first.index + 1].any()
    # the product of the multipliers is e^2 for every impact, times the free decay
    product = np.where(impacts, 0.8**2, 1.0) * math.exp(-0.1 * 2 * math.pi)
    assert np.prod(branch.multipliers, axis=1) == pytest.approx(product, rel=1e-7)
    assert branch.amplitude_mean[~impacts] == pytest.approx(branch.parameter[~impacts] / 0.1, rel=1e-12)
    assert not branch.stable[first.index + 1] and branch.stable[-1]


def test_files_of_branches(grazing, tmp_path):
    xarray = pytest.importorskip("xarray")
    grazing.save(tmp_path / "branch.h5")
    found = vd.Branches.load(tmp_path / "branch.h5")
    assert found.to_json() == grazing.to_json() and found.scene == grazing.scene
    for name in ("parameter", "state", "multipliers", "stable", "amplitude_mean", "sequence", "symmetric", "neutral"):
        assert np.array_equal(getattr(found.branches[0], name), getattr(grazing.branches[0], name)), name
    assert found.branches[0].special[0].state == pytest.approx(grazing.branches[0].special[0].state)
    with xarray.open_dataset(tmp_path / "branch.h5", engine="h5netcdf") as data:
        memory = grazing.to_xarray()
        assert data.parameter.attrs["units"] == memory.parameter.attrs["units"] == "N"
        assert set(data.variables) == set(memory.variables)
        assert np.array_equal(data.state.sel(coordinate="mode 0"), memory.state.sel(coordinate="mode 0"))


class Killed(Exception):
    pass


@pytest.mark.parametrize("count", [1, 9])
def test_goes_on_where_it_was_interrupted(grazing, count, tmp_path):
    def killed(done, total):
        if done == count:
            raise Killed

    short = scene(STOP, **table(STOP, max_points=12))
    with pytest.raises(Killed):
        vd.orbits(short, killed, tmp_path / "partial")
    seen = []
    again = vd.orbits(short, lambda done, total: seen.append(done), tmp_path / "partial")
    assert seen[0] == count
    again.save(tmp_path / "again.h5")
    found, whole = vd.Branches.load(tmp_path / "again.h5").branches[0], grazing.branches[0]
    assert np.array_equal(found.state, whole.state[:12]) and np.array_equal(found.parameter, whole.parameter[:12])
    assert found.end == "max_points (12) reached"


def test_a_checkpoint_of_another_scene_is_left_alone(tmp_path):
    vd.orbits(scene(STOP, **table(STOP, max_points=2)), checkpoint=tmp_path / "partial")
    with pytest.raises(InputError, match="the checkpoint of another scene"):
        vd.orbits(scene(STOP), checkpoint=tmp_path / "partial")


def test_a_sweeps_periodic_points_lie_on_the_branch():
    swept = vd.sweep(scene(BODY, sweep={"excitation.frequency": [102.0, 101.8, 101.6]}))
    assert list(swept.classification) == ["periodic-1"] * 3
    for frequency, amplitude in zip(swept.axes["excitation.frequency"], swept.amplitude_mean, strict=True):
        start = scene(BODY, **table(BODY, **{"from": float(frequency)}))
        orbit = vd.find_orbit(start)
        assert orbit.status is OrbitStatus.OK and orbit.stable and orbit.iterations < 6
        assert orbit.amplitude_mean == pytest.approx(amplitude, rel=1e-9)


def test_a_branch_of_impacts_changes_its_sequence_and_doubles():
    coarse = {"from": 101.8, "to": 101.43, "step": 0.05, "max_step": 0.1}
    (branch,) = vd.orbits(scene(BODY, **table(BODY, **coarse))).branches
    assert [point.kind for point in branch.special][:2] == ["sequence", "period doubling"]
    doubling = branch.special[1].parameter
    assert not branch.stable[branch.special[1].index + 1] and 101.4 < doubling < 101.5
    # the same point, with other steps
    again = vd.orbits(scene(BODY, **table(BODY, **{"from": 101.47, "to": 101.43, "step": 0.02}))).branches[0]
    (other,) = [point.parameter for point in again.special if point.kind == "period doubling"]
    assert other == pytest.approx(doubling, rel=1e-8)


def resting(**changes):
    """The branch without impacts in a wider cavity, where friction lets the body rest anywhere."""
    table_ = table(BODY, **{"from": 101.0, "to": 100.4, "step": 0.05, "max_step": 0.1} | changes)
    (branch,) = vd.orbits(scene(BODY, cavity=[{"name": "c1", "gap": 5e-4}], **table_)).branches
    assert (branch.neutral == 1).all() and branch.stable.all() and not branch.impacts_per_period.any()
    return branch


def test_a_body_that_may_rest_anywhere_is_moved_from_the_wall_that_it_grazes():
    branch = resting(max_points=30)
    first = branch.special[0]
    assert first.kind == "grazing" and "rest anywhere" in first.note
    before, after = branch.state[first.index], branch.state[first.index + 1]
    assert abs(after[2] - before[2]) > 1e-5  # of the cavity's 5e-4
    assert np.delete(after, 2) == pytest.approx(np.delete(before, 2), rel=1e-4)


@pytest.mark.slow
def test_impacts_begin_where_the_travel_fills_the_cavity():
    branch = resting()
    onset = branch.special[-2]
    assert "left" in onset.note and "right" in onset.note and "no orbit found beyond" in branch.end
    # the slip is harmonic but for friction: its travel, from a run without walls beside it
    free = scene(
        BODY, cavity=[{"name": "c1", "gap": 5e-3}], excitation=BODY["excitation"] | {"frequency": onset.parameter}
    )
    response = vd.simulate(free, samples_per_period=2000)
    travel = np.ptp(response.body_displacement[-2000:, 0])
    assert travel == pytest.approx(5e-4, rel=1e-5)


def test_dry_friction_that_sticks_has_a_zero_multiplier():
    """Den Hartog's oscillator (1931) below its resonance, with two stops a period."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.0},
        "excitation": {"frequency": 0.25 / (2 * math.pi), "force": 1.0},
        "friction_damper": [{"normal_force": 1.0, "friction": 0.6}],
        "time": {"periods": 30, "transient": 20},
    }
    orbit = vd.find_orbit(scene(data))
    assert orbit.status is OrbitStatus.OK and orbit.iterations < 6 and orbit.stable and orbit.symmetric
    assert any("sticks" in name for name in orbit.passage.sequence)
    assert np.abs(orbit.multipliers).min() < 1e-12
    response = vd.simulate(scene(data))
    assert orbit.amplitude_mean == pytest.approx(response.amplitude_mean, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parameter": "cavity.c1.gpa"}, "orbit.parameter: cavity.c1.gpa: .*no 'gpa'.*did you mean 'gap'"),
        ({"parameter": "cavity.c2.gap"}, "orbit.parameter: cavity.c2.gap: no entry 'c2'"),
        ({"parameter": "structure.model"}, "orbit.parameter: structure.model: names no number"),
        ({"parameter": "structure"}, "orbit.parameter: structure: names no number"),
        ({"parameter": "time.periods"}, "orbit.parameter: time.periods is no number of the motion's equations"),
        ({"parameter": "damper.0.restitution", "from": 0.7, "to": 1.4}, "at damper.0.restitution = 1.4"),
        (
            {"parameter": "cavity.c1.gap", "track": {"parameter": "cavity.gap", "to": 1.0}},
            "orbit.track.parameter: cavity.gap is orbit.parameter; take another number",
        ),
        ({"from": None, "to": 102.0}, "orbit.to: 102 is where the branch begins"),
    ],
    ids=lambda value: value.get("parameter", "range") if isinstance(value, dict) else "",
)
def test_bad_tables_are_refused_in_one_line(changes, message):
    data = {key: value for key, value in (BODY["orbit"] | changes).items() if value is not None}
    with pytest.raises(InputError, match=message) as found:
        vd.orbits(scene(BODY, orbit=data))
    assert "\n" not in str(found.value)


def test_a_scene_without_table_and_another_method_are_refused():
    data = {key: value for key, value in BODY.items() if key != "orbit"}
    with pytest.raises(InputError, match="orbit: missing"):
        vd.orbits(scene(data))
    with pytest.raises(InputError, match=r"solver.method: orbits are those of the exact engine"):
        vd.orbits(scene(BODY, solver={"method": "moreau"}))
    still = {"structure": {"model": "prescribed", "displacement_amplitude": 1e-3}, "damper": [], "cavity": []}
    with pytest.raises(InputError, match="damper: expected bodies"):
        vd.find_orbit(scene(data, excitation={"frequency": 100.0}, **still))


def test_a_run_that_repeats_after_several_periods_is_an_orbit_of_so_many():
    """Figure 9 between its first two period doublings, 2365.541 and 2368.608 Hz (docs/orbits.md)."""
    data = tomllib.loads((ROOT / "docs" / "examples" / "orbits.toml").read_text())
    del data["orbit"]
    data["excitation"]["frequency"] = 2367.0
    figure9 = scene(data)
    assert vd.simulate(figure9).classification == "periodic-2"
    orbit = vd.find_orbit(figure9)
    assert (orbit.status, orbit.periods, orbit.stable) == (OrbitStatus.OK, 2, True)
    single = vd.find_orbit(scene(data, orbit={"periods": 1}))
    assert (single.status, single.periods, single.stable) == (OrbitStatus.OK, 1, False)


def test_a_run_that_does_not_repeat_starts_from_its_closest_returns():
    wandering = scene(
        BODY, cavity=[{"name": "c1", "gap": 5e-4}], orbit={}, excitation=BODY["excitation"] | {"frequency": 99.5}
    )
    response, map_ = vd.simulate(wandering), period_map(wandering)
    assert response.classification == "non-periodic"
    starts = of_run(map_, response, None)
    assert [start.periods for start in starts.candidates] == [1, 1, 2, 2, 3, 3]
    assert "the run of the scene is non-periodic: over 256 periods it comes back to 0." in starts.remedy
    assert vd.find_orbit(wandering).status is OrbitStatus.OK


def test_a_linear_start_that_leads_nowhere_says_what_the_run_gives():
    """Figure 9 near its resonance: the linear motion would pass through the walls."""
    data = tomllib.loads((ROOT / "docs" / "examples" / "orbits.toml").read_text())
    data["excitation"]["frequency"], data["cavity"][0]["gap"] = 2395.0, 3.5e-5
    data["orbit"] = {"start": "linear"}
    lost = scene(data)
    kind = vd.simulate(lost).classification
    with pytest.raises(InputError, match=r"no orbit of 1 .*; start = \"run\" finds an orbit of 1 period\(s\)$"):
        vd.orbits(lost)
    search = _Search(lost)
    starts = search.starts()
    assert starts.run is not None
    none = starts.run()._replace(candidates=[])
    diagram = Diagram(search.map, search.table, search.low, search.to, lambda: starts._replace(run=lambda: none))
    with pytest.raises(InputError, match=rf"finds none either .* run of the scene is {kind}.* \(the phase planes"):
        diagram.follow(lambda done, total: None)


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(STOP | table(STOP, max_points=5)))
    assert main(["orbits", "scene.toml", "-o", "branch.h5", "--json", "branch.json"]) == 0
    assert "branch 0: 5 orbits of 1 period(s), excitation.force = 0.09" in capsys.readouterr().out
    result = json.loads((tmp_path / "branch.json").read_text())
    assert {"parameter", "branches", "special_points", "iterations", "wall_time_s", "warnings"} <= result.keys()
    assert result["branches"][0]["points"] == 5 and result["branches"][0]["from"] is None
    assert vd.Branches.load("branch.h5").provenance["versions"]
    assert not (tmp_path / "branch.h5.partial").exists()
    assert main(["orbits", "scene.toml", "-o", "branch.h5", "--resume"]) == BAD_INPUT
    assert "nothing to resume" in capsys.readouterr().err
