"""Modes find their partners: in another analysis, on another mesh, among measured shapes with noise and sign flips."""

import numpy as np
import pytest

from tests.tools import small_structures
from vanedamp.meshes.parameters import VaneCluster
from vanedamp.meshes.vane_cluster import build as build_cluster
from vanedamp.modal.correlation import (
    CorrelationError,
    MeasuredShapes,
    compare,
    interpolation,
    measured_mac,
    modal_assurance,
    mode_like,
    observed_shapes,
    pair_modes,
)
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, assemble

STEEL = Material(young=2.0e11, poisson=0.3, density=8190.0)


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    return small_structures.blade(tmp_path_factory.mktemp("blade"), (6, 3, 1))


@pytest.fixture(scope="module")
def blade_modes(blade):
    return solve_modes(blade, 8)


@pytest.fixture(scope="module")
def coarse_path(tmp_path_factory):
    return build_cluster(VaneCluster(airfoils=2, element_size=0.006), tmp_path_factory.mktemp("coarse") / "cluster.msh")


def measurement(matrices, modes, seed=0, noise=0.1, count=20):
    """Shapes at random points inside the elements' reach, with noise (of the shape's rms), scales and flipped signs."""
    rng = np.random.default_rng(seed)
    nodes = rng.choice(len(matrices.coordinates), count, replace=False)
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    exact = np.einsum("mpa,pa->mp", modes.shapes.reshape(len(modes), -1, 3)[:, nodes], directions)
    exact += noise * exact.std(axis=1, keepdims=True) * rng.standard_normal(exact.shape)
    scales = rng.uniform(0.1, 10.0, len(modes)) * rng.choice([-1.0, 1.0], len(modes))
    return MeasuredShapes(matrices.coordinates[nodes], directions, scales[:, None] * exact, modes.frequencies_hz)


def test_modal_assurance(blade, blade_modes):
    shapes = blade_modes.shapes
    assert modal_assurance(shapes, -3.0 * shapes, blade.mass) == pytest.approx(np.eye(len(shapes)), abs=1e-9)
    mixed = shapes[:1] + shapes[1:2]
    assert modal_assurance(mixed, shapes[:3], blade.mass)[0] == pytest.approx([0.5, 0.5, 0.0], abs=1e-9)
    assert modal_assurance(np.array([[1.0, 0.0]]), np.array([[1.0, 1.0]]))[0, 0] == pytest.approx(0.5)
    turned = np.exp(0.7j) * shapes[:2]
    assert modal_assurance(shapes[:2], turned, blade.mass) == pytest.approx(np.eye(2), abs=1e-9)


def test_pairs_are_the_best_together():
    """The first takes its second best, because the second has no other: row-wise maxima would share a partner."""
    mac = np.array([[0.90, 0.85], [0.88, 0.10], [0.30, 0.30]])
    pairing = pair_modes(mac)
    assert list(zip(pairing.first, pairing.second, strict=True)) == [(0, 1), (1, 0)]
    assert pairing.pair_mac == pytest.approx([0.85, 0.88])


def test_softer_airfoils_keep_their_modes(coarse_path):
    """Another modulus of one volume group changes the order of modes; the pairs follow the shapes."""
    materials = {"default": STEEL, "airfoils": Material(2.6e11, 0.3, 7000.0)}
    first = assemble(coarse_path, {"default": STEEL}, {"clamp": "xyz"})
    second = assemble(coarse_path, materials, {"clamp": "xyz"})
    modes = solve_modes(first, 6)
    other = solve_modes(second, 8)
    shuffled = np.random.default_rng(1).permutation(8)
    mac = compare(modes, first, other, second)[:, shuffled]
    pairing = pair_modes(mac)
    assert pairing.first.tolist() == list(range(6))
    assert shuffled[pairing.second].tolist() == list(range(6))
    assert pairing.pair_mac.min() > 0.95


