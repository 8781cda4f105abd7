"""The optimisation finds the optimum that is known, and keeps what it found. No test asserts a time."""

import html
import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w
import xarray

from tests.tools.processes import ROOT
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.kinds.optimisation.charts import optimisation_figure
from vanedamp.studies.optimisation import search as module
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import deviations, optimise
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.worst_start import STARTS

EXAMPLE = ROOT / "docs" / "examples" / "optimise.toml"


def study(folder, change=lambda data: None, quick=True):
    """The example, with a tiny budget."""
    data = tomllib.loads(EXAMPLE.read_text())
    if quick:
        data["time"] = {"periods": 60, "transient": 50, "tolerance": 0.6}  # of the transient half is left
        data["optimise"] |= {"evaluations": 10, "samples": 3, "map": {"mass_ratio": 3, "gap_ratio": 2}}
        data["optimise"]["band"] = {"start": 2380.0, "stop": 2430.0, "num": 3}
    change(data)
    path = folder / "optimise.toml"
    path.write_text(tomli_w.dumps(data))
    return path


def along_order(data):
    """The example's structure on a disc: its frequency rises with the speed, and an engine order meets it."""
    data["structure"]["centrifugal_stiffness"] = 0.2
    data["rotation"] = {"rpm": 24_000.0}
    data["damper"][0]["normal_load"] = 0.01  # bodies that the centrifugal load does not press
    del data["excitation"]["frequency"]
    data["excitation"]["engine_order"] = 6.0
    del data["optimise"]["band"]
    data["optimise"]["rpm"] = {"start": 24_300.0, "stop": 24_900.0, "num": 3}
    data["optimise"] |= {"map": {"mass_ratio": 2, "gap_ratio": 2}, "evaluations": 5, "samples": 1}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("optimise")
    calls = []
    return optimise(Study.load(study(folder)), progress=lambda *call: calls.append(call), provenance={"a": 1}), calls


def test_best_of_all_that_was_tried(found):
    record, calls = found
    nominal = record.history_amplitude[record.history_robust == 0]
    assert record.nominal.amplitude == pytest.approx(nominal.min(), rel=1e-12)
    assert record.robust.amplitude_tolerances <= record.nominal.amplitude_tolerances
    assert record.nominal.amplitude <= record.nominal.amplitude_tolerances  # the design itself is in the sample
    assert record.nominal_response.max() == pytest.approx(record.nominal.amplitude)
    assert 0 < record.nominal.amplitude < 1
    best = {record.nominal.design, record.robust.design}
    others = len(best) * len(STARTS) * len(record.frequency)
    (_, at_first), (done, expected) = calls[0], calls[-1]
    assert done == record.scenes + others <= expected <= at_first and record.trouble == 0
    for name, optimum in (("nominal", record.nominal), ("robust", record.robust)):
        assert record.starts[name]["starts"] == 3  # of which one is that of the search
        assert record.starts[name]["peak_ratio"] >= optimum.amplitude * (1 - 1e-9)
    assert f"from the worst of 3 starts, {STARTS[record.starts['nominal']['direction']]}, " in record.sentence


def test_designs_stay_within_their_bounds(found):
    mass, gap, bodies = found[0].history_design.T
    assert mass.min() >= 0.005 and mass.max() <= 0.05
    assert gap.min() >= 0.1 and gap.max() <= 2.0
    assert set(bodies) <= {1, 2, 3, 4} and len(set(bodies)) > 1


def test_the_map_is_made_of_single_runs(found, tmp_path):
    """A value of the map by the engine alone, with the scene put together by hand."""
    record = found[0]
    case = Study.load(study(tmp_path))
    count = record.nominal.design.bodies
    gap, total = record.map_gap_ratio[1] * 3e-5, record.map_mass_ratio[2] * 0.148
    cavities = sorted(["c1", "c2"][i % 2] for i in range(count))
    placed = [(name, cavities[:i].count(name) + 1, cavities.count(name) + 1) for i, name in enumerate(cavities)]
    bodies = [
        {"cavity": name, "mass": total / count, "friction": 0.4, "restitution": 0.7, "position": gap * (at / of - 0.5)}
        for name, at, of in placed
    ]
    scene = case.scene.replace({"cavity.gap": gap, "damper": bodies})
    peaks = [simulate(scene.replace({"excitation.frequency": f})).amplitude_mean for f in (2380.0, 2405.0, 2430.0)]
    assert record.map_amplitude[2, 1] == pytest.approx(max(peaks) / 3e-5, rel=1e-9)


