"""Displacements and stresses as outputs of a reduced model, and their histories in damped runs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from tests.tools.input_files import DAMPED_BLOCK
from tests.tools.small_structures import truss
from vanedamp.coupling.output_histories import histories
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.algebra import von_mises
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.recovery import COMPONENTS, hot_spots, with_displacements, with_outputs, with_stresses
from vanedamp.rom.reduced import ReducedModel, ReducedModelError
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import truncated

ENDS = [InterfaceCoordinate("a", "a", (0, 1, 0)), InterfaceCoordinate("c", "c", (0, 1, 0))]


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """The clamped block of the command's tests: its finite elements, 60 modes, and a model with its hottest spot."""
    from vanedamp.modal.eigen import solve_modes
    from vanedamp.studies.case.stages import assemble, reduction, with_hot_spots
    from vanedamp.studies.case.tables import Case

    path = tmp_path_factory.mktemp("block") / "case.toml"
    path.write_text(DAMPED_BLOCK)
    structure = assemble(Case.load(path))
    model = with_hot_spots(structure, reduction(structure, 20, keep_recovery=True))
    return structure, solve_modes(structure.matrices, 60), model


@pytest.mark.parametrize("basis", ["craig-bampton", "macneal", "truncated"])
def test_displacements_at_points(basis):
    matrices = truss()
    model = reduce(matrices, Interface.on_patches(matrices, ENDS), basis, 6, keep_recovery=True)
    model = with_displacements(model, {"top": matrices.coordinates[9] + 1e-3, "held": matrices.coordinates[0]})
    assert model.outputs == ("top.x", "top.y", "top.z", "held.x", "held.y", "held.z")
    q, forces = np.random.default_rng(0).standard_normal((model.size, 5)), np.ones((2, 5))
    full = model.reconstruct(q, forces)
    assert model.evaluate(q, forces)[:3] == pytest.approx(full[27:30], rel=1e-12)
    assert np.all(model.evaluate(q, forces)[3:] == 0.0)
    # outputs follow their model through truncation
    smaller = truncated(model, 3)
    again = with_displacements(
        reduce(matrices, Interface.on_patches(matrices, ENDS), basis, 3, keep_recovery=True),
        {"top": matrices.coordinates[9]},
    )
    squared = [m.output_rows @ m.output_rows.T if basis == "truncated" else m.evaluate(
        np.linalg.solve(m.stiffness, m.selection.T), np.eye(2)) for m in (smaller, again)]  # fmt: skip
    assert squared[0][:3, :2] == pytest.approx(squared[1][:3, :2], rel=1e-8, abs=1e-12)


def test_von_mises():
    assert von_mises(np.array([3.0, 0, 0, 0, 0, 0])) == pytest.approx(3.0)
    assert von_mises(np.array([0.0, 0, 0, 2.0, 0, 0])) == pytest.approx(2.0 * np.sqrt(3.0))
    assert von_mises(np.array([5.0, 5.0, 5.0, 0, 0, 0])) == pytest.approx(0.0, abs=1e-12)


def test_stress_components_are_those_of_von_mises(block):
    structure, modes, _ = block
    components = structure.solid.stress_components(modes.shapes[0])
    assert von_mises(components) == pytest.approx(structure.solid.von_mises(modes.shapes[0]), rel=1e-9)


def test_stress_components_of_several_displacements_at_places(block):
    structure, modes, _ = block
    places = np.array([20, 7, 8])
    several = structure.solid.stress_components(modes.shapes[:3], places)
    assert several.shape == (3, 6, 3)
    for shape, found in zip(modes.shapes, several, strict=False):
        assert np.array_equal(found, structure.solid.stress_components(shape)[:, places])


def test_static_stress_of_a_cantilever(block):
    """Bending stress 6 F l / (w t^2) of a beam, at the hot spot near the clamp (Gere, Mechanics of Materials)."""
    _, _, model = block
    q = np.linalg.solve(model.stiffness, model.row("tip"))
    spot = hot_spots(model)["hot1"]["coordinates"]
    stress = model.evaluate(q)[model.outputs.index("hot1.xx")]
    assert min(abs(spot[2]), abs(spot[2] - 0.01)) < 1e-9  # on the surface
    assert abs(stress) == pytest.approx(6 * (0.1 - spot[0]) / (0.02 * 0.01**2), rel=0.1)


