"""Modes without factors against those by factors, the choice between the two, and what multigrid stands on."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tests.modal.test_lanczos import rod
from tests.tools.small_structures import truss
from tests.tools.tiers import cases
from tests.tools.two_cubes_mesh import write_boxes
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal import davidson, fenicsx
from vanedamp.modal.eigen import SolverError, solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid, assemble
from vanedamp.modal.iterative import chosen, machine_memory
from vanedamp.modal.lanczos import NotConvergedError
from vanedamp.modal.matrices import MatricesError, SystemMatrices
from vanedamp.modal.petsc import Product, factorize

STEEL = {"default": Material(young=2.1e11, poisson=0.3, density=7800.0)}
PLATE = TaperedBlock(0.3, 0.2, 0.02, element_size=0.04)
#: supports of a plate, and its springs
HELD = {
    "clamped": ({"root": "xyz"}, {}),
    "rollers": ({"root": "x", "left": "xy", "bottom": "z"}, {}),
    "springs": ({"tip": "z"}, {"root": ElasticSupport((1e11, 2e11, 1e12)), "left": ElasticSupport(normal=1e10)}),
    "free": ({}, {}),
}  # fmt: skip


def agree(matrices, count=10, multiples=1e-6):
    """Assert that both solvers find the same modes, each within those of nearly its frequency."""
    factor, iterative = (solve_modes(matrices, count, solver=solver) for solver in ("factor", "iterative"))
    assert not iterative.counted and factor.counted
    straining = factor.frequencies_hz > 0.0
    assert iterative.frequencies_hz[straining] == pytest.approx(factor.frequencies_hz[straining], rel=1e-8)
    assert np.array_equal(iterative.frequencies_hz > 0.0, straining)
    assert iterative.shapes @ (matrices.mass @ iterative.shapes.T) == pytest.approx(np.eye(count), abs=1e-12)
    assert np.all(iterative.shapes[:, matrices.fixed] == 0.0)
    assert iterative.residuals.max() < 1e-7
    shares = (iterative.shapes @ (matrices.mass @ factor.shapes.T)) ** 2
    near = np.abs(factor.frequencies_hz[:, None] - factor.frequencies_hz) <= multiples * factor.frequencies_hz.max()
    last = near[:, -1] & straining  # its copies may lie beyond
    assert np.sum(np.where(near, shares, 0.0), axis=1)[~last] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    ("held", "degree"),
    cases(
        [(held, degree) for held in HELD for degree in (1, 2, 3)],
        fast=[("rollers", 1), ("free", 1), *((held, 2) for held in HELD), ("rollers", 3)],
    ),
)
def test_modes_equal_those_by_factors(held, degree, tmp_path):
    """Multigrid on the vertices for degree 2 and 3; GAMG for degree 1, where rollers hold parts of nodes."""
    clamped, springs = HELD[held]
    block = PLATE if degree < 3 else replace(PLATE, element_size=0.08)
    agree(assemble(build(block, tmp_path / "plate.msh"), STEEL, clamped, degree, elastic=springs))


@pytest.mark.parametrize("held", cases(["clamped", "rollers", "free"], fast=["rollers"]))
def test_matrices_of_which_the_vertices_are_unknown(held, tmp_path):
    clamped, _ = HELD[held]
    agree(replace(assemble(build(PLATE, tmp_path / "plate.msh"), STEEL, clamped), vertices=None))


@pytest.mark.parametrize("hexahedra", [False, True])
def test_bricks_and_tetrahedra(hexahedra, tmp_path):
    block = TaperedBlock(0.5, 0.06, 0.05, divisions=(16, 3, 2), hexahedra=hexahedra)
    agree(assemble(build(block, tmp_path / "beam.msh"), STEEL, {"root": "xyz"}))


@pytest.mark.parametrize(
    ("ratio", "vertices"),
    cases([(1e-4, True), (1e-4, False), (1e4, True), (1e4, False)], fast=[(1e-4, True), (1e4, False)]),
)
def test_bonded_materials_of_very_different_stiffness(ratio, vertices, tmp_path):
    path = write_boxes(tmp_path / "boxes.msh", {"held": [1], "far": [2]}, {"left": [(0, 1, 1)]}, size=0.25)
    materials = {"held": Material(1.0, 0.3, 1.0), "far": Material(ratio, 0.3, 1.0)}
    matrices = assemble(path, materials, {"left": "xyz"})
    agree(matrices if vertices else replace(matrices, vertices=None), 8)


@pytest.mark.parametrize("count", cases([5, 20, 33], fast=[5, 33]))
def test_no_copy_of_a_multiple_frequency_is_missed(count):
    """Twenty equal trusses side by side: every frequency is twentyfold."""
    one, copies = truss(seed=3, nodes=20), 20
    together = SystemMatrices(
        stiffness=sparse.block_diag([one.stiffness] * copies, format="csr"),
        mass=sparse.block_diag([one.mass] * copies, format="csr"),
        coordinates=np.tile(one.coordinates, (copies, 1)),
        fixed=np.concatenate([one.fixed + one.size * copy for copy in range(copies)]),
        patches={},
        damping_ratio=0.0,
    )
    expected = np.repeat(solve_modes(one, 5).frequencies_hz, copies)
    assert solve_modes(together, count, solver="iterative").frequencies_hz == pytest.approx(expected[:count], rel=1e-9)


def test_a_range_of_frequencies(tmp_path):
    plate = assemble(build(PLATE, tmp_path / "plate.msh"), STEEL, {"root": "xyz"})
    many = solve_modes(plate, 16).frequencies_hz
    low, high = 0.5 * (many[2] + many[3]), 0.5 * (many[13] + many[14])
    found = solve_modes(plate, max_frequency=high, min_frequency=low, solver="iterative")
    assert found.frequencies_hz == pytest.approx(many[3:14], rel=1e-8)
    assert not found.counted
    with pytest.raises(SolverError, match="no mode from"):
        solve_modes(plate, max_frequency=0.5 * many[0], min_frequency=0.1 * many[0], solver="iterative")


def test_a_structure_smaller_than_the_space():
    """LAPACK's modes."""
    one = truss()
    expected = solve_modes(one, 6)
    found = solve_modes(one, 6, solver="iterative")
    assert found.frequencies_hz == pytest.approx(expected.frequencies_hz, rel=1e-10)
    assert found.provenance["solver"] == {"name": "iterative", "counted": False}


