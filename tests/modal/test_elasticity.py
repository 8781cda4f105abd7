"""Stiffness, mass, patches and stresses against what elasticity gives in closed form."""

import h5py
import numpy as np
import pytest

from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.elasticity import ElasticityError, Material, Solid, assemble

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)
BLOCK = TaperedBlock(0.3, 0.2, 0.1, tip_width=0.1, element_size=0.08)


@pytest.fixture(scope="module", params=[1, 2])
def solid(request, tmp_path_factory):
    path = build(BLOCK, tmp_path_factory.mktemp("block") / "block.msh")
    return Solid(path, {"default": STEEL}, degree=request.param)


@pytest.fixture(scope="module")
def block(solid):
    return solid.assemble({"root": "xyz"}, damping_ratio=0.01)


def displacement(matrices, gradient):
    """Displacements x -> gradient x of all nodes, (N,)."""
    return (matrices.coordinates @ np.asarray(gradient).T).ravel()


def test_mass_is_density_times_volume(block):
    assert block.total_mass == pytest.approx(7800.0 * 0.3 * 0.15 * 0.1, rel=1e-12)


def test_patch_weights_integrate_linear_functions(block):
    """Area and centroid of the top face, a trapezium: exact in degree 1 and 2."""
    patch = block.patches["top"]
    centroid = patch.weights @ block.coordinates[patch.nodes] / patch.area
    assert patch.area == pytest.approx(0.3 * 0.15, rel=1e-12)
    assert centroid == pytest.approx([0.3 / 3 * (0.2 + 2 * 0.1) / (0.2 + 0.1), 0.0, 0.1], abs=1e-12)


def test_patch_normals_point_out_of_the_material(block):
    assert block.patches["top"].normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert block.patches["bottom"].normal == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)
    assert block.patches["root"].normal == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)


def test_rigid_motions_have_no_strain(block):
    spin = np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])
    for motion in (*block.rigid_translations().T, displacement(block, spin)):
        forces = block.stiffness @ motion
        assert np.abs(forces).max() < 1e-11 * (abs(block.stiffness) @ abs(motion)).max()


def test_strain_energy_of_uniform_strain(block):
    """Uniaxial tension: the energy is E strain^2 / 2 per volume, in any degree and on any mesh."""
    strain = 1e-4
    tension = displacement(block, strain * np.diag([1.0, -0.3, -0.3]))
    energy = 0.5 * tension @ (block.stiffness @ tension)
    assert energy == pytest.approx(0.5 * 2.1e11 * strain**2 * 0.3 * 0.15 * 0.1, rel=1e-10)


def test_kinetic_energy_of_linear_velocity(block):
    """Rotation about z: the moment of inertia of the trapezoidal block, exact as degree 1 holds linear velocities."""
    spin = displacement(block, [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    along, share = np.polynomial.legendre.leggauss(8)
    x, dx = 0.15 * (along + 1.0), 0.15 * share
    width = 0.2 - 0.1 * x / 0.3
    exact = 7800.0 * 0.1 * np.sum(dx * (width * x**2 + width**3 / 12.0))
    assert spin @ (block.mass @ spin) == pytest.approx(exact, rel=1e-12)


def test_von_mises_of_tension_and_shear(solid, block):
    tension = displacement(block, 1e-4 * np.diag([1.0, -0.3, -0.3]))
    assert solid.von_mises(tension) == pytest.approx(2.1e11 * 1e-4, rel=1e-9)
    shear = displacement(block, [[0.0, 1e-4, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert solid.von_mises(shear) == pytest.approx(np.sqrt(3.0) * 2.1e11 / 2.6 * 1e-4, rel=1e-9)


def test_supports_hold_the_named_components(solid):
    matrices = solid.assemble({"root": "y", "bottom": "zx"}, damping_ratio=0.0)
    root, bottom = (3 * matrices.patches[name].nodes for name in ("root", "bottom"))
    assert set(matrices.fixed) == {*(root + 1), *bottom, *(bottom + 2)}


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ((0.0, 0.3, 1.0), "young"),
        ((1.0, 0.5, 1.0), "poisson"),
        ((1.0, 0.3, -1.0), "density"),
        ((1, float("nan"), 1), "poisson"),
    ],
)
def test_refuses_materials(values, name):
    with pytest.raises(ElasticityError, match=f"^{name}: "):
        Material(*values)


def test_refuses_supports_and_fields(solid, block):
    with pytest.raises(ElasticityError, match="support 'root': expected components out of 'xyz'"):
        solid.assemble({"root": "w"}, 0.0)
    with pytest.raises(ElasticityError, match="displacement"):
        solid.von_mises(np.zeros(block.size + 3))


def test_refuses_a_group_without_material(tmp_path):
    path = build(BLOCK, tmp_path / "block.msh")
    with pytest.raises(ElasticityError, match="volume group 'block' has none"):
        assemble(path, {}, {})


def test_fields_for_paraview(solid, block, tmp_path):
    """The stretch of the block comes back at the nodes of the mesh."""
    fields = {"stretch": displacement(block, np.diag([1.0, 2.0, 3.0])), "zero": np.zeros(block.size)}
    solid.write(fields, tmp_path / "u.xdmf")
    with h5py.File(tmp_path / "u.h5") as file:
        points = file["Mesh/mesh/geometry"][()]
        assert np.ptp(points, axis=0) == pytest.approx([0.3, 0.2, 0.1])
        assert file["Function/stretch/0"][()] == pytest.approx(points * [1.0, 2.0, 3.0], abs=1e-12)
        assert np.all(file["Function/zero/0"][()] == 0.0)


def test_cells_for_pyvista(solid, block):
    """The cells that drawing takes fill the volume, on the points of the matrices."""
    pyvista = pytest.importorskip("pyvista", reason="needs VTK: make setup-peers")
    cells, types, points = solid.vtk_mesh()
    assert np.array_equal(points, block.coordinates)
    assert pyvista.UnstructuredGrid(cells, types, points).volume == pytest.approx(0.3 * 0.15 * 0.1, rel=1e-6)


def test_refuses_other_formats(solid, tmp_path):
    with pytest.raises(ElasticityError, match=r"\.xdmf"):
        solid.write({}, tmp_path / "u.vtk")
