"""SystemMatrices: the border of the project. What does not fit is refused, what is saved comes back."""

import numpy as np
import pytest
from scipy import sparse

from vanedamp.modal.matrices import MatricesError, Patch, SystemMatrices, patch_average


def springs(**changes):
    """Three nodes on the x axis with unit springs to their neighbours in every direction, the first one held."""
    chain = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    values = {
        "stiffness": sparse.csr_array(np.kron(chain, np.eye(3))),
        "mass": sparse.csr_array(np.kron(np.diag([1.0, 2.0, 3.0]), np.eye(3))),
        "coordinates": np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        "fixed": [2, 0, 1],
        "patches": {"tip": Patch([2], [1.0]), "both": Patch([2, 1], [1.0, 3.0])},
        "damping_ratio": 0.01,
        "provenance": {"mesh": "by hand"},
    }
    return SystemMatrices(**(values | changes))


def test_masses_and_free_dofs():
    matrices = springs()
    assert matrices.size == 9
    assert matrices.free.tolist() == [3, 4, 5, 6, 7, 8]
    assert matrices.total_mass == pytest.approx(6.0, rel=1e-14)
    assert matrices.movable_mass == pytest.approx([5.0, 5.0, 5.0], rel=1e-14)
    assert np.all(matrices.stiffness @ matrices.rigid_translations() == 0.0)


def test_arrays_are_read_only_copies():
    given = sparse.csr_array(np.eye(9))
    matrices = springs(mass=given)
    given.data[:] = 7.0
    assert matrices.mass.data.max() == 1.0
    for array in (matrices.mass.data, matrices.mass.indices, matrices.coordinates, matrices.patches["tip"].nodes):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_patch_average_weighs_by_area():
    functional = patch_average(springs(), "both", [0, 2, 0])
    displacement = np.arange(9.0)
    assert functional @ displacement == pytest.approx((3 * 4.0 + 1 * 7.0) / 4, rel=1e-14)


@pytest.mark.parametrize("patches", [{}, {"tip": Patch([2], [0.5], [0, 1, 0]), "both": Patch([2, 1], [1.0, 3.0])}])
def test_round_trip(tmp_path, patches):
    matrices = springs(patches=patches)
    matrices.save(tmp_path / "matrices.h5")
    again = SystemMatrices.load(tmp_path / "matrices.h5")
    for name in ("stiffness", "mass"):
        assert (getattr(again, name) != getattr(matrices, name)).nnz == 0
    assert np.array_equal(again.fixed, matrices.fixed)
    assert np.array_equal(again.coordinates, matrices.coordinates)
    assert list(again.patches) == list(patches)
    for label in patches:
        assert np.array_equal(again.patches[label].nodes, patches[label].nodes)
        assert np.array_equal(again.patches[label].weights, patches[label].weights)
        assert np.array_equal(again.patches[label].normal, patches[label].normal)
    assert again.damping_ratio == matrices.damping_ratio
    assert again.provenance == matrices.provenance


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": sparse.csr_array(np.eye(8))}, "mass: shape"),
        ({"stiffness": sparse.csr_array(np.triu(np.ones((9, 9))))}, "stiffness: not symmetric"),
        ({"stiffness": sparse.csr_array(np.full((9, 9), np.nan))}, "stiffness: .*not finite"),
        ({"coordinates": np.zeros((9, 1))}, "coordinates: expected shape"),
        ({"fixed": [9]}, "fixed: .*out of range, there are 9 DOFs"),
        ({"patches": {"tip": Patch([3], [1.0])}}, "patch tip: .*there are 3 nodes"),
        ({"damping_ratio": 1.5}, "damping_ratio"),
    ],
)
def test_refuses_what_does_not_fit(changes, message):
    with pytest.raises(MatricesError, match=message):
        springs(**changes)


@pytest.mark.parametrize(
    ("nodes", "weights", "message"),
    [
        ([], [], "not empty"),
        ([0, 1], [1.0], "same length"),
        ([1, 1], [1.0, 1.0], "twice"),
        ([0], [0.0], "positive sum"),
    ],
)
def test_refuses_a_patch_without_area(nodes, weights, message):
    with pytest.raises(MatricesError, match=message):
        Patch(nodes, weights)


def test_refuses_a_normal_that_is_none():
    with pytest.raises(MatricesError, match="normal must be three numbers"):
        Patch([0], [1.0], [0.0, 1.0])


def test_unknown_patch_and_direction_name_the_remedy():
    with pytest.raises(MatricesError, match="no patch 'root'; there are: both, tip"):
        patch_average(springs(), "root", [0, 1, 0])
    with pytest.raises(MatricesError, match="direction"):
        patch_average(springs(), "tip", [0, 0, 0])
