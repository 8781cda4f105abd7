"""Structures that rotate: prestressed modes against beam theory, stresses against closed forms."""

import json

import gmsh
import numpy as np
import pytest
from scipy import sparse

from tests.reference.finite_strain import frequencies as by_finite_strains
from tests.tools.arched_cluster import write as write_arched
from vanedamp.files.store import load
from vanedamp.files.toml_input import InputError
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal import gyroscopic
from vanedamp.modal.algebra import cross_matrix
from vanedamp.modal.eigen import SolverError, solve_modes, static_shape
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.gyroscopic import gyroscopic_modes
from vanedamp.modal.matrices import MatricesError, SystemMatrices
from vanedamp.modal.msh import session
from vanedamp.modal.rotating import RotatingMatrices, SpeedError, UnstableError
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
    block = TaperedBlock(LENGTH, SIDE, SIDE, divisions=(12, 1, 1), hexahedra=True)
    return Solid(build(block, tmp_path_factory.mktemp("beam") / "beam.msh"), BEAM)


@pytest.fixture(scope="module")
def blade(beam):
    """The beam clamped at an axis along z, which its root is on."""
    return beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [0, 0, 2.0], [0.0, 0.0, 0.5 * SIDE], speed=5.0 * UNIT)


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
    matrices, middle = beam.assemble({"root": "xyz"}, 0.0), [0.0, 0.0, 0.5 * SIDE]
    standing = solve_modes(matrices, 1).angular_frequencies[0]
    rotating = beam.rotating(matrices, [1, 0, 0], middle, speed=0.6 * standing)
    found = solve_modes(rotating.at(0.6 * standing), 2).angular_frequencies
    assert found == pytest.approx(0.8 * standing, rel=(SIDE / LENGTH) ** 2)
    with pytest.raises(SpeedError, match=r"speed: the matrices hold up to .* rad/s, not at"):
        rotating.at(0.7 * standing)
    with pytest.raises(UnstableError, match=r"speed: at .* rad/s the structure is unstable") as caught:
        beam.rotating(matrices, [1, 0, 0], middle, speed=7.0 * standing)
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
    matrices = beam.assemble({"root": "xyz"}, 0.0)
    standing = solve_modes(matrices, 4).angular_frequencies
    speed = 0.5 * standing[0]
    rotating = beam.rotating(matrices, [1, 0, 0], [0.0, 0.0, 0.5 * SIDE], speed=speed)
    modes = gyroscopic_modes(rotating, speed, 4)
    expected = [standing[0] - speed, standing[0] + speed, standing[2] - speed, standing[2] + speed]
    assert 2 * np.pi * modes.frequencies_hz == pytest.approx(expected, rel=(SIDE / LENGTH) ** 2)
    assert modes.whirl == pytest.approx([1, -1, 1, -1], abs=2e-3)


def test_gyroscopic_modes_against_the_dense_problem(tmp_path):
    """A stout skew blade: eigenvalues of the whole first-order system, residuals, and the norm of the shapes."""
    block = TaperedBlock(0.1, 0.03, 0.02, divisions=(4, 1, 1))
    solid = Solid(build(block, tmp_path / "blade.msh"), {"default": Material(YOUNG, 0.3, DENSITY)})
    speed = 4500.0
    rotating = solid.rotating(solid.assemble({"root": "xyz"}, 0.0), [1, 2, 1], [0, 0.01, 0], speed=speed)
    free = rotating.standing.free
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
    slow = 0.1 * FLAP[0] * UNIT
    rotating = beam.rotating(beam.assemble({"root": "xyz"}, 0.0), [1, 0, 0], [0.0, 0.0, 0.5 * SIDE], speed=slow)
    complete = gyroscopic._converged
    assert gyroscopic_modes(foucault(3.0, 100.0, 160.0), 90.0, 1).frequencies_hz > 0.0
    monkeypatch.setattr(gyroscopic, "_converged", lambda *given: tuple(np.delete(a, 0, -1) for a in complete(*given)))
    # the beam's first modes leave a gap of more than 2 W, those of the mass do not
    for structure, speed, count in ((rotating, slow, 2), (foucault(3.0, 100.0, 160.0), 90.0, 1)):
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


@pytest.fixture(scope="module")
def arched(tmp_path_factory):
    """A small cluster of two vanes between arched bands, held at its outer band: solid and matrices."""
    solid = Solid(write_arched(tmp_path_factory.mktemp("arched") / "arched.msh"), {"default": STEEL})
    return solid, solid.assemble({"clamp": "xyz"}, 0.0)


