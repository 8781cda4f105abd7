"""Poincare sections and Lyapunov exponents that a sweep keeps: those of the single runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray

from tests.tools.sweep_processes import DATA, scene
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.exponents import lyapunov as module
from vanedamp.coupling.exponents.lyapunov import lyapunov
from vanedamp.coupling.quantities.quantity import family
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError

AXES = {"cavity.c1.gap": [5e-4, 2e-4], "excitation.frequency": [15.6, 15.9]}
#: without friction, whose events would cost the most
BODY = {"damper": [{"cavity": "c1", "mass": 0.05, "restitution": 0.6, "friction": 0.0}]}


def kept(**numbers):
    return scene(sweep=AXES | numbers, **BODY)


@pytest.fixture(scope="module")
def result():
    return sweep(kept(sections=14, exponents=40))


def point(i, j):
    gap, frequency = AXES["cavity.c1.gap"][i], AXES["excitation.frequency"][j]
    return scene(sweep={}, **BODY).replace({"cavity.c1.gap": gap, "excitation.frequency": frequency})


def test_sections_are_those_of_the_single_runs(result):
    """Ten periods are evaluated: they have eleven starts and ends, of fourteen places."""
    assert {name: values.shape for name, values in result.sections.items()} == {
        "section_displacement": (2, 2, 14), "section_velocity": (2, 2, 14),
        "section_slip": (2, 2, 14, 1), "section_slip_velocity": (2, 2, 14, 1),
    }  # fmt: skip
    for i, j in np.ndindex(2, 2):
        run = simulate(point(i, j))
        own = {name: values[i, j] for name, values in result.sections.items()}
        assert all(np.isnan(values[:3]).all() for values in own.values())
        np.testing.assert_array_equal(own["section_displacement"][3:], run.section[80:, 0])
        np.testing.assert_array_equal(own["section_velocity"][3:], run.section[80:, 1])
        np.testing.assert_array_equal(own["section_slip"][3:], run.slip[80:])
        np.testing.assert_array_equal(own["section_slip_velocity"][3:], run.slip_velocity[80:])


def test_exponents_are_those_of_the_motion_after_the_single_runs(result):
    for i, j in np.ndindex(2, 2):
        found = lyapunov(point(i, j), 40, simulate(point(i, j)).final)
        own = {name: values[i, j] for name, values in result.exponents.items()}
        assert (own["motion"], own["exponent_status"]) == (found.motion.value, "ok")
        assert (own["exponent"], own["exponent_confidence"]) == (found.largest, found.error)
        assert own["exponent_second"] == found.exponents[1]
        assert own["exponent_per_period"] == pytest.approx(found.largest / AXES["excitation.frequency"][j], rel=1e-14)


@pytest.mark.parametrize("numbers", [{}, {"sections": 4}, {"exponents": 32}])
def test_measures_are_those_without_and_only_what_is_asked_for_is_kept(result, numbers):
    found = sweep(kept(**numbers))
    np.testing.assert_array_equal(found.amplitude_mean, result.amplitude_mean)
    np.testing.assert_array_equal(found.energy_share, result.energy_share)
    assert bool(found.sections) == ("sections" in numbers) and bool(found.exponents) == ("exponents" in numbers)
    for part in ("sections", "exponents"):
        assert set(getattr(found, part)) in (set(), {one.name for one in family(part)})


def test_the_file_has_dimensions_and_units_and_reads_as_the_record(result, tmp_path):
    result.save(tmp_path / "sweep.h5")
    read = Sweep.load(tmp_path / "sweep.h5")
    for part in ("sections", "exponents"):
        for name, values in getattr(result, part).items():
            np.testing.assert_array_equal(getattr(read, part)[name], values, err_msg=name)
    with xarray.open_dataset(tmp_path / "sweep.h5", engine="h5netcdf") as data:
        assert data.section_slip.dims == ("cavity_c1_gap", "excitation_frequency", "section", "damper")
        assert data.section_slip.attrs["units"] == "m" and data.section_velocity.attrs["units"] == "m/s"
        assert data.exponent.attrs["units"] == "1/s"
    plain = result.to_json()
    assert plain["exponent"] == result.exponents["exponent"].tolist() and plain["units"]["exponent"] == "1/s"
    assert plain["motion"] == result.exponents["motion"].tolist() and "section_slip" not in plain


def test_linked_runs_begin_where_those_without_do():
    up = {"continuation": {"direction": "up"}}
    plain, sections, both = (
        sweep(kept(**numbers).replace(up)) for numbers in ({}, {"sections": 4}, {"sections": 4, "exponents": 32})
    )
    np.testing.assert_array_equal(sections.amplitude_mean, plain.amplitude_mean)
    np.testing.assert_array_equal(both.amplitude_mean, plain.amplitude_mean)
    np.testing.assert_array_equal(both.sections["section_slip"], sections.sections["section_slip"])


def test_columns_of_a_point_follow_each_other():
    block = {"cavity": "c1", "mass": 0.05, "shape": "block", "length": 0.01, "height": 0.01}
    data = scene(sweep=AXES | {"sections": 3, "exponents": 32}, damper=[block], cavity=[
        {"name": "c1", "gap": 5e-4, "play": 1e-4},
    ])  # fmt: skip
    row = Row(data)
    widths = dict.fromkeys(("in_plane", "exponents", "sections"), 0)
    for name, place in row.places.items():
        if row.quantities[name].family in widths:
            widths[row.quantities[name].family] += place.stop - place.start
    assert widths == {"in_plane": 4, "exponents": 4, "sections": 12} and len(row.texts) == 4
    ends = [0, *(place.stop for place in row.places.values())]
    assert [place.start for place in row.places.values()] == ends[:-1] and ends[-1] == row.width


def test_points_of_a_checkpoint_keep_them(result, tmp_path):
    class Stop(Exception):
        pass

    def stop(done, total):
        if done >= 2:
            raise Stop

    with pytest.raises(Stop):
        sweep(kept(sections=14, exponents=40), progress=stop, checkpoint=tmp_path / "kept")
    assert (tmp_path / "kept").exists()
    again = sweep(kept(sections=14, exponents=40), checkpoint=tmp_path / "kept")
    for part in ("sections", "exponents"):
        for name, values in getattr(result, part).items():
            np.testing.assert_array_equal(getattr(again, part)[name], values, err_msg=name)


def test_what_breaks_has_none(monkeypatch):
    """A run that ends early has no motion to follow; one that breaks has no words; a passage without derivative says
    so."""
    cut = sweep(scene(sweep=AXES | {"sections": 3, "exponents": 32}, solver={"max_events": 5}, **BODY))
    assert (cut.exponents["exponent_status"] == "stopped").all() and (cut.exponents["motion"] == "undecided").all()
    assert np.isnan(cut.exponents["exponent"]).all()
    critical = {"model": "rigid", "mass": 1.0, "stiffness": 1.0e4, "damping_ratio": 1.0}
    broken = sweep(scene(sweep=AXES | {"sections": 3, "exponents": 32}, structure=critical, **BODY))
    assert all(status.startswith("error") for status in broken.status.flat)
    assert (broken.exponents["motion"] == "").all() and np.isnan(broken.sections["section_slip"]).all()
    find = module.PeriodMap.each_period
    monkeypatch.setattr(
        module.PeriodMap, "each_period",
        lambda *given: [(*found[:2], PassageStatus.UNDETERMINED) for found in find(*given)],
    )  # fmt: skip
    found = sweep(kept(exponents=32)).exponents
    assert (found["exponent_status"] == "undetermined").all() and np.isnan(found["exponent"]).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sections": 0}, "sweep.sections: expected a whole number of periods, at least 1"),
        ({"sections": [4, 5]}, "sweep.sections: expected a whole number"),
        ({"exponents": 31}, "sweep.exponents: expected a whole number of periods, at least 32"),
        ({"exponents": 3.0}, "sweep.exponents"),
        ({"excitation.force": 3}, "sweep.excitation.force: a sweep needs a list"),
    ],
)
def test_bad_numbers_are_refused(changes, words):
    with pytest.raises(InputError, match=words.replace(".", r"\.")):
        kept(**changes)


def test_exponents_are_those_of_the_exact_engine():
    with pytest.raises(InputError, match=r"sweep\.exponents: .* exact engine"):
        sweep(scene(sweep=AXES | {"exponents": 32}, solver={"method": "moreau"}))


def test_numbers_are_no_axes():
    given = kept(sections=5, exponents=50)
    assert given.points == 4 and list(given.axes) == list(AXES) and given.kept == {"sections": 5, "exponents": 50}
    assert short_form(given)["sweep"] == AXES | {"sections": 5, "exponents": 50}
    with pytest.raises(InputError, match="sweep: missing"):
        sweep(scene(sweep={"sections": 5}))
    assert math.prod(sweep(given.replace({"sweep": AXES})).shape) == 4 and DATA["time"]["periods"] == 90
