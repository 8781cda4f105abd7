"""Designs of any numbers of the scene, and tolerances of them, by their paths: what single runs say."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.studies.optimisation.test_search import EXAMPLE, alone
from tests.studies.optimisation.test_search import study as written
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, tables, validate
from vanedamp.studies.cli import main
from vanedamp.studies.kinds.optimisation.charts import along_figure, optimisation_figure
from vanedamp.studies.optimisation.gradient import _Surface
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import deviations, optimise
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION, Variables

SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.02},
    "excitation": {"frequency": 2412.0, "resonance_amplitude": 3e-5},
    "cavity": [{"name": "c1", "gap": 2.5e-5}],
    "damper": [{"cavity": "c1", "mass": 0.012, "friction": 0.4, "restitution": 0.3}],
    "time": {"periods": 300, "transient": 200},
}
PLATE = [{"normal_force": 2.0, "friction": 0.3, "stiffness": 1e6}]
THREE = {
    "damper.0.friction": [5.0, 40.0],
    "friction_damper.0.stiffness": {"min": 1e4, "max": 1e8, "scale": "log"},
    "cavity.c1.gap": [1e-5, 4e-5],
}


def study(scene=(), **optimise):
    table = {
        "band": {"start": 2364.0, "stop": 2436.0, "num": 3}, "evaluations": 6, "samples": 2, "gradient_steps": 1,
        "map": {"mass_ratio": 2, "gap_ratio": 2, "along": 3},
    } | optimise  # fmt: skip
    return Study.of(SCENE | dict(scene) | {"optimise": table})


def worst(case, design):
    runs = [simulate(case.scene_of(design, NO_DEVIATION, float(f))) for f in case.frequencies]
    return max(run.amplitude_mean_dynamic for run in runs) / case.reference


def test_the_best_friction_is_that_of_a_grid_of_single_runs():
    """Scenes of the grid are put together by hand; a finer design may be better than the grid's best, never worse."""
    pressed = {"damper": [SCENE["damper"][0] | {"normal_load": 60.0}]}
    case = study(pressed, variables={"damper.0.friction": [0.02, 0.5]}, band=[2300.0, 2368.0, 2436.0])
    record, grid = optimise(case), np.linspace(0.02, 0.5, 25)
    peaks = [
        max(
            simulate(case.scene.replace({"damper.friction": mu, "excitation.frequency": f})).amplitude_mean_dynamic
            for f in (2300.0, 2368.0, 2436.0)
        )
        / record.reference
        for mu in grid.tolist()
    ]
    [(path, best)] = record.nominal.design.numbers
    assert path == "damper.0.friction" and abs(best - grid[np.argmin(peaks)]) < 0.03
    assert 0.97 * min(peaks) < record.nominal.amplitude <= min(peaks)
    assert max(peaks) > 1.5 * min(peaks)  # the friction counts
    assert record.gradient["taken"] > 0 and len(record.history_design) < 25


@pytest.mark.parametrize(
    ("key", "path", "half"),
    [
        ("mass", "damper.mass", {"relative": 0.03}),
        ("gap", "cavity.c1.gap", {"relative": 0.1}),
        ("excitation", "excitation.resonance_amplitude", {"relative": 0.2}),
        ("restitution", "damper.0.restitution", 0.8),  # beyond its limits, to which both are cut
        ("friction", "damper.friction", 0.2),
        ("orientation_deg", "gravity.orientation_deg", 15.0),
    ],
)
def test_a_tolerance_by_path_is_that_of_its_key(key, path, half):
    one = study(variables={"mass_ratio": 0.08, "gap_ratio": [0.7, 0.9]}, tolerances={key: _number(half)})
    other = study(variables={"mass_ratio": 0.08, "gap_ratio": [0.7, 0.9]}, tolerances={path: half})
    design = Design(0.08, 0.8, 1)
    for mine, its in zip(deviations(one), deviations(other), strict=True):
        assert one.scene_of(design, mine, 2400.0) == other.scene_of(design, its, 2400.0)
        assert one.level_deviation(mine) == other.level_deviation(its)
    corners = one.scene_of(design, {key: _number(half)}, 2400.0), other.scene_of(design, {path: _number(half)}, 2400.0)
    assert corners[0] == corners[1] != one.scene_of(design, NO_DEVIATION, 2400.0)


