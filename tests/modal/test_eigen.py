"""Modes against independent solvers and closed forms, on meshes that refine."""

import subprocess
import sys

import numpy as np
import pytest
from petsc4py import PETSc
from scipy import linalg, optimize, sparse
from scipy.sparse.linalg import eigsh, spsolve

from tests.tools.processes import environment
from tests.tools.small_structures import truss
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal import petsc
from vanedamp.modal.eigen import SolverError, count_below, factorize, solve_modes
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.participation import effective_masses, first_bending
from vanedamp.modal.petsc import negative_eigenvalues, one_analysis
from vanedamp.modal.records.modes import Modes

# threads of a process before and after it factorises a grid's stiffness by CHOLMOD
THREADS_OF_A_FACTORISATION = """
import os
from scipy import sparse
from vanedamp.modal.petsc import Factorization
line = sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(14, 14))
before = len(os.listdir("/proc/self/task"))
Factorization(sparse.csr_array(sparse.kronsum(sparse.kronsum(line, line), line)), "cholmod")
print(before, len(os.listdir("/proc/self/task")))
"""

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)


def matrices_of(block, path, clamped, material=STEEL, degree=2):
    return assemble(build(block, path / "block.msh"), {"default": material}, clamped, degree)


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    """A clamped beam whose three principal directions differ."""
    block = TaperedBlock(1.0, 0.08, 0.05, divisions=(6, 1, 1), hexahedra=True)
    return matrices_of(block, tmp_path_factory.mktemp("beam"), {"root": "xyz"})


@pytest.fixture(scope="module")
def free_block(tmp_path_factory):
    block = TaperedBlock(0.4, 0.15, 0.1, divisions=(3, 2, 1), hexahedra=True)
    return matrices_of(block, tmp_path_factory.mktemp("free"), {})


def free_pair(matrices):
    free = matrices.free
    return matrices.stiffness[free][:, free], matrices.mass[free][:, free]


def test_frequencies_equal_arpack(beam):
    stiffness, mass = free_pair(beam)
    eigenvalues = eigsh(stiffness.tocsc(), 12, mass.tocsc(), sigma=0.0, return_eigenvectors=False)
    modes = solve_modes(beam, 12)
    assert modes.frequencies_hz == pytest.approx(np.sqrt(np.sort(eigenvalues)) / (2 * np.pi), rel=1e-8)


def test_shapes_are_orthonormal_and_held(beam):
    modes = solve_modes(beam, 12)
    assert modes.shapes @ (beam.mass @ modes.shapes.T) == pytest.approx(np.eye(12), abs=1e-12)
    energies = np.diag(modes.shapes @ (beam.stiffness @ modes.shapes.T))
    assert energies == pytest.approx(modes.angular_frequencies**2, rel=1e-9)
    assert np.all(modes.shapes[:, beam.fixed] == 0.0)
    assert modes.residuals.max() < 1e-8


def test_residuals_bound_the_defect_of_the_shapes(beam):
    modes, free = solve_modes(beam, 5), beam.free
    stiffness, mass = free_pair(beam)
    inertia = modes.angular_frequencies[:, None] ** 2 * (modes.shapes[:, free] @ mass)
    defects = np.linalg.norm(modes.shapes[:, free] @ stiffness - inertia, axis=1) / np.linalg.norm(inertia, axis=1)
    # both are round-off, which differs between two ways to add up
    assert np.all(defects < 1e-8)
    assert np.all(modes.residuals < 1e-8)
    assert np.all(modes.residuals > 0.01 * defects)


def test_the_sign_of_shapes_is_fixed(beam):
    modes = solve_modes(beam, 8)
    factors = modes.shapes @ (beam.mass @ beam.movable_translations())
    coupled = np.abs(factors).max(axis=1) > 1e-5 * np.abs(factors).max()
    strongest = np.take_along_axis(factors, np.abs(factors).argmax(axis=1)[:, None], axis=1)[:, 0]
    assert np.all(strongest[coupled] > 0.0)
    assert solve_modes(beam, 8).shapes == pytest.approx(modes.shapes, abs=1e-7 * np.abs(modes.shapes).max())


def test_all_modes_up_to_a_frequency(beam):
    many = solve_modes(beam, 12).frequencies_hz
    limit = 0.5 * (many[6] + many[7])
    assert count_below(beam, limit) == 7
    assert solve_modes(beam, max_frequency=limit).frequencies_hz == pytest.approx(many[:7], rel=1e-9)
    with pytest.raises(SolverError, match="max_frequency"):
        solve_modes(beam, max_frequency=0.5 * many[0])