def test_auto_compares_the_factor_with_the_memory():
    """160 bytes times n^(4/3): of a million DOFs 16 GB, which half of a machine's memory holds or does not."""
    assert chosen("auto", 10**6, 33e9) == {"name": "factor", "factor_bytes": 16 * 10**9, "memory_bytes": 33 * 10**9}
    assert chosen("auto", 10**6, 31e9)["name"] == "iterative"
    assert chosen("factor", 10**9, 1.0) == {"name": "factor"}
    assert 1e8 < machine_memory() < 1e15
    modes = solve_modes(truss(), 3, memory=1.0)
    assert modes.provenance["solver"]["name"] == "iterative" and not modes.counted
    assert solve_modes(truss(), 3, memory=1e9).provenance["solver"]["name"] == "factor"


def test_a_solver_that_does_not_exist():
    with pytest.raises(SolverError, match=r"^solver: expected one of factor, iterative, auto, not 'lobpcg'$"):
        solve_modes(truss(), 3, solver="lobpcg")


@pytest.mark.parametrize("hexahedra", [False, True])
@pytest.mark.parametrize("degree", [2, 3])
def test_vertices_carry_linear_fields_to_the_nodes(degree, hexahedra, tmp_path):
    path = build(TaperedBlock(1.0, 0.5, 0.4, divisions=(3, 2, 2), hexahedra=hexahedra), tmp_path / "block.msh")
    solid = Solid(path, STEEL, degree)
    weights = solid.assemble({}, 0.0).vertices
    at = fenicsx.node_coordinates(fenicsx.vector_space(solid.domain.mesh, 1))
    assert weights.shape == (len(fenicsx.node_coordinates(solid.space)), len(at))
    assert weights.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    own = np.argmax(weights.toarray(), axis=0)  # the nodes at the vertices
    places = fenicsx.node_coordinates(solid.space)
    assert weights @ places[own] == pytest.approx(places, abs=1e-14)


def test_vertices_of_another_mesh():
    with pytest.raises(MatricesError, match="vertices: expected one row for each of 14 nodes"):
        replace(truss(), vertices=sparse.csr_array((3, 2)))


def davidson_on_a_rod(precondition, limits):
    """Eigenvalues and vectors from a start at random, with a preconditioner of rows."""
    stiffness, mass, _ = rod()
    start = np.random.default_rng(1).standard_normal((len(limits), stiffness.shape[0]))
    products = Product(sparse.csr_array(stiffness)), Product(sparse.csr_array(mass))
    return davidson.lowest_eigenpairs(*products, stiffness.diagonal(), precondition, start, limits)


def test_davidson_on_a_rod():
    stiffness, mass, eigenvalues = rod()
    factors = factorize(sparse.csr_array(stiffness))
    values, vectors = davidson_on_a_rod(factors.solve_rows, np.repeat([1e-11, 1e-3], [8, 4]))
    assert values[:8] == pytest.approx(eigenvalues[:8], rel=1e-12)
    assert vectors @ (mass @ vectors.T) == pytest.approx(np.eye(12), abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_davidson_that_does_not_converge(sign, monkeypatch):
    """With a poor preconditioner, and an indefinite one: no residual may look small for a negative square."""
    monkeypatch.setattr(davidson, "_ROUNDS", 3)
    with pytest.raises(NotConvergedError, match="0 of 12 modes converged"):
        davidson_on_a_rod(lambda rows: sign * rows, np.full(12, 1e-2))


def test_modes_load_no_library_that_they_do_not_use():
    """h5py's wheel alone comes first, for the sake of its HDF5 (modal.stack)."""
    code = (
        "import sys, importlib.util, pathlib, vanedamp.modal.eigen\n"
        "wheel = pathlib.Path(importlib.util.find_spec('h5py').origin).parent.with_name('h5py.libs').is_dir()\n"
        "unused = ['slepc4py', 'pydantic', 'dolfinx', 'numba', *(['h5py'] if not wheel else [])]\n"
        "print([name for name in unused if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
