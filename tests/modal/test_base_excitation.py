"""On a shaker: modes with a static correction against the direct solve of the full equations, and closed forms."""

import numpy as np
import pytest
from scipy import linalg
from scipy.sparse.linalg import spsolve

from tests.tools.small_structures import rod
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.base_excitation import BaseExcitationError, base_response
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import Material, assemble
from vanedamp.modal.matrices import patch_average
from vanedamp.modal.records.modes import Modes

STEEL = Material(young=2.1e11, poisson=0.3, density=7800.0)
RATIO = 0.01


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    block = TaperedBlock(0.3, 0.03, 0.02, divisions=(6, 1, 1), hexahedra=True)
    path = build(block, tmp_path_factory.mktemp("beam") / "b.msh")
    return assemble(path, {"default": STEEL}, {"root": "xyz"}, damping_ratio=RATIO)


def direct(matrices, functionals, direction, frequencies, beta):
    """(K + i w beta K - w^2 M) q = -M r, solved at every frequency."""
    free = matrices.free
    stiffness, mass = (matrix[free][:, free] for matrix in (matrices.stiffness, matrices.mass))
    translation = matrices.rigid_translations() @ np.asarray(direction, dtype=float)
    load = -(matrices.mass @ translation)[free].astype(complex)
    found = [
        functionals[free].T @ spsolve(((1 + 1j * w * beta) * stiffness - w**2 * mass).tocsc(), load)
        for w in 2 * np.pi * frequencies
    ]
    relative = np.array(found).T
    return relative, (functionals.T @ translation)[:, None] - (2 * np.pi * frequencies) ** 2 * relative


@pytest.mark.parametrize("direction", [[0, 0, 1], [0, 1, 0]])
def test_few_modes_and_the_correction_equal_the_direct_solve(beam, direction):
    """Relative displacement and transmissibility from below the first mode to beyond the second, stiffness damping."""
    functionals = np.column_stack([patch_average(beam, name, direction) for name in ("tip", "top")])
    modes = solve_modes(beam, 10)
    beta = 2 * RATIO / modes.angular_frequencies[0]
    first = modes.frequencies_hz[0]
    frequencies = np.concatenate([np.linspace(0.1, 3.0, 12), [1.0]]) * first
    exact = direct(beam, functionals, direction, frequencies, beta)
    ratios = 0.5 * beta * modes.angular_frequencies
    found = base_response(modes, beam, functionals, direction, frequencies, ratios)
    for ours, theirs in zip((found.relative, found.transmissibility), exact, strict=True):
        assert np.abs(ours - theirs).max() < 1e-4 * np.abs(theirs).max()
        assert np.abs(ours / theirs - 1).max() < 5e-3
    bare = base_response(modes, beam, functionals, direction, frequencies, ratios, static_correction=False)
    worst = [np.abs(r.relative / exact[0] - 1).max() for r in (found, bare)]
    assert worst[0] < 0.1 * worst[1]


def test_all_modes_are_exact(beam):
    modes = solve_modes(beam, beam.free.size)
    tip = patch_average(beam, "tip", [0, 0, 1])
    frequencies = np.array([0.3, 0.99, 1.0, 4.0]) * modes.frequencies_hz[0]
    beta = 2 * RATIO / modes.angular_frequencies[0]
    found = base_response(modes, beam, tip, [0, 0, 1], frequencies, 0.5 * beta * modes.angular_frequencies, False)
    exact, _ = direct(beam, tip[:, None], [0, 0, 1], frequencies, beta)
    assert np.abs(found.relative / exact - 1).max() < 1e-6


def test_static_limit_is_exact_with_one_mode(beam):
    """At rest the structure moves with the base, and lags by the static shape under -M r."""
    tip = patch_average(beam, "tip", [0, 0, 1])
    found = base_response(solve_modes(beam, 1), beam, tip, [0, 0, 1], [0.0])
    exact, _ = direct(beam, tip[:, None], [0, 0, 1], np.zeros(1), 0.0)
    assert found.relative[0, 0] == pytest.approx(exact[0, 0], rel=1e-9)
    assert found.transmissibility[0, 0] == pytest.approx(1.0, rel=1e-14)


def test_transmissibility_of_a_rod_in_closed_form():
    """A clamped unit rod, undamped: u(1)/u(0) = 1/cos(w) (Graff 1975, section 2.4)."""
    system = rod(40)
    free = system.free
    values, vectors = linalg.eigh(*(m[free][:, free].toarray() for m in (system.stiffness, system.mass)))
    shapes = np.zeros((8, system.size))
    shapes[:, free] = vectors[:, :8].T
    modes = Modes(np.sqrt(values[:8]) / (2 * np.pi), shapes, np.zeros(8))
    tip = patch_average(system, "tip", [1, 0, 0])
    frequencies = np.array([0.05, 0.15, 0.4, 0.6])
    found = base_response(modes, system, tip, [1, 0, 0], frequencies)
    assert found.transmissibility[0] == pytest.approx(1 / np.cos(2 * np.pi * frequencies), rel=2e-4)


def test_refuses_what_is_not_held(beam):
    tip = patch_average(beam, "tip", [0, 0, 1])
    free = Modes([0.0, 10.0], np.ones((2, beam.size)), [0.0, 0.0])
    with pytest.raises(BaseExcitationError, match="modes: the structure has rigid motions"):
        base_response(free, beam, tip, [0, 0, 1], [1.0])
    with pytest.raises(BaseExcitationError, match="frequencies_hz"):
        base_response(solve_modes(beam, 1), beam, tip, [0, 0, 1], [-1.0])
