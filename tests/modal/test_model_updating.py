"""Detuned moduli and supports are found again; the sensitivities are the derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tests.tools.small_structures import truss
from tests.tools.tiers import cases
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.correlation import MeasuredShapes, observed_shapes
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.elasticity import ElasticSupport, Material, Solid
from vanedamp.modal.model_updating import TuningError, sensitivities, tune

STEEL = Material(young=2.0e11, poisson=0.3, density=8190.0)


def springs(matrices, nodes, stiffness):
    """Springs to the ground at nodes, along all axes."""
    diagonal = np.zeros((len(matrices.coordinates), 3))
    diagonal[nodes] = stiffness
    return sparse.csr_array(sparse.diags(diagonal.ravel()))


@pytest.fixture(scope="module")
def system():
    """A truss on springs: its own stiffness and the springs are the parts."""
    bare = truss(nodes=16, held=0)
    parts = {"material.rods": bare.stiffness, "support.feet": springs(bare, [0, 1, 2, 3], [0.3, 0.5, 0.4])}
    return replace(bare, stiffness=sum(parts.values())), parts


def stretched(system, factors):
    matrices, parts = system
    return replace(matrices, stiffness=sum(f * part for f, part in zip(factors, parts.values(), strict=True)))


def test_sensitivities_are_derivatives(system):
    """Central differences of log f; and they sum to one half, since all stiffness scales the frequencies' squares."""
    matrices, parts = system
    modes, step = solve_modes(matrices, 8), 1e-5
    found = sensitivities(modes, parts)
    for column in range(2):
        factors = [np.ones(2) + sign * step * np.eye(2)[column] for sign in (1, -1)]
        up, down = (solve_modes(stretched(system, f), 8).frequencies_hz for f in factors)
        assert found[:, column] == pytest.approx(np.log(up / down) / (2 * step), rel=1e-5, abs=1e-8)
    assert found.sum(axis=1) == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("factors", [(1.2, 0.7), (0.8, 3.0), (1.0, 0.3)])
def test_three_frequencies_give_modulus_and_support(system, factors):
    matrices, parts = system
    target = solve_modes(stretched(system, factors), 3).frequencies_hz
    tuned = tune(matrices, parts, target)
    assert tuned.factors == pytest.approx(factors, rel=1e-3)
    assert tuned.after_hz == pytest.approx(target, rel=1e-6)
    assert np.abs(tuned.before_hz / target - 1).max() > 0.05
    assert np.all(tuned.deviations > 0.0)
    assert solve_modes(tuned.matrices, 3).frequencies_hz == pytest.approx(target, rel=1e-6)


@pytest.mark.parametrize("draws", cases([12, 40], fast=[12]))
def test_deviations_are_those_of_noisy_frequencies(system, draws):
    matrices, parts = system
    exact = solve_modes(stretched(system, (1.1, 0.8)), 6).frequencies_hz
    rng = np.random.default_rng(2)
    found = [tune(matrices, parts, exact * (1 + 1e-3 * rng.standard_normal(6))) for _ in range(draws)]
    scatter = np.std([np.log(t.factors) for t in found], axis=0)
    assert scatter == pytest.approx(found[0].deviations, rel=0.4)


def test_measured_shapes_say_which_frequency_is_whose(system):
    """Targets in another order, flipped and noisy shapes, one mode not measured."""
    matrices, parts = system
    true = stretched(system, (1.3, 0.6))
    modes, order = solve_modes(true, 6), [4, 0, 3, 1]
    rng = np.random.default_rng(0)
    points = np.repeat(matrices.coordinates[:10], 3, axis=0)
    bare = MeasuredShapes(points, np.tile(np.eye(3), (10, 1)), np.ones((1, 30)))
    shapes = observed_shapes(modes, true, bare)[order]
    shapes = shapes * rng.choice([-2.0, 3.0], (4, 1)) + 0.05 * shapes.std() * rng.standard_normal(shapes.shape)
    measured = MeasuredShapes(points, bare.directions, shapes)
    tuned = tune(matrices, parts, modes.frequencies_hz[order], measured)
    assert tuned.factors == pytest.approx([1.3, 0.6], rel=1e-3)
    assert tuned.modes_after.tolist() == order
    assert tuned.mac_after.min() > 0.9