def test_stress_history_of_a_damped_run_equals_modal_superposition(block, tmp_path):
    structure, modes, model = block
    model.save(tmp_path / "rom.h5")
    assert ReducedModel.load(tmp_path / "rom.h5").outputs == model.outputs
    # the full model's modes, each with its own stress at the spot: a modal model of the same structure
    from vanedamp.studies.case.stages import interface

    rows = modes.shapes @ interface(structure.case, structure.matrices).vectors
    spot = hot_spots(model)["hot1"]["coordinates"]
    place = np.argmin(np.linalg.norm(structure.solid.stress_points() - spot, axis=1))
    stresses = np.array([structure.solid.stress_components(shape, [place])[:, 0] for shape in modes.shapes])
    full = ReducedModel.from_matrices(
        np.eye(len(modes)), np.diag(modes.angular_frequencies**2), dict(zip(model.interface, rows.T, strict=True)),
        damping_ratio=model.damping_ratio,
    )  # fmt: skip
    with_stresses(full, {"hot1": stresses.T}).save(tmp_path / "full.h5")
    frequency = modes.frequencies_hz[0]
    scene = validate(
        Scene,
        {
            "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
            "excitation": {"frequency": 0.99 * frequency, "resonance_amplitude": 1e-4, "at": "tip"},
            "cavity": [{"name": "c", "gap": 5e-5, "floor": "tip"}],
            "damper": [{"cavity": "c", "mass": 0.002, "restitution": 0.5}],
            "contact": {"law": "compliant", "stiffness": 2e6},
            "time": {"periods": 12, "transient": 0},
        },
        "scene",
    )
    names = [f"hot1.{component}" for component in COMPONENTS]
    own = histories(scene, names, 200)
    other = histories(scene.replace({"structure.file": str(tmp_path / "full.h5")}), names, 200)
    assert own.status == other.status == "ok"
    scale = np.abs(other.values).max()
    assert scale > 1e6
    assert np.abs(own.values - other.values).max() < 0.01 * scale
    assert np.abs(von_mises(own.values) - von_mises(other.values)).max() < 0.01 * scale


def test_hot_spots_of_earlier_files_are_coordinates():
    """Their provenance has a list by name; of other outputs, and of incomplete stresses, there is nothing."""
    rows = {f"{name}.{part}": np.zeros(2) for name in ("hot1", "mine") for part in COMPONENTS}
    model = ReducedModel.from_matrices(
        np.eye(2), np.eye(2), {"tip": 0}, damping_ratio=0.1, provenance={"hot_spots": {"hot1": [1.0, 2.0, 3.0]}}
    )
    model = with_outputs(model, rows | {"tip.x": np.zeros(2), "part.xx": np.zeros(2)})
    assert hot_spots(model) == {"hot1": {"coordinates": [1.0, 2.0, 3.0]}, "mine": {}}
    assert hot_spots(replace(model, outputs=(), output_rows=None)) == {}


def test_what_does_not_fit(block, tmp_path):
    _, _, model = block
    with pytest.raises(ReducedModelError, match=r"there is an output 'hot1.xx' already"):
        with_outputs(model, {"hot1.xx": np.zeros(model.size)})
    with pytest.raises(ReducedModelError, match=r"stress 'x': expected shape \(6,"):
        with_stresses(model, {"x": np.zeros((3, 3))})
    plain = reduce(truss(), Interface.on_patches(truss(), ENDS), modes=3)
    with pytest.raises(ReducedModelError, match="keep_recovery=True"):
        with_displacements(plain, {"p": (0, 0, 0)})
    with pytest.raises(ReducedModelError, match="outputs: this model has none"):
        plain.evaluate(np.zeros(plain.size))
    plain.save(tmp_path / "plain.h5")
    scene = {
        "structure": {"model": "rom", "file": str(tmp_path / "plain.h5")},
        "excitation": {"frequency": 1.0, "at": "a"},
    }
    with pytest.raises(InputError, match=r"outputs: no output 'hot1\.xx'"):
        histories(validate(Scene, scene, "scene"), ["hot1.xx"])


def test_shape_of_a_beam_has_its_stress_where_it_bends(block):
    """The first bending mode of the block: its hot spot lies at the clamp, on the surface."""
    _, modes, model = block
    assert linalg.eigh(model.stiffness, model.mass, eigvals_only=True)[0] == pytest.approx(
        modes.angular_frequencies[0] ** 2, rel=1e-4
    )
