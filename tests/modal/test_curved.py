"""Curved elements: volumes, areas and frequencies of a cylinder, which straight elements reach at second order only."""

import gmsh
import numpy as np
import pytest

from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, assemble
from vanedamp.modal.msh import session

RADIUS, LENGTH, SIZES = 0.5, 1.0, (0.6, 0.3, 0.15)
UNIT = {"default": Material(young=2.6, poisson=0.3, density=1.0)}  # shear modulus and density one


def write_cylinder(path, size, order):
    """A cylinder along x with the groups root, tip, mantle."""
    with session("cylinder"):
        gmsh.model.occ.addCylinder(0, 0, 0, LENGTH, 0, 0, RADIUS)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], name="cylinder")
        for _, tag in gmsh.model.getEntities(2):
            x = gmsh.model.occ.getCenterOfMass(2, tag)[0]
            name = "mantle" if abs(x - 0.5 * LENGTH) < 1e-6 else "root" if x < 0.1 else "tip"
            gmsh.model.addPhysicalGroup(2, [tag], name=name)
        for option in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(option, size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    return path


def torsion(matrices):
    """Lowest torsional frequency, Hz: of the modes, the one that takes part in the spin about x."""
    modes = solve_modes(matrices, 6)
    x, y, z = matrices.coordinates.T
    shares = modes.shapes @ (matrices.mass @ np.column_stack([0 * x, -z, y]).ravel())
    return modes.frequencies_hz[np.argmax(shares**2)]


@pytest.mark.parametrize(("order", "rate", "last"), [(1, 1.2, 2e-2), (2, 2.8, 1e-4)])
def test_cylinder_converges_at_the_rate_of_its_geometry(tmp_path, order, rate, last):
    """Volume pi r^2 l, mantle 2 pi r l, and torsion at sqrt(G / rho) / (4 l), exact in three dimensions."""
    errors = []
    for size in SIZES:
        cylinder = assemble(write_cylinder(tmp_path / "c.msh", size, order), UNIT, {"root": "xyz"}, degree=2)
        errors.append(
            [
                cylinder.total_mass / (np.pi * RADIUS**2 * LENGTH) - 1.0,
                cylinder.patches["mantle"].area / (2.0 * np.pi * RADIUS * LENGTH) - 1.0,
                torsion(cylinder) / (0.25 / LENGTH) - 1.0,
            ]
        )
    # sizes are halved twice, but the element counts follow only roughly: less than 2 and 4 exactly
    assert np.all(np.log2(np.abs(errors[0]) / np.abs(errors[2])) / 2.0 > rate)
    assert np.abs(errors[2]).max() < last


def test_curved_elements_know_rigid_motions_and_uniform_strain(tmp_path):
    """Rigid motions need no forces, and uniaxial tension stores E strain^2 / 2 per volume: the quadrature suffices."""
    cylinder = assemble(write_cylinder(tmp_path / "c.msh", 0.5, 2), UNIT, {}, degree=2)
    spin = np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])
    scale = abs(cylinder.stiffness).max()
    for motion in (*cylinder.rigid_translations().T, (cylinder.coordinates @ spin.T).ravel()):
        assert np.abs(cylinder.stiffness @ motion).max() < 1e-12 * scale
    tension = (cylinder.coordinates * [1.0, -0.3, -0.3]).ravel()
    energy = 0.5 * tension @ (cylinder.stiffness @ tension)
    assert energy == pytest.approx(0.5 * 2.6 * cylinder.total_mass, rel=1e-12)


def test_mass_is_the_volume_of_the_curved_elements(tmp_path):
    """Against gmsh's own integral of the Jacobian with Gauss points of degree 10."""
    path = write_cylinder(tmp_path / "c.msh", 0.5, 2)
    with session("volume"):
        gmsh.merge(str(path))
        kind = gmsh.model.mesh.getElementTypes(3)[0]
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss10")
        determinants = np.asarray(gmsh.model.mesh.getJacobians(kind, points)[1])
        volume = np.sum(determinants.reshape(-1, len(weights)) @ weights)
    cylinder = assemble(path, UNIT, {}, degree=2)
    assert cylinder.total_mass == pytest.approx(volume, rel=1e-9)


def test_springs_across_a_round_face(tmp_path):
    """A cylinder in a bed of springs normal to its mantle: k pi r l against every crosswise translation, none along."""
    path = write_cylinder(tmp_path / "c.msh", 0.15, 2)
    bed = {"mantle": ElasticSupport(normal=1e3)}
    cylinder = assemble(path, {"default": Material(1e-6, 0.3, 1.0)}, {}, degree=2, elastic=bed)
    translations = cylinder.rigid_translations()
    crosswise = 1e3 * np.pi * RADIUS * LENGTH
    expected = np.diag([0.0, crosswise, crosswise])
    assert translations.T @ (cylinder.stiffness @ translations) == pytest.approx(expected, abs=2e-3 * crosswise)