def _number(half):
    return half["relative"] if isinstance(half, dict) else half


def test_amplitudes_within_tolerances_by_path_are_those_of_the_keys():
    variables = {"mass_ratio": 0.1, "gap_ratio": [0.8, 0.9]}
    by_key = optimise(study(variables=variables, tolerances={"excitation": 0.01}))
    by_path = optimise(study(variables=variables, tolerances={"excitation.resonance_amplitude": {"relative": 0.01}}))
    assert by_path.robust.amplitude_tolerances == by_key.robust.amplitude_tolerances
    theirs, own = by_key.nominal.estimate, by_path.nominal.estimate
    assert theirs["worst"] is not None and own | {"by": 0} == theirs | {"by": 0}
    assert own["by"] == [["excitation.resonance_amplitude", theirs["by"][0][1]]]


@pytest.fixture(scope="module")
def found():
    tolerances = {"friction": 0.1, "structure.stiffness": 1e4}
    case = study({"friction_damper": PLATE}, variables=THREE, tolerances=tolerances)
    return case, optimise(case, provenance={})


def test_three_numbers_of_different_tables(found, tmp_path, capsys):
    case, record = found
    assert record.trouble == 0 and record.nominal.design.mass_ratio is record.nominal.design.gap_ratio is None
    assert record.nominal.amplitude == pytest.approx(worst(case, record.nominal.design), rel=1e-12)
    assert np.isnan(record.history_design[:, :2]).all() and set(record.history_design[:, 2]) == {1.0}
    assert list(record.along) == list(record.labels()["variable"][3:]) == sorted(THREE)
    for column, (low, high) in zip(record.history_design.T[3:], ((1e-5, 4e-5), (5, 40), (1e4, 1e8)), strict=True):
        assert low * (1 - 1e-12) <= column.min() < column.max() <= high * (1 + 1e-12)
    assert np.median(record.history_design[:10, 5]) < 1e7  # even in the logarithm
    assert record.along_value[2] == pytest.approx([1e4, 1e6, 1e8]) and record.map_amplitude.size == 0
    for row, name in enumerate(record.along):
        moved = Design.of(record.nominal.design.values | {name: record.along_value[row, 1]})
        assert record.along_amplitude[row, 1] == pytest.approx(worst(case, moved), rel=1e-12)
    assert "friction_damper.0.stiffness = " in record.sentence and " N/m" in record.sentence
    record.save(tmp_path / "optimum.h5")
    loaded = Optimisation.load(tmp_path / "optimum.h5")
    told, whole = (json.dumps(each.to_json(), sort_keys=True) for each in (loaded, record))
    assert told == whole and loaded.nominal == record.nominal
    assert len(along_figure(loaded).data) == 6 and optimisation_figure(loaded).layout.xaxis3.type == "log"
    assert main(["info", str(tmp_path / "optimum.h5")]) == 0
    assert "friction_damper.0.stiffness" in capsys.readouterr().out
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<th>friction_damper.0.stiffness, N/m</th>" in page and 'download="optimum-0.csv"' in page


def test_ratios_and_paths_together_have_a_map_and_sections(tmp_path):
    """The first of one or two bodies has a restitution of its own; the tolerance moves all of them."""
    cavity = [{"name": "c1", "gap": 2.5e-5}, {"name": "c2", "gap": 2e-5}]
    variables = {"mass_ratio": [0.05, 0.1], "gap_ratio": 0.8, "bodies": [1, 2], "damper.0.restitution": [0.1, 0.5]}
    case = study({"cavity": cavity}, variables=variables, tolerances={"restitution": 0.05, "cavity.c1.gap": 1e-6})
    moved = case.scene_of(
        Design.of({**case.middle.values, "bodies": 2}), {"restitution": 0.05, "cavity.c1.gap": 1e-6}, 2400.0
    )
    assert [body.restitution for body in moved.damper] == pytest.approx([0.35, 0.35])
    assert [cavity.gap for cavity in moved.cavity] == pytest.approx([2.5e-5, 2.4e-5])
    record = optimise(case, provenance={})
    best = record.nominal.design
    assert record.along == ("damper.0.restitution",) and record.map_amplitude.shape == (2, 2)
    heavy = best._replace(mass_ratio=0.1)
    assert record.map_amplitude[1, 0] == pytest.approx(worst(case, heavy), rel=1e-12)
    record.save(tmp_path / "optimum.h5")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'download="optimum-1.csv"' in page and "<th>damper.0.restitution</th>" in page


