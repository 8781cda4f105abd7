"""The rigid model moves as its mode does."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.records.modes import Modes
from vanedamp.modal.rigid_model import CalibrationError, fatigue_amplitude, rigid_model

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)


def test_oscillator_of_two_masses_in_closed_form():
    """Masses 1 and 2 that move together in the ratio 1 : 1.5, seen at the second."""
    shape = np.array([1.0, 1.5]) / np.sqrt(1.0 + 2.0 * 1.5**2)
    model = rigid_model(Modes([3.0 / np.pi], [shape], [0.0]), 0, np.array([0.0, 1.0]), "second", 0.01)
    mass = (1.0 + 2.0 * 1.5**2) / 1.5**2
    assert model.mass == pytest.approx(mass, rel=1e-14)
    assert model.stiffness == pytest.approx(36.0 * mass, rel=1e-14)
    assert model.damping == pytest.approx(2 * 0.01 * 6.0 * mass, rel=1e-14)
    assert (model.at, model.damping_ratio, model.frequency_hz) == ("second", 0.01, 3.0 / np.pi)
    assert model.resonance_force(1e-3) == pytest.approx(model.damping * 6.0 * 1e-3, rel=1e-14)


@pytest.fixture(scope="module")
def solid(tmp_path_factory):
    path = build(
        TaperedBlock(0.5, 0.04, 0.02, divisions=(8, 1, 1), hexahedra=True), tmp_path_factory.mktemp("beam") / "b.msh"
    )
    return Solid(path, {"default": STEEL})


@pytest.fixture(scope="module")
def beam(solid):
    return solid.assemble({"root": "xyz"}, damping_ratio=0.01)


def test_receptance_near_resonance_is_the_rigid_model(beam):
    """The full structure's response at the tip, with the same modal damping, within the other modes' small share."""
    modes, tip = solve_modes(beam, 3), patch_average(beam, "tip", [0, 0, 1])
    model = rigid_model(modes, 0, tip, "tip", beam.damping_ratio)
    omega, free = 0.999 * modes.angular_frequencies[0], beam.free
    stiffness, mass = (matrix[free][:, free] for matrix in (beam.stiffness, beam.mass))
    damping = 2.0 * beam.damping_ratio / modes.angular_frequencies[0] * stiffness
    full = tip[free] @ spsolve((stiffness - omega**2 * mass + 1j * omega * damping).tocsc(), tip[free].astype(complex))
    rigid = 1.0 / (model.stiffness - omega**2 * model.mass + 1j * omega * model.damping)
    assert abs(full / rigid - 1.0) < 2e-3


def test_resonance_reaches_the_share_of_the_strength(solid, beam):
    """The von Mises stress of the resonant shape is the given share of the strength."""
    modes, tip = solve_modes(beam, 1), patch_average(beam, "tip", [0, 0, 1])
    peak = solid.von_mises(modes.shapes[0]).max()
    amplitude = fatigue_amplitude(peak / abs(tip @ modes.shapes[0]), fatigue_strength=4e8, share=0.7)
    resonant = modes.shapes[0] * amplitude / (tip @ modes.shapes[0])
    assert solid.von_mises(resonant).max() == pytest.approx(0.7 * 4e8, rel=1e-10)


def test_refuses_what_does_not_move(beam):
    modes = solve_modes(beam, 1)
    with pytest.raises(CalibrationError, match=r"at: mode 0 .* does not move 'root'"):
        rigid_model(modes, 0, patch_average(beam, "root", [0, 0, 1]), "root", 0.01)
    free = Modes([0.0], [[1.0]], [0.0])
    with pytest.raises(CalibrationError, match="mode: mode 0 is a rigid motion"):
        rigid_model(free, 0, np.ones(1), "all", 0.01)
    with pytest.raises(CalibrationError, match="fatigue_strength: expected a positive number"):
        fatigue_amplitude(1.0, 0.0)