STEEL = Material(YOUNG, 0.3, 8190.0)
OBLIQUE = (np.array([1.0, 1.0, 1.0]), np.array([0.01, 0.02, 0.0]))
AXIAL = (np.array([1.0, 0.0, 0.0]), np.zeros(3))


@pytest.mark.parametrize(("axis", "speed"), [(AXIAL, 600.0), (AXIAL, 1200.0), (OBLIQUE, 300.0), (OBLIQUE, 1200.0)])
def test_shifts_of_arched_bands(arched, axis, speed):
    """Ten modes against the whole tangent at the equilibrium by other code: to 1e-4 of the shift.

    Without the initial-displacement stiffness, shifts are wrong by up to their size.
    """
    solid, standing = arched
    still = solve_modes(standing, 10).angular_frequencies
    expected = by_finite_strains(solid, standing.fixed, STEEL, *axis, speed, 10) - still
    found = solve_modes(solid.rotating(standing, *axis, speed=speed).at(speed), 10).angular_frequencies
    assert found - still == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("axis", [pytest.param(AXIAL, marks=pytest.mark.slow), OBLIQUE])
def test_shifts_between_the_speeds_of_the_equilibria(arched, axis):
    """To 2e-3 of the shift of each of ten modes, and the told error is the largest one.

    A stiffness linear in the squared speed, right at both ends, is wrong by up to 19 % of a shift there.
    """
    solid, standing = arched
    rotating = solid.rotating(standing, *axis, speed=1200.0)
    still = solve_modes(standing, 10).angular_frequencies
    for share in (0.25, 0.5, 0.85):
        expected = by_finite_strains(solid, standing.fixed, STEEL, *axis, share * 1200.0, 10)
        modes = solve_modes(rotating.at(share * 1200.0), 10)
        assert modes.angular_frequencies - still == pytest.approx(expected - still, rel=2e-3, abs=1e-7 * still.max())
        if share == 0.5:
            errors = np.abs(modes.angular_frequencies / expected - 1.0)
            assert rotating.neglected_error(modes.shapes) == pytest.approx(errors.max(), rel=0.02)


# Hz of ten modes by CalculiX 2.20, C3D10 elements on the mesh of `write_arched(path, 2)`: *STEP, NLGEOM with *STATIC
# and CENTRIF, then *STEP, PERTURBATION with *FREQUENCY; at standstill, and by axis and speed in rpm
CALCULIX_STILL = (
    3252.970, 7096.248, 7442.258, 8486.265, 11576.78, 15946.50, 18377.40, 19734.47, 23052.89, 24422.33,
)  # fmt: skip
CALCULIX = (
    (AXIAL, 6000, (3233.078, 7077.484, 7437.811, 8483.570, 11570.9, 15904.83, 18373.28, 19768.79, 23052.63, 24408.02)),
    (AXIAL, 12000, (3172.564, 7020.803, 7424.463, 8475.535, 11553.25, 15778.81, 18361.0, 19874.05, 23052.19, 24364.33)),
    (OBLIQUE, 6000, (3238.638, 7081.539, 7436.648, 8483.333, 11565.51, 15916.21, 18375.0, 19762.78, 23045.9, 24427.88)),
    (OBLIQUE, 9000, (3220.691, 7063.186, 7429.508, 8479.536, 11551.34, 15878.02, 18371.87, 19798.02, 23037.0, 24433.0)),
)  # fmt: skip


# the same on the mesh of `arched`, of the modes that its few points of integration leave right: 0-5 and 7
COARSE_STILL = (3462.486, 7583.315, 7690.099, 8786.882, 12542.74, 17280.92, 20624.61)
COARSE = (
    (AXIAL, 6000, (3443.807, 7564.783, 7685.331, 8783.944, 12536.72, 17243.63, 20653.40)),
    (AXIAL, 9000, (3420.296, 7541.537, 7679.369, 8780.287, 12529.20, 17196.89, 20689.69)),
    (OBLIQUE, 6000, (3448.783, 7568.657, 7684.420, 8783.517, 12531.32, 17255.33, 20646.63)),
    (OBLIQUE, 9000, (3431.630, 7550.361, 7677.225, 8779.222, 12516.96, 17223.05, 20674.04)),
)