def test_a_tolerance_moves_each_body_from_its_own_number():
    two = [SCENE["damper"][0] | {"friction": 0.2, "position": -5e-6}, SCENE["damper"][0] | {"position": 5e-6}]
    case = study(
        {"damper": two}, variables={"damper.0.restitution": [0.2, 0.6]}, tolerances={"friction": 0.3, "mass": 0.1}
    )
    design = case.design({"damper.0.restitution": 0.5})
    moved = case.scene_of(design, {"friction": -0.3, "mass": 0.1}, 2400.0).damper
    assert [(body.friction, body.restitution) for body in moved] == [(0.0, 0.5), (pytest.approx(0.1), 0.3)]
    assert [body.mass for body in moved] == pytest.approx([0.0132, 0.0132]) and moved[1].position == 5e-6


def test_the_gradient_by_paths_is_that_of_runs():
    """By friction, a stiffness over powers of ten and a gap, against differences of single runs."""
    scene = {"friction_damper": PLATE, "time": {"periods": 3000, "transient": 2900}}
    case = study(scene, variables=THREE)
    design = Design(None, None, 1, (("cavity.c1.gap", 3e-5), ("damper.0.friction", 15.0), (sorted(THREE)[2], 1e6)))

    def amplitudes(place):
        own = surface.design(place)
        runs = [simulate(case.scene_of(own, NO_DEVIATION, float(f))) for f in case.frequencies]
        assert {run.classification for run in runs} == {"periodic-1"}
        return np.array([run.amplitude_mean_dynamic for run in runs]) / case.reference

    surface = _Surface(case, sorted(THREE), design, np.full(3, 0.2))
    surface = _Surface(case, sorted(THREE), design, amplitudes(surface.place))
    assert surface.descends and not surface.without
    values, turns = surface._at(surface.place)
    np.testing.assert_allclose(values, amplitudes(surface.place), rtol=1e-9)
    for variable in range(3):
        side = np.eye(3)[variable] * 4e-4
        one, two = (
            (amplitudes(surface.place + n * side) - amplitudes(surface.place - n * side)) / (8e-4 * n) for n in (1, 2)
        )
        np.testing.assert_allclose(turns[:, variable], (4 * one - two) / 3, rtol=1e-5, atol=1e-9)


def test_a_number_without_derivative_is_left_to_the_search():
    """Friction that is none has a kink there; the gap goes on by itself."""
    case = study(variables={"damper.0.friction": [0.0, 0.1], "cavity.c1.gap": [1e-5, 4e-5]})
    design = Design(None, None, 1, (("cavity.c1.gap", 2.9e-5), ("damper.0.friction", 0.0)))
    response = np.array([
        simulate(case.scene_of(design, NO_DEVIATION, float(f))).amplitude_mean_dynamic for f in case.frequencies
    ]) / case.reference  # fmt: skip
    surface = _Surface(case, ["cavity.c1.gap", "damper.0.friction"], design, response)
    assert surface.descends
    gap, friction = surface.lowest(0.1) - surface.place
    assert gap != 0.0 and friction == 0.0


