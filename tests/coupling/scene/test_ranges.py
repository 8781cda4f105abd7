"""Numbers given as ranges: where a file may have them, what the scene is then, and what is none."""

import copy
import math

import pytest
import tomli_w

from tests.tools.input_files import OSCILLATOR
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate


def loaded(folder, *changes, **tables):
    """The scene of a file with some numbers changed: (table, entry or None, key, value)."""
    data = copy.deepcopy(OSCILLATOR) | tables
    for table, entry, key, value in changes:
        (data[table] if entry is None else data[table][entry])[key] = value
    (folder / "scene.toml").write_text(tomli_w.dumps(data))
    return Scene.load(folder / "scene.toml")


def test_a_range_in_the_place_of_a_number(tmp_path):
    found = loaded(tmp_path, ("damper", 0, "friction", [0.2, 0.5]), ("structure", None, "damping_ratio", [0.01, 0.03]))
    assert found.ranges == {"damper.0.friction": (0.2, 0.5), "structure.damping_ratio": (0.01, 0.03)}
    assert found.damper[0].friction == 0.35 and found.structure.damping_ratio == 0.02
    assert validate(Scene, found.to_dict(), "again") == found
    found.save(tmp_path / "written.toml")
    assert Scene.load(tmp_path / "written.toml") == found


def test_a_table_of_ranges_keeps_the_number_itself(tmp_path):
    found = loaded(tmp_path, ranges={"damper.friction": [0.05, 0.5]})
    assert found.damper[0].friction == 0.1 and found.ranges == {"damper.friction": (0.05, 0.5)}


def test_the_middle_of_a_logarithmic_range_is_geometric(tmp_path):
    found = loaded(tmp_path, ("damper", 0, "mass", [0.01, 0.09]), ensemble={"distribution": "log-uniform"})
    assert found.damper[0].mass == pytest.approx(0.03, rel=1e-14)


def test_lists_that_belong_there_stay_what_they_are(tmp_path):
    sweep_table = {"excitation.frequency": [15.0, 16.0]}
    found = loaded(tmp_path, ("excitation", None, "resonance_near", [15.0, 16.0]), sweep=sweep_table)
    assert not found.ranges and found.excitation.resonance_near == (15.0, 16.0)


def test_replace_makes_and_unmakes_ranges(tmp_path):
    found = loaded(tmp_path).replace({"cavity.c1.gap": [1e-4, 3e-4]})
    assert found.ranges == {"cavity.0.gap": (1e-4, 3e-4)} and found.cavity[0].gap == pytest.approx(2e-4)
    assert not found.replace({"cavity.0.gap": 1e-4}).ranges and not found.replace({"cavity.gap": 1e-4}).ranges
    assert found.replace({"cavity.gap": 1e-4}).cavity[0].gap == 1e-4


@pytest.mark.parametrize("value", [[0.5, 0.2], [0.2, 0.2], [0.2, 0.3, 0.5], [0.2], [], ["a", 0.5], [True, 2.0]])
def test_a_list_that_is_no_range_is_one_line(tmp_path, value):
    with pytest.raises(InputError) as told:
        loaded(tmp_path, ("damper", 0, "friction", value))
    assert "scene.toml: damper[0].friction: expected a number, or a range [low, high]" in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("changes", "tables", "message"),
    [
        ([("damper", 0, "friction", [-0.1, 0.5])], {}, "damper[0].friction: should be greater than or equal to 0"),
        ([("damper", 0, "restitution", [0.5, 1.5])], {}, "damper[0].restitution: should be less than or equal to 1"),
        ([], {"ranges": {"damper.0.frction": [0.1, 0.2]}}, "ranges.damper.0.frction"),
        ([], {"ranges": {"damper.0.friction": [0.3, 0.2]}}, "ranges.damper.0.friction: expected [lowest, highest]"),
        ([("damper", 0, "friction", [0.0, 0.5])], {"ensemble": {"distribution": "log-uniform"}}, "above zero"),
        ([], {"ensemble": {"samples": 60}}, "ensemble: samples: expected a power of 2, such as 64, not 60"),
        ([("damper", 0, "friction", [0.1, 0.5])], {"sweep": {"damper.0.friction": [0.1, 0.2]}}, "is a range as well"),
        ([("damper", 0, "friction", [0.1, 0.5])], {"sweep": {"damper.friction": [0.1, 0.2]}}, "is a range as well"),
        ([("cavity", 0, "gap", [1e-4, 5e-4])], {"sweep": {"cavity.gap": [1e-4, 2e-4]}}, "(ranges.cavity.0.gap)"),
        ([("cavity", 0, "gap", [1e-4, 5e-4])], {"sweep": {"cavity.c1.gap": [1e-4]}}, "sweep.cavity.c1.gap: is a range"),
        (
            [("cavity", 0, "gap", [1e-4, 5e-4])],
            {"ranges": {"cavity.gap": [1e-4, 2e-4]}},
            "ranges.cavity.0.gap: names the same number as cavity.gap",
        ),
        ([], {"sweep": {"cavity.gap": [1e-4], "cavity.c1.gap": [2e-4]}}, "names the same value as cavity.gap"),
        ([("time", None, "periods", [10, 20])], {}, "time.periods"),
    ],
)
def test_bad_ranges_are_one_line(tmp_path, changes, tables, message):
    with pytest.raises(InputError) as told:
        loaded(tmp_path, *changes, **tables)
    assert message in str(told.value) and "\n" not in str(told.value)


def test_what_knows_no_ranges_says_so(tmp_path):
    given = loaded(tmp_path, ("damper", 0, "friction", [0.2, 0.5]), sweep={"excitation.frequency": [15.9]})
    found = simulate(given)
    assert any(warning.startswith("ranges: damper.0.friction") for warning in found.warnings)
    own = simulate(given.replace({"damper.0.friction": 0.35}))
    assert found.amplitude_mean == own.amplitude_mean and not math.isnan(own.amplitude_mean)
    with pytest.raises(InputError, match=r"damper\.0\.friction is a range"):
        sweep(given)