def test_all_modes_of_a_range(beam):
    many = solve_modes(beam, 12).frequencies_hz
    low, high = 0.5 * (many[2] + many[3]), 0.5 * (many[9] + many[10])
    inside = solve_modes(beam, max_frequency=high, min_frequency=low)
    assert inside.frequencies_hz == pytest.approx(many[3:10], rel=1e-9)
    with pytest.raises(SolverError, match="no mode from"):
        solve_modes(beam, max_frequency=1.001 * many[4], min_frequency=0.999 * many[4] + 0.001 * many[5])
    with pytest.raises(SolverError, match="min_frequency: expected"):
        solve_modes(beam, max_frequency=low, min_frequency=high)


def test_the_options_of_petsc_stay_as_they_were(beam):
    """They are the process's own: other code in it may use PETSc, too."""
    before = PETSc.Options().getAll()
    assert not any(key.startswith("vanedamp") for key in before)
    modes = solve_modes(beam, 3)
    solve_modes(beam, max_frequency=1.001 * modes.frequencies_hz[2], min_frequency=0.999 * modes.frequencies_hz[0])
    assert PETSc.Options().getAll() == before


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_range_of_many_modes_is_sliced(beam, share):
    """More than a hundred modes against LAPACK's."""
    stiffness, mass = (matrix.toarray() for matrix in free_pair(beam))
    frequencies = np.sqrt(linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    high, low = 0.5 * (frequencies[149] + frequencies[150]), share * frequencies[149]
    expected = frequencies[(frequencies > low) & (frequencies < high)]
    assert expected.size > 100
    modes = solve_modes(beam, max_frequency=high, min_frequency=low)
    assert modes.frequencies_hz == pytest.approx(expected, rel=1e-8)
    # round-off of one product over the DOFs: some eps sqrt(n) for each of two factors, where slices alone leave 1e-8
    assert modes.shapes @ (beam.mass @ modes.shapes.T) == pytest.approx(np.eye(len(modes)), abs=1e-12)
    assert modes.residuals.max() < 1e-7


@pytest.mark.parametrize("count", [5, 20, 33])
def test_no_copy_of_a_multiple_frequency_is_missed(count):
    """Twenty equal trusses side by side: every frequency is twentyfold."""
    one, copies = truss(seed=3), 20
    together = SystemMatrices(
        stiffness=sparse.block_diag([one.stiffness] * copies, format="csr"),
        mass=sparse.block_diag([one.mass] * copies, format="csr"),
        coordinates=np.tile(one.coordinates, (copies, 1)),
        fixed=np.concatenate([one.fixed + one.size * copy for copy in range(copies)]),
        patches={},
        damping_ratio=0.0,
    )
    expected = np.repeat(solve_modes(one, 5).frequencies_hz, copies)
    modes = solve_modes(together, count)
    assert modes.frequencies_hz == pytest.approx(expected[:count], rel=1e-9)
    assert modes.shapes @ (together.mass @ modes.shapes.T) == pytest.approx(np.eye(count), abs=1e-12)
    limit = 0.5 * (expected[20] + expected[40])
    assert solve_modes(together, max_frequency=limit).frequencies_hz == pytest.approx(expected[:40], rel=1e-9)


def test_pairs_of_a_square_section(tmp_path):
    """Bending about two axes: pairs of equal frequencies, both found and orthonormal, nearly equal ones told apart."""
    for width, spread in ((0.05, 1e-9), (0.05 * (1 + 1e-5), 1e-4)):
        block = TaperedBlock(0.5, width, 0.05, divisions=(8, 1, 1), hexahedra=True)
        beam = matrices_of(block, tmp_path, {"root": "xyz"})
        modes = solve_modes(beam, 7)
        assert np.ptp(modes.frequencies_hz[[0, 1]]) < spread * modes.frequencies_hz[0]
        assert modes.shapes @ (beam.mass @ modes.shapes.T) == pytest.approx(np.eye(7), abs=1e-12)
        y, z = effective_masses(modes, beam)[:2, 1:].T
        assert y.sum() == pytest.approx(z.sum(), rel=1e-4)
        if width != 0.05:
            assert np.ptp(modes.frequencies_hz[[0, 1]]) > 1e-6 * modes.frequencies_hz[0]
            assert y == pytest.approx([0.0, y.sum()], abs=1e-3 * y.sum())


def test_free_block_has_six_rigid_modes(free_block):
    modes = solve_modes(free_block, 9)
    stiffness, mass = (matrix.toarray() for matrix in free_pair(free_block))
    eigenvalues = linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=(6, 8))
    assert modes.frequencies_hz[6:] == pytest.approx(np.sqrt(eigenvalues) / (2 * np.pi), rel=1e-8)
    assert modes.frequencies_hz[:6].max() < 1e-3
    assert modes.shapes @ (free_block.mass @ modes.shapes.T) == pytest.approx(np.eye(9), abs=1e-12)
    assert modes.residuals.max() < 1e-8
    rigid = modes.shapes[:6]
    for translation in free_block.rigid_translations().T:
        projected = rigid.T @ (rigid @ (free_block.mass @ translation))
        assert projected == pytest.approx(translation, abs=1e-6)