def test_further_starts_leave_a_local_optimum():
    """Stiffer feet make two modes veer: from the untuned system the search ends where the misfit is half a percent."""
    bare = truss(nodes=16, held=0)
    parts = {"material.rods": bare.stiffness, "support.feet": springs(bare, [0, 1, 2, 3], [3.0, 5.0, 4.0])}
    matrices = replace(bare, stiffness=sum(parts.values()))
    target = solve_modes(stretched((matrices, parts), (1.2, 0.7)), 3).frequencies_hz
    assert np.abs(tune(matrices, parts, target).after_hz / target - 1).max() > 5e-3
    assert tune(matrices, parts, target, starts=8).factors == pytest.approx([1.2, 0.7], rel=1e-3)


@pytest.mark.parametrize("true", [[0, 2, 3], [2, 4, 6], [0, 3]])
def test_frequencies_of_other_modes_are_refused_and_named(system, true):
    """The first modes are meant unless named; measured were others, which meet the frequencies as they are."""
    matrices, parts = system
    target = solve_modes(matrices, 8).frequencies_hz[true]
    names = ", ".join(map(str, true))
    with pytest.raises(TuningError, match=rf"modes: \[{names}\] meet .* with factors 1, 1, modes .* say which modes"):
        tune(matrices, parts, target)
    assert tune(matrices, parts, target, modes=true).factors == pytest.approx([1.0, 1.0], rel=1e-9)


def test_frequencies_that_no_modes_meet_are_refused(system):
    """Modes 0, 2 and 3 of a structure whose feet are softer: no order of the modes at hand explains them."""
    matrices, parts = system
    target = solve_modes(stretched(system, (1.2, 0.7)), 4).frequencies_hz
    with pytest.raises(TuningError, match=r"tuned modes .* lie at .* off the measured .* by \+7\.9%, -8\.1%"):
        tune(matrices, parts, target[[0, 2, 3]])
    feet = {"support.feet": parts["support.feet"]}
    (warning,) = tune(matrices, feet, solve_modes(matrices, 3).frequencies_hz * [1.02, 0.985, 1.0]).warnings
    assert "off the measured" in warning
    assert "more than measurements scatter" in warning


def test_one_factor_meets_one_frequency_with_any_mode(system):
    """The second mode's frequency taken as the first one's: the factor is met exactly, and so is one without change."""
    matrices, _ = system
    whole = {"all": matrices.stiffness}
    first, second = solve_modes(matrices, 2).frequencies_hz
    with pytest.raises(TuningError, match=r"modes: \[1\] meet"):
        tune(matrices, whole, [second])
    named = tune(matrices, whole, [second], modes=[0])
    assert named.factors == pytest.approx([(second / first) ** 2], rel=1e-6)
    assert "modes: [1] meet" in named.warnings[0]
    assert not tune(matrices, whole, [1.02 * first]).warnings


@pytest.mark.parametrize("starts", [1, 3])
def test_one_factor_on_the_whole_stiffness_is_a_closed_form(system, starts):
    """Frequencies rise by the root of the factor: one eigenvalue problem, and another one confirms it."""
    matrices, _ = system
    before = solve_modes(matrices, 3).frequencies_hz
    found = tune(matrices, {"all": matrices.stiffness}, [1.1 * before[0], 1.1 * before[2]], modes=[0, 2], starts=starts)
    assert found.evaluations == 1
    assert found.factors == pytest.approx([1.21], rel=1e-9)
    confirmed = solve_modes(found.matrices, 3).frequencies_hz
    assert found.after_hz == pytest.approx(confirmed[[0, 2]], rel=1e-9)
    assert found.sensitivities == pytest.approx(
        sensitivities(solve_modes(found.matrices, 3), {"all": found.matrices.stiffness}, [0, 2])
    )


