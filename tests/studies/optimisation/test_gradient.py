"""The gradient continues the search where responses repeat, and tolerances to first order agree with runs."""

import html
from dataclasses import replace

import numpy as np
import pytest

from vanedamp.coupling.simulation import simulate
from vanedamp.studies.cli import main
from vanedamp.studies.optimisation.gradient import _Surface
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import optimise
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION


def study(damper=(), periods=300, damping=0.02, band=(2340.0, 2436.0, 4), **optimise):
    """A slider of little restitution in a damped structure, whose motion repeats along the band."""
    start, stop, num = band
    return Study.of(
        {
            "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": damping},
            "excitation": {"frequency": 2412.0, "resonance_amplitude": 3e-5},
            "cavity": [{"name": "c1", "gap": 1.5e-5}],
            "damper": [{"cavity": "c1", "mass": 3e-3, "friction": 0.4, "restitution": 0.3} | dict(damper)],
            "time": {"periods": periods, "transient": periods - 100},
            "optimise": {
                "band": {"start": start, "stop": stop, "num": num},
                "variables": {"mass_ratio": [0.05, 0.1], "gap_ratio": [0.3, 1.2]},
                "map": {"mass_ratio": 2, "gap_ratio": 2},
                "evaluations": 6,
            }
            | optimise,
        }
    )


@pytest.fixture(scope="module")
def found():
    return optimise(study())


def test_fewer_designs_reach_more_than_the_search_alone(found):
    """The worst of the band, with the mass at its bound; runs of designs beside it are worse."""
    coarse = optimise(study(evaluations=40, gradient_steps=0))
    assert len(found.history_design) < len(coarse.history_design) / 2
    assert found.nominal.amplitude < coarse.nominal.amplitude
    gradient = found.gradient
    assert gradient["after"] == found.nominal.amplitude < gradient["before"] and 0 < gradient["taken"] <= 20
    assert found.nominal.design.mass_ratio == pytest.approx(0.1, rel=1e-6)
    case, best = study(), found.nominal.design
    for moved in (
        best._replace(gap_ratio=best.gap_ratio + 2e-3),
        best._replace(gap_ratio=best.gap_ratio - 2e-3),
        best._replace(mass_ratio=best.mass_ratio - 2e-4),
    ):
        runs = [simulate(case.scene_of(moved, NO_DEVIATION, float(f))) for f in case.frequencies]
        assert max(run.amplitude_mean_dynamic for run in runs) / case.reference > found.nominal.amplitude * (1 - 1e-6)
    assert "the gradient leads from" in found.remarks[0]
    assert coarse.gradient["before"] is None and coarse.remarks == []


def test_designs_of_the_gradient_stay_within_bounds(found):
    assert np.all(found.history_design[:, 0] <= 0.1) and np.all(found.history_design[:, 1] >= 0.3)


@pytest.mark.parametrize("over_band", ["worst", "mean"])
def test_the_gradient_is_that_of_runs(over_band):
    """Of every amplitude by mass ratio and gap ratio, against differences of the runs that the search makes."""
    case, design = study(periods=3000, band=(2364.0, 2436.0, 3), over_band=over_band), Design(0.09, 0.85, 1)

    def amplitudes(place):
        own = surface.design(place)
        runs = [simulate(case.scene_of(own, NO_DEVIATION, float(f))) for f in case.frequencies]
        assert {run.classification for run in runs} == {"periodic-1"}
        return np.array([run.amplitude_mean_dynamic for run in runs]) / case.reference

    surface = _Surface(case, ["mass_ratio", "gap_ratio"], design, np.full(3, 0.2))
    surface = _Surface(case, ["mass_ratio", "gap_ratio"], design, amplitudes(surface.place))
    assert surface.descends and not surface.without
    values, turns = surface._at(surface.place)
    np.testing.assert_allclose(values, amplitudes(surface.place), rtol=1e-9)
    for variable, step in ((0, 4e-4), (1, 4e-4)):
        side = np.eye(2)[variable] * step
        one, two = (
            (amplitudes(surface.place + n * side) - amplitudes(surface.place - n * side)) / (2 * n * step)
            for n in (1, 2)
        )
        np.testing.assert_allclose(turns[:, variable], (4 * one - two) / 3, rtol=1e-6)


def test_tolerances_to_first_order_agree_with_runs():
    """What first order leaves falls with the square of the widths; the mean is that of the sample."""
    left = []
    for scale in (1.0, 0.5):
        widths = {"mass": 4e-3, "gap": 4e-3, "excitation": 4e-3, "restitution": 4e-3, "friction": 0.04}
        tolerances = {name: scale * width for name, width in widths.items()}
        case = study(periods=500, tolerances=tolerances, over_tolerances="mean", evaluations=5, gradient_steps=0)
        case = replace_variables(case, Design(0.09, 0.85, 1))
        record = optimise(case)
        estimate = record.nominal.estimate
        assert estimate["without"] == {}
        names, each = zip(*estimate["by"], strict=True)
        assert set(names) == set(widths) and list(each) == sorted(each)[::-1]
        added = sum(each)
        assert estimate["worst"] == pytest.approx(record.nominal.amplitude + added, rel=1e-4)
        left.append(abs(estimate["run"] - estimate["worst"]))
        assert left[-1] < 0.05 * added
        assert abs(record.nominal.amplitude_tolerances - estimate["mean"]) < 0.05 * added
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.2)


