"""Runs of rings with bodies: against a single structure, an independent integrator, and by sector."""

import json

import numpy as np
import pytest

from tests.reference.comparison import follow
from tests.tools.rings import Chain
from tests.tools.tiers import cases
from vanedamp.coupling.engine.line import sleeping
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.sector_response import BY_SECTOR, SectorResponse
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_peaks
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.store import load
from vanedamp.files.toml_input import InputError, validate

CHAIN = Chain(sectors=6, damping_ratio=0.01)
#: of two nodal diameters
RESONANCE = float(np.sqrt(CHAIN.squares([2])[0]) / (2 * np.pi))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return CHAIN.saved(tmp_path_factory.mktemp("ring"))


def scene(file, **changes):
    tables = {
        "structure": {"model": "ring", "file": file},
        "excitation": {"frequency": 0.99 * RESONANCE, "resonance_amplitude": 2e-4, "at": "tip", "wave": 2},
        "cavity": [
            {"name": "c", "gap": 1e-4, "floor": "tip", "sectors": "all", "scatter": {"position": 0.5, "seed": 1}}
        ],
        "damper": [{"cavity": "c", "mass": 0.01, "friction": 0.2, "restitution": 0.6}],
        "time": {"periods": 60, "transient": 20},
    }
    return validate(Scene, tables, "scene").replace({path.replace("__", "."): value for path, value in changes.items()})


def as_single_structure(made, tmp_path):
    """The scene written out by hand, on the same modes as a reduced model."""
    model = CHAIN.ring().model(made.structure.mistuning and made.structure.mistuning.deviations(6))
    model.save(tmp_path / "rom.h5")
    data = unrolled(made).to_dict() | {"structure": {"model": "rom", "file": str(tmp_path / "rom.h5")}}
    return validate(Scene, data, "scene"), model


def test_one_cavity_is_that_of_a_single_structure(file, tmp_path):
    # the level by a force: by a resonance it would be that of the tuned ring
    excitation = {"frequency": RESONANCE, "force": 25.0, "at": "tip", "wave": 2}
    made = scene(
        file, cavity__c__sectors=[4], structure__mistuning={"stiffness": {"std": 0.02}}, excitation=excitation
    )  # fmt: skip
    single, _ = as_single_structure(made, tmp_path)
    assert [damper.cavity for damper in single.damper] == ["c@4"]
    one, other = simulate(made, events=True), simulate(single, events=True)
    assert one.status is other.status is Status.NOT_STEADY  # after so few periods
    assert one.event_list == other.event_list
    assert sum(event.kind == "impact" for event in one.event_list) > 50
    assert np.array_equal(one.section, other.section)
    assert one.energy_residual < 1e-10
    assert other.sectors is None


def test_six_bodies_follow_an_independent_integrator(file, tmp_path, monkeypatch):
    monkeypatch.setattr(sleeping, "CROWD", 0)
    made = scene(file, excitation={"frequency": RESONANCE, "force": 25.0, "at": "tip", "wave": 2})
    single, model = as_single_structure(made, tmp_path)
    found = follow(single, 8, model, tmp_path)
    assert found.counters["impacts"] > 20
    ring = simulate(made.replace({"time": {"periods": 8, "transient": 0}}), events=True)
    assert ring.event_list == found.event_list