def test_modes_that_cross_are_followed():
    """Bending about two axes on springs of their own: stiffening one moves its mode past the other's."""
    bare = truss(nodes=14, held=13, seed=1)
    base = replace(bare, stiffness=springs(bare, [13], [400.0, 500.0, 900.0]))
    part = springs(bare, [13], [400.0, 0.0, 0.0])
    first, second, _ = solve_modes(base, 3).frequencies_hz
    tuned = tune(base, {"support.x": part}, [first * np.sqrt(1.6), second], modes=[0, 1])
    assert tuned.factors == pytest.approx([1.6], rel=1e-6)
    assert tuned.modes_after.tolist() == [1, 0]


@pytest.mark.parametrize("starts", [1, 2])
def test_a_search_that_was_stopped_anywhere_resumes_bit_for_bit(system, starts):
    """With starts of its own it goes back to the untuned modes in between."""
    matrices, parts = system
    target = solve_modes(stretched(system, (1.2, 0.7)), 3).frequencies_hz
    all_kept = []

    def recorded(solve):
        all_kept.append(solve())
        return all_kept[-1]

    whole = tune(matrices, parts, target, starts=starts, keep=recorded)
    assert len(all_kept) == whole.evaluations > 4
    for number in range(1, len(all_kept) + 1):
        waiting = all_kept[:number]
        resumed = tune(
            matrices, parts, target, starts=starts, keep=lambda solve, kept=waiting: kept.pop(0) if kept else solve()
        )
        for name in ("factors", "deviations", "after_hz", "mac_after", "sensitivities", "modes_after"):
            np.testing.assert_array_equal(getattr(resumed, name), getattr(whole, name))


def test_a_beam_with_an_elastic_clamp(tmp_path):
    """Finite elements: Young's modulus and the springs of the root from three frequencies, to 0.1 %."""
    path = build(TaperedBlock(0.1, 0.02, 0.01, divisions=(6, 1, 1), hexahedra=True), tmp_path / "b.msh")
    solid = Solid(path, {"default": STEEL}, elastic={"root": ElasticSupport((5e12, 5e12, 5e12))})
    matrices, parts = solid.assemble({}, 0.0), solid.stiffness_parts()
    true = sum(f * parts[name] for name, f in (("material.block", 0.93), ("support.root", 0.4)))
    target = solve_modes(replace(matrices, stiffness=sparse.csr_array(true)), 3).frequencies_hz
    tuned = tune(matrices, parts, target)
    assert dict(zip(tuned.names, tuned.factors, strict=True)) == pytest.approx(
        {"material.block": 0.93, "support.root": 0.4}, rel=1e-3
    )


def test_refuses_what_determines_nothing(system):
    matrices, parts = system
    target = solve_modes(matrices, 3).frequencies_hz
    for arguments, message in [
        ((parts, target[:1]), "parts: 2 factors .* from 1 frequencies"),
        (({}, target), "parts: 0 factors"),
        ((parts, [-1.0, 2.0]), "target_hz: expected positive"),
        (({"all": matrices.stiffness, "again": 2.0 * matrices.stiffness}, target), "all, again change .* the same way"),
        (({"far": 0.0 * matrices.stiffness}, target), "far: does not change these frequencies"),
        (({"small": sparse.csr_array(np.eye(3))}, target), "small: shape"),
        (({"support.feet": parts["support.feet"]}, 9.0 * target), "support.feet: its factor runs to"),
    ]:
        with pytest.raises(TuningError, match=message):
            tune(matrices, *arguments)
    with pytest.raises(TuningError, match="modes: expected 3 different indices"):
        tune(matrices, parts, target, modes=[0, 0, 1])
