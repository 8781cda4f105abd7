"""Meshed bodies against added masses: the same fixed frequency, and what differs is told apart."""

import pytest

from vanedamp.files.toml_input import InputError
from vanedamp.studies.case.glued_bodies import compare_tied
from vanedamp.studies.case.tables import Case

CASE = """
[mesh]
generator = "vane_cluster"
airfoils = 2
cavities = 1
element_size = 0.008
damper_width = 0.010
damper_height = 0.004
damper_depth = 0.010
[material.default]
young = 2e11
poisson = 0.3
density = 8190.0
[material.damper]
young = 2e11
poisson = 0.3
density = 8190.0
[support]
clamped = ["clamp"]
[modes]
count = 3
"""


def load(text, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text)
    return Case.load(path)


def test_meshed_bodies_and_added_masses_agree(tmp_path):
    """The fixed frequency within 0.5 %; the stiffness of a body raises it by much less than its mass lowers it."""
    found = compare_tied(load(CASE, tmp_path))
    assert found.mass == pytest.approx(8190.0 * 0.010 * 0.004 * 0.010)
    assert found.tied_hz < 0.99 * found.free_hz
    assert abs(found.difference) < 2e-3
    assert 0.0 < found.stiffening < 2e-3
    assert found.soft_hz < found.tied_hz


def test_refuses_a_case_without_bodies(tmp_path):
    text = CASE.replace("damper_width = 0.010\ndamper_height = 0.004\ndamper_depth = 0.010\n", "")
    with pytest.raises(InputError, match="damper_width"):
        compare_tied(load(text, tmp_path))
