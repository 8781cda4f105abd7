"""Heated structures: stress of what cannot expand, and moduli that depend on the temperature."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.tools.arched_cluster import write as write_arched
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.rotating import UnstableError
from vanedamp.modal.temperature import Temperature, TemperatureError
from vanedamp.studies.case.calibration import tuned_case
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

YOUNG, DENSITY, EXPANSION = 2e11, 8000.0, 1.2e-5
LENGTH, SIDE = 1.0, 0.02
HELD = {"root": "xyz", "tip": "xyz"}
# a face of each direction can slide along itself
FREE_TO_EXPAND = {"root": "x", "left": "y", "bottom": "z"}
STEEL = Material(YOUNG, 0.0, DENSITY, EXPANSION)
# Euler's load of a beam clamped at both ends, 4 pi^2 E I / L^2, over E A alpha
BUCKLING = 4.0 * np.pi**2 * SIDE**2 / (12.0 * LENGTH**2) / EXPANSION


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    block = TaperedBlock(LENGTH, SIDE, SIDE, divisions=(16, 1, 1), hexahedra=True)
    return build(block, tmp_path_factory.mktemp("beam") / "beam.msh")


def first(mesh, temperature, material=STEEL, clamped=HELD):
    """The lowest angular frequency."""
    solid = Solid(mesh, {"default": material}, temperature=temperature)
    return solve_modes(solid.assemble(clamped, 0.0), 1).angular_frequencies[0]


def uniform(value, reference=0.0):
    return Temperature(reference, np.array(value))


def held_beam(load):
    """The first root of a clamped beam's mu^4 under compression, EI w'''' + P w'' = rho A omega^2 w; P = load / L^2 EI.

    w is a sum of cosh, sinh of a x and cos, sin of b x, with b^2 - a^2 = P/EI and a b = mu^2.
    """

    def determinant(squared):
        half = 0.5 * load
        a, b = np.sqrt(np.hypot(half, squared) - half), np.sqrt(np.hypot(half, squared) + half)
        return 2 * a * b * (1 - np.cosh(a) * np.cos(b)) + (a**2 - b**2) * np.sinh(a) * np.sin(b)

    return brentq(determinant, 1e-2, 25.0)


def test_root_of_the_held_beam():
    """Without load the first root is 4.7300^2 (Blevins 1979)."""
    assert held_beam(0.0) == pytest.approx(22.3733, rel=1e-5)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_heat_lowers_the_bending_of_a_held_beam(mesh, share):
    """Against Euler and Bernoulli's beam under the load E A alpha (T - T0), relative to the cold one."""
    ratio = first(mesh, uniform(share * BUCKLING)) / first(mesh, uniform(0.0))
    assert ratio == pytest.approx(held_beam(share * 4.0 * np.pi**2) / held_beam(0.0), rel=0.02 if share > 0.8 else 5e-3)


def test_heat_buckles_a_held_beam(mesh):
    """Between 98 and 101 % of the temperature of Euler's load; the message names how much of the stress it bears."""
    assert first(mesh, uniform(20.0 + 0.98 * BUCKLING, 20.0)) > 0.0
    with pytest.raises(UnstableError, match=r"^temperature: the structure buckles at ") as caught:
        first(mesh, uniform(20.0 + 2.0 * BUCKLING, 20.0))
    share = float(str(caught.value).split("buckles at ")[1].split()[0])
    assert 0.49 < share < 0.505


def test_free_expansion_is_growth(mesh):
    """No stress: a body that is 1 + alpha (T - T0) times as large, of the same modulus and mass, is as much stiffer."""
    material = replace(STEEL, poisson=0.3)
    cold, hot = (
        Solid(mesh, {"default": material}, temperature=uniform(value, 20.0)).assemble(FREE_TO_EXPAND, 0.0)
        for value in (20.0, 520.0)
    )
    # of the stress of a body that is held, E alpha (T - T0), at the size of an element
    held = YOUNG * EXPANSION * 500.0 * SIDE
    assert abs(hot.stiffness - (1.0 + EXPANSION * 500.0) * cold.stiffness).max() < 1e-6 * held
    assert abs(hot.mass - cold.mass).max() == 0.0
    clamped = Solid(mesh, {"default": material}, temperature=uniform(70.0, 20.0)).assemble(HELD, 0.0)
    assert abs(clamped.stiffness - cold.stiffness).max() > 1e-3 * held


# Hz of ten modes by CalculiX 2.20, C3D10 elements on the mesh of `arched_cluster.write`: *STEP, NLGEOM with *STATIC and
# *TEMPERATURE, then *STEP, PERTURBATION with *FREQUENCY; cold, and 300 K hotter
CALCULIX_COLD = (
    3462.486, 7583.315, 7690.099, 8786.882, 12542.74, 17280.92, 19731.81, 20624.61, 24768.48, 26430.92,
)  # fmt: skip
CALCULIX_HOT = (
    3467.391, 7617.162, 7710.327, 8805.708, 12586.43, 17410.90, 19792.30, 20631.28, 24855.42, 26533.32,
)  # fmt: skip


def test_hot_cluster_equals_calculix(tmp_path):
    """Arched bands and vanes held at the outer band: stress and deformation shift each frequency in its own way.

    CalculiX takes the modulus as one of the cold sizes: its squares are larger by 1 + alpha (T - T0).
    """
    steel = {"default": Material(YOUNG, 0.3, 8190.0, EXPANSION)}
    path = write_arched(tmp_path / "arched.msh")
    cold, hot = (
        solve_modes(Solid(path, steel, temperature=uniform(rise)).assemble({"clamp": "xyz"}, 0.0), 10).frequencies_hz
        for rise in (0.0, 300.0)
    )
    expected = np.divide(CALCULIX_HOT, CALCULIX_COLD) / np.sqrt(1.0 + 300.0 * EXPANSION)
    assert hot / cold == pytest.approx(expected, rel=7e-5)
    assert np.ptp(expected) > 5e-3


def test_frequency_follows_the_modulus(mesh):
    """By its square root, linear between the temperatures of the table."""
    material = Material(YOUNG, 0.3, DENSITY, 0.0, ((300.0, YOUNG), (500.0, 0.8 * YOUNG), (900.0, 0.4 * YOUNG)))
    cold = first(mesh, None, material)
    assert first(mesh, uniform(300.0), material) == pytest.approx(cold, rel=1e-7)
    assert first(mesh, uniform(600.0), material) == pytest.approx(np.sqrt(0.7) * cold, rel=1e-7)
    with pytest.raises(TemperatureError, match="young_at: reaches from 300 to 900, the temperatures from 950 to 950"):
        first(mesh, uniform(950.0), material)


def test_field_with_the_mean_of_a_uniform_temperature(mesh):
    """A held bar's force is E A alpha times the mean of its temperature along it, whatever the distribution."""
    corners = np.array(np.meshgrid([0.0, LENGTH], [-SIDE, SIDE], [-SIDE, 2 * SIDE])).reshape(3, -1).T
    rise = 0.6 * BUCKLING
    field = Temperature(10.0, 10.0 + 2.0 * rise * corners[:, 0] / LENGTH, corners)
    assert first(mesh, field) == pytest.approx(first(mesh, uniform(rise)), rel=1e-4)


def test_interpolation():
    """Linear fields are met inside, the nearest point takes over just outside, and what lies far away is refused."""
    points = np.random.default_rng(4).uniform(size=(40, 3))
    points[:8] = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    field = Temperature(0.0, points @ [100.0, -20.0, 5.0] + 300.0, points)
    places = np.random.default_rng(5).uniform(size=(50, 3))
    assert field.at(places) == pytest.approx(places @ [100.0, -20.0, 5.0] + 300.0)
    assert field.at(np.array([[1.005, 1.0, 1.0]])) == pytest.approx(385.0)
    with pytest.raises(TemperatureError, match=r"reaches beyond the points: \(1.5, 1, 1\) m lies outside, 0.5 m from"):
        field.at(np.array([[0.5, 0.5, 0.5], [1.5, 1.0, 1.0]]))
    with pytest.raises(TemperatureError, match="8 points lie in one plane"):
        Temperature(0.0, np.ones(8), points[:8] * [1.0, 1.0, 0.0] + np.arange(8)[:, None] * [0.1, 0, 0]).at(places)
    with pytest.raises(TemperatureError, match="a point occurs twice"):
        Temperature(0.0, np.ones(2), np.zeros((2, 3)))


def test_free_structure_is_refused(mesh):
    with pytest.raises(ElasticityError, match="temperature: the structure is not held against every rigid motion"):
        first(mesh, uniform(50.0), clamped={})


CASE = """
[mesh]
generator = "block"
length = 1.0
width = 0.02
thickness = 0.02
divisions = [16, 1, 1]
hexahedra = true
[material.default]
young = 2e11
poisson = 0.0
density = 8000.0
expansion = 1.2e-5
[support]
clamped = ["root", "tip"]
[modes]
count = 1
"""


def test_case_with_a_file(tmp_path, mesh):
    """The table reaches the finite elements, from a CSV as from one number."""
    rows = [f"{x},{y},{z},{20.0 + 120.0 * x}" for x in (0, 1) for y in (-0.01, 0.01) for z in (0, 0.02)]
    (tmp_path / "T.csv").write_text("x,y,z,T\n" + "\n".join(rows) + "\n")
    found = []
    for table in ('file = "T.csv"', "uniform = 80.0"):
        (tmp_path / "case.toml").write_text(CASE + f"[temperature]\nreference = 20.0\n{table}\n")
        case = Case.load(tmp_path / "case.toml")
        found.append(solve_modes(assemble(case).matrices, 1).angular_frequencies[0])
    assert found == pytest.approx([first(mesh, uniform(60.0))] * 2, rel=1e-4)
    assert Case.load(tmp_path / "case.toml").files == []


def test_tuned_modulus_takes_its_table_along(tmp_path):
    (tmp_path / "case.toml").write_text(CASE.replace("expansion", "young_at = [[0, 2e11], [500, 1e11]]\nexpansion"))
    structure = assemble(Case.load(tmp_path / "case.toml"))
    tuned = tuned_case(structure.case, {"material.block": 1.1}, structure).material["block"]
    assert tuned.young_at == pytest.approx(np.array([[0.0, 2.2e11], [500.0, 1.1e11]]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[temperature]\nreference = 0.0\n", "temperature: give one of uniform and file"),
        ("[temperature]\nuniform = 9.0\n", "temperature.reference: missing"),
        ('[temperature]\nreference = 0.0\nfile = "none.csv"\n', "temperature.file: no such file"),
        ('[temperature]\nreference = 0.0\nfile = "empty.csv"\n', "empty.csv: holds no rows of numbers"),
        ('[temperature]\nreference = 0.0\nfile = "three.csv"\n', "three.csv: expected the columns x, y, z (m) and"),
        ("[temperature]\nreference = 0.0\nuniform = 900.0\n", "temperature: the structure buckles at 0.12"),
    ],
)
def test_tables_that_are_refused(tmp_path, capsys, text, message):
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "three.csv").write_text("0,0,1\n")
    path = tmp_path / "case.toml"
    path.write_text(CASE + text)
    assert main(["modal", str(path)]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count("\n") == 1


@pytest.mark.parametrize(
    ("material", "message"),
    [
        ("", "temperature: changes nothing"),
        ("expansion = 12.0", "material.default.expansion"),
        ("young_at = [[0, 2e11]]", "young_at: expected [[temperature, modulus], ...], at least two"),
        ("young_at = [[9, 2e11], [0, 1e11]]", "young_at: expected [[temperature, modulus], ...], at least two"),
        (
            "young_at = [[50, 2e11], [90, 1e11]]",
            "material.default.young_at: holds from 50 to 90, without the reference 20",
        ),
        (
            "young_at = [[0, 2.2e11], [90, 2.2e11]]",
            "material.default.young: is the modulus at the reference temperature",
        ),
    ],
)
def test_materials_that_are_refused(tmp_path, capsys, material, message):
    path = tmp_path / "case.toml"
    path.write_text(CASE.replace("expansion = 1.2e-5", material) + "[temperature]\nreference = 20.0\nuniform = 30.0\n")
    assert main(["modal", str(path)]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count("\n") == 1


def test_stress_of_a_held_beam(mesh):
    """-E alpha T along a beam whose ends are held along it, Poisson's ratio 0; nothing in one that can expand.

    Green's strain of the growth, and the modulus by the cold size.
    """
    stretch = 1.0 + EXPANSION * 10.0
    held = Solid(mesh, {"default": STEEL}, temperature=uniform(30.0, 20.0))
    held.assemble(FREE_TO_EXPAND | {"tip": "x"}, 0.0)
    points = np.arange(0, len(held.stress_points()), 7)
    stress = held.static_stresses(points)
    assert list(stress) == ["temperature"] and stress["temperature"].shape == (6, len(points))
    assert stress["temperature"][0] == pytest.approx(-0.5 * YOUNG * (stretch**2 - 1.0) / stretch, rel=1e-9)
    assert np.abs(stress["temperature"][1:]).max() < 1e-6 * YOUNG * EXPANSION * 10.0
    free = Solid(mesh, {"default": STEEL}, temperature=uniform(30.0, 20.0))
    free.assemble(FREE_TO_EXPAND, 0.0)
    assert np.abs(free.static_stresses(points)["temperature"]).max() < 1e-6 * YOUNG * EXPANSION * 10.0
