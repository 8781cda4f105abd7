"""ReducedModel: what it answers, what it refuses, that it comes back from disk and runs without finite elements."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from vanedamp.files import store
from vanedamp.rom.reduced import ReducedModel, ReducedModelError, modal_damping
from vanedamp.rom.truncation import truncated

MASS = np.diag([2.0, 1.0, 0.5])
STIFFNESS = np.array([[300.0, -100.0, 0.0], [-100.0, 150.0, -50.0], [0.0, -50.0, 50.0]])


def chain(**changes):
    """Three masses in a row, held at the first one; interface coordinates in the middle and at the end."""
    values = {
        "mass": MASS,
        "stiffness": STIFFNESS,
        "interface": {"middle": [0, 1, 0], "end": [0, 0, 1]},
        "damping_ratio": 0.05,
        "directions": {"end": [0, 1, 0]},
        "base_load": MASS @ np.outer(np.ones(3), [0, 1, 0]),
        "provenance": {"source": "by hand"},
    } | changes
    mass, stiffness, interface = (values.pop(name) for name in ("mass", "stiffness", "interface"))
    return ReducedModel.from_matrices(mass, stiffness, interface, **values)


def test_masses_on_a_spring():
    """Two of them at one coordinate add up; the damping stays, and is no longer that of a ratio."""
    model = ReducedModel.from_matrices([[2.0]], [[8.0]], {"tip": [1.0]}, damping_ratio=0.01)
    heavier = model.with_masses([("tip", 10.0), ("tip", 20.0)])
    assert heavier.natural_frequencies_hz == pytest.approx([0.5 / (2.0 * np.pi)], rel=1e-12)
    assert (heavier.damping, heavier.damping_ratio) == (model.damping, None)
    with pytest.raises(ReducedModelError, match="no interface coordinate 'root'"):
        model.with_masses([("root", 1.0)])


def test_one_degree_of_freedom_in_closed_form():
    model = ReducedModel.from_matrices([[2.0]], [[800.0]], {"x": [1.0]}, damping_ratio=0.1)
    assert model.natural_frequencies_hz == pytest.approx([20.0 / (2 * np.pi)], rel=1e-14)
    assert model.damping[0, 0] == pytest.approx(2 * 0.1 * 20.0 * 2.0, rel=1e-14)
    assert model.static_stiffness[0, 0] == pytest.approx(800.0, rel=1e-14)
    assert model.contact_mass("x") == pytest.approx(2.0, rel=1e-14)
    frequencies = np.array([0.0, 1.0, 20.0 / (2 * np.pi)])
    omega = 2 * np.pi * frequencies
    expected = 1.0 / (800.0 + 1j * omega * 8.0 - 2.0 * omega**2)
    assert model.frf(frequencies, "x", "x") == pytest.approx(expected, rel=1e-12)


def test_every_mode_has_the_damping_ratio():
    model = chain(damping_ratio=0.05)
    forces = np.linalg.solve(MASS, np.hstack([STIFFNESS, model.damping]))
    state = np.vstack([np.eye(3, 6, k=3), -forces])
    eigenvalues = np.linalg.eigvals(state)
    assert -eigenvalues.real / np.abs(eigenvalues) == pytest.approx(np.full(6, 0.05), rel=1e-10)


def test_receptance_is_symmetric_and_starts_at_the_flexibility():
    model = chain()
    receptance = model.receptance([0.0, 0.7, 1.9])
    assert np.abs(receptance - receptance.swapaxes(1, 2)).max() < 1e-13 * np.abs(receptance).max()
    assert receptance[0] == pytest.approx(np.linalg.inv(STIFFNESS)[1:, 1:], rel=1e-12)
    assert model.frf([0.7], "middle", "end")[0] == receptance[1, 0, 1]


def test_static_stiffness_condenses_the_rest():
    condensed = STIFFNESS[1:, 1:] - np.outer(STIFFNESS[1:, 0], STIFFNESS[0, 1:]) / STIFFNESS[0, 0]
    assert chain().static_stiffness == pytest.approx(condensed, rel=1e-12)


def test_static_stiffness_of_a_free_structure():
    spring = np.array([[3.0, -3.0], [-3.0, 3.0]])
    model = ReducedModel.from_matrices(np.eye(2), spring, {"l": [1, 0], "r": [0, 1]}, damping_ratio=0.0)
    assert model.static_stiffness == pytest.approx(spring, abs=1e-14)


def test_contact_mass_of_a_functional():
    row = np.array([0.5, 0.5, 1.0])
    model = chain(interface={"mean": row}, directions={})
    assert model.contact_mass("mean") == pytest.approx(1.0 / (0.125 + 0.25 + 2.0), rel=1e-14)


def test_truncation_keeps_what_a_smaller_model_has():
    model = chain(interface={"tip": [1, 0, 0]}, directions={}, fixed_interface_modes=2)
    smaller = truncated(model, 1)
    assert (smaller.size, smaller.fixed_interface_modes) == (2, 1)
    assert np.array_equal(smaller.stiffness, STIFFNESS[:2, :2])
    assert smaller.damping == pytest.approx(modal_damping(MASS[:2, :2], STIFFNESS[:2, :2], 0.05), rel=1e-14)
    # a matrix of the user's own is cut, not made anew
    given = replace(model, damping_ratio=None)
    assert np.array_equal(truncated(given, 1).damping, model.damping[:2, :2])


def test_reconstruct():
    basis = np.arange(18.0).reshape(6, 3)
    model = replace(chain(), recovery=basis, coordinates=np.zeros((2, 3)))
    history = np.random.default_rng(1).standard_normal((3, 5))
    assert model.reconstruct(history) == pytest.approx(basis @ history, abs=1e-13)
    with pytest.raises(ReducedModelError, match="keep_recovery=True"):
        chain().reconstruct(history)


@pytest.mark.parametrize("damping", [{"damping_ratio": 0.05}, {"damping_ratio": None, "damping": 0.01 * STIFFNESS}])
@pytest.mark.parametrize("recovered", [False, True])
def test_round_trip(tmp_path, damping, recovered):
    model = chain(**damping)
    if recovered:
        model = replace(model, recovery=np.arange(18.0).reshape(6, 3), coordinates=np.ones((2, 3)))
    model.save(tmp_path / "rom.h5")
    again = ReducedModel.load(tmp_path / "rom.h5")
    for name in ("mass", "damping", "stiffness", "selection", "directions", "base_load", "recovery", "coordinates"):
        assert np.array_equal(getattr(again, name), getattr(model, name)), name
    for name in ("interface", "damping_ratio", "fixed_interface_modes", "provenance"):
        assert getattr(again, name) == getattr(model, name), name


def test_record_opens_in_xarray(tmp_path):
    xarray = pytest.importorskip("xarray")
    model = chain()
    model.save(tmp_path / "rom.h5")
    with xarray.open_dataset(tmp_path / "rom.h5", engine="h5netcdf") as data:
        assert data.stiffness.attrs["units"] == "N/m"
        assert data.selection.sel(interface="end").values.tolist() == [0.0, 0.0, 1.0]
        assert data.base_load.sel(axis="y").values == pytest.approx([2.0, 1.0, 0.5])
        assert data.natural_frequency.values == pytest.approx(model.natural_frequencies_hz)


def test_load_refuses_other_records(tmp_path):
    store.save(tmp_path / "other.h5", "modes", {})
    with pytest.raises(store.StoreError, match="holds modes, expected reduced-model"):
        ReducedModel.load(tmp_path / "other.h5")


def test_arrays_are_read_only_copies():
    given = MASS.copy()
    model = chain(mass=given)
    given[0, 0] = 7.0
    assert model.mass[0, 0] == 2.0
    with pytest.raises(ValueError, match="read-only"):
        model.stiffness[0, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": np.diag([1.0, 1.0, 0.0])}, "mass: not positive definite"),
        ({"stiffness": np.triu(STIFFNESS)}, "stiffness: not symmetric"),
        ({"stiffness": -STIFFNESS}, "stiffness: not positive semidefinite"),
        ({"stiffness": STIFFNESS[:2, :2]}, r"stiffness: expected shape \(3, 3\), not \(2, 2\)"),
        ({"stiffness": np.full((3, 3), np.inf)}, "stiffness: .*not finite"),
        ({"interface": {"end": [0, 1]}, "directions": {}}, r"row of 'end': expected shape \(3,\)"),
        ({"interface": {}, "directions": {}}, "interface: empty"),
        ({"interface": {"end": [0, 0, 0]}}, "the row of 'end' is zero"),
        ({"normals": np.zeros((3, 3))}, r"normals: expected shape \(2, 3\)"),
        ({"directions": {"top": [0, 1, 0]}}, "directions: no interface coordinate 'top'; there are: middle, end"),
        ({"base_load": np.zeros(3)}, r"base_load: expected shape \(3, 3\)"),
        ({"damping_ratio": 1.0}, "damping_ratio: expected 0 <= ratio < 1"),
        ({"damping": STIFFNESS}, "damping: give either"),
        ({"damping_ratio": None}, "damping: give either"),
        # a wrong shape is told first
        ({"damping_ratio": None, "mass": np.ones((3, 2))}, r"mass: expected shape \(3, 3\), not \(3, 2\)"),
        ({"damping_ratio": None, "stiffness": np.eye(2)}, r"stiffness: expected shape \(3, 3\), not \(2, 2\)"),
        ({"damping_ratio": None, "interface": {"end": [1.0]}}, r"row of 'end': expected shape \(3,\), not \(1,\)"),
        ({"fixed_interface_modes": 1}, "the last coordinates are fixed-interface modes"),
        ({"fixed_interface_modes": 4}, "fixed_interface_modes: expected 0 to 3"),
        ({"recovery": np.zeros((4, 3))}, r"recovery: expected shape \(3, 3\)"),
    ],
)
def test_refuses_what_does_not_fit(changes, message):
    with pytest.raises(ReducedModelError, match=message):
        chain(**changes)


def test_labels_are_unique():
    with pytest.raises(ReducedModelError, match="'end' occurs twice"):
        replace(chain(), interface=("end", "end"))


def test_questions_it_cannot_answer():
    with pytest.raises(ReducedModelError, match="no interface coordinate 'top'; there are: middle, end"):
        chain().frf([1.0], "top", "end")
    with pytest.raises(ReducedModelError, match=r"modes: expected 0 to 0 .* not 1"):
        truncated(chain(), 1)


def test_runs_without_finite_elements():
    program = """
import sys
for name in ("dolfinx", "petsc4py", "slepc4py", "mpi4py", "ufl", "gmsh"):
    sys.modules[name] = None
import numpy as np
from vanedamp.rom.reduced import ReducedModel
model = ReducedModel.from_matrices(np.eye(1), np.eye(1), {"x": [1.0]}, damping_ratio=0.5)
assert abs(model.frf([0.0], "x", "x")[0] - 1.0) < 1e-14
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
