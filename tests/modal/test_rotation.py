"""Structures that rotate: prestressed modes against beam theory, stresses against closed forms."""

import json

import gmsh
import numpy as np
import pytest
import skfem
from scipy import linalg, sparse
from scipy.sparse.linalg import spsolve
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from vanedamp.files.store import load
from vanedamp.files.toml_input import InputError
from vanedamp.meshes.benchmarks import Block, build
from vanedamp.modal import gyroscopic
from vanedamp.modal.algebra import cross_matrix
from vanedamp.modal.eigen import SolverError, solve_modes, static_shape
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.gyroscopic import gyroscopic_modes
from vanedamp.modal.matrices import MatricesError, SystemMatrices
from vanedamp.modal.msh import session
from vanedamp.modal.rotating import RotatingMatrices, UnstableError
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

YOUNG, DENSITY = 2e11, 8000.0
LENGTH, SIDE = 1.0, 0.02
# beam theory knows no Poisson's ratio
BEAM = {"default": Material(YOUNG, 0.0, DENSITY)}
# angular frequencies of bending over this one are Euler and Bernoulli's mu^2
UNIT = np.sqrt(YOUNG * SIDE**2 / (12.0 * DENSITY)) / LENGTH**2
# first flapwise mode of a beam clamped at the hub, no hub radius, at speeds 0, 1, ... 5 UNIT: Wright et al. (1982),
# J. Appl. Mech. 49; Hodges (1981), J. Am. Helicopter Soc. 26
FLAP = (3.5160, 3.6816, 4.1373, 4.7973, 5.5850, 6.4495)


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    """A slender beam along x."""
    block = Block(LENGTH, SIDE, SIDE, divisions=(12, 1, 1), hexahedra=True)
    return Solid(build(block, tmp_path_factory.mktemp("beam") / "beam.msh"), BEAM)


@pytest.fixture(scope="module")
def blade(beam):
    """The beam clamped at an axis along z, which its root is on."""
    return beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [0, 0, 2.0], [0.0, 0.0, 0.5 * SIDE])


@pytest.mark.parametrize("eta", range(6))
def test_flap_and_lag_of_a_rotating_beam(blade, eta):
    """Flapwise within 1 % of the literature; lag loses the squared speed by spin softening."""
    matrices = blade.at(eta * UNIT)
    modes = solve_modes(matrices, 2)
    lag, flap = modes.angular_frequencies / UNIT
    assert flap == pytest.approx(FLAP[eta], rel=0.01)
    assert lag == pytest.approx(np.sqrt(FLAP[eta] ** 2 - eta**2), rel=0.01)
    if eta:
        motion = np.abs(modes.shapes.reshape(2, -1, 3)).max(axis=1)
        assert motion[0].argmax() == 1 and motion[1].argmax() == 2


def test_axis_of_the_beam_softens_it_to_instability(beam):
    """Spin about its own axis takes the squared speed from the bending, until nothing is left: at 3.516 UNIT.

    Rotary inertia, which is along the axis, and the stress across it are of the order (SIDE / LENGTH)^2 beside it.
    """
    rotating = beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [1, 0, 0], [0.0, 0.0, 0.5 * SIDE])
    standing = solve_modes(rotating.at(0.0), 1).angular_frequencies[0]
    found = solve_modes(rotating.at(0.6 * standing), 2).angular_frequencies
    assert found == pytest.approx(0.8 * standing, rel=(SIDE / LENGTH) ** 2)
    with pytest.raises(UnstableError, match=r"speed: at .* rad/s the structure is unstable") as caught:
        rotating.at(7.0 * standing)
    named = float(str(caught.value).split(" above ")[1].split()[0])
    assert 0.995 * standing < named < 1.0004 * standing


def test_what_has_no_centrifugal_equilibrium(beam):
    """A free beam, one that can turn about the axis, and an axis without a direction: one line each."""
    with pytest.raises(ElasticityError, match=r"^rotation: the structure is not held .* \[support\], .*$"):
        beam.rotating(beam.assemble({}, 0.0), [0, 0, 1], [0, 0, 0])
    with pytest.raises(ElasticityError, match="not held"):
        beam.rotating(beam.assemble({"root": "x"}, 0.0), [1, 0, 0], [0, 0, 0])
    with pytest.raises(MatricesError, match="direction: expected three numbers, not all zero"):
        beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [0, 0, 0], [0, 0, 0])


