"""Each quantity is said once: formulas of numbers and of many scenes; a new one is everywhere at once."""

import ast
import csv
import math
import pkgutil
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vanedamp as vd
from docs._ext.quantities import KINDS, lacks, reason
from vanedamp.coupling.quantities import quantity as quantities
from vanedamp.coupling.quantities.quantity import FAMILIES, evaluated, possible, quantity, table
from vanedamp.coupling.quantities.sums import COMPLEX, ENERGIES, SUMS, sources_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.record import NamedArrays, Record, declared
from vanedamp.files.toml_input import validate
from vanedamp.studies import kinds
from vanedamp.studies.cli import main
from vanedamp.studies.explore.point_view import point_view
from vanedamp.studies.identification.data import forced
from vanedamp.studies.identification.fit import Fit
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.tables import ForcedTable, Sought
from vanedamp.studies.life.study import LifeStudy
from vanedamp.studies.optimisation.measures import Limits, check_measured
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect

ROOT = Path(__file__).parents[3]
SCENE = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "resonance_amplitude": 1e-3},
    "cavity": [{"name": "c", "gap": 4e-4}],
    "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.2, "restitution": 0.6}],
    "contact": {"law": "newton", "pair": {"young": 2e11, "radius": 0.01, "yield_strength": 1e9}},
    "wear": {"rate": 1e-15, "impact_rate": 1e-13, "area": 1e-6},
    "time": {"periods": 60, "transient": 40},
}

#: a body that friction holds, and a run so short that neighbours stay together
RESTS = {"damper": [SCENE["damper"][0] | {"friction": 0.2, "normal_load": 500.0}]}
SHORT = {"periods": 6, "transient": 3}
LONG = {"periods": 400, "transient": 300, "tolerance": 0.2}


def scene(**changes):
    return validate(Scene, SCENE | changes, "scene")


class Jerk:
    """A family of quantities, as of one file more."""

    ORDER = 5

    @quantity("m/s^3", spread=True, limited=True)
    def largest_jerk(highest, omega):
        """largest jerk of a sine of that amplitude"""
        return omega**3 * highest


@pytest.fixture
def jerk(monkeypatch):
    known = {"jerk": Jerk} | FAMILIES.all()
    monkeypatch.setattr(quantities, "FAMILIES", SimpleNamespace(all=lambda: known, own=lambda: known))
    for kept in (table, possible):
        kept.cache_clear()
    yield Jerk.largest_jerk.name
    monkeypatch.undo()
    for kept in (table, possible):
        kept.cache_clear()


def test_a_quantity_of_one_file_is_in_runs(jerk, tmp_path, capsys):
    run = vd.simulate(scene())
    expected = (2 * math.pi * 15.9) ** 3 * run.amplitude_max
    assert getattr(run, jerk) == pytest.approx(expected, rel=1e-12)
    assert run.to_json()[jerk] == getattr(run, jerk) and f"{jerk}:" in str(run) and "m/s^3" in str(run)
    run.save(tmp_path / "run.h5")
    assert getattr(vd.Response.load(tmp_path / "run.h5"), jerk) == getattr(run, jerk)
    assert run.to_xarray().attrs[jerk] == getattr(run, jerk)
    assert main(["info", str(tmp_path / "run.h5")]) == 0
    assert jerk in capsys.readouterr().out


def test_a_quantity_of_one_file_is_in_sweeps_and_ensembles(jerk, tmp_path):
    over = {"excitation.frequency": [15.7, 15.9, 16.1]}
    found = vd.sweep(scene(sweep=over))
    assert getattr(found, jerk) == pytest.approx((2 * np.pi * np.array([15.7, 15.9, 16.1])) ** 3 * found.amplitude_max)
    assert found.to_json()[jerk] == getattr(found, jerk).tolist() and found.to_json()["units"][jerk] == "m/s^3"
    assert found.to_xarray()[jerk].attrs["units"] == "m/s^3" and jerk in found._repr_html_()
    found.save(tmp_path / "sweep.h5")
    assert main(["export", str(tmp_path / "sweep.h5"), "-o", str(tmp_path / "sweep.csv")]) == 0
    with open(tmp_path / "sweep.csv", encoding="utf-8") as file:
        assert f"{jerk} [m/s^3]" in next(csv.reader(file))
    spread = scene(ranges={"damper.0.friction": (0.1, 0.3)}, ensemble={"samples": 4}, sweep=over, time=LONG)
    found = vd.ensemble(spread)
    assert found.quantile[jerk].shape == (5, 3) and np.isfinite(found.quantile[f"peak_{jerk}"]).all()