def test_tolerances_of_bodies_that_stick_are_a_closed_form(tmp_path):
    """A body pressed on its floor is mass of the structure: |1 - r^2 (1 + m) + 2 i zeta r| by m, none by the level."""
    case = study(
        damper={"normal_load": 1e4}, band=(2300.0, 2340.0, 2), tolerances={"mass": 0.01, "excitation": 0.1},
        over_tolerances="mean", evaluations=5, gradient_steps=0,
    )  # fmt: skip
    mass, zeta = 0.08, 0.02
    record = optimise(replace_variables(case, Design(mass, 1.0, 1)))
    r = case.frequencies / (np.sqrt(3.4e7 / 0.148) / (2 * np.pi))
    real, size = 1 - r**2 * (1 + mass), np.hypot(1 - r**2 * (1 + mass), 2 * zeta * r)
    amplitude, slope = 1 / size, r**2 * real / size**3
    worst = int(np.argmax(amplitude))
    level = record.nominal.amplitude / amplitude[worst]
    by = dict(record.nominal.estimate["by"])
    assert by["mass"] == pytest.approx(abs(slope[worst]) * 0.01 * mass * level, rel=1e-6)
    assert by["excitation"] == pytest.approx(0.0, abs=1e-7)
    assert record.nominal.estimate["frequency_hz"] == pytest.approx(case.frequencies[worst])
    record.save(tmp_path / "optimum.h5")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.unescape(record.remarks[0][1:]) in html.unescape(page) and "mass costs most" in page
    assert "<th>mass</th><th>excitation</th>" in page
    assert f"<td>{100 * record.nominal.estimate['worst']:.2f}</td>" in page


def test_a_motion_that_does_not_repeat_says_so(tmp_path):
    """Neither gradient nor tolerances to first order; numbers and words survive the file."""
    case = study(damper={"restitution": 0.7}, band=(2400.0, 2436.0, 2), tolerances={"gap": 0.01}, samples=1)
    record = optimise(replace_variables(case, Design(0.1, 1.1, 1)))
    assert record.nominal.estimate == {
        "worst": None, "run": None, "mean": None, "by": [], "without": {"not_periodic": 1},
        "frequency_hz": pytest.approx(case.frequencies[np.argmax(record.nominal_response)]),
    }  # fmt: skip
    assert any("has none (not periodic)" in remark for remark in record.remarks)
    record.save(tmp_path / "o.h5")
    loaded = Optimisation.load(tmp_path / "o.h5")
    assert loaded.remarks == record.remarks and loaded.nominal == record.nominal


def test_where_the_worst_does_not_repeat_the_gradient_leads_nowhere():
    case = study(damper={"restitution": 0.7}, band=(2400.0, 2436.0, 2), evaluations=5)
    variables = replace(case.table.variables, mass_ratio=(0.1, 0.1), gap_ratio=(1.1, 1.15))
    record = optimise(case._replace(table=replace(case.table, variables=variables)))
    gradient = record.gradient
    assert gradient["steps"] == gradient["taken"] == 0 and gradient["after"] == gradient["before"]
    assert gradient["without"]["not_periodic"] >= 1
    assert "the gradient leads no further" in record.remarks[0]


def test_other_methods_and_static_deflections_have_no_derivatives():
    for change, reason in (
        ({"solver.method": "moreau", "solver.steps_per_period": 100}, "refused"),
        ({"gravity.orientation_deg": 30.0}, "static_deflection"),
    ):
        case = study(band=(2364.0, 2436.0, 2), tolerances={"gap": 0.01}, samples=1, evaluations=5)
        case = case._replace(scene=case.scene.replace(change))
        variables = replace(case.table.variables, mass_ratio=(0.09, 0.1), gap_ratio=(0.85, 0.85))
        record = optimise(case._replace(table=replace(case.table, variables=variables)))
        assert set(record.gradient["without"]) == set(record.nominal.estimate["without"]) == {reason}
        assert record.gradient["steps"] == record.gradient["orbits"] == 0


def test_a_tolerance_that_begins_at_a_kink_has_no_derivative():
    """Friction that a body may have, but has not as designed."""
    case = study(damper={"friction": 0.0}, band=(2364.0, 2436.0, 2), tolerances={"friction": 0.1}, samples=1)
    record = optimise(replace_variables(case, Design(0.09, 0.85, 1)))
    assert record.nominal.estimate["worst"] is None and record.nominal.estimate["without"] == {"undetermined": 1}


def replace_variables(case, design):
    """The study with one design only."""
    variables = replace(case.table.variables, mass_ratio=(design.mass_ratio,) * 2, gap_ratio=(design.gap_ratio,) * 2)
    return case._replace(table=replace(case.table, variables=variables))