CASE = """
[mesh]
generator = "block"
length = 1.0
width = 0.02
thickness = 0.02
hexahedra = true
[material.default]
young = 2e11
poisson = 0.0
density = 8000.0
[support]
clamped = ["root"]
[modes]
count = 2
"""


def case(tmp_path, text):
    """The beam's case with further tables."""
    path = tmp_path / "case.toml"
    path.write_text(CASE + text)
    return Case.load(path)


def test_case_at_a_speed(tmp_path):
    """The stages take the matrices at the speed of the case; those at standstill stay beside them."""
    structure = assemble(case(tmp_path, f"[rotation]\naxis = [0, 0, 1]\nspeed = {5 * UNIT}\n"))
    lag, flap = solve_modes(structure.matrices, 2).angular_frequencies / UNIT
    assert flap == pytest.approx(FLAP[5], rel=0.01)
    assert lag == pytest.approx(np.sqrt(FLAP[5] ** 2 - 25.0), rel=0.01)
    assert structure.matrices.provenance["speed"] == pytest.approx(5 * UNIT)
    standing = solve_modes(structure.rotating.standing, 1).angular_frequencies[0]
    assert standing == pytest.approx(FLAP[0] * UNIT, rel=0.01)


def test_case_with_an_axis_of_length_zero(tmp_path):
    with pytest.raises(InputError, match=r"case.toml: rotation.axis: expected three numbers, not all zero"):
        case(tmp_path, "[rotation]\naxis = [0, 0, 0]\nrpm = 100.0\n")


def foucault(mass, natural, across=None):
    """A mass on springs that turn about z: `natural` rad/s along x, `across` along y, 3 natural along z."""
    stiffness = mass * np.diag([natural, across or natural, 3.0 * natural]) ** 2
    standing = SystemMatrices(*map(sparse.csr_array, (stiffness, mass * np.eye(3))), np.zeros((1, 3)), [], {}, 0.0)
    axis, plane = np.array([0.0, 0.0, 1.0]), np.diag([1.0, 1.0, 0.0])
    gyroscopic = sparse.csr_array(2.0 * mass * cross_matrix(axis))
    softening = sparse.csr_array(-mass * plane)
    return RotatingMatrices(standing, softening, gyroscopic, np.zeros(3), axis, np.zeros(3))


def test_whirl_of_a_mass_on_springs():
    """In the frame of the springs the mass of Foucault and Jeffcott whirls forward at w0 - W and backward at w0 + W."""
    modes = gyroscopic_modes(foucault(2.0, 100.0), 30.0, 3)
    assert 2 * np.pi * modes.frequencies_hz == pytest.approx([70.0, 130.0, 300.0], rel=1e-12)
    assert modes.whirl == pytest.approx([1.0, -1.0, 0.0], abs=1e-12)
    assert modes.shapes[0, 1] / modes.shapes[0, 0] == pytest.approx(-1j, rel=1e-9)


def test_whirl_on_springs_of_two_stiffnesses():
    """omega^4 - (a^2 + b^2 + 2 W^2) omega^2 + (a^2 - W^2) (b^2 - W^2) = 0, the determinant of Q."""
    a, b, speed = 100.0, 160.0, 70.0
    modes = gyroscopic_modes(foucault(3.0, a, b), speed, 2)
    squares = np.roots([1.0, -(a**2 + b**2 + 2 * speed**2), (a**2 - speed**2) * (b**2 - speed**2)])
    assert 2 * np.pi * modes.frequencies_hz == pytest.approx(np.sqrt(np.sort(squares)), rel=1e-12)


def test_whirl_of_a_shaft(beam):
    """A square beam that spins about itself: each pair of bendings becomes w0 - W and w0 + W, rotary inertia apart."""
    rotating = beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [1, 0, 0], [0.0, 0.0, 0.5 * SIDE])
    standing = solve_modes(rotating.standing, 4).angular_frequencies
    speed = 0.5 * standing[0]
    modes = gyroscopic_modes(rotating, speed, 4)
    expected = [standing[0] - speed, standing[0] + speed, standing[2] - speed, standing[2] + speed]
    assert 2 * np.pi * modes.frequencies_hz == pytest.approx(expected, rel=(SIDE / LENGTH) ** 2)
    assert modes.whirl == pytest.approx([1, -1, 1, -1], abs=2e-3)


