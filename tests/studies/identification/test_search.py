"""Identification as a whole: the truth within its intervals, flat numbers, wrong models, commands and files."""

import json
import time
import tomllib
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w

from tests.studies.identification import oscillator
from tests.studies.identification.oscillator import FREQUENCY, RATIO, STIFFNESS, half_swings, response, study
from tests.studies.identification.test_fit import body
from tests.studies.identification.test_study import write
from tests.tools.tiers import cases
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.store import load
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.identification import search
from vanedamp.studies.identification.data import forced
from vanedamp.studies.identification.record import Identification, IdentificationStatus
from vanedamp.studies.identification.search import identify
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.summary import noise_texts
from vanedamp.studies.identification.tables import SearchTable, Sought
from vanedamp.studies.jobs.workers import WorkerPool

QUICK = SearchTable(candidates=8, starts=1)


@pytest.fixture(scope="module")
def found():
    calls = []
    return identify(study(), progress=lambda *call: calls.append(call), provenance={"a": 1}), calls


def test_truth_lies_in_the_intervals(found):
    record, calls = found
    assert record.status is IdentificationStatus.OK and record.flat == () and record.notes == ()
    truth = np.array([RATIO, STIFFNESS])
    assert np.all(record.interval[:, 0] < truth) and np.all(truth < record.interval[:, 1])
    # intervals of nearly straight residuals are those of the covariance
    half, deviation = np.ptp(record.interval, axis=1) / 2, np.sqrt(np.diag(record.covariance))
    assert half == pytest.approx(1.96 * deviation, rel=0.05)
    assert record.threshold == pytest.approx(3.8415, abs=1e-3) and record.test.chance > 0.01
    assert record.correlation.diagonal() == pytest.approx(1.0) and abs(record.correlation[0, 1]) < 1
    assert calls[-1][0] == calls[-1][1] and all(done <= total for done, total in calls)
    assert record.scene.structure.stiffness == record.best[1]
    errors = (record.data_model - record.data_value) / record.data_deviation
    assert errors @ errors == pytest.approx(record.misfit, rel=0.05)


def test_proposals_are_those_of_closed_forms(found):
    """A further amplitude tells most of the damping at the resonance, which no level shifts."""
    record, _ = found
    proposal = record.proposal
    assert proposal.axes == ("excitation.force", "excitation.frequency")
    assert record.paths[proposal.worst] == "structure.damping_ratio"
    own = record.best
    at = proposal.points[:, 1]
    step = 1e-5 * own[0]
    slope = (np.log(response(at, own[1], own[0] + step)[0]) - np.log(response(at, own[1], own[0] - step)[0])) / 2e-5
    assert proposal.shrink[:, 0].argmin() % 13 == pytest.approx(np.abs(slope[:13]).argmax(), abs=1)
    assert np.all(proposal.shrink <= 1.0 + 1e-12)


def test_record_comes_back(found, tmp_path):
    record, _ = found
    record.save(tmp_path / "found.h5")
    back = Identification.load(tmp_path / "found.h5")
    one, other = (json.dumps(each.to_json(), sort_keys=True) for each in (back, record))
    assert one == other and back.provenance == {"a": 1}
    assert type(back.plot()).__name__ == "Figure"
    record.save_scene(tmp_path / "tuned.toml")
    assert Scene.load(tmp_path / "tuned.toml") == record.scene


def test_noise_is_estimated_from_residuals():
    noisy = study(seed=3)
    open_noise = [forced("sweep", FREQUENCY, noisy.measured[0].channels[0].values, {})]
    record = identify(IdentificationStudy(oscillator.scene(), oscillator.NUMBERS, open_noise, QUICK))
    residual = np.log(record.data_model / record.data_value)
    assert record.deviation[0] == pytest.approx(np.sqrt(residual @ residual / (len(residual) - 2)), rel=0.03)
    assert record.estimated.all() and record.threshold == pytest.approx(6.61, abs=0.01)  # F of 1 and 5 at 0.95
    assert np.isnan(record.test.chance)


def test_a_body_that_sticks_tells_nothing_of_friction():
    """Amplitudes of a body that friction holds are those of a greater mass, whatever friction and gap are."""
    base, at = body().replace({"excitation.force": 0.02}), [15.2, 15.5, 15.6, 15.8, 16.1]
    amplitude = [simulate(base.replace({"excitation.frequency": frequency})).amplitude_mean for frequency in at]
    measured = [forced("low", at, amplitude, {}, noise=0.02)]
    numbers = {"damper.0.friction": Sought(0.15, 0.8), "structure.damping_ratio": Sought(0.005, 0.02)}
    record = identify(IdentificationStudy(base, numbers, measured, SearchTable(candidates=4, starts=1)))
    assert record.status is IdentificationStatus.FLAT and record.flat == ("damper.0.friction",)
    assert record.notes[0] == "damper.0.friction: flat, the measurements do not tell it between 0.15 and 0.8"
    low, high = record.interval[1]
    assert low < 0.01 < high and np.isnan(record.correlation[0, 0])