def test_shifts_on_few_elements_equal_calculix(arched):
    """To 0.5 % of the shift, by matrices up to 12,000 rpm, between standstill and there."""
    solid, standing = arched
    up_to = {id(axis): solid.rotating(standing, *axis, speed=400.0 * np.pi) for axis in (AXIAL, OBLIQUE)}
    modes = [0, 1, 2, 3, 4, 5, 7]
    still = solve_modes(standing, 10).frequencies_hz[modes]
    for axis, rpm, frequencies in COARSE:
        found = solve_modes(up_to[id(axis)].at(rpm * np.pi / 30.0), 10).frequencies_hz[modes]
        assert found - still == pytest.approx(np.subtract(frequencies, COARSE_STILL), rel=5e-3)


@pytest.mark.slow
def test_shifts_of_arched_bands_equal_calculix(tmp_path):
    """To 0.5 % of the shift, and 2.5e-6 of the frequency: its digits, and points of integration of its elements.

    Matrices up to 12,000 rpm, between standstill and there.
    """
    solid = Solid(write_arched(tmp_path / "arched.msh", 2), {"default": STEEL})
    standing = solid.assemble({"clamp": "xyz"}, 0.0)
    still = solve_modes(standing, 10).frequencies_hz
    assert still == pytest.approx(CALCULIX_STILL, rel=3e-4)
    up_to = {id(axis): solid.rotating(standing, *axis, speed=400.0 * np.pi) for axis in (AXIAL, OBLIQUE)}
    for axis, rpm, frequencies in CALCULIX:
        shifts = np.array(frequencies) - CALCULIX_STILL
        found = solve_modes(up_to[id(axis)].at(rpm * np.pi / 30.0), 10).frequencies_hz
        assert np.all(np.abs(found - still - shifts) <= 5e-3 * np.abs(shifts) + 2.5e-6 * still)


def test_slender_blade_that_bends(tmp_path):
    """A blade on one side of the axis' plane: its own stress straightens it, a third of what first order has.

    Between standstill and the highest speed as well; a stiffness that is linear in the squared speed, or quadratic,
    is wrong by 6 % of the first frequency or has it unstable there.
    """
    axis, point, top = np.array([0.0, 1.0, 0.0]), np.array([-0.15, 0.0, 0.0]), 1256.0
    blade = build(TaperedBlock(0.15, 0.04, 0.004, divisions=(10, 2, 1)), tmp_path / "blade.msh")
    solid = Solid(blade, {"default": Material(1.14e11, 0.33, 4430.0)})
    standing = solid.assemble({"root": "xyz"}, 0.0)
    rotating = solid.rotating(standing, axis, point, speed=top)
    for share, most in ((0.25, 5e-4), (0.5, 5e-4), (1.0, 1e-6)):
        expected = by_finite_strains(solid, standing.fixed, solid.materials["block"], axis, point, share * top, 4)
        assert solve_modes(rotating.at(share * top), 4).angular_frequencies == pytest.approx(expected, rel=most)
    assert rotating.neglected_error(solve_modes(rotating.at(0.5 * top), 4).shapes) < 5e-4


def test_turned_deformation(arched):
    """A small turn of the whole deformed body turns its internal forces: an identity of the exact stiffness.

    With the skew matrix R of any turn, K_t (R (x + u)) = R f, f the internal forces at any shape u.
    """
    solid, standing = arched
    rotating = solid.rotating(standing, *OBLIQUE)
    shape = 1200.0**2 * static_shape(standing, rotating.load)
    for turn in (cross_matrix(axis) for axis in np.eye(3)):

        def turned(field, turn=turn):
            return (field.reshape(-1, 3) @ turn.T).ravel()

        found = solid._deformation.tangent(shape) @ turned(standing.coordinates.ravel() + shape)
        expected = turned(solid._deformation.force(shape))
        assert found == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


def test_stout_block_beyond_what_a_metal_bears(tmp_path):
    """About a skew axis beside it."""
    axis, point = np.array([1.0, 2.0, 1.0]), np.array([-0.05, 0.01, 0.0])
    block = TaperedBlock(0.1, 0.03, 0.02, divisions=(3, 1, 1))
    solid = Solid(build(block, tmp_path / "block.msh"), {"default": STEEL})
    standing = solid.assemble({"root": "xyz"}, 0.0)
    for speed in (2000.0, 6000.0):
        expected = by_finite_strains(solid, standing.fixed, STEEL, axis, point, speed, 4)
        rotating = solid.rotating(standing, axis, point, speed=speed)
        assert solve_modes(rotating.at(speed), 4).angular_frequencies == pytest.approx(expected, rel=1e-5)
    assert expected[0] > 1.1 * solve_modes(standing, 1).angular_frequencies[0]