@pytest.mark.parametrize(
    ("sectors", "mass", "friction", "wave", "contact"),
    cases(CROWDS := [
        (8, 0.3, 0.0, 3, {"law": "newton"}), (7, 0.1, 0.6, 1, {"law": "newton"}), (8, 0.01, 0.1, 2, {"law": "newton"}),
        (7, 0.05, 0.1, 2, {"law": "compliant", "stiffness": 1e6}),
    ], fast=CROWDS[::3]),
)  # fmt: skip
def test_sleeping_bodies_follow_an_independent_integrator(
    sectors, mass, friction, wave, contact, tmp_path, monkeypatch
):  # fmt: skip
    """Heavy bodies wake each other by their impacts, without friction as well; light ones sleep for long."""
    monkeypatch.setattr(sleeping, "CROWD", 0)
    chain = Chain(sectors=sectors, damping_ratio=0.01)
    frequency = 1.01 * float(np.sqrt(chain.squares([wave])[0]) / (2 * np.pi))
    made = scene(chain.saved(tmp_path), excitation={"frequency": frequency, "force": 25.0, "at": "tip", "wave": wave})
    made = made.replace(
        {"damper.0.mass": mass, "damper.0.friction": friction, "cavity.c.gap": 5e-5, "contact": contact}
    )
    model = chain.ring().model(None)
    model.save(tmp_path / "rom.h5")
    data = unrolled(made).to_dict() | {"structure": {"model": "rom", "file": str(tmp_path / "rom.h5")}}
    found = follow(validate(Scene, data, "scene"), 6, model, tmp_path)
    assert found.counters["impacts"] > 30


def test_time_steps_converge_to_the_events(file):
    made = scene(file, excitation={"frequency": RESONANCE, "force": 25.0, "at": "tip", "wave": 2})
    made = made.replace({"time": {"periods": 6, "transient": 0}})
    exact = simulate(made)
    stepped = simulate(made.replace({"solver": {"method": "moreau", "steps_per_period": 8000}}))
    assert stepped.sectors is not None
    assert np.isnan(stepped.sectors.impacts_per_period).all()
    assert stepped.section[:, 0] == pytest.approx(exact.section[:, 0], abs=2e-3 * exact.amplitude_max)


def test_without_bodies_every_sector_answers_alike(file):
    made = scene(file, cavity=[], damper=[], time={"periods": 400, "transient": 300})
    response = simulate(made)
    sectors = response.sectors
    assert sectors.amplitude_mean == pytest.approx(np.full(6, response.amplitude_mean), rel=1e-7)
    assert sectors.amplitude_undamped == pytest.approx(np.full(6, response.amplitude_mean), rel=1e-6)
    assert sectors.amplitude_fixed == pytest.approx(sectors.amplitude_undamped, rel=1e-12)
    assert sectors.localisation == pytest.approx(1.0, abs=1e-7)
    assert sectors.tuned == pytest.approx(2e-4, rel=1e-9)
    assert sectors.amplification == pytest.approx(response.amplitude_mean / 2e-4, rel=1e-7)
    assert sectors.largest == 0  # of equal ones


def test_results_by_sector_are_those_of_the_run(file, tmp_path):
    made = scene(file, structure__mistuning={"seed": 2, "stiffness": {"std": 0.03}}, excitation__at="tip@2")
    response = simulate(made)
    sectors = response.sectors
    assert sectors.amplitude_mean[2] == pytest.approx(response.amplitude_mean, rel=1e-12)
    assert sectors.amplitude_max[2] == pytest.approx(response.amplitude_max, rel=1e-12)
    assert sectors.impacts_per_period.sum() == pytest.approx(response.impacts_per_period)
    assert np.ptp(sectors.amplitude_mean) > 0.05 * sectors.amplitude_mean.max()
    assert 1.0 < sectors.localisation < np.sqrt(6)
    data = json.loads(json.dumps(response.to_json()))["sectors"]
    assert data["largest"] == int(np.argmax(sectors.amplitude_mean))
    assert f"sector {data['largest']} of 6" in sectors.sentence
    response.save(tmp_path / "run.h5")
    values, attributes = load(tmp_path / "run.h5", "response")
    assert values["sector_amplitude_mean"].tolist() == sectors.amplitude_mean.tolist()
    assert json.loads(attributes["sectors"])["localisation"] == sectors.localisation


def test_a_static_pull_moves_no_amplitude_by_sector(file):
    # along their cavities the bodies pull the structure from its place: amplitudes count from there
    made = scene(file, gravity={"acceleration": 500.0, "orientation_deg": 90.0}, damper__0__friction=0.0)
    response = simulate(made)
    assert abs(response.static_deflection) > 0.01 * response.amplitude_mean
    assert response.sectors.amplitude_mean[0] == pytest.approx(response.amplitude_mean_dynamic, rel=1e-12)


