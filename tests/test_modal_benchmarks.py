"""Published benchmarks with solid elements."""

import numpy as np
import pytest

from meshes.benchmarks import Block, build
from modal.eigen import solve_modes
from modal.elasticity import Material, assemble


def test_tapered_cantilever_membrane(tmp_path):
    """NAFEMS FV32 (Selected Benchmarks for Natural Frequency Analysis, 1987): in-plane modes, plane stress.

    The lower half of the plate's thickness with its middle plane on rollers: no bending, free to thin.
    """
    path = build(Block(10.0, 5.0, 0.025, tip_width=1.0, divisions=(16, 8, 1), hexahedra=True), tmp_path / "fv32.msh")
    matrices = assemble(path, {"default": Material(200e9, 0.3, 8000.0)}, {"root": "xyz", "bottom": "z"}, degree=2)
    reference = [44.623, 130.03, 162.70, 246.05, 379.90, 391.44]
    assert solve_modes(matrices, 6).frequencies_hz == pytest.approx(reference, rel=5e-3)


def test_cantilever_square_plate(tmp_path):
    """SDLS01 (Guide de validation des progiciels de calcul de structures, 1990): a thin plate clamped on one edge."""
    side, thickness, young, density = 1.0, 0.01, 2.1e11, 7800.0
    path = build(Block(side, side, thickness, divisions=(16, 16, 1), hexahedra=True), tmp_path / "sdls01.msh")
    matrices = assemble(path, {"default": Material(young, 0.3, density)}, {"root": "xyz"}, degree=2)
    parameters = np.array([3.492, 8.525, 21.43, 27.33, 31.11, 54.44])
    reference = parameters / (2 * np.pi * side**2) * np.sqrt(young * thickness**2 / (12 * density * (1 - 0.3**2)))
    assert solve_modes(matrices, 6).frequencies_hz == pytest.approx(reference, rel=5e-3)
