"""Structures that rotate: prestressed modes against beam theory, stresses against closed forms."""

import numpy as np
import pytest

from vanedamp.files.toml_input import InputError
from vanedamp.meshes.benchmarks import Block, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticityError, Material, Solid
from vanedamp.modal.matrices import MatricesError
from vanedamp.modal.rotating import UnstableError
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case

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
