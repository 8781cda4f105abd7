"""The estimate of a reduction's error against the true one, and the choice of the number of modes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from tests.tools.reduction_errors import full_receptance, receptance_errors
from tests.tools.small_structures import rod, truss
from vanedamp.rom import error_estimate as ladder
from vanedamp.rom.bases.projection import superlu
from vanedamp.rom.basis import BASES, BLOCKS, basis_ladder, basis_named
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import truncated

ENDS = [InterfaceCoordinate("a", "a", (0, 1, 0)), InterfaceCoordinate("c", "c", (0, 1, 0))]


@pytest.fixture(scope="module")
def coarse():
    """The shipped cluster in degree 1 with its interface, 8 frequencies and its receptance there."""
    from vanedamp.meshes.vane_cluster import SHIPPED
    from vanedamp.modal.eigen import factorize, solve_modes
    from vanedamp.modal.elasticity import Material, assemble

    material = Material(young=2.0e11, poisson=0.3, density=8190.0)
    matrices = assemble(SHIPPED, {"default": material}, {"clamp": "xyz"}, degree=1, damping_ratio=0.0)
    labels = ("c1_left", "c1_floor", "shroud")
    interface = Interface.on_patches(matrices, [InterfaceCoordinate(label, label, (0, 1, 0)) for label in labels])
    first, second, third = solve_modes(matrices, 3).frequencies_hz
    frequencies = np.array([0.3 * first, 0.97 * first, 1.002 * first, 1.5 * first, 1.01 * second, 1.2 * third])
    return matrices, interface, frequencies, full_receptance(matrices, interface, frequencies, factorize)


def within_five(rich, basis, frequencies, reference, counts):
    """Assert that the estimate is within a factor of five of the true error, frequency by frequency."""
    compared = 0
    for modes in counts:
        model = basis_named(basis).cut(rich, modes)
        truth = receptance_errors(model, frequencies, reference)
        estimate = ladder.frf_errors(model, rich if basis == "massless" else truncated(rich, modes), frequencies)
        seen = truth > 1e-9  # what round-off leaves of the reference
        assert np.all(estimate[seen] < 5 * truth[seen]), (basis, modes)
        assert np.all(estimate[seen] > truth[seen] / 5), (basis, modes)
        compared += seen.sum()
    assert compared >= len(counts) * len(frequencies) / 2


@pytest.mark.parametrize("basis", BASES.names())
def test_estimate_over_forty_modes_of_the_cluster(coarse, basis):
    from vanedamp.modal.eigen import factorize

    matrices, interface, frequencies, reference = coarse
    rich = basis_named(basis).rich(matrices, interface, 40, factorize, 1 + BLOCKS)
    least = {"craig-bampton": 0, "rubin": 0}.get(basis, 1)
    # plain modes below the excitation leave errors of whole modes, which no local correction sees
    counts = [modes for modes in (0, 1, 2, 3, 5, 8, 12, 20, 30, 40) if modes >= least]
    within_five(rich, basis, frequencies, reference, counts)


@pytest.mark.parametrize("basis", BASES.names())
def test_estimate_of_a_rod(basis):
    interface = Interface.on_patches(rod(), [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    frequencies = np.array([0.1, 0.3, 0.6, 0.7])
    omega = 2 * np.pi * frequencies
    rich = basis_named(basis).rich(rod(), interface, 12, superlu, 1 + BLOCKS)
    within_five(rich, basis, frequencies, (np.tan(omega) / omega)[:, None, None], range(1, 12))


def test_choice_is_the_smallest_that_stays_within():
    errors = [1.0, 0.02, 0.3, 0.04, 0.005, 0.001]
    rungs = [ladder.Rung(modes, modes, error, 0.0) for modes, error in enumerate(errors, 1)]
    choice = ladder.choose(rungs, 0.05, rigid=0.06)
    assert choice.chosen.modes == 4
    assert choice.sentence == "4 modes: estimated error 4 %, rigid model 6 %"
    assert "rigid model 140 % (its coordinates move alike" in ladder.choose(rungs, 0.05, rigid=1.4).sentence
    assert choice.met
    assert choice.to_json()["rigid"] == 0.06
    # where a rigid model is no worse, the sentence says what the modes are for
    assert ladder.choose(rungs, 0.05, rigid=0.04).sentence.endswith("for higher frequencies and for impacts)")
    missed = ladder.choose(rungs[:3], 0.01, rigid=0.06)
    assert not missed.met
    assert "none within the tolerance of 1 %" in missed.sentence
    with pytest.raises(ladder.LadderError, match="tolerance: expected a relative error between 0 and 1"):
        ladder.choose(rungs, 0.0, 1.0)


def test_choice_keeps_its_promise():
    matrices = replace(truss(), damping_ratio=0.01)
    interface = Interface.on_patches(matrices, ENDS)
    every = reduce(matrices, interface, modes=28)
    rich = basis_named("craig-bampton").rich(matrices, interface, 20, superlu, 1 + BLOCKS)
    frequencies = ladder.frequency_grid(rich, 0.0, 2.0 * rich.natural_frequencies_hz[0])
    rungs = basis_ladder(rich, "craig-bampton", frequencies)
    for tolerance in (0.1, 1e-2, 1e-4):
        choice = ladder.choose(rungs, tolerance, 1.0)
        chosen = choice.chosen.modes
        assert choice.met
        true = receptance_errors(truncated(rich, chosen, 1), frequencies, every.receptance(frequencies))
        assert true.max() < 1.01 * tolerance


def test_natural_ladder_ends_at_the_whole_model():
    matrices = replace(truss(), damping_ratio=0.01)
    whole = reduce(matrices, Interface.on_patches(matrices, ENDS), modes=6)
    frequencies = ladder.frequency_grid(whole, 0.0, 0.1)
    rungs = ladder.natural_ladder(whole, frequencies, ["a"])
    assert rungs[-1].receptance < 1e-12
    assert [rung.modes for rung in rungs] == list(range(1, whole.size + 1))
    # by hand: the first mode alone
    squares, shapes = linalg.eigh(whole.stiffness, whole.mass)
    row = whole.row("a") @ shapes
    gains = row**2 / (squares - (w := 2 * np.pi * frequencies[:, None]) ** 2 + 0.02j * w * np.sqrt(squares))
    assert rungs[0].receptance == pytest.approx(np.abs(gains[:, 1:].sum(1) / gains.sum(1)).max(), rel=1e-8)
    assert ladder.rigid_errors(whole, frequencies, "a", ["a"]).max() == pytest.approx(rungs[0].receptance, rel=1e-8)


@pytest.mark.parametrize("ratio", [0.0, 0.01])
def test_frequencies_of_comparison_hold_resonances_that_have_a_height(ratio):
    """Without damping the receptance has no value at a natural frequency, or one that round-off makes."""
    model = ReducedModel.from_matrices(np.eye(2), np.diag([1.0, 9.0]), {"tip": [1.0, 1.0]}, damping_ratio=ratio)
    found = np.isin(model.natural_frequencies_hz, ladder.frequency_grid(model, 0.01, 1.0))
    assert np.all(found == (ratio > 0.0))