@pytest.mark.parametrize("count", [1, 3, 6, 7])
def test_some_of_the_rigid_modes(free_block, count):
    assert np.count_nonzero(solve_modes(free_block, count).frequencies_hz < 1e-3) == min(count, 6)


def test_a_body_on_rollers_keeps_three_rigid_modes(tmp_path):
    block = TaperedBlock(0.4, 0.15, 0.1, divisions=(3, 2, 1), hexahedra=True)
    sliding = solve_modes(matrices_of(block, tmp_path, {"bottom": "z"}), 5).frequencies_hz
    assert np.all(sliding[:3] < 1e-3)
    assert sliding[3] > 100.0


@pytest.mark.parametrize("count", [0, -1, 10**6])
def test_refuses_counts(beam, count):
    with pytest.raises(SolverError, match="count: expected 1 to"):
        solve_modes(beam, count)


def test_matrices_beyond_the_arithmetic_are_refused(monkeypatch, beam):
    """As of a disk with a thickness of 1e-11 m: round-off decides the signs that the factors count."""
    monkeypatch.setattr(petsc, "negative_eigenvalues", lambda matrix: 0)
    with pytest.raises(SolverError, match="modes found where the factors count 0: round-off"):
        solve_modes(beam, 2)


def test_a_single_mass(tmp_path):
    point = SystemMatrices(4.0 * np.eye(3), np.eye(3), np.zeros((1, 3)), [0, 2], {}, 0.0)
    assert solve_modes(point, 1).angular_frequencies == pytest.approx([2.0], rel=1e-12)


def test_factorization_solves_one_and_many(beam):
    stiffness, _ = free_pair(beam)
    rhs = np.random.default_rng(1).standard_normal((stiffness.shape[0], 3))
    expected = spsolve(stiffness.tocsc(), rhs)
    with factorize(stiffness) as factors:
        assert factors.solve(rhs) == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
        assert factors.solve(rhs[:, 1]) == pytest.approx(expected[:, 1], abs=1e-8 * np.abs(expected).max())
        with pytest.raises(SolverError, match="rhs: expected shape"):
            factors.solve(rhs[:-1])


def test_factorization_refuses_a_free_structure(free_block):
    with pytest.raises(SolverError, match="singular"):
        factorize(free_block.stiffness)


def test_round_trip(beam, tmp_path):
    modes = solve_modes(beam, 3)
    modes.save(tmp_path / "modes.h5")
    again = Modes.load(tmp_path / "modes.h5")
    for name in ("frequencies_hz", "shapes", "residuals"):
        assert np.array_equal(getattr(again, name), getattr(modes, name))
    assert again.provenance == modes.provenance and beam.provenance.items() <= modes.provenance.items()


@pytest.mark.parametrize("hexahedra", [False, True])
@pytest.mark.parametrize("degree", [1, 2])
def test_bar_converges_at_the_rate_of_its_degree(tmp_path, degree, hexahedra):
    """Longitudinal modes of a clamped-free bar, f = sqrt(E/rho) / (4 L), Poisson's ratio zero and sides on rollers."""
    clamped = {"root": "xyz", "left": "yz", "right": "yz", "bottom": "yz", "top": "yz"}
    errors = []
    for cells in (2, 4, 8):
        block = TaperedBlock(1.0, 0.1, 0.1, divisions=(cells, 1, 1), hexahedra=hexahedra)
        bar = matrices_of(block, tmp_path, clamped, Material(1.0, 0.0, 1.0), degree)
        errors.append(solve_modes(bar, 1).frequencies_hz[0] / 0.25 - 1.0)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert min(errors) > 0.0
    assert rates == pytest.approx(2.0 * degree, abs=0.3)
    assert errors[-1] < (2e-3 if degree == 1 else 1.1e-6)


