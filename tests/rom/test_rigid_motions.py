"""Supported and free structures told apart by round-off, whatever the spread of their frequencies and their units."""

import numpy as np
import pytest

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.modal_basis import modal_basis
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.dense_modes import rounding, spectrum
from vanedamp.rom.external import external_model
from vanedamp.rom.reduced import ReducedModel

# SI; N, mm and t; both of one structure
UNITS = {"SI": (1.0, 1.0), "mm": (1e-3, 1e-3)}


def model(mass, stiffness, units="SI", ratio=0.05):
    size = len(mass)
    rows = {"first": np.eye(size)[0], "last": np.eye(size)[-1]}
    per_mass, per_stiffness = UNITS[units]
    return external_model(
        np.array(mass) * per_mass, np.array(stiffness) * per_stiffness, rows, damping_ratio=ratio
    )  # fmt: skip


def chain(ground, springs):
    """Stiffness of masses in a row, the first one held by `ground`."""
    size = len(springs) + 1
    stiffness = np.zeros((size, size))
    stiffness[0, 0] = ground
    for index, spring in enumerate(springs):
        at = np.ix_([index, index + 1], [index, index + 1])
        stiffness[at] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return stiffness


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("light", [1e-12, 1e-15])
def test_a_soft_support_beside_a_light_mass_runs(tmp_path, units, light):
    """A light mass on the end: f_1 / f_max of 1e-6 and less; closed form: the response of one mass on its spring.

    The light mass changes the first square frequency by its share of the mass, 1e-12 and less, alone.
    """
    made, findings = model(np.diag([1.0, light]), chain(1.0, [1.0]), units)
    assert findings.rigid_motions == 0
    assert made.natural_frequencies_hz[0] / made.natural_frequencies_hz[-1] < 1.1e-6
    assert modal_basis(made).stiffness[0] == pytest.approx(1.0, rel=1e-11)
    made.save(tmp_path / "rom.h5")
    ratio, force = 0.8, 0.01
    scene = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {"frequency": ratio / (2 * np.pi), "force": force, "at": "first"},
        "time": {"periods": 300, "transient": 200},
    }
    response = simulate(validate(Scene, scene, "scene"))
    stiffness = UNITS[units][1]
    assert response.status == "ok"
    expected = force / stiffness / abs(1 - ratio**2 + 0.1j * ratio)
    assert response.amplitude_harmonic == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("units", UNITS)
def test_a_soft_support_under_stiff_springs_is_right_to_the_round_off_of_the_stiffness(units):
    """Two masses: lambda_1 lambda_2 = k_1 k_2 / m^2, lambda_1 + lambda_2 = (k_1 + 2 k_2) / m."""
    for power in (20, 30, 38):
        stiff = 2.0**power
        made, findings = model(np.eye(2), chain(1.0, [stiff]), units)
        assert findings.rigid_motions == 0
        highest = stiff + 0.5 + np.sqrt(stiff**2 + 0.25)
        own = rounding(made.stiffness, made.natural[1])[0] / made.squares[0]
        # of the given entries (exact in SI), and of as many operations of the solution
        assert abs(made.squares[0] * highest / stiff - 1.0) < 4.0 * own
        assert modal_basis(made).stiffness[0] == pytest.approx(stiff / highest, rel=4.0 * own)
        assert own < 2.0**power * 2.3e-16 * 4.0


def test_a_frequency_lost_in_round_off_is_refused():
    made, findings = model(np.eye(2), chain(1.0, [2.0**44]))
    assert findings.rigid_motions == 0
    with pytest.raises(InputError, match=r"round-off alone is worth .* give the model in coordinates"):
        modal_basis(made)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("size", [2, 5, 30])
def test_a_free_structure_is_refused(size, units):
    """Random chains without a support, springs and masses over eight decades, in random coordinates too.

    Among so many decades some elastic motions are lost in the round-off of random coordinates as well.
    """
    for seed in range(20):
        rng = np.random.default_rng(seed)
        stiffness = chain(0.0, 10.0 ** rng.uniform(0, 8, size - 1))
        mass = np.diag(10.0 ** rng.uniform(-4, 4, size))
        turned = np.linalg.qr(rng.standard_normal((size, size)))[0]
        for basis in (np.eye(size), turned):
            made, findings = model(basis.T @ mass @ basis, basis.T @ stiffness @ basis, units)
            assert findings.rigid_motions == made.rigid_modes >= 1
            with pytest.raises(InputError, match="rigid-body motion; support it before reduction"):
                modal_basis(made)


@pytest.mark.parametrize("size", [2, 5, 30])
def test_a_supported_structure_is_not_refused(size):
    """The same chains with a support, their first frequencies down to 1e-6 of the highest."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        springs, mass = 10.0 ** rng.uniform(0, 4, size - 1), np.diag(10.0 ** rng.uniform(-4, 4, size))
        made, findings = model(mass, chain(1.0, springs))
        assert findings.rigid_motions == 0
        modal_basis(made)


def test_a_wide_spectrum_keeps_its_lowest_frequencies():
    """Graded masses and springs, whose flexibility is known without a difference: 1/omega^2 from its own matrix."""
    springs, mass = 10.0 ** np.arange(6, -1, -1.0), 10.0 ** np.arange(-6, 2, 1.0)
    stiffness = chain(1e7, springs)
    squares, shapes = spectrum(np.diag(mass), stiffness)
    flexibility = np.cumsum(1.0 / np.append(1e7, springs))
    flexibility = np.minimum.outer(flexibility, flexibility)
    root = np.sqrt(mass)
    expected = 1.0 / np.linalg.eigvalsh(root[:, None] * flexibility * root)[::-1]
    assert squares[-1] / squares[0] > 1e12
    assert squares[:3] == pytest.approx(expected[:3], rel=1e-10)
    assert shapes.T @ np.diag(mass) @ shapes == pytest.approx(np.eye(len(mass)), abs=1e-12)


def test_one_criterion():
    """The reduced model that the check of an import calls free is the one that a run refuses."""
    free = ReducedModel.from_matrices(np.eye(2), chain(0.0, [3.0]), {"a": [1.0, 0.0]}, damping_ratio=0.0)
    assert free.rigid_modes == 1
    with pytest.raises(InputError):
        modal_basis(free)
