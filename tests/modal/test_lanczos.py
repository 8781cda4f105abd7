"""Block Lanczos against closed forms: a rod's frequencies, multiple eigenvalues, shifts inside, restarts."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import splu

from vanedamp.modal import lanczos
from vanedamp.modal.lanczos import NotConvergedError, directions, eigenpairs

SIZE = 600
COPIES = lanczos.block(10)


def rod(size=SIZE):
    """Return stiffness and consistent mass of linear elements of unit length, held at both ends, and eigenvalues."""
    stiffness = sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(size, size), format="csr")
    mass = sparse.diags([1.0, 4.0, 1.0], [-1, 0, 1], shape=(size, size), format="csr") / 6.0
    cosines = np.cos(np.pi * np.arange(1, size + 1) / (size + 1))
    return stiffness, mass, 6.0 * (1.0 - cosines) / (2.0 + cosines)


def inverse(stiffness, mass, shift):
    factor = splu(sparse.csc_matrix(stiffness - shift * mass))
    return lambda rows: factor.solve(np.ascontiguousarray(rows.T)).T


def check(stiffness, mass, values, vectors, tolerance=1e-8):
    inertia = (mass @ vectors.T).T
    assert np.abs(vectors @ inertia.T - np.eye(len(values))).max() < 1e-10
    defects = np.linalg.norm((stiffness @ vectors.T).T - values[:, None] * inertia, axis=1)
    assert np.all(defects < tolerance * np.abs(values) * np.linalg.norm(inertia, axis=1))


def test_lowest_eigenpairs_of_a_rod():
    stiffness, mass, exact = rod()
    values, vectors = eigenpairs(inverse(stiffness, mass, 0.0), mass, 10)
    assert values == pytest.approx(exact[:10], rel=1e-10)
    check(stiffness, mass, values, vectors)


def test_shift_inside_the_spectrum():
    stiffness, mass, exact = rod()
    shift = 0.7 * exact[20] + 0.3 * exact[21]  # nothing is as near as another, not even the last that is wanted
    values, vectors = eigenpairs(inverse(stiffness, mass, shift), mass, 8, shift)
    nearest = exact[np.argsort(np.abs(exact - shift))[:8]]
    assert values == pytest.approx(nearest, rel=1e-10)
    check(stiffness, mass, values, vectors)


def test_all_copies_of_multiple_eigenvalues():
    """Equal rods beside each other: as many copies as right-hand sides in a block."""
    stiffness, mass, exact = rod()
    stiffness, mass = (sparse.csr_matrix(sparse.kron(sparse.eye(COPIES), each)) for each in (stiffness, mass))
    values, vectors = eigenpairs(inverse(stiffness, mass, 0.0), mass, 10)
    assert values == pytest.approx(np.repeat(exact[:3], COPIES)[:10], rel=1e-10)
    check(stiffness, mass, values, vectors)


def test_a_full_space_restarts_with_what_it_has(monkeypatch):
    stiffness, mass, exact = rod()
    solves = []

    def counted(rows):
        solves.append(len(rows))
        return solve(rows)

    solve = inverse(stiffness, mass, 0.0)
    monkeypatch.setattr(lanczos, "directions", lambda count, _width=0: count + 4 * COPIES)
    values, vectors = eigenpairs(counted, mass, 12)
    assert sum(solves) > lanczos.directions(12)
    assert values == pytest.approx(exact[:12], rel=1e-10)
    check(stiffness, mass, values, vectors)


def test_spare_pairs_have_half_the_digits():
    """Their eigenvalues have all of them: the error is that of the vector squared."""
    stiffness, mass, exact = rod()
    values, vectors = eigenpairs(inverse(stiffness, mass, 0.0), mass, 6, spare=6)
    assert values == pytest.approx(exact[:12], rel=1e-9)
    check(stiffness, mass, values[:6], vectors[:6])
    check(stiffness, mass, values, vectors, 1e-3)


def test_a_space_that_is_invariant_at_once():
    """A mass with three eigenvalues only: every block after the third depends on those before."""
    size = 3 * directions(10)
    values = np.repeat([1.0, 2.0, 5.0], [3, 3, size - 6])
    matrix = sparse.diags(values, format="csr")
    found, vectors = eigenpairs(lambda rows: rows / values, sparse.eye(size, format="csr"), 6)
    assert found == pytest.approx(values[:6], rel=1e-12)
    check(matrix, sparse.eye(size), found, vectors)


def test_a_space_that_runs_out_of_directions():
    """Two eigenvalues, 200 and 400 times: a start reaches a block of copies of each, then another one is made.

    That copies are left is for a count of the eigenvalues to say (modal.eigen).
    """
    stiffness = sparse.diags(np.repeat([1.0, 2.0], [200, 400]), format="csr")
    mass = sparse.identity(SIZE, format="csr")
    values, vectors = eigenpairs(inverse(stiffness, mass, 0.0), mass, 20)
    assert values == pytest.approx(np.repeat([1.0, 2.0], 10), rel=1e-10)
    check(stiffness, mass, values, vectors)


def test_too_little_time(monkeypatch):
    stiffness, mass, _ = rod()
    monkeypatch.setattr(lanczos, "_RESTARTS", 1)
    monkeypatch.setattr(lanczos, "directions", lambda count, _width=0: count + COPIES)
    with pytest.raises(NotConvergedError, match="of 12 modes converged"):
        eigenpairs(inverse(stiffness, mass, 0.0), mass, 12)
