"""Sector of a bladed disk: volumes, areas and groups, faces that match, wrong parameters."""

import math

import numpy as np
import pytest

from vanedamp.meshes.parameters import ParameterError
from vanedamp.meshes.sector import Sector, build
from vanedamp.modal.cyclic import cyclic_sector
from vanedamp.modal.elasticity import Material, assemble

DISK = {"sectors": 12, "inner_radius": 0.05, "outer_radius": 0.1, "thickness": 0.02, "element_size": 0.01}
BLADE = {"blade_length": 0.06, "blade_thickness": 0.012, "blade_width": 0.01}
CAVITY = {"cavity_length": 0.02, "cavity_thickness": 0.006, "cavity_width": 0.004, "cavity_wall": 0.01}
DENSITY = 7800.0


def matrices(folder, **parameters):
    """Of the sector with these parameters."""
    path = build(Sector(**DISK | parameters), folder / "sector.msh")
    return assemble(path, {"default": Material(2e11, 0.3, DENSITY)}, {"bore": "xyz"})


def test_volume_areas_and_groups(tmp_path):
    """Curved elements have the volume of the disk, and the cavity's walls face each other."""
    found = matrices(tmp_path, **BLADE, **CAVITY, order=2)
    disk = math.pi / 12 * (0.1**2 - 0.05**2) * 0.02
    # the blade begins on the cylinder of the rim, and ends in one like it: every fibre is 0.06 m long
    blade = 0.012 * 0.01 * 0.06 - 0.006 * 0.004 * 0.02
    assert found.total_mass == pytest.approx(DENSITY * (disk + blade), rel=1e-6)
    areas = {"low": 0.05 * 0.02, "high": 0.05 * 0.02, "bore": 2 * math.pi / 12 * 0.05 * 0.02,
             "cavity_left": 0.02 * 0.004, "cavity_right": 0.02 * 0.004}  # fmt: skip
    assert {name: found.patches[name].area for name in areas} == pytest.approx(areas, rel=1e-6)
    normals = {"cavity_left": [0, 1, 0], "cavity_right": [0, -1, 0]}
    for name, normal in normals.items():
        assert found.patches[name].normal == pytest.approx(normal, abs=1e-9)
    floor, roof = (found.coordinates[found.patches[f"cavity_{name}"].nodes][:, 0] for name in ("floor", "roof"))
    assert floor.min() - roof.max() == pytest.approx(0.02, abs=1e-4)
    assert set(found.patches) == {*areas, "rim", "tip", "cavity_floor", "cavity_roof"}


@pytest.mark.parametrize("order", [1, 2])
def test_faces_match_for_any_number_of_sectors(order, tmp_path):
    for sectors in (2, 7, 36):
        made = matrices(tmp_path, sectors=sectors, order=order)
        sector = cyclic_sector(made, "low", "high", sectors)
        assert sector.distance < 1e-15
        assert np.unique(sector.low).size == np.unique(sector.high).size == made.patches["low"].nodes.size


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"sectors": 1}, "sectors: expected at least 2, not 1"),
        ({"inner_radius": 0.0}, "inner_radius: expected a positive number, not 0"),
        ({"outer_radius": 0.05}, "outer_radius: expected more than the inner 0.05 m"),
        ({"element_size": 1e-7}, "element_size: about .* elements; at most"),
        ({"order": 3}, r"order: expected 1 \(straight\) or 2 \(curved elements\), not 3"),
        ({"blade_length": 0.06}, "blade_thickness: expected more than 0 and less than 0.0517638 m, not 0"),
        (BLADE | {"blade_width": 0.03}, "blade_width: expected more than 0 and less than 0.02 m, not 0.03"),
        (BLADE | CAVITY | {"cavity_length": 0.051}, "cavity_length: expected more than 0 and less than 0.05 m"),
        (BLADE | CAVITY | {"cavity_thickness": 0.02}, "cavity_thickness: expected more than 0 and less than 0.012 m"),
        (CAVITY, "cavity_length: needs a blade; give blade_length"),
    ],
)  # fmt: skip
def test_wrong_parameters_are_rejected(wrong, message):
    with pytest.raises(ParameterError, match=message):
        Sector(**DISK | wrong)
