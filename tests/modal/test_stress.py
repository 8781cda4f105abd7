"""The hot spot lies where a field with known stresses has it, and where the strength says."""

import numpy as np
import pytest

from tests.tools.two_cubes_mesh import write_boxes
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.stress import hot_spot, nodal_von_mises, peak_stresses

STEEL = Material(young=2.0e11, poisson=0.25, density=8000.0)


@pytest.fixture(scope="module")
def solid(tmp_path_factory):
    path = write_boxes(tmp_path_factory.mktemp("boxes") / "boxes.msh", {"near": [1], "far": [2]})
    return Solid(path, {"default": STEEL})


@pytest.fixture(scope="module")
def stretched(solid):
    """u_x = k x^2 / 2: uniaxial strain k x, whose von Mises stress is 2 G k x."""
    coordinates = solid.assemble({}, 0.0).coordinates
    return np.column_stack([0.5e-3 * coordinates[:, 0] ** 2, *np.zeros((2, len(coordinates)))]).ravel()


def test_the_largest_stress_in_closed_form(solid, stretched):
    spot = hot_spot(peak_stresses(solid, stretched), {"near": 4e8, "far": 4e8})
    shear = 0.5 * STEEL.young / (1.0 + STEEL.poisson)
    assert spot.stress == pytest.approx(2.0 * shear * 1e-3 * 2.0, rel=1e-9)
    assert spot.coordinates[0] == pytest.approx(2.0, abs=1e-12)
    assert (spot.group, spot.strength) == ("far", 4e8)


def test_nodes_have_the_largest_stress_of_their_cells(solid, stretched):
    nodes, stress = solid.assemble({}, 0.0).coordinates, nodal_von_mises(solid, stretched)
    shear = 0.5 * STEEL.young / (1.0 + STEEL.poisson)
    corners = stress > 1.0
    assert stress[corners] == pytest.approx(2.0 * shear * 1e-3 * nodes[corners, 0], rel=1e-9)
    assert np.isclose(nodes[corners, 0], 2.0).any() and not corners.all()


def test_round_off_does_not_choose_between_equal_stresses(solid, stretched):
    """The whole end face has the largest one."""
    round_off = 1e-15 * np.random.default_rng(0).standard_normal((8, stretched.size)) * np.abs(stretched).max()
    strengths = {"near": 4e8, "far": 4e8}
    spots = {hot_spot(peak_stresses(solid, stretched + each), strengths).coordinates for each in round_off}
    assert len(spots) == 1


def test_the_weaker_material_counts(solid, stretched):
    """Half the stress at a third of the strength: the near box, at the face it shares, seen from its own side."""
    spot = hot_spot(peak_stresses(solid, stretched), {"near": 1e8, "far": 3e8})
    assert (spot.group, spot.strength) == ("near", 1e8)
    assert spot.coordinates[0] == pytest.approx(1.0, abs=1e-12)


def test_groups_can_be_left_out(solid, stretched):
    assert hot_spot(peak_stresses(solid, stretched), {"near": 4e8, "far": 4e8}, within=["near"]).group == "near"
    assert hot_spot(peak_stresses(solid, stretched), {"near": 4e8}).group == "near"


def test_refuses_groups_and_strengths_that_are_none(solid, stretched):
    for strengths, within, message in [
        ({"near": 1e8}, ["fra"], "volume group 'fra' is not there"),
        ({}, None, "no volume group"),
        ({"near": -1.0}, None, "strength of 'near': expected a positive number"),
    ]:
        with pytest.raises(ElasticityError, match=message):
            hot_spot(peak_stresses(solid, stretched), strengths, within)
    with pytest.raises(ElasticityError, match="strain none"):
        hot_spot(peak_stresses(solid, 0.0 * stretched), {"near": 1e8})
