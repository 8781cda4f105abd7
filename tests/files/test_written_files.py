"""Files as commands of version 0.2.0 wrote them: today's records read them, and write the same names, units and values.

`written` has one small file of every kind of result, with the command's JSON (`--json`) and its table (`export`) where
there are some. The names in them are an interface.
"""

import json
import math
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest

import vanedamp as vd
from vanedamp.files.store import finite, json_text, load_any
from vanedamp.rom.ring.sector_ring import load_ring
from vanedamp.studies import kinds
from vanedamp.studies.cli import main

WRITTEN = Path(__file__).parent / "written"
FILES = sorted(path.stem for path in WRITTEN.glob("*.h5"))
#: what commands add to a record's JSON, and to its file; anywhere, and by the kind of the file
TIMES = {"wall_time_s", "points_per_second", "points_resumed", "resonance"}
OF_COMMANDS = {
    "calibration": {"status", "tuning"},
    "design": {"status", "stages"},
    "modes": {
        "cavity", "effective_mass", "fatigue", "first_bending", "first_bending_number", "movable_mass", "rigid",
        "solver", "warnings",
    },
    "reduced-model": {
        "basis", "estimate", "fatigue", "frequency_hz", "hot_spot_modes", "hot_spots", "modes", "warnings",
    },
    "ring-modes": {"mistuning", "warnings"},
    "response": {"event_list"},
    "ring-sectors": {
        "basis", "coordinates", "diameters", "estimate", "frequency_hz", "greatest_speed", "warnings",
    },
    "sweep": {"designs", "headlines"},
}  # fmt: skip
IN_FILES = {
    "ring-modes": {"cell", "coordinates", "damping_ratio", "vtk_cell_type"},
    "modes": {
        "axis", "cell", "coordinates", "damping_ratio", "effective_mass", "fatigue", "first_bending", "movable_mass",
        "rigid", "stress_error", "stress_per_amplitude", "stress_place", "stress_singular", "versions", "volume",
        "von_mises", "vtk_cell_type",
    },
    "life": {"worn_away"},
}  # fmt: skip


def kind(name):
    return load_any(WRITTEN / f"{name}.h5")[0]


def read(name):
    """The record in a file, by the class of its kind; None where there is no way to read it."""
    if kind(name) in ("ring-model", "ring-sectors"):
        return load_ring(WRITTEN / f"{name}.h5")
    known = kinds.kind(kind(name))
    load = known and getattr(pkgutil.resolve_name(known.RECORD), "load", None)
    return load and load(WRITTEN / f"{name}.h5")


def same(one, other, where=""):
    """Assert that plain data have what others had, equal to the last digits of numbers."""
    if isinstance(one, dict):
        assert one.keys() <= other.keys(), where
        for key in one:
            same(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, list | tuple):
        assert len(one) == len(other), where
        for index, pair in enumerate(zip(one, other, strict=True)):
            same(*pair, f"{where}[{index}]")
    elif isinstance(one, float) and not isinstance(other, str | None):
        assert math.isclose(one, other, rel_tol=1e-12) or math.isnan(one), where
    else:
        assert one == other or (one is None and math.isnan(other)), where


def test_every_kind_is_here():
    assert {kind(name) for name in FILES} >= set(kinds.names())


@pytest.mark.parametrize("name", FILES)
def test_what_is_read_is_written_again(name, tmp_path):
    record = read(name)
    if record is None or not hasattr(record, "save"):
        pytest.skip("no class reads and writes it")
    record.save(tmp_path / "again.h5")
    (_, variables, attributes), (_, again, named) = load_any(WRITTEN / f"{name}.h5"), load_any(tmp_path / "again.h5")
    of_command = IN_FILES.get(kind(name), set())
    assert again.keys() >= variables.keys() - of_command and named.keys() >= attributes.keys() - of_command
    for key, made in again.items():
        if key not in variables:  # what all records have by now
            continue
        assert (tuple(made.dims), made.units) == (tuple(variables[key].dims), variables[key].units), key
        assert made.values.dtype == variables[key].values.dtype, key
        kept = variables[key].values
        if made.values.dtype.kind in "fc":  # some come from others, by arithmetic
            largest = np.abs(kept[np.isfinite(kept)]).max(initial=0.0)
            np.testing.assert_allclose(made.values, kept, rtol=1e-9, atol=1e-12 * largest, err_msg=key)
        else:
            np.testing.assert_array_equal(made.values, kept, key)
    same({key: attributes[key] for key in attributes.keys() - of_command}, named)


@pytest.mark.parametrize("name", [name for name in FILES if (WRITTEN / f"{name}.json").exists()])
def test_json_has_the_names_of_before(name):
    record, before = read(name), json.loads((WRITTEN / f"{name}.json").read_text())
    if record is None or not hasattr(record, "to_json"):
        pytest.skip("no class reads it and gives JSON")
    now = json.loads(json_text(finite(record.to_json())))
    own = before.keys() - OF_COMMANDS.get(kind(name), set())
    assert own - TIMES <= now.keys()
    both = own & now.keys()
    if "scene" not in before:  # which would be most of it
        assert "scene" not in now
    same({key: before[key] for key in both}, {key: now[key] for key in both})


@pytest.mark.parametrize("name", FILES)
def test_every_file_is_described(name, capsys):
    assert main(["info", str(WRITTEN / f"{name}.h5"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == kind(name)


@pytest.mark.parametrize("name", FILES)
def test_every_file_goes_to_a_table(name, tmp_path):
    assert main(["export", str(WRITTEN / f"{name}.h5"), "-o", str(tmp_path / "now.csv")]) == 0
    now = (tmp_path / "now.csv").read_text().splitlines()
    assert len(now) > 1
    if (WRITTEN / f"{name}.csv").exists():
        before = (WRITTEN / f"{name}.csv").read_text().splitlines()
        assert {*before[0].split(",")} <= {*now[0].split(",")} and len(now) == len(before)


@pytest.mark.parametrize("name", [name for name in FILES if name not in ("sweep-checkpoint", "response-of-ring")])
def test_every_file_has_a_figure_with_named_axes(name):
    drawn = vd.plot(WRITTEN / f"{name}.h5").to_plotly_json()
    layout = drawn["layout"]
    places = [layout[place] for place in layout if place.startswith("scene")] or [layout]
    titles = [place[axis]["title"].get("text") for place in places for axis in place if re.match("[xy]axis", axis)
              and "title" in place[axis]]  # fmt: skip
    assert drawn["data"] and (any(titles) or kind(name) == "modes")


def test_every_kind_is_on_a_page(tmp_path):
    shown = [str(WRITTEN / f"{name}.h5") for name in FILES if name != "sweep-checkpoint"]
    assert main(["report", *shown, "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for path in map(Path, shown):
        assert f">{path.name}<" in page, path.name
