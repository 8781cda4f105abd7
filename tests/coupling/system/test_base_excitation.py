"""Base excitation from a scene: any direction, rigid models of continuous structures, bodies that feel the base."""

import json
import math

import numpy as np
import pytest

from tests.tools.input_files import DAMPED_BLOCK
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.base_excitation import base_response
from vanedamp.modal.eigen import solve_modes
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.reduction import reduce
from vanedamp.studies.case.stages import assemble, base_inertia, interface
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

LEVEL = 3.0
OBLIQUE = np.array([2.0, -1.0, 2.0])


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """A clamped block of two by one by six elements: its case, its structure, and a reduced model in a file."""
    folder = tmp_path_factory.mktemp("block")
    (folder / "case.toml").write_text(DAMPED_BLOCK)
    structure = assemble(Case.load(folder / "case.toml"))
    shown = interface(structure.case, structure.matrices)
    reduced = reduce(structure.matrices, shown, "craig-bampton", 12, quasi_static=2)
    reduced.save(folder / "rom.h5")
    return folder, structure, reduced


def reduced_scene(folder, frequency, **excitation):
    data = {
        "structure": {"model": "rom", "file": str(folder / "rom.h5")},
        "excitation": {"frequency": frequency, "at": "tip", "base_acceleration": LEVEL} | excitation,
    }
    return validate(Scene, data, "scene")


@pytest.mark.parametrize("direction", [None, [0.0, 0.0, 5.0], OBLIQUE.tolist()])
def test_a_reduced_model_against_the_whole_mesh(block, direction):
    """Up to beyond the third mode; the tip's own direction, z, unless another is given."""
    folder, structure, reduced = block
    matrices, label = structure.matrices, interface(structure.case, structure.matrices, ["tip"])
    frequencies = np.linspace(0.2, 1.3, 12) * reduced.natural_frequencies_hz[2]
    along = [0.0, 0.0, 1.0] if direction is None else direction
    expected = base_response(solve_modes(matrices, 40), matrices, label.vectors, along, frequencies).relative[0]
    given = {} if direction is None else {"base_direction": direction}
    curve, _ = linear_responses(reduced_scene(folder, 100.0, **given))
    assert curve.amplitude(frequencies) == pytest.approx(LEVEL * np.abs(expected), rel=1e-6)


