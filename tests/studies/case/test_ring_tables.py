"""The table [ring] of a case, and the stages from it to the modes of the ring."""

import numpy as np
import pytest

from tests.tools.input_files import changed
from vanedamp.files.errors import VanedampError
from vanedamp.files.toml_input import InputError
from vanedamp.modal.cyclic_modes import ring_modes
from vanedamp.studies.case.ring_stages import ring_analysis, ring_sector
from vanedamp.studies.case.stages import assemble, campbell_diagram, modal_analysis
from vanedamp.studies.case.tables import Case

CASE = """
[mesh]
generator = "sector"
degree = 1
sectors = 5
inner_radius = 0.05
outer_radius = 0.1
thickness = 0.01
element_size = 0.05
[material.default]
young = 2e11
poisson = 0.3
density = 7800.0
[support]
clamped = ["bore"]
[modes]
count = 2
[ring]
sectors = 5
low = "low"
high = "high"
"""
FACES = 'low = "low"\nhigh = "high"\n'
ROTATION = "[rotation]\naxis = [0, 0, 1]\nrpm = 6000\ngyroscopic = true\n"


def load(text, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text)
    return Case.load(path)


def test_modes_of_a_case(tmp_path):
    """About the z axis unless the table says; every diameter as ring_modes has it."""
    structure = assemble(load(CASE, tmp_path))
    sector = ring_sector(structure)
    assert sector.sectors == 5 and sector.axis.tolist() == [0.0, 0.0, 1.0] and sector.distance < 1e-15
    found = ring_analysis(structure)
    assert found.table == pytest.approx(ring_modes(sector, 2).table, rel=1e-12)
    assert found.diameters.tolist() == [0, 0, 1, 1, 2, 2]
    up_to = load(changed(CASE, ("count = 2", f"max_frequency = {found.table[1, 0] + 1.0}")), tmp_path)
    assert set(ring_analysis(assemble(up_to)).frequencies_hz < found.table[1, 0] + 1.0) == {True}


def test_modes_of_the_sector_by_itself_come_with_a_warning(tmp_path):
    axial = changed(CASE, ("count = 2", "count = 2\ndirection = [0, 0, 1]"))
    found = modal_analysis(assemble(load(axial, tmp_path)))
    assert any(warning.startswith("ring: these are modes of one sector whose") for warning in found.warnings)


def test_case_that_rotates_has_the_axis_and_waves_of_its_rotation(tmp_path):
    structure = assemble(
        load(CASE + ROTATION + "[campbell]\nrpm = [0, 6000]\nengine_orders = [1]\nmodes = 2\n", tmp_path)
    )
    found = ring_analysis(structure)
    assert np.unique(found.diameters).tolist() == [-2, -1, 0, 1, 2]
    diagram = campbell_diagram(structure)
    assert np.array_equal(diagram.diameters, found.diameters) and diagram.gyroscopic
    assert diagram.frequencies_hz[:, -1] == pytest.approx(found.frequencies_hz, rel=1e-8)
    assert diagram.label(2) == "1 of h=1"
    diagram.save(tmp_path / "campbell.h5")
    again = type(diagram).load(tmp_path / "campbell.h5")
    assert again.to_json() == diagram.to_json()


def test_separate_structures_are_coupled_by_springs(tmp_path):
    """With springs too soft to matter every diameter is alike; with stiff ones they differ."""
    spring = '[[ring.spring]]\nlow = "low"\nhigh = "high"\nstiffness = '
    weak, strong = (
        ring_analysis(assemble(load(changed(CASE, (FACES, "")) + spring + stiffness, tmp_path))).table
        for stiffness in ("1e-3", "[1e8, 1e8, 1e8]")
    )
    assert np.ptp(weak, axis=0).max() < 1e-6 * weak.max()
    assert np.ptp(strong[:, 0]) > 0.01 * strong[0, 0] and np.all(strong[1:] > 1.001 * weak[1:])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[ring]\nsectors = 5", "[ring]\nsectors = 1", "ring.sectors: should be greater than or equal to 2 (got 1)"),
        ("[ring]\nsectors = 5\n", "[ring]\n", "ring.sectors: missing"),
        (
            "count = 2",
            "min_frequency = 10.0\nmax_frequency = 1e4",
            "modes.min_frequency: families of a ring count from",
        ),
        ('high = "high"\n', "", "ring: give both faces, low and high, or none of separate structures"),
        (FACES, "", "ring: low: missing; give the faces low and high, or [[ring.spring]] of separate structures"),
        ('high = "high"', 'high = "low"', "ring: high: expected another group than low, 'low'"),
        ('high = "high"', 'high = "high"\naxis = [0, 0, 0]', "ring.axis: expected three numbers, not all zero"),
        ('high = "high"', 'high = "high"\ntolerance = 0.1', "ring.tolerance: should be less than or equal to 0.01"),
        (
            'high = "high"\n',
            'high = "high"\naxis = [0, 0, 1]\n' + ROTATION,
            "ring.axis: a ring that rotates has the axis of [rotation]; leave out axis and point",
        ),
        (
            'high = "high"\n',
            'high = "high"\n[[ring.spring]]\nlow = "low"\nhigh = "low"\nstiffness = 1e6\n',
            "ring: spring[0].high: expected another group than low, 'low'",
        ),
        (
            'high = "high"\n',
            'high = "high"\n[[ring.spring]]\nlow = "low"\nhigh = "high"\nstiffness = 0\n',
            "ring.spring[0]: stiffness: expected N/m above zero, such as 1e7 or [1e7, 5e6, 1e7]",
        ),
        ("[ring]\nsectors = 5", "[ring]\nsectors = 6", "ring.sectors: the mesh is a sector of 5, not of 6"),
    ],
)
def test_wrong_tables_are_rejected(old, new, message, tmp_path):
    with pytest.raises(InputError) as refused:
        load(changed(CASE, (old, new)), tmp_path)
    assert str(refused.value).startswith(f"{tmp_path / 'case.toml'}: {message}")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('high = "high"', 'high = "hihg"', "ring.high: no facet group 'hihg' in the mesh; it has bore, high, low, rim"),
        (FACES, 'low = "high"\nhigh = "low"\n', "ring.low: low and high are swapped"),
        ('high = "high"', 'high = "high"\naxis = [0, 1, 0]', "ring.axis: the faces are centred at the radii"),
    ],
)
def test_meshes_that_make_no_ring_are_rejected(old, new, message, tmp_path):
    with pytest.raises(VanedampError) as refused:
        ring_sector(assemble(load(changed(CASE, (old, new)), tmp_path)))
    assert str(refused.value).startswith(message)
