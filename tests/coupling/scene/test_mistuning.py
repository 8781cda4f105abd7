"""Mistuning of the sectors of a ring: given, measured, drawn, in a pattern; bad input in one line."""

import numpy as np
import pytest

from vanedamp.coupling.scene.mistuning import Mistuning
from vanedamp.files.toml_input import InputError, validate


def mistuning(**tables):
    return validate(Mistuning, tables, "mistuning")


def test_deviations_are_given_drawn_or_repeat():
    found = mistuning(stiffness={"values": [0.1, 0.0, -0.1]}, mass={"pattern": [0.02]}).deviations(3)
    assert found.stiffness.tolist() == [0.1, 0.0, -0.1]
    assert found.mass.tolist() == [0.02] * 3
    assert found.damping is None
    assert mistuning(stiffness={"pattern": [0.1, -0.1]}).deviations(4).stiffness.tolist() == [0.1, -0.1, 0.1, -0.1]


def test_a_deviation_of_frequency_is_one_of_stiffness():
    # f ~ sqrt(k)
    found = mistuning(frequency={"values": [0.01, -0.02, 0.0]}).deviations(3)
    assert found.stiffness == pytest.approx([1.01**2 - 1, 0.98**2 - 1, 0.0])


def test_what_is_drawn_depends_on_the_seed_only():
    drawn = {seed: mistuning(seed=seed, stiffness={"std": 0.02}).deviations(2000).stiffness for seed in (0, 1)}
    assert not np.allclose(drawn[0], drawn[1])
    assert drawn[0] == pytest.approx(
        mistuning(stiffness={"std": 0.02}, mass={"std": 0.5e-3}).deviations(2000).stiffness
    )
    assert drawn[0].std() == pytest.approx(0.02, rel=0.05)
    assert abs(drawn[0].mean()) < 4 * 0.02 / np.sqrt(2000)
    # deviations of mass are not those of stiffness
    both = mistuning(stiffness={"std": 0.01}, mass={"std": 0.01}).deviations(500)
    assert abs(np.corrcoef(both.stiffness, both.mass)[0, 1]) < 0.2


def test_blade_tests_count_relative_to_their_mean(tmp_path):
    file = tmp_path / "blades.csv"
    file.write_text("frequency_hz,sector\n101,2\n100,0\n99,1\n")
    found = mistuning(frequency={"file": str(file)}).deviations(3)
    assert found.stiffness == pytest.approx([0.0, 0.99**2 - 1, 1.01**2 - 1])
    for name in ("stiffness", "mass", "damping"):
        with pytest.raises(InputError, match=rf"mistuning.{name}.file: .* has frequencies; give it as mistuning.freq"):
            mistuning(**{name: {"file": str(file)}}).deviations(3)
    file.write_text("sector,deviation\n0,0.1\n1,0.2\n2,0\n")
    assert mistuning(mass={"file": str(file)}).deviations(3).mass.tolist() == [0.1, 0.2, 0.0]


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"stiffness": {}}, "stiffness: give one of values, file, std and pattern"),
        ({"stiffness": {"std": 0.1, "pattern": [0.1]}}, "give one of values, file, std and pattern"),
        ({"stiffness": {"std": -0.1}}, "stiffness.std: should be greater than or equal to 0"),
        ({"stiffness": {"std": 0.1}, "frequency": {"std": 0.1}}, "give one of stiffness and frequency"),
        ({"seed": 4}, "mistuning: gives no deviations; add a key such as frequency"),
        ({"seed": -1}, "seed: should be greater than or equal to 0"),
        ({"mass": {"values": []}}, "mass.values: expected at least 1 entries"),
    ],
)
def test_bad_tables_say_so(tables, message):
    with pytest.raises(InputError, match=message):
        mistuning(**tables)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"mass": {"values": [0.1, 0.2]}}, r"mistuning.mass.values: expected 3 deviations, one per sector, not 2"),
        ({"damping": {"pattern": [0.1, 0.2]}}, "mistuning.damping.pattern: 2 deviations do not repeat over 3 sectors"),
        ({"mass": {"values": [0.0, -1.0, 0.0]}}, "mistuning.mass: -1 in sector 1 leaves nothing"),
    ],
)
def test_deviations_fit_the_ring(tables, message):
    with pytest.raises(InputError, match=message):
        mistuning(**tables).deviations(3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sector,deviation\n0,0.1\n1,0.2\n", "mistuning.mass.file: .*sector 2 is missing"),
        ("sector,deviation\n0,0.1\n0,0.2\n", "line 3: sector: 0 is given twice"),
        ("sector,deviation\n3,0.1\n", "line 2: sector: expected a whole number from 0 to 2"),
        ("sector,frequency_hz\n0,-5\n", "line 2: frequency_hz: expected a number above 0"),
        ("blade,deviation\n0,0.1\n", "line 1: expected the header sector,deviation"),
    ],
)
def test_bad_files_say_so(tmp_path, text, message):
    file = tmp_path / "blades.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        mistuning(mass={"file": str(file)}).deviations(3)