def test_the_rigid_model_of_a_mode_with_its_base_mass(block):
    """By itself it is that mode's share of the response, exactly; the mass in its place is off by a third and more."""
    folder, structure, _ = block
    assert main(["calibrate", str(folder / "case.toml"), "--json", str(folder / "c.json")]) == 0
    rigid = json.loads((folder / "c.json").read_text())["rigid"]
    modes = solve_modes(structure.matrices, 1)
    tip = interface(structure.case, structure.matrices, ["tip"]).vectors
    frequencies = rigid["frequency_hz"] * np.array([0.3, 0.99, 1.0, 1.4])
    expected = base_response(modes, structure.matrices, tip, [0, 0, 1], frequencies, 0.01, static_correction=False)
    table = {"model": "rigid"} | {name: rigid[name] for name in ("mass", "stiffness", "damping", "base_mass")}
    excitation = {"frequency": frequencies[0], "base_acceleration": LEVEL}
    curve, _ = linear_responses(validate(Scene, {"structure": table, "excitation": excitation}, "scene"))
    assert curve.amplitude(frequencies) == pytest.approx(LEVEL * np.abs(expected.relative[0]), rel=1e-6)
    assert rigid["base_mass"] > 1.3 * rigid["mass"]
    # phi^T M r / w^T phi, whatever the mode's scale and sign
    inertia = base_inertia(structure.case, structure.matrices, "tip")
    expected = float(modes.shapes[0] @ inertia / (modes.shapes[0] @ tip[:, 0]))
    assert rigid["base_mass"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("base_mass", [None, 2.5, -0.7, 0.0])
def test_a_rigid_structure_in_closed_form(base_mass):
    """m x'' + d x' + c x = -base_mass a: amplitude, and phase against a sine of the base's acceleration."""
    mass, stiffness, damping, frequency = 1.5, 4e3, 12.0, 9.0
    structure = {"model": "rigid", "mass": mass, "stiffness": stiffness, "damping": damping}
    data = {
        "structure": structure | ({} if base_mass is None else {"base_mass": base_mass}),
        "excitation": {"frequency": frequency, "base_acceleration": LEVEL},
        "time": {"periods": 200, "transient": 190},
    }
    response = simulate(validate(Scene, data, "scene"))
    omega = 2 * math.pi * frequency
    loaded = mass if base_mass is None else base_mass
    wave = -loaded * LEVEL / (stiffness - mass * omega**2 + 1j * omega * damping)
    assert response.amplitude_max == pytest.approx(abs(wave), rel=1e-9, abs=1e-18)
    if loaded:
        turn = (response.phase - np.angle(wave) + math.pi) % (2 * math.pi) - math.pi
        assert turn == pytest.approx(0.0, abs=1e-9)


def test_bodies_feel_the_base_along_their_cavities(tmp_path):
    """One that nothing touches stays behind the base's motion by its component along the cavity."""
    frequency, own, cavity = 12.0, 2 * math.pi * 31.0, np.array([0.6, 0.8, 0.0])
    model = ReducedModel.from_matrices(
        [[1.0]], [[own**2]], {"tip": [1.0], "floor": [0.5]}, damping_ratio=0.0,
        directions={"tip": [0.0, 0.0, 1.0], "floor": cavity}, base_load=[[0.2, -0.4, 1.0]],
    )  # fmt: skip
    model.save(tmp_path / "rom.h5")
    data = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {
            "frequency": frequency, "at": "tip", "base_acceleration": LEVEL, "base_direction": OBLIQUE.tolist()
        },
        "cavity": [{"name": "c", "gap": 1.0, "floor": "floor"}],
        "damper": [{"cavity": "c", "mass": 0.1}],
        "time": {"periods": 3, "transient": 0},
    }  # fmt: skip
    response = simulate(validate(Scene, data, "scene"), samples_per_period=32)
    along = OBLIQUE / 3.0
    omega, t = 2 * math.pi * frequency, response.time
    # from rest under a(t) = LEVEL sin(omega t): twice integrated, and the mode's Duhamel integral
    travelled = LEVEL * (t / omega - np.sin(omega * t) / omega**2)
    duhamel = (np.sin(omega * t) - omega / own * np.sin(own * t)) / (own**2 - omega**2)
    mode = -LEVEL * (np.array([0.2, -0.4, 1.0]) @ along) * duhamel
    assert response.status is Status.OK and response.impacts_per_period == 0
    np.testing.assert_allclose(response.displacement, mode, rtol=0, atol=1e-12 * np.abs(mode).max())
    slip = -(cavity @ along) * travelled - 0.5 * mode
    np.testing.assert_allclose(response.body_displacement[:, 0], slip, rtol=0, atol=1e-11 * np.abs(slip).max())


def test_a_direction_that_needs_no_label_of_its_own(tmp_path):
    """The direction of excitation.at may be unknown if the base has one; without either it is refused."""
    model = ReducedModel.from_matrices([[1.0]], [[1e4]], {"tip": [1.0]}, damping_ratio=0.1, base_load=[[1.0, 0.0, 0.0]])
    model.save(tmp_path / "rom.h5")
    curve, _ = linear_responses(reduced_scene(tmp_path, 5.0, base_direction=[1.0, 0.0, 0.0]))
    assert curve.amplitude([0.0])[0] == pytest.approx(LEVEL / 1e4, rel=1e-12)
    with pytest.raises(InputError, match=r"^excitation.at: the reduced model knows no direction of 'tip'"):
        linear_responses(reduced_scene(tmp_path, 5.0))


def test_structures_without_directions_refuse_one():
    rigid = {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1}
    excitation = {"frequency": 1.0, "base_acceleration": 1.0}
    with pytest.raises(InputError, match=r"^scene: excitation.base_direction: a direction in space is for a reduced"):
        validate(Scene, {"structure": rigid, "excitation": excitation | {"base_direction": [1, 0, 0]}}, "scene")
    with pytest.raises(InputError, match=r"^scene: excitation.base_direction: expected three numbers, not all zero"):
        validate(Scene, {"structure": rigid, "excitation": excitation | {"base_direction": [0, 0, 0]}}, "scene")
    table = {"model": "prescribed", "displacement_amplitude": 1e-3}
    with pytest.raises(InputError, match=r"^scene: excitation.base_acceleration: a prescribed motion is that of the b"):
        validate(Scene, {"structure": table, "excitation": excitation}, "scene")