def test_undamped_response_is_the_closed_form(found):
    omega, first = 2 * np.pi * found[0].frequency, np.sqrt(3.4e7 / 0.148)
    ratio, zeta = omega / first, 0.002
    expected = 2 * zeta * np.sqrt(1 - zeta**2) / np.abs(1 - ratio**2 + 2j * zeta * ratio)
    assert found[0].undamped == pytest.approx(expected, rel=1e-6)
    assert found[0].mass == pytest.approx(0.148) and found[0].amplitude == pytest.approx(3e-5)


@pytest.mark.slow
def test_same_seed_same_answer(found, tmp_path):
    again = optimise(Study.load(study(tmp_path)))
    for name in ("map_amplitude", "history_design", "history_amplitude", "robust_response"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found[0], name))
    assert (again.nominal, again.robust) == (found[0].nominal, found[0].robust)


def test_a_search_that_is_interrupted_three_times_gives_the_same_answer(found, tmp_path):
    file, calls, stops = tmp_path / "o.h5.partial", [], [1, 80, 160]
    given = Study.load(study(tmp_path))

    def progress(done, total):
        calls.append(done)
        if stops and done >= stops[0]:
            raise KeyboardInterrupt

    while stops:
        with pytest.raises(KeyboardInterrupt):
            optimise(given, progress=progress, provenance={"a": 1}, checkpoint=file)
        stop, before = stops.pop(0), len(calls)
    resumed = optimise(given, progress=progress, provenance={"a": 1}, checkpoint=file)
    assert resumed.scenes == found[0].scenes and calls[-1] == found[1][-1][0]
    # what was done is not done again
    assert calls[before] > stop and len(calls) <= len(found[1]) + 6
    for name, record in (("whole.h5", found[0]), ("resumed.h5", resumed)):
        record.save(tmp_path / name)
    assert (tmp_path / "resumed.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
    other = Study.load(study(tmp_path, lambda data: data["optimise"].update(seed=7)))
    with pytest.raises(InputError, match="the checkpoint of another study; nothing was done to it"):
        optimise(other, provenance={"a": 1}, checkpoint=file)


def test_file_round_trip(found, tmp_path):
    record = found[0]
    record.save(tmp_path / "optimum.h5")
    loaded = Optimisation.load(tmp_path / "optimum.h5")
    assert loaded.to_json() == record.to_json()
    assert loaded.provenance == {"a": 1} and not loaded.map_amplitude.flags.writeable
    with xarray.open_dataset(tmp_path / "optimum.h5", engine="h5netcdf") as data:
        assert data.map_amplitude.dims == ("map_mass_ratio", "map_gap_ratio")
        assert data.frequency.attrs["units"] == "Hz"


@pytest.mark.parametrize(
    ("design", "told"),
    [
        (
            {"mass_ratio": 0.05},
            "as designed, mass_ratio = 0.05 is at the upper bound of its range, 0.005 to 0.05: b",
        ),
        ({"gap_ratio": 0.21}, "as designed, gap_ratio = 0.21 is at the lower bound of its range, 0.2 to 1.2: better"),
        ({"gap_ratio": 1e-4}, "as designed, a gap of 0.1 um is below 10 um, what"),
        ({"bodies": 2}, "as designed, bodies = 2 is at the upper bound of its range, 1 to 2: better designs may lie"),
        ({"bodies": 1}, ""),  # no design has fewer
    ],
)
def test_what_speaks_against_an_optimum(found, design, told):
    record, middle = found[0], Design(0.02, 0.7, 1)
    ranges = {"mass_ratio": [0.005, 0.05], "gap_ratio": [0.2, 1.2], "bodies": [1, 2]}
    table = record.study["optimise"] | {"variables": ranges, "tolerances": {"gap": 0.0}}
    record = replace(record, study=record.study | {"optimise": table}, amplitude=1e-3, gradient={})
    plain = replace(record.nominal, design=middle, estimate={})
    assert replace(record, nominal=plain, robust=plain).remarks == []
    moved = replace(plain, design=middle._replace(**design))
    remarks = replace(record, nominal=moved, robust=plain).to_json()["remarks"]
    assert all(told in text for text in remarks[-1:]) and bool(remarks) is bool(told)


def test_sample_of_the_tolerances(tmp_path):
    """A Latin hypercube: each of the strata of every tolerance once, and the design itself first."""
    case = Study.load(study(tmp_path))
    sample = deviations(case)
    assert len(sample) == 4 and set(sample[0].values()) == {0.0}
    for name, width in (("mass", 0.03), ("orientation_deg", 15.0)):
        strata = sorted(int((one[name] / width + 1) / 2 * 3) for one in sample[1:])
        assert strata == [0, 1, 2]
    held = Study.load(study(tmp_path, lambda data: data["optimise"].pop("tolerances")))
    assert len(deviations(held)) == 1


def test_the_search_finds_a_known_optimum(tmp_path, monkeypatch):
    """Runs replaced by a bowl with its lowest point at 2 %, 0.7 X and two bodies."""

    def bowl(self, designs, sample):
        values = [
            (d.mass_ratio - 0.02) ** 2 * 1e3 + (d.gap_ratio - 0.7) ** 2 + 0.1 * (d.bodies - 2) ** 2 + 0.1
            for d in designs
        ]
        shape = (len(designs), len(sample), len(self.study.frequencies))
        self.scenes += np.prod(shape)
        return np.broadcast_to(np.reshape(values, (-1, 1, 1)), shape), np.ones(shape), np.zeros(shape)

    monkeypatch.setattr(module._Trial, "_run", bowl)
    change = {"evaluations": 600, "gradient_steps": 0}  # the gradient has no bowl
    record = optimise(Study.load(study(tmp_path, lambda data: data["optimise"].update(change), quick=False)))
    assert record.nominal.design.bodies == 2
    assert record.nominal.design.mass_ratio == pytest.approx(0.02, abs=2e-3)
    assert record.nominal.design.gap_ratio == pytest.approx(0.7, abs=0.05)
    assert len(record.history_design) <= 2 * 600 + 4  # both optima are judged once more


def test_one_value_is_held(tmp_path):
    def hold(data):
        data["optimise"]["variables"] = {"mass_ratio": 0.02, "gap_ratio": [0.4, 0.6], "bodies": 1}
        data["optimise"].pop("tolerances")

    record = optimise(Study.load(study(tmp_path, hold)))
    assert set(record.history_design[:, 0]) == {0.02} and set(record.history_design[:, 2]) == {1.0}
    assert record.robust == record.nominal


def undamped_at(frequency):
    """Closed form of the example's amplitude without bodies, m."""
    ratio = frequency / (np.sqrt(3.4e7 / 0.148) / (2 * np.pi))
    return 3e-5 * 2 * 0.002 * np.sqrt(1 - 0.002**2) / abs(1 - ratio**2 + 2j * 0.002 * ratio)


def alone(data):
    data["optimise"]["variables"] = {"mass_ratio": 0.02, "gap_ratio": 0.5, "bodies": 1}
    data["optimise"]["map"] = {"mass_ratio": 2, "gap_ratio": 2}
    data["optimise"].pop("tolerances")


def test_a_band_far_from_the_resonance_gains_nothing(tmp_path):
    """Damped and amplitudes without bodies of the same band: the walls are out of reach, so nothing is taken."""

    def far(data):
        alone(data)
        data["optimise"]["band"] = {"start": 1700.0, "stop": 1850.0, "num": 3}
        data["time"] = {"periods": 450, "transient": 400}

    record = optimise(Study.load(study(tmp_path, far)))
    assert record.reference == pytest.approx(undamped_at(1850.0), rel=1e-9)
    assert record.amplitude == pytest.approx(3e-5)  # the gap's unit is the resonance's amplitude all the same
    assert abs(record.nominal.reduction) < 0.02
    assert record.headlines["nominal"]["undamped_at_edge"] and record.headlines["nominal"]["peak_at_edge"]
    assert "of the highest amplitude without bodies in the band" in record.sentence
    assert "no resonance without bodies lies within the range" in record.sentence


def test_mean_over_mean(tmp_path):
    def mean(data):
        alone(data)
        data["optimise"]["over_band"] = "mean"

    record = optimise(Study.load(study(tmp_path, mean)))
    band = [2380.0, 2405.0, 2430.0]
    assert record.reference == pytest.approx(np.mean([undamped_at(frequency) for frequency in band]), rel=1e-9)
    assert record.nominal.amplitude == pytest.approx(record.nominal_response.mean(), rel=1e-9)
    assert "of the mean without bodies in the band" in record.sentence
    # 25 Hz of a resonance of 9.6 Hz
    assert record.headlines["nominal"]["too_coarse"]
    assert "points 25 Hz apart are too coarse for a resonance 9.65 Hz wide" in record.sentence


def test_runs_that_are_not_ok_count_as_undamped(tmp_path):
    def broken(data):
        alone(data)
        data["solver"] = {"max_events": 20}

    record = optimise(Study.load(study(tmp_path, broken)))
    assert record.trouble == record.scenes
    assert record.nominal.reduction == 0.0
    assert np.all(np.isnan(record.nominal_response))
    assert record.headlines["nominal"]["points_left_out"] == 3
    assert "3 of 3 points are left out" in record.sentence


def test_a_design_with_a_run_that_is_not_ok_never_wins(tmp_path, monkeypatch):
    """Not by the mean of its other runs either; designs below 1 % of the mass would be the best."""

    def unsettled(self, designs, sample):
        shape = (len(designs), len(sample), len(self.study.frequencies))
        masses = np.array([design.mass_ratio for design in designs])
        damped = np.broadcast_to(masses[:, None, None], shape).copy()
        damped[masses < 0.01, :, 0] = np.nan
        return damped, np.ones(shape), np.zeros(shape)

    def mean(data):
        data["optimise"] |= {"over_band": "mean", "over_tolerances": "mean"}

    monkeypatch.setattr(module._Trial, "_run", unsettled)
    record = optimise(Study.load(study(tmp_path, mean)))
    light = record.history_design[:, 0] < 0.01
    assert light.any() and np.all(record.history_amplitude[light] >= 1.0)
    for best in (record.nominal, record.robust):
        assert best.design.mass_ratio >= 0.01 and best.amplitude == pytest.approx(best.design.mass_ratio)


def test_figure(found):
    figure = optimisation_figure(found[0])
    assert [trace.type for trace in figure.data] == ["contour", "scatter", "scatter"]
    assert np.shape(figure.data[0].z) == (2, 3)
    assert "%" in figure.layout.xaxis.title.text and "µm" in figure.layout.yaxis.title.text
    assert figure.data[1].name.startswith("optimum as designed")
    for trace, optimum in zip(figure.data[1:], (found[0].nominal, found[0].robust), strict=True):
        assert trace.x[0] == 100 * optimum.design.mass_ratio and trace.y[0] == optimum.design.gap_ratio


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    study(tmp_path, alone)
    assert main(["optimise", "optimise.toml", "-o", "o.h5", "--json", "-", "--workers", "1"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["nominal"]["reduction"] == pytest.approx(1 - result["nominal"]["amplitude"])
    assert Optimisation.load("o.h5").sentence == result["sentence"]
    assert result["wall_time_s"] > 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda data: data.pop("optimise"), "is a scene ([structure]): vanedamp run optimise.toml; `vanedamp opt"),
        (lambda data: data["optimise"].pop("band"), "optimise.band: missing"),
        (lambda data: data["optimise"].update(band={"start": 2430.0, "stop": 2380.0, "num": 3}), "frequencies that ri"),
        (lambda data: data["optimise"].update(band=[2400.0, 2400.0]), "rise, not 2400 Hz after 2400 Hz"),
        (lambda data: data["optimise"].update(band=[]), "optimise.band"),
        (lambda data: data["optimise"]["variables"].update(gap_ratio=[2.0, 1.0]), "gap_ratio: expected [lowest, high"),
        (lambda data: data["optimise"]["variables"].update(gap=1.0), "optimise.variables.gap: unknown key"),
        (lambda data: data["optimise"]["tolerances"].update(orientation_deg=100.0), "gravity lifts the body"),
        (lambda data: data["excitation"].pop("resonance_amplitude"), "excitation: name force or resonance_amplitude"),
        (lambda data: data.pop("damper"), "damper: missing"),
        (
            lambda data: (
                data["damper"][0].update(shape="auto", length=0.01, height=0.005)
                or [cavity.update(play=1e-5) for cavity in data["cavity"]]
            ),
            "damper.shape: name one",
        ),
        (lambda data: data["structure"].update(damping_ratio=0.0), "an undamped resonance has no amplitude"),
        (
            lambda data: data.update(time={"periods": 150, "transient": 100}),
            "time.transient: 100 periods leave 0.3 of the structure's own transient, so that designs cannot be "
            "compared; give transient = 37",
        ),
        (
            lambda data: data.update(time={"periods": 450, "transient": 0}),
            "time.transient: 0 periods leave 1 of the structure's own transient, so that designs cannot be compared; "
            "give transient = 37",
        ),
        (lambda data: data["structure"].update(damping_ratio=5e-5) or data.pop("time"), "1000 periods leave 0.7"),
        (lambda data: data["optimise"].update(evaluations=2), "optimise.evaluations: should be greater"),
        (lambda data: data["optimise"].update(rpm=[6000.0]), "give one of band (Hz) and, for an engine order, speeds"),
        (
            lambda data: data["optimise"].update(rpm=[6000.0]) or data["optimise"].pop("band"),
            "optimise.rpm: a frequency follows the speed by excitation.engine_order only",
        ),
        (
            lambda data: along_order(data) or data["optimise"].update(band=[2400.0]) or data["optimise"].pop("rpm"),
            "optimise.band: the frequency follows the speed by excitation.engine_order; give speeds or rpm",
        ),
        (
            lambda data: along_order(data) or data["optimise"].update(rpm=[300.0, 200.0]),
            "rpm: expected speeds that rise, not 200 rpm after 300 rpm",
        ),
    ],
)  # fmt: skip
def test_bad_studies(change, told, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = study(tmp_path, change)
    with pytest.raises(InputError):
        Study.load(path)
    assert main(["optimise", "optimise.toml", "-o", "o.h5"]) == BAD_INPUT
    error = capfd.readouterr().err
    assert "optimise.toml: " in error and told in error and error.count("\n") == 1
    assert not (tmp_path / "o.h5").exists()


def test_the_best_damper_along_an_engine_order(tmp_path):
    """Amplitudes are those of runs at the speeds; X is that of the crossing with the engine order."""
    case = Study.load(study(tmp_path, along_order))
    structure = case.scene.structure
    crossing = np.sqrt(structure.stiffness / (structure.mass * 36.0 - 0.2))
    assert case.resonance.frequency == pytest.approx(6.0 * crossing / (2 * np.pi), rel=1e-5)
    assert case.amplitude == pytest.approx(3e-5) and case.reference == pytest.approx(3e-5, rel=1e-5)
    assert case.frequencies == pytest.approx(np.linspace(2430.0, 2490.0, 3))
    record = optimise(case)
    assert record.trouble == 0 and 0.0 < record.nominal.amplitude < 0.9
    design, base = record.nominal.design, case.with_bodies(record.nominal.design.bodies)
    point = case.point(design, dict.fromkeys(deviations(case)[0], 0.0), 2460.0)
    alone = simulate(base.replace(point))
    assert alone.frequency == pytest.approx(2460.0)
    assert record.nominal_response[1] == pytest.approx(alone.amplitude_mean / record.reference, rel=1e-9)
    assert record.headlines["nominal"]["undamped_peak_at"] == pytest.approx(case.resonance.frequency, rel=1e-5)


def test_bodies_are_spread_over_the_cavities(tmp_path):
    case = Study.load(study(tmp_path))
    for count, expected in ((1, {"c1": 1}), (3, {"c1": 2, "c2": 1}), (4, {"c1": 2, "c2": 2})):
        cavities = [damper.cavity for damper in case.with_bodies(count).damper]
        assert {name: cavities.count(name) for name in set(cavities)} == expected
    point = case.point(Design(0.02, 0.5, 3), dict.fromkeys(deviations(case)[0], 0.0), 2400.0)
    assert case.with_bodies(3).replace(point).positions == pytest.approx([-2.5e-6, 2.5e-6, 0.0])
    assert point["damper.mass"] == pytest.approx(0.02 * 0.148 / 3)


def test_report_tells_the_optimum(found, tmp_path):
    record = found[0]
    record.save(tmp_path / "optimum.h5")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert record.sentence in html.unescape(page)
    assert f"{100 * record.robust.reduction_tolerances:.1f}" in page
    assert "Plotly.newPlot" in page and 'download="optimum-0.csv"' in page