def test_a_friction_damper_that_rests_anywhere_has_no_tolerance_to_first_order():
    """It sticks where it has come to rest, on which the amplitude depends; the scene has no loose bodies."""
    scene = {"cavity": [], "damper": [], "friction_damper": [PLATE[0] | {"normal_force": 400.0}]}
    variables, path = {"friction_damper.0.stiffness": [5e6, 1e7]}, "friction_damper.0.friction"
    record = optimise(study(scene, variables=variables, tolerances={path: {"relative": 0.1}}))
    assert record.trouble == 0 and 0.0 < record.nominal.amplitude < 0.5
    assert set(record.gradient["without"]) == set(record.nominal.estimate["without"]) == {"undetermined"}
    assert record.nominal.estimate["worst"] is None and record.gradient["steps"] == 0


@pytest.mark.parametrize(
    "body",
    [
        {"shape": "block", "length": 0.006, "height": 0.004, "lift": 1e-6},
        {"shape": "disc", "radius": 0.004},
        {"stiffness": 1e5},
    ],
)
def test_designs_of_planar_bodies_are_single_runs(body):
    cavity = [{"name": "c1", "gap": 2.5e-5, "play": 1e-5}, {"name": "c2", "gap": 2.5e-5, "play": 1e-5}]
    scene = {"cavity": cavity, "damper": [SCENE["damper"][0] | body], "time": {"periods": 60, "transient": 50}}
    scene["structure"] = SCENE["structure"] | {"damping_ratio": 0.05}
    case = study(scene, variables={"mass_ratio": [0.05, 0.1], "gap_ratio": 0.8, "bodies": [1, 2]}, gradient_steps=0)
    record = optimise(case)
    assert record.trouble == 0 and 0.0 < record.nominal.amplitude < 1.0
    design = record.nominal.design
    assert record.nominal.amplitude == pytest.approx(worst(case, design), rel=1e-12)
    own = case.scene_of(Design(0.08, 0.8, 2), NO_DEVIATION, 2400.0).damper
    assert [one.cavity for one in own] == ["c1", "c2"] and {one.lift for one in own} == {0.0}
    assert all(getattr(one, key) == value for one in own for key, value in body.items() if key != "lift")


def test_files_of_before_mean_the_same(tmp_path):
    """What they leave out has the bounds of before, and their tables are written as before."""
    usual = {"mass_ratio": [0.005, 0.05], "gap_ratio": [0.1, 1.5], "bodies": [1, 1]}
    assert tables(validate(Variables, {}, "v")) == usual
    assert tables(validate(Variables, {"bodies": 2}, "v")) == usual | {"bodies": [2, 2]}
    assert tables(Study.load(EXAMPLE).table.map) == {"mass_ratio": 6, "gap_ratio": 8}
    record = optimise(Study.load(written(tmp_path, alone)))
    assert "numbers" not in record.nominal.to_json() and record.along == () and record.along_value.size == 0


def test_runs_that_are_kept_are_of_the_same_numbers(tmp_path):
    file = tmp_path / "o.h5.partial"
    variables = {"damper.0.friction": [0.1, 0.5], "damper.0.mass": [0.005, 0.012]}
    with_order = [dict(reversed(variables.items())), variables]

    def stop(done, _):
        if done >= 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimise(study(variables=with_order[0], gradient_steps=0), progress=stop, checkpoint=file)
    resumed = optimise(study(variables=with_order[1], gradient_steps=0), checkpoint=file)
    whole = optimise(study(variables=variables, gradient_steps=0))
    np.testing.assert_array_equal(resumed.history_design, whole.history_design)
    np.testing.assert_array_equal(resumed.history_amplitude, whole.history_amplitude)
    with pytest.raises(InputError, match="the checkpoint of another study"):
        optimise(study(variables=variables | {"damper.0.mass": [0.005, 0.013]}), checkpoint=file)