def test_the_record_tells_the_ring_from_its_arrays():
    rows = np.array([[3.0, 1.0], [4.0, 1.0], [2.0, 2.0], [1.0, 1.0], [0.0, 2.0]])
    record = SectorResponse(dict(zip(BY_SECTOR, rows, strict=True)), tuned=2.0)
    assert (record.largest, record.amplification) == (0, 1.5)
    assert record.localisation == pytest.approx(3.0 / np.sqrt(5.0))
    assert "impacts per period 0 to 2" in record.sentence
    still = SectorResponse(dict(zip(BY_SECTOR, [*np.zeros((4, 2)), np.full(2, np.nan)], strict=True)))
    assert still.to_json()["impacts_per_period"] == [None, None]
    assert (still.amplification, still.localisation) == (None, None)


def test_seeds_and_sectors_are_axes_of_a_sweep(file, tmp_path):
    made = scene(
        file, structure__mistuning={"stiffness": {"std": 0.02}}, time={"periods": 30, "transient": 10},
        sweep={"structure.mistuning.seed": [0, 1], "cavity.c.sectors": ["all", 3]},
    )  # fmt: skip
    found = sweep(made)
    assert found.status.shape == (2, 2)
    assert (found.status == "not_steady").all()
    assert found.sectors["sector_amplitude_mean"].shape == (2, 2, 6)
    alone = simulate(made.replace({"structure.mistuning.seed": 1, "cavity.c.sectors": 3, "sweep": {}})).sectors
    for name in ("amplitude_mean", "amplitude_undamped", "impacts_per_period"):
        assert found.sectors[f"sector_{name}"][1, 1].tolist() == getattr(alone, name).tolist()
    assert found.sectors["localisation"][1, 1] == alone.localisation
    assert np.flatnonzero(found.sectors["sector_impacts_per_period"][0, 1]).tolist() == [3]
    found.save(tmp_path / "sweep.h5")
    again = Sweep.load(tmp_path / "sweep.h5")
    for name, values in found.sectors.items():
        assert np.array_equal(again.sectors[name], values)
    assert "sector" in again.to_xarray()["sector_amplitude_max"].dims
    assert np.shape(again.to_json()["sector_amplitude_max"]) == (2, 2, 6)


def test_a_sweep_over_the_frequency_has_the_peaks_of_its_ring(file):
    made = scene(
        file, structure__mistuning={"stiffness": {"std": 0.02}}, time={"periods": 30, "transient": 10},
        sweep={"excitation.frequency": [0.99 * RESONANCE, 1.01 * RESONANCE]},
    )  # fmt: skip
    found = sweep(made)
    free, fixed = linear_peaks(made, 0.99 * RESONANCE, 1.01 * RESONANCE)
    assert float(found.peaks["undamped_peak"]) == pytest.approx(free.amplitude, rel=1e-9)
    assert float(found.peaks["fixed_peak"]) == pytest.approx(fixed.amplitude, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sweep": {"cavity.c.sectors": ["all", 7]}}, "the ring has no sector 7"),
        ({"sweep": {"cavity.c.sectors": ["all", 1], "sections": 3}}, r"sweep.cavity.c.sectors: changes the number"),
    ],
)
def test_a_sweep_that_has_no_points_says_so(file, changes, message):
    with pytest.raises(InputError, match=message):
        sweep(scene(file, **changes))


def test_no_points_have_no_sectors_but_their_number(file):
    row = Row(scene(file))
    columns = row.arrays(np.zeros((0, row.width)), (0,))
    assert columns["sector_amplitude_mean"].shape == (0, 6)
    assert columns["localisation"].shape == (0,)


def test_a_sweep_over_rings_of_other_sizes_is_rejected(file, tmp_path):
    Chain(sectors=4).ring().save(tmp_path / "four.h5")
    with pytest.raises(InputError, match="rings of different sectors"):
        sweep(scene(file, sweep={"structure.file": [file, str(tmp_path / "four.h5")]}))