def test_gyroscopic_modes_against_the_dense_problem(tmp_path):
    """A stout skew blade: eigenvalues of the whole first-order system, residuals, and the norm of the shapes."""
    block = Block(0.1, 0.03, 0.02, divisions=(4, 1, 1))
    solid = Solid(build(block, tmp_path / "blade.msh"), {"default": Material(YOUNG, 0.3, DENSITY)})
    rotating = solid.rotating(solid.assemble({"root": "xyz"}, 0.0), [1, 2, 1], [0, 0.01, 0])
    speed, free = 9000.0, rotating.standing.free
    modes = gyroscopic_modes(rotating, speed, 5)
    matrices = (rotating.at(speed).stiffness, rotating.standing.mass, rotating.gyroscopic)
    stiffness, mass, gyroscopic = (matrix[free][:, free].toarray() for matrix in matrices)
    lower = -np.linalg.solve(mass, np.hstack([stiffness, speed * gyroscopic]))
    values = np.linalg.eigvals(np.block([[np.zeros_like(mass), np.eye(free.size)], [lower]])).imag
    assert 2 * np.pi * modes.frequencies_hz == pytest.approx(np.sort(values[values > 0.0])[:5], rel=1e-8)
    shapes = modes.shapes[:, free]
    assert np.einsum("ij,jk,ik->i", shapes.conj(), mass, shapes) == pytest.approx(1.0, rel=1e-9)
    still = solve_modes(rotating.at(speed), 5).angular_frequencies
    assert np.abs(2 * np.pi * modes.frequencies_hz / still - 1.0).max() > 0.01


def test_missed_modes_are_counted(beam, monkeypatch):
    """A result without the lowest mode does not pass, whichever way the modes are counted."""
    rotating = beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [1, 0, 0], [0.0, 0.0, 0.5 * SIDE])
    complete = gyroscopic._converged
    assert gyroscopic_modes(foucault(3.0, 100.0, 160.0), 90.0, 1).frequencies_hz > 0.0
    monkeypatch.setattr(gyroscopic, "_converged", lambda *given: tuple(np.delete(a, 0, -1) for a in complete(*given)))
    # the beam's first modes leave a gap of more than 2 W, those of the mass do not
    for structure, speed, count in ((rotating, 0.1 * FLAP[0] * UNIT, 2), (foucault(3.0, 100.0, 160.0), 90.0, 1)):
        with pytest.raises(SolverError, match=r"modes found below .* Hz at"):
            gyroscopic_modes(structure, speed, count)


def test_gyroscopic_modes_at_standstill_are_the_modes(blade):
    modes = gyroscopic_modes(blade, 0.0, 4)
    assert modes.frequencies_hz == pytest.approx(solve_modes(blade.standing, 4).frequencies_hz, rel=1e-7)
    assert np.abs(modes.shapes.imag).max() < 1e-5 * np.abs(modes.shapes).max()