def test_a_wrong_model_is_seen_by_its_misfit():
    """Responses of two masses, which one mass cannot have."""
    amplitude = response(FREQUENCY)[0] * (1 + 0.3 * np.sin(3 * (FREQUENCY - 15.3)))
    measured = [forced("two masses", FREQUENCY, amplitude, {}, noise=0.02)]
    record = identify(IdentificationStudy(oscillator.scene(), oscillator.NUMBERS, measured, QUICK))
    assert record.status is IdentificationStatus.MISFIT and record.test.chance < 1e-6
    assert record.notes[0].startswith("misfit: ")


@pytest.mark.parametrize(
    ("wrong", "noise", "said"),
    [
        (1e3, None, "divided by 1000 all amplitudes fit (mm and m?)"),
        pytest.param(np.sqrt(2.0), 0.02, "divided by 1.414 all amplitudes fit", marks=pytest.mark.slow),
        pytest.param(2.0, 0.02, "divided by 2 all amplitudes fit", marks=pytest.mark.slow),
        (np.where(FREQUENCY == 15.3, 4.0, 1.0), None, "% of the values"),
    ],
)  # fmt: skip
def test_wrong_units_and_outliers_are_a_misfit(wrong, noise, said):
    """Amplitudes of the closed form, with noise of 1 %, in millimetres, as rms, peak to peak, and with an outlier."""
    rng = np.random.default_rng(5)
    amplitude = response(FREQUENCY)[0] * np.exp(0.01 * rng.standard_normal(len(FREQUENCY)))
    measured = [forced("sweep", FREQUENCY, wrong * amplitude, {}, noise=noise)]
    number = {"structure.damping_ratio": oscillator.NUMBERS["structure.damping_ratio"]}
    few = SearchTable(candidates=1, starts=1)
    record = identify(IdentificationStudy(oscillator.scene(), number, measured, few))
    assert record.status is IdentificationStatus.MISFIT
    assert said in record.notes[0]
    assert noise is not None or record.test.noise == record.deviation[0] > 0.2
    assert noise is not None or any("by the residuals" in line for line in noise_texts(record))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    pairs = zip(FREQUENCY, response(FREQUENCY)[0], strict=True)
    lines, (time, amplitude) = ["frequency_hz,amplitude_m", *(f"{f},{a:.6g}" for f, a in pairs)], half_swings()
    decay = ["time_s,amplitude_m", *(f"{t},{a:.6g}" for t, a in zip(time, amplitude, strict=True))]
    write(
        tmp_path, lambda data: data.update(search={"candidates": 4, "starts": 1}), "\n".join(lines), "\n".join(decay),
        oscillator.SCENE | {"sweep": {"excitation.frequency": [15.8, 15.9]}},
    )  # fmt: skip
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_commands(folder, capfd):
    assert main(["check", "study.toml"]) == 0
    assert "structure.stiffness 9000 to 11000" in capfd.readouterr().out
    options = ["-o", "f.h5", "--scene", "t.toml", "--json", "f.json", "--workers", "1"]
    assert main(["identify", "study.toml", *options]) == 0
    printed = capfd.readouterr().out
    assert printed.startswith("status ok") and "structure.stiffness = 1e+04 N/m" in printed and "next: " in printed
    data = json.loads((folder / "f.json").read_text())
    assert data["best"] == pytest.approx([RATIO, STIFFNESS], rel=1e-3)
    tuned = tomllib.loads((folder / "t.toml").read_text())
    assert tuned["structure"]["stiffness"] == data["best"][1] and tuned["sweep"]["excitation.frequency"] == [15.8, 15.9]
    assert main(["identify", "study.toml", "-o", "b.h5", "--budget", "1e-9", "--workers", "1"]) == 0
    captured = capfd.readouterr()
    assert captured.out.startswith("status budget") and "the budget of time is over" in captured.err
    assert main(["identify", "study.toml", "-o", "b.h5", "--workers", "1"]) == 0
    assert Identification.load("b.h5").best.tolist() == data["best"]
    assert sorted(path.name for path in folder.glob("*.partial")) == []
    assert main(["identify", "study.toml", "-o", "b.h5", "--resume"]) == BAD_INPUT
    with pytest.raises(SystemExit):
        main(["identify", "study.toml", "--budget", "0"])
    assert "--budget: expected a time in s, not '0'" in capfd.readouterr().err
    assert main(["info", "f.h5"]) == 0
    assert "vanedamp identify" in capfd.readouterr().out
    assert main(["report", "f.h5", "-o", "r.html"]) == 0
    page = (folder / "r.html").read_text()
    for chart in ("data", "profiles", "correlations", "next"):
        assert f'id="identification-{chart}-0"' in page