BLOCK = {
    "damper": [SCENE["damper"][0] | {"shape": "block", "length": 1e-2, "height": 1e-2}],
    "cavity": [{"name": "c", "gap": 4e-4, "play": 1e-4}],
}  # fmt: skip


@pytest.mark.parametrize("changes", [{}, {"wear": None}, {"contact": None, "wear": None}, {"contact": None}, BLOCK])
def test_points_of_sweeps_have_what_runs_have(changes):
    """Whether they run as one in compiled code, or one by one."""
    tables = {name: table for name, table in (SCENE | changes).items() if table is not None}
    given = validate(Scene, tables, "scene")
    found = vd.sweep(given.replace({"sweep": {"excitation.frequency": [15.7, 15.9, 16.1], "sections": 3}}))
    for place, frequency in enumerate([15.7, 15.9, 16.1]):
        run = vd.simulate(given.replace({"excitation.frequency": frequency}))
        known = {name for name in table() if getattr(run, name) is not None}
        assert known - {*found.quantities} == set()
        for name in known - {*found.sections}:
            np.testing.assert_array_equal(found.quantities[name][place], getattr(run, name), err_msg=name)
    assert ("contact_force" in found.quantities) == ("contact" in tables)


def test_a_quantity_of_one_file_is_in_orbits(jerk, tmp_path):
    found = vd.orbits(scene(orbit={"from": 15.7, "to": 15.8, "max_points": 3, "start": "linear"}, **RESTS))
    (branch,) = found.branches
    expected = (2 * np.pi * branch.parameter) ** 3 * branch.amplitude_max
    assert getattr(branch, jerk) == pytest.approx(expected, rel=1e-9)
    found.save(tmp_path / "orbits.h5")
    assert getattr(vd.Branches.load(tmp_path / "orbits.h5"), jerk) == pytest.approx(expected)
    assert found.to_xarray()[jerk].attrs["units"] == "m/s^3"
    assert getattr(vd.orbit_at(found), jerk) == pytest.approx(expected[0])


def test_a_quantity_of_one_file_is_in_ramps_and_ring_downs(jerk, tmp_path):
    found = vd.ramp(scene(ramp={"from": 15.0, "to": 15.5, "periods": 5}))
    (run,) = found.runs
    assert getattr(run, jerk) == pytest.approx((2 * np.pi * run.frequency) ** 3 * run.amplitude_max)
    assert run.largest[jerk] == getattr(run, jerk).max() and found.to_xarray()[jerk].attrs["units"] == "m/s^3"
    rung = vd.ring_down(scene(ring_down={"start": "steady", "periods": 30}))
    assert rung.quantities[jerk] > 0.0 and rung.to_xarray().attrs.get(jerk, rung.quantities[jerk]) > 0.0


def test_a_quantity_of_one_file_has_derivatives(jerk):
    found = vd.sensitivity(scene(time=SHORT), ["excitation.frequency", "damper.0.mass"])
    assert found.values[jerk] == pytest.approx((2 * np.pi * 15.9) ** 3 * found.values["amplitude_max"], rel=1e-9)
    expected = (2 * np.pi * 15.9) ** 3 * found.derivatives["amplitude_max"]
    expected[0] += 3 * found.values[jerk] / 15.9
    assert found.derivatives[jerk] == pytest.approx(expected, rel=1e-9)


def test_a_quantity_of_one_file_may_be_limited_and_is_on_the_page(jerk, tmp_path):
    check_measured(scene(), jerk, Limits(quantities={jerk: 1e3}))
    vd.sweep(scene(sweep={"excitation.frequency": [15.7, 15.9]})).save(tmp_path / "sweep.h5")
    write_report(collect([tmp_path / "sweep.h5"]), tmp_path / "report.html")
    assert f"{jerk}-0" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(reason(table()[jerk], kind) is None for kind in KINDS)