def test_modal_command_at_a_speed(tmp_path, capsys):
    """The speed stands above the modes, the modes with the gyroscopic coupling below; all of it in JSON and HDF5."""
    path = tmp_path / "case.toml"
    path.write_text(CASE + "[rotation]\naxis = [1, 0, 0]\nspeed = 50.0\ngyroscopic = true\n")
    assert main(["modal", str(path), "-o", str(tmp_path / "m.h5"), "--json", str(tmp_path / "m.json")]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("at 50 rad/s (477.465 rpm)\n")
    result = json.loads((tmp_path / "m.json").read_text())
    first = FLAP[0] * UNIT
    assert result["speed"] == 50.0
    assert 2 * np.pi * np.array(result["frequency_hz"]) == pytest.approx(np.sqrt(first**2 - 50.0**2), rel=5e-3)
    found = result["gyroscopic"]
    assert 2 * np.pi * np.array(found["frequency_hz"]) == pytest.approx([first - 50.0, first + 50.0], rel=5e-3)
    assert found["whirl"] == pytest.approx([1.0, -1.0], abs=1e-3)
    values, attributes = load(tmp_path / "m.h5", "modes")
    assert attributes["speed"] == 50.0
    assert values["gyroscopic_shape_real"].shape == values["shape"].shape
    assert main(["report", str(tmp_path / "m.h5"), "-o", str(tmp_path / "report.html")]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "at 50 rad/s without the gyroscopic coupling" in page and "whirl: 1 with the rotation" in page


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("[rotation]\naxis = [1, 0, 0]\nspeed = 1000.0\n", "speed: at 1000 rad/s the structure is unstable"),
        (
            "[rotation]\naxis = [1, 0, 0]\ngyroscopic = true\n[modes]\nmin_frequency = 5.0\nmax_frequency = 50.0\n",
            "modes.min_frequency: modes with the gyroscopic coupling are the lowest; leave it out",
        ),
        (
            "[rotation]\naxis = [1, 0, 0]\nrpm = 10.0\n"
            '[calibration.tune]\nvary = ["material.block"]\nfrequencies = [16.0]\n',
            "calibration.tune: takes frequencies measured at standstill and without [temperature]; leave them out",
        ),
    ],
)
def test_cases_that_are_refused(tmp_path, capsys, table, message):
    path = tmp_path / "case.toml"
    text = CASE.replace("[modes]\ncount = 2\n", "") if "[modes]" in table else CASE
    path.write_text(text + table)
    assert main(["modal", str(path)]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count("\n") == 1


def centrifugal_stress(solid, rotating):
    """Places (k, 3) and stresses xx, yy, zz, xy, yz, zx (6, k) at unit speed."""
    return solid.stress_points(), solid.stress_components(static_shape(rotating.standing, rotating.load))


def test_stress_of_a_rotating_rod(beam, blade):
    """rho W^2 (L^2 - x^2) / 2 along the rod (Timoshenko and Goodier 1970), and nothing else of its size."""
    places, stress = centrifugal_stress(beam, blade)
    inside = (places[:, 0] > 0.02 * LENGTH) & (places[:, 0] < 0.95 * LENGTH)
    expected = 0.5 * DENSITY * (LENGTH**2 - places[inside, 0] ** 2)
    assert np.abs(stress[0, inside] / expected - 1.0).max() < 0.01
    assert np.abs(stress[1:, inside]).max() < 1e-3 * expected.max()


def write_disc(path, radius, thickness, size):
    """A quarter of a disc about z with the groups `along_x` and `along_y`, its cuts, and `bottom`; curved elements."""
    with session("disc"):
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, thickness, radius, angle=0.5 * np.pi)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], name="disc")
        for _, tag in gmsh.model.getEntities(2):
            middle = np.abs(gmsh.model.occ.getCenterOfMass(2, tag)) < 1e-9
            for name, flat in zip(("along_y", "along_x", "bottom"), middle, strict=True):
                if flat:
                    gmsh.model.addPhysicalGroup(2, [tag], name=name)
        for option in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(option, size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    return path


def test_stress_of_a_rotating_disc(tmp_path):
    """Radial and hoop stress of a thin solid disc with a free rim (Timoshenko and Goodier 1970, section 32)."""
    radius, poisson = 0.2, 0.3
    mesh = write_disc(tmp_path / "disc.msh", radius, 0.02 * radius, radius / 10)
    solid = Solid(mesh, {"default": Material(YOUNG, poisson, DENSITY)})
    held = {"along_y": "x", "along_x": "y", "bottom": "z"}
    places, stress = centrifugal_stress(solid, solid.rotating(solid.assemble(held, 0.0), [0, 0, 1], [0, 0, 0]))
    r = np.hypot(places[:, 0], places[:, 1])
    inside = (r > 0.1 * radius) & (r < 0.9 * radius)
    r, (c, s) = r[inside], places[inside, :2].T / r[inside]
    xx, yy, _, xy, _, _ = stress[:, inside]
    radial, hoop = c**2 * xx + s**2 * yy + 2 * c * s * xy, s**2 * xx + c**2 * yy - 2 * c * s * xy
    centre = (3 + poisson) / 8 * DENSITY * radius**2
    assert radial == pytest.approx(centre * (1 - (r / radius) ** 2), abs=0.01 * centre)
    assert hoop == pytest.approx(centre * (1 - (1 + 3 * poisson) / (3 + poisson) * (r / radius) ** 2), rel=0.01)


def test_squared_frequencies_over_the_squared_speed(blade):
    """Their slope is phi^T K1 phi (first-order perturbation; Lancaster 1964, Numer. Math. 6)."""
    speed = 3.0 * UNIT
    modes = solve_modes(blade.at(speed), 4)
    slopes = np.einsum("ij,ij->i", modes.shapes, (blade.centrifugal_stiffness @ modes.shapes.T).T)
    squares = [solve_modes(blade.at(np.sqrt(s) * speed), 4).angular_frequencies ** 2 for s in (0.99, 1.01)]
    # curvature over the step leaves 1e-4 of its square, round-off less
    assert slopes == pytest.approx((squares[1] - squares[0]) / (0.02 * speed**2), rel=1e-3)
    assert np.all(slopes[[1, 3]] - slopes[[0, 2]] == pytest.approx(1.0, rel=1e-2))  # flap and lag differ by W^2


def frequencies_by_scikit_fem(solid, material, axis, point, speed, count):
    """Angular frequencies of a solid of straight tetrahedra, held at x = 0: all of it at the speed, from its mesh."""
    cells, _, points = solid.vtk_mesh()
    corners, numbers = np.unique(cells.reshape(-1, 11)[:, 1:5], return_inverse=True)
    mesh = skfem.MeshTet(points[corners].T.copy(), numbers.reshape(-1, 4).T.copy())
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)
    lame, shear = lame_parameters(material.young, material.poisson)
    across = np.eye(3) - np.outer(axis, axis) / np.dot(axis, axis)
    force = skfem.LinearForm(
        lambda v, w: (
            material.density * speed**2 * dot(np.einsum("ij,j...->i...", across, w.x - point[:, None, None]), v)
        )
    )
    elastic = skfem.asm(linear_elasticity(lame, shear), basis).tocsr()
    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda x: np.isclose(x[0], 0.0)).all())
    displacement = np.zeros(basis.N)
    displacement[free] = spsolve(elastic[free][:, free].tocsc(), skfem.asm(force, basis)[free])
    gradient = basis.interpolate(displacement).grad
    strain = 0.5 * (gradient + np.swapaxes(gradient, 0, 1))
    stress = 2.0 * shear * strain + lame * np.einsum("kk...,ij->ij...", strain, np.eye(3))
    geometric = skfem.BilinearForm(
        lambda u, v, w: (
            np.einsum("jk...,ij...,ik...->...", stress, u.grad, v.grad)
            - material.density * speed**2 * dot(np.einsum("ij,j...->i...", across, u), v)
        )
    )
    mass = skfem.BilinearForm(lambda u, v, w: material.density * dot(u, v))
    stiffness, inertia = (
        matrix[free][:, free].toarray() for matrix in (elastic + skfem.asm(geometric, basis), skfem.asm(mass, basis))
    )
    return np.sqrt(linalg.eigh(stiffness, inertia, eigvals_only=True, subset_by_index=[0, count - 1]))


def test_frequencies_at_speeds_equal_scikit_fem(tmp_path):
    """K0 + W^2 K1 against matrices that another code makes at each speed, about a skew axis beside the structure."""
    material, axis, point = Material(YOUNG, 0.3, DENSITY), np.array([1.0, 2.0, 1.0]), np.array([-0.05, 0.01, 0.0])
    block = Block(0.1, 0.03, 0.02, divisions=(3, 1, 1))
    solid = Solid(build(block, tmp_path / "block.msh"), {"default": material})
    rotating = solid.rotating(solid.assemble({"root": "xyz"}, 0.0), axis, point)
    for speed in (2000.0, 6000.0, 12000.0):
        expected = frequencies_by_scikit_fem(solid, material, axis, point, speed, 4)
        assert solve_modes(rotating.at(speed), 4).angular_frequencies == pytest.approx(expected, rel=1e-7)
    assert expected[0] > 1.1 * solve_modes(rotating.standing, 1).angular_frequencies[0]
