"""Published benchmarks with solid elements, on three meshes each."""

import numpy as np
import pytest

from tests.validation.modes import FV32, SDLS01, square_plate, tapered_membrane
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import factorize, solve_modes
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.matrices import patch_average


def converged(solutions):
    """The finest of solutions on meshes halved twice, and the observed orders log2((f1 - f2) / (f2 - f3))."""
    steps = np.diff(solutions, axis=0)
    return solutions[-1], np.log2(steps[0] / steps[1])


def test_tapered_cantilever_membrane(tmp_path):
    """NAFEMS FV32 (Selected Benchmarks for Natural Frequency Analysis, 1987): in-plane modes, plane stress.

    The stress is singular at the ends of the clamp, so that the modes which load them show an order far below the
    elements' four.
    """
    solutions = [tapered_membrane(tmp_path, cells) for cells in (4, 8, 16)]
    finest, orders = converged(solutions)
    assert finest == pytest.approx([float(value) for value in FV32], rel=2e-3)
    assert np.all(orders > 1.1)
    assert np.all(np.diff(solutions, axis=0) < 0.0)


def test_cantilever_square_plate(tmp_path):
    """SDLS01 (Guide de validation des progiciels de calcul de structures, 1990): a thin plate clamped on one edge."""
    solutions = [square_plate(tmp_path, cells) for cells in (4, 8, 16)]
    finest, orders = converged(solutions)
    assert finest == pytest.approx([float(value) for value in SDLS01], rel=5e-3)
    assert np.all(orders > 1.3)
    assert np.all(np.diff(solutions, axis=0) < 0.0)


def bending_stress_errors(path, cells, shape_of, stress_at):
    """Largest relative error of the von Mises stress of a cantilever's top and bottom, away from clamp and tip."""
    length, width, height = 1.0, 0.06, 0.05
    block = TaperedBlock(length, width, height, divisions=(4 * cells, 1, cells), hexahedra=True)
    solid = Solid(build(block, path), {"default": Material(2e11, 0.3, 8000.0)}, degree=2)
    matrices = solid.assemble({"root": "xyz"}, 0.0)
    tip = patch_average(matrices, "tip", [0, 0, 1])
    shape = shape_of(matrices, tip)
    x, _, z = solid.stress_points().T
    chosen = (np.abs(np.abs(z - 0.5 * height) - 0.5 * height) < 1e-9) & (x > 0.15) & (x < 0.6)
    expected = stress_at(x[chosen], length, width, height) * (tip @ shape if stress_at is modal_stress else 1.0)
    return np.abs(solid.von_mises(shape)[chosen] / np.abs(expected) - 1.0).max()


def static_shape(matrices, tip):
    free, shape = matrices.free, np.zeros(matrices.size)
    with factorize(matrices.stiffness[free][:, free]) as factors:
        shape[free] = factors.solve(tip[free])
    return shape


def static_stress(x, length, width, height):
    """F (L - x) c / I of a unit tip load."""
    return (length - x) * 6.0 / (width * height**2)


def first_shape(matrices, tip):
    return solve_modes(matrices, 1).shapes[0]


def modal_stress(x, length, width, height):
    """E c w'' of Euler and Bernoulli's first mode with unit displacement of the tip (Blevins 1979, table 8-1)."""
    beta, sigma = 1.8751040687 / length, 0.7340955138
    curvature = np.cosh(beta * x) + np.cos(beta * x) - sigma * (np.sinh(beta * x) + np.sin(beta * x))
    return 2e11 * 0.5 * height * 0.5 * beta**2 * curvature


@pytest.mark.parametrize(("shape_of", "stress_at"), [(static_shape, static_stress), (first_shape, modal_stress)])
def test_bending_stress_of_a_cantilever(tmp_path, shape_of, stress_at):
    """Under a tip load and in the first mode: converging to beam theory, which leaves out the mode's shear (0.4 %)."""
    errors = [bending_stress_errors(tmp_path / "beam.msh", cells, shape_of, stress_at) for cells in (2, 4, 8)]
    assert errors[0] > 3.0 * errors[1] > 3.0 * errors[2]
    assert errors[2] < 0.005