def test_another_mesh_keeps_its_modes(coarse_path, tmp_path):
    path = build_cluster(VaneCluster(airfoils=2, element_size=0.005), tmp_path / "other.msh")
    first, second = (assemble(p, {"default": STEEL}, {"clamp": "xyz"}) for p in (coarse_path, path))
    mac = compare(solve_modes(first, 5), first, solve_modes(second, 5), second)
    pairing = pair_modes(mac)
    assert pairing.second.tolist() == [0, 1, 2, 3, 4]
    assert pairing.pair_mac.min() > 0.98


@pytest.mark.parametrize("seed", range(5))
def test_a_measurement_with_noise_and_flipped_signs_is_paired(blade, blade_modes, seed):
    measured = measurement(blade, blade_modes, seed)
    order = np.random.default_rng(seed).permutation(len(blade_modes))
    shuffled = MeasuredShapes(measured.points, measured.directions, measured.shapes[order])
    pairing = pair_modes(measured_mac(blade_modes, blade, shuffled))
    assert order[pairing.second].tolist() == list(range(len(blade_modes)))
    assert pairing.pair_mac.min() > 0.9


def test_interpolation_is_exact_for_affine_fields(blade):
    rng = np.random.default_rng(3)
    points = rng.uniform([0, -0.04, 0], [0.2, 0.04, 0.01], (30, 3))
    gradient, offset = rng.standard_normal((3, 3)), rng.standard_normal(3)
    directions = rng.standard_normal((30, 3))
    field = (blade.coordinates @ gradient.T + offset).ravel()
    expected = np.einsum("pa,pa->p", points @ gradient.T + offset, directions)
    assert interpolation(blade.coordinates, points, directions) @ field == pytest.approx(expected, rel=1e-9)
    at_nodes = interpolation(blade.coordinates, blade.coordinates[:5], directions[:5]).toarray()
    expected = np.einsum("pq,pa->pqa", np.eye(5, len(blade.coordinates)), directions[:5]).reshape(5, -1)
    assert at_nodes == pytest.approx(expected, abs=1e-9)


def test_the_mode_like_a_given_shape(blade, blade_modes):
    """A line of points that move along y picks the edgewise bending, wherever it lies in the list."""
    x = np.linspace(0.02, 0.2, 10)
    bending = x**2 * (0.6 - x)
    points, directions = np.column_stack([x, 0 * x, 0 * x + 0.005]), np.tile([0.0, 1.0, 0.0], (10, 1))
    found = mode_like(blade_modes, blade, MeasuredShapes(points, directions, -bending))
    shape = blade_modes.shapes[found].reshape(-1, 3)
    assert found > 0
    assert np.abs(shape[:, 1]).max() > np.abs(shape[:, 2]).max()
    with pytest.raises(CorrelationError, match=r"shape: no mode has a MAC of 0\.5 .* Hz:"):
        mode_like(blade_modes, blade, MeasuredShapes(points, directions, (-1.0) ** np.arange(10)))


def test_points_in_millimetres_are_refused(blade, blade_modes):
    measured = MeasuredShapes([[200.0, 0.0, 5.0]], [[0, 0, 1]], [[1.0]])
    with pytest.raises(CorrelationError, match=r"points: \[200\.0, 0\.0, 5\.0\] \(row 0\) lies .* in metres"):
        observed_shapes(blade_modes, blade, measured)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": [[0, 0, 0]]}, "points: expected 2 rows"),
        ({"directions": [[0, 0, 1], [0, 0, 0]]}, "directions: row 1 has no length"),
        ({"shapes": [[0.0, 0.0]]}, "not all zero"),
        ({"frequencies_hz": [1.0, 2.0]}, "frequencies_hz: 2 values for 1 shapes"),
    ],
)
def test_refuses_what_does_not_fit(changes, message):
    values = {"points": np.zeros((2, 3)), "directions": np.eye(3)[:2], "shapes": [[1.0, 2.0]]}
    with pytest.raises(CorrelationError, match=message):
        MeasuredShapes(**(values | changes))