@pytest.mark.parametrize(
    ("variables", "tolerances", "told"),
    [
        ({"damper.0.fricton": [0.1, 0.5]}, {}, "variables: damper.0.fricton: .* did you mean 'friction'"),
        ({"damper.3.friction": [0.1, 0.5]}, {}, "there are only 1 entries"),
        ({"damper.0.stiffness": [1e3, 1e5]}, {}, "the scene holds no 'stiffness' there"),
        ({"damper.0.cavity": [0.1, 0.5]}, {}, "names no number"),
        ({"damper.0.restitution": [0.5, 1.5]}, {}, "variables: damper.0.restitution: .*less than or equal to 1"),
        ({"cavity.c1.gap": [-1e-5, 1e-5]}, {}, "variables: cavity.c1.gap: .*greater than 0"),
        ({"damper.0.friction": [0.5, 0.1]}, {}, "damper.0.friction: expected .lowest, highest., not .0.5, 0.1."),
        ({"damper.0.friction": [0.1, 0.2, 0.3]}, {}, "optimise.variables.damper.0.friction"),
        ({"damper.0.friction": {"min": 0.0, "max": 1.0, "scale": "log"}}, {}, 'a positive number with scale = "log"'),
        ({"damper.0.friction": [0.1, 0.5], "damper.friction": [0.1, 0.5]}, {}, "names the same number as damper.0.fr"),
        ({"damper.0.mass": [0.01, 0.02], "mass_ratio": 0.1}, {}, "damper.0.mass is given by mass_ratio as well; leave"),
        ({"cavity.0.gap": [1e-5, 2e-5], "gap_ratio": [0.5, 1.0]}, {}, "cavity.0.gap is given by gap_ratio as well"),
        ({"damper.friction": [0.1, 0.5]}, {}, "damper.friction is given by an axis of .sweep."),
        ({"excitation.frequency": [2400.0, 2410.0]}, {}, "is no number of structure, bodies or level"),
        ({"time.tolerance": [0.1, 0.2]}, {}, "time.tolerance is no number of structure"),
        ({"structure.damping_ratio": [0.01, 0.02]}, {"x": 0}, "changes the amplitude without bodies"),
        ({"structure.stiffness": [3.3e7, 3.4e7]}, {}, "changes the amplitude without bodies"),
        ({"excitation.resonance_amplitude": [1e-5, 2e-5]}, {}, "changes the amplitude without bodies"),
        ({"damper.0.mass": [0.01, 0.02]}, {"damper.0.weight": 0.1}, "tolerances: damper.0.weight"),
        ({"damper.0.mass": [0.01, 0.02]}, {"friction": 0.1, "damper.0.friction": 0.1}, "given by friction; leave one"),
        ({"damper.0.mass": [0.01, 0.02]}, {"excitation.frequency": 1.0}, "tolerances: excitation.frequency is no num"),
        ({"damper.0.mass": [0.01, 0.02]}, {"damper.0.mass": 0.02}, "mass.*greater than 0"),
        ({"damper.0.mass": [0.01, 0.02]}, {"damper.0.mass": {"relative": 1.5}}, "relative.*less than 1"),
        ({"damper.0.mass": [0.01, 0.02]}, {"structure.damping_ratio": 0.0199}, "periods leave .* transient"),
    ],
)
def test_what_cannot_vary_is_rejected_before_anything_runs(variables, tolerances, told):
    sweep = {"sweep": {"damper.0.friction": [0.1, 0.2]}} if told.endswith("sweep.") else {}
    tolerances = {name: half for name, half in tolerances.items() if name != "x"}
    with pytest.raises(InputError, match=told) as raised:
        study(sweep, variables=variables, tolerances=tolerances)
    assert "\n" not in str(raised.value)


def test_bodies_whose_inertia_would_not_follow_their_mass_are_rejected():
    disc = SCENE["damper"][0] | {"shape": "disc", "radius": 0.004, "inertia": 1e-8}
    scene = {"cavity": [{"name": "c1", "gap": 2.5e-5, "play": 1e-5}], "damper": [disc]}
    with pytest.raises(InputError, match=r"damper.inertia: does not follow the mass"):
        study(scene)
    case = study(scene, variables={"damper.0.friction": [0.1, 0.3]})
    assert replace(case.scene, sweep={}) == case.with_bodies(1)
    with pytest.raises(InputError, match=r"damper.shape: name one"):
        study(scene | {"damper": [SCENE["damper"][0] | {"shape": "auto", "length": 0.01, "height": 0.005}]})