def test_a_quantity_of_one_file_may_be_measured_and_count_for_a_life(jerk):
    places, numbers = [15.7, 15.9], {"excitation.resonance_amplitude": Sought(5e-4, 2e-3)}
    given = scene(time=LONG, **RESTS)
    values = [getattr(vd.simulate(given.replace({"excitation.frequency": at})), jerk) for at in places]
    measured = forced("jerk", places, values, {}, ForcedTable("", noise=0.01, measure=jerk))
    study = IdentificationStudy(given, numbers, [measured])
    fit, z = Fit(study), study.coordinates([1e-3])
    assert np.abs(fit.residual(z)).max() < 1e-6
    assert fit.jacobian(z)[:, 0] == pytest.approx(1.5e-3 / 1e-3 / 0.01, rel=1e-4)
    assert measured.channels[0].unit == "m/s^3"
    table = {"band": [15.7, 15.9], "hours": 10.0, "measure": jerk, "limit": 1e3}
    assert LifeStudy.of(SCENE | {"life": table}).measure.value(vd.simulate(given)) == getattr(vd.simulate(given), jerk)


def test_a_quantity_of_one_file_is_in_the_explorer(jerk):
    tables = {name: table for name, table in SCENE.items() if name != "wear"}
    assert point_view(tables, 15.9).quantities[jerk].endswith(" m/s^3")


def test_formulas_take_numbers_and_arrays_of_scenes_alike():
    rng = np.random.default_rng(1)
    rows = rng.uniform(0.5, 2.0, (7, len(SUMS)))
    many = evaluated(sources_of(rows))
    for place, row in enumerate(rows):
        for name, value in evaluated(sources_of(row)).items():
            np.testing.assert_array_equal(many[name][place], value, err_msg=name)


def test_sums_have_a_place_each():
    assert len({*SUMS}) == len(SUMS) and set(COMPLEX + ENERGIES).isdisjoint(
        sources_of(np.zeros(len(SUMS))).keys() - {*COMPLEX}
    )


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_result_lacks_is_explained(kind):
    needed = {name for one in table().values() for name in (one.name, *one.needs, *one.dims)}
    assert lacks(kind).keys() <= needed
    assert all(len(why) > 10 for why in lacks(kind).values())
    assert any(reason(one, kind) is None for one in table().values())


# rules of the code


def product(pattern):
    """The files of the product in whose text a pattern is found, as trees."""
    listed = subprocess.run(
        ["git", "ls-files", "coupling", "studies", "rom", "modal", "files", "meshes"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    for name in listed.stdout.split():
        if name.endswith(".py") and not name.startswith("coupling/quantities/"):
            text = (ROOT / name).read_text(encoding="utf-8")
            if re.search(pattern, text):
                yield name, ast.parse(text)


UNITS = {"m", "1", "rad", "Pa", "N", "m/s", "m/h", "m^3/h", "W", "1/h", "1/s", "Hz", "J"}
#: units of the keys of other tables: of measured data, and of contacts at one speed
OTHERS = {
    "studies/identification/data.py",
    "coupling/contacts/numbers.py",
    "files/formats/lab_units.py",
    "files/formats/lab_table.py",
}


def test_a_quantity_has_its_unit_in_one_file():
    """No other file lists names of quantities with units, or declares a field of that name."""
    names, again = {*table()}, []
    for name, tree in product(rf'"({"|".join(names)})":\s*"({"|".join(map(re.escape, UNITS))})"'):
        for node in ast.walk(tree):
            if isinstance(node, ast.Dict) and name not in OTHERS:
                pairs = zip(node.keys, node.values, strict=True)
                again += [
                    (name, key.value)
                    for key, value in pairs
                    if isinstance(key, ast.Constant) and key.value in names
                    and isinstance(value, ast.Constant) and value.value in UNITS
                ]  # fmt: skip
    assert again == []


#: methods by which records of results write or read parts by hand: fewer are better, more need a reason
BY_HAND = 15


def test_records_declare_what_they_are():
    """A record declares its fields: of all kinds together, few write more, or read it, by themselves."""
    found, names = [], ("to_json", "variables", "attributes", "of")
    for kind in map(kinds.kind, kinds.names()):
        record = pkgutil.resolve_name(kind.RECORD)
        if issubclass(record, Record):
            assert declared(record)
            found += [(record.__name__, name) for name in names if name in vars(record)]
    assert len(found) <= BY_HAND, found
    assert any(isinstance(item[1], NamedArrays) for item in declared(vd.Sweep).values())
