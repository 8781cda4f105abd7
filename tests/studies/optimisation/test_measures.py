"""Optimisation by stress, life and wear, and within their limits: what counts is what runs of the design show."""

import pytest

from tests.coupling.strength.test_strength_of_runs import CURVE, FACTS, saved
from tests.coupling.strength.test_stressed_runs import FIRST, STRESS
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError
from vanedamp.studies.kinds.optimisation.charts import optimisation_figure
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.optimisation.search import optimise
from vanedamp.studies.optimisation.study import Design, Study
from vanedamp.studies.optimisation.tables import NO_DEVIATION

RIGID = {"model": "rigid", "mass": 1.0, "stiffness": 1e6, "damping_ratio": 0.01}
WEAR = {"rate": 1e-15, "impact_rate": 1e-13, "area": 1e-6}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    facts = FACTS | {"hot2": FACTS["hot2"] | {"fatigue": CURVE}}
    return saved(tmp_path_factory.mktemp("measures") / "rom.h5", facts)


def tables(file, **table):
    return {
        "structure": {"model": "rom", "file": file},
        "excitation": {"frequency": FIRST, "resonance_amplitude": 1e-4, "at": "tip"},
        "cavity": [{"name": "c", "gap": 5e-5, "floor": "tip"}],
        "damper": [{"cavity": "c", "mass": 0.02, "friction": 0.2, "restitution": 0.6}],
        "wear": WEAR,
        "time": {"periods": 60, "transient": 50, "tolerance": 0.6},
        "optimise": {
            "band": [0.99 * FIRST, FIRST], "evaluations": 6, "gradient_steps": 3,
            "map": {"mass_ratio": 2, "gap_ratio": 2}, "variables": {"mass_ratio": [0.01, 0.05], "gap_ratio": [0.2, 1]},
        } | table,
    }  # fmt: skip


def runs_of(study, design):
    return [simulate(study.scene_of(design, NO_DEVIATION, float(f))) for f in study.frequencies]


VALUES = {
    "stress": lambda run, study: max(spot.von_mises for spot in run.stress) / study.reference,
    "life": lambda run, study: 1e4 * max(spot.strength["damage_per_hour"] for spot in run.stress),
    "wear": lambda run, study: 1e4 * max(contact.depth_rate for contact in run.wear) / study.amplitude,
}


@pytest.mark.parametrize("measure", VALUES)
def test_measure_is_that_of_the_runs(file, measure, tmp_path):
    study = Study.of(tables(file, measure=measure))
    record = optimise(study)
    expected = max(VALUES[measure](run, study) for run in runs_of(study, record.nominal.design))
    assert record.nominal.amplitude == pytest.approx(expected, rel=1e-9)
    assert record.nominal.amplitude == pytest.approx(record.history_amplitude.min(), rel=1e-12)
    assert record.gradient["steps"] == 0 and record.headlines == {}
    words = {"stress": "of the stress without bodies", "life": "life used in 10000 h", "wear": "of X worn off"}
    assert words[measure] in record.sentence and "one start only" in record.sentence
    record.save(tmp_path / "optimum.h5")
    assert Optimisation.load(tmp_path / "optimum.h5").sentence == record.sentence
    assert optimisation_figure(record).data


def test_any_quantity_counts_relative_to_its_limit(file):
    study = Study.of(tables(file, measure="wear_work_rate", limits={"quantities": {"wear_work_rate": 2e-2}}))
    record = optimise(study)
    rates = [sum(contact.work_rate for contact in run.wear) for run in runs_of(study, record.nominal.design)]
    assert record.nominal.amplitude == pytest.approx(max(rates) / 2e-2, rel=1e-9)
    assert "of the limit of wear_work_rate" in record.sentence and optimisation_figure(record).data


def test_stress_without_bodies_is_the_reference(file):
    """That of the linear structure at resonance."""
    study = Study.of(tables(file, measure="stress"))
    linear = simulate(study.scene.replace({"cavity": [], "damper": [], "wear": None, "time": {"periods": 900}}))
    at_resonance = max(spot.undamped["von_mises"] for spot in linear.stress)
    assert study.reference == pytest.approx(at_resonance, rel=2e-3)
    assert STRESS.keys() == {spot.name for spot in linear.stress}


def test_a_limit_excludes_designs_that_exceed_it(file):
    """The limit lies between the wear of two designs; a worse amplitude within it beats a better one beyond."""
    free = optimise(Study.of(tables(file)))
    study = Study.of(tables(file))
    worn = {design: max(VALUES["wear"](run, study) for run in runs_of(study, design)) for design in _tried(free)}
    most = sorted(worn.values())[len(worn) // 2] * study.amplitude / 1e4
    found = optimise(Study.of(tables(file, limits={"wear": 1.0001 * most})))
    design = found.nominal.design
    rate = max(VALUES["wear"](run, study) for run in runs_of(study, design)) * study.amplitude / 1e4
    assert rate <= 1.0001 * most
    beyond = found.history_amplitude[[rate > 1.0001 * most for rate in _rates(study, found)]]
    assert len(beyond) and beyond.min() > 1.0


def _tried(record):
    return {Design(mass, gap, int(count)) for mass, gap, count in record.history_design.tolist()}


def _rates(study, record):
    for mass, gap, count in record.history_design.tolist():
        runs = runs_of(study, Design(mass, gap, int(count)))
        yield max(VALUES["wear"](run, study) for run in runs) * study.amplitude / 1e4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"structure": RIGID}, "optimise.measure: stress"),
        ({"optimise": {"limits": {"utilisation": -1.0}}}, "greater than 0"),
        ({"optimise": {"limits": {"quantities": {"warmth": 1.0}}}}, "unknown quantity 'warmth'; there are ampl"),
        ({"optimise": {"measure": "contact_force"}}, "have no contact_force, which is largest force of an impact"),
        ({"optimise": {"measure": "wear_work_rate"}}, "give limits.quantities.wear_work_rate"),
        ({"wear": None, "optimise": {"limits": {"wear": 1e-9}}}, "optimise.limits.wear: wear is not counted"),
        ({"wear": {"rate": 1e-15}, "optimise": {"limits": {"wear": 1e-9}}}, "optimise.limits.wear: the patch"),
    ],
)  # fmt: skip
def test_what_runs_do_not_have_is_rejected(file, change, message):
    data = tables(file, measure="stress")
    for key, value in change.items():
        data[key] = data[key] | value if key == "optimise" else value
    if "structure" in change:
        del data["excitation"]["at"], data["cavity"][0]["floor"]
    if data["wear"] is None:
        del data["wear"]
    with pytest.raises(InputError, match=message):
        Study.of(data)


def test_a_limit_that_runs_do_not_tell_is_not_kept(file):
    """A width alone leaves the patch of a slider unknown."""
    data = tables(file, limits={"wear": 1e-9}) | {"wear": {"impact_rate": 1e-13, "width": 1e-3}}
    record = optimise(Study.of(data))
    assert record.history_amplitude.min() >= 2.0