@pytest.mark.parametrize("workers", cases([None, 2], fast=[None]))
def test_an_interrupted_search_resumes_bit_for_bit(found, tmp_path, workers):
    file, calls, stops = tmp_path / "f.h5.partial", [], [1, 8, 5]

    def progress(done, total):
        calls.append((done, total))
        if stops and len(calls) >= stops[0]:
            raise KeyboardInterrupt

    with nullcontext() if workers is None else WorkerPool(workers) as pool:
        while stops:
            calls.clear()
            with pytest.raises(KeyboardInterrupt):
                identify(study(), pool, progress, {"a": 1}, file)
            stops.pop(0)
        assert len(load(file, "identify-checkpoint")[0]["part"]) == 14  # none is done again
        resumed = identify(study(), pool, progress, {"a": 1}, file)
    whole = found[0].to_json() | {"wall_time_s": resumed.wall_time_s}
    assert json.dumps(resumed.to_json(), sort_keys=True) == json.dumps(whole, sort_keys=True)
    done, total = calls[-1]
    assert done == total
    with pytest.raises(InputError, match="the checkpoint of another study; nothing was done to it"):
        identify(study(seed=2), provenance={"a": 1}, checkpoint=file)


def test_what_a_budget_leaves_is_written_and_gone_on_from(found, tmp_path):
    file = tmp_path / "f.h5.partial"
    cut = identify(study(search=SearchTable(candidates=8, starts=1, budget=1e-9)), provenance={"a": 1}, checkpoint=file)
    assert cut.status is IdentificationStatus.BUDGET and cut.proposal is None
    assert cut.notes[0] == "the budget of time is over: 8 of 8 candidates and what follows are not finished"
    # the first guess, with the intervals of its derivatives
    assert cut.best == pytest.approx([0.02, 1.02e4]) and np.all(np.ptp(cut.interval, axis=1) > 0.0)
    cut.save(tmp_path / "cut.h5")
    assert Identification.load(tmp_path / "cut.h5").status is IdentificationStatus.BUDGET
    whole = identify(study(), provenance={"a": 1}, checkpoint=file)
    assert whole.best.tolist() == found[0].best.tolist() and whole.interval.tolist() == found[0].interval.tolist()


@pytest.mark.parametrize("function", cases(["_minimum", "_profile", "_sensitivity"], fast=["_profile"]))
def test_a_budget_that_ends_within_a_stage(found, monkeypatch, function):
    """The clock runs out as that stage begins."""
    late = []
    clock = SimpleNamespace(monotonic=lambda: 2.0 if late else 0.0, perf_counter=time.perf_counter)
    monkeypatch.setattr(search, "time", clock)
    monkeypatch.setattr("vanedamp.studies.identification.fit.time", clock)
    own = getattr(search, function)
    monkeypatch.setattr(search, function, lambda *arguments: late.append(1) or own(*arguments))
    cut = identify(study(), budget=1.0)
    assert cut.status is IdentificationStatus.BUDGET and "the budget of time is over" in cut.notes[0]
    if function == "_minimum":
        assert cut.best == pytest.approx([0.02, 1.02e4], rel=0.2)
    else:
        assert cut.best == pytest.approx(found[0].best, rel=1e-6)
        assert cut.interval == pytest.approx(found[0].interval, rel=0.02)


def test_pipeline_finds_numbers_and_sweeps_with_them(folder):
    pipeline = {"folder": "out", "identify": [{"study": "study.toml"}], "sweep": [{"scene": "out/study_found.toml"}]}
    (folder / "p.toml").write_text(tomli_w.dumps(pipeline))
    assert main(["pipeline", "p.toml", "--workers", "1"]) == 0
    assert Identification.load(folder / "out/study.h5").status is IdentificationStatus.OK
    assert (folder / "out/study_found.h5").exists()
    assert Scene.load(folder / "out/study_found.toml").structure.stiffness == pytest.approx(STIFFNESS, rel=1e-3)
    assert main(["pipeline", "p.toml", "--workers", "1", "--json", "again.json"]) == 0
    assert [each["status"] for each in json.loads((folder / "again.json").read_text())["stages"]] == ["kept", "kept"]
    (folder / "forced.csv").write_text((folder / "forced.csv").read_text().replace("16.6", "16.60001"))
    assert main(["pipeline", "p.toml", "--dry-run", "--json", "plan.json"]) == 0
    plan = json.loads((folder / "plan.json").read_text())["stages"]
    assert plan[0]["status"] == "runs" and plan[0]["reasons"] == ["file forced.csv changed"]