def timoshenko_cantilever(length, side, young, density, shear_factor):
    """First frequency (Hz) of a square cantilever with Poisson's ratio zero, from its first-order system."""
    area, second_moment = side**2, side**4 / 12.0

    def determinant(omega):
        system = np.array(
            [
                [0.0, 1.0, 0.0, 1.0 / (shear_factor * 0.5 * young * area)],
                [0.0, 0.0, 1.0 / (young * second_moment), 0.0],
                [0.0, -density * second_moment * omega**2, 0.0, -1.0],
                [-density * area * omega**2, 0.0, 0.0, 0.0],
            ]
        )
        return linalg.det(linalg.expm(system * length)[2:, 2:])

    slender = 1.8751040687**2 * np.sqrt(young * second_moment / (density * area)) / length**2
    return optimize.brentq(determinant, 0.9 * slender, 1.01 * slender) / (2 * np.pi)


def test_cantilever_beam_converges_to_timoshenko(tmp_path):
    exact = timoshenko_cantilever(1.0, 0.1, 1.0, 1.0, 5.0 / 6.0)
    errors = []
    for cells in (4, 8, 16):
        block = TaperedBlock(1.0, 0.1, 0.1, divisions=(cells, 2, 2), hexahedra=True)
        beam = matrices_of(block, tmp_path, {"root": "xyz"}, Material(1.0, 0.0, 1.0))
        modes = solve_modes(beam, 4)
        first = first_bending(modes, beam, [0, 1, 0])
        errors.append(modes.frequencies_hz[first] / exact - 1.0)
    # Euler and Bernoulli's share, (2 sigma / lambda)^2; the square section turns the pair of modes at will
    pair = effective_masses(modes, beam)[:2, 1].sum()
    assert pair / beam.total_mass == pytest.approx((2.0 * 0.7340955 / 1.8751041) ** 2, rel=5e-3)
    assert errors[0] > errors[1] > errors[2]
    assert abs(errors[2]) < 1e-3


def test_one_analysis_serves_matrices_of_one_pattern():
    """Inertia and solutions are those of each matrix, also after another pattern, and one that CHOLMOD cannot take."""
    random = np.random.default_rng(0)
    base = np.where(random.random((40, 40)) < 0.1, random.random((40, 40)), 0.0)
    pattern = sparse.csr_array(base + base.T + 40.0 * sparse.identity(40))
    load = random.standard_normal(40)
    with one_analysis():
        for shift, other in ((0.0, 0.0), (-3.0, 0.0), (39.5, 0.0), (55.0, 0.0), (0.0, 1.0), (0.0, 0.0)):
            matrix = sparse.csr_array(pattern - shift * sparse.identity(40))
            matrix = sparse.csr_array(
                matrix + other * sparse.csr_array(([1.0, 1.0], ([0, 39], [39, 0])), shape=(40, 40))
            )
            known = linalg.eigvalsh(matrix.toarray())
            assert np.all(matrix.diagonal() > 0.0) or shift == 55.0
            assert negative_eigenvalues(matrix) == np.count_nonzero(known < 0.0)
            with factorize(matrix) as factors:
                assert matrix @ factors.solve(load) == pytest.approx(load, abs=1e-10)


@pytest.mark.skipif(not petsc.has_cholmod(), reason="PETSc without SuiteSparse")
@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
def test_one_thread_is_one_thread():
    words = [sys.executable, "-c", THREADS_OF_A_FACTORISATION]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment(OMP_NUM_THREADS="1"))
    before, after = done.stdout.split()
    assert after == before


def test_factors_keep_nothing_of_their_matrix():
    """PETSc reads a matrix where it is: a factor is that of the entries at its time, whatever becomes of them."""
    random = np.random.default_rng(0)
    matrix = sparse.csr_array(sparse.diags([-1.0, 2.5, -1.0], [-1, 0, 1], shape=(60, 60)))
    known, dense = random.standard_normal(60), matrix.toarray()
    for direct in ("cholmod", "mumps") if petsc.has_cholmod() else ("mumps",):
        given = matrix.copy()
        with petsc.Factorization(given, direct) as factors:
            given.data[:] = np.nan
            given.indices[:] = 0
            del given
            assert factors.solve(dense @ known) == pytest.approx(known, abs=1e-12)
