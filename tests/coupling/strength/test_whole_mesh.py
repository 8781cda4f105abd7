"""Stress at hot spots under impacts, against the whole mesh step by step."""

from dataclasses import replace

import numpy as np

from benchmarks.methods.full_mesh_run import explicit_run, lumped
from tests.tools.input_files import DAMPED_BLOCK, changed
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.bases.craig_bampton import reduce
from vanedamp.rom.recovery import COMPONENTS, hot_spots

PERIODS, SPOTS, NEAR = 10, 3, 60


def stress_rows(structure, model, name):
    """The six stresses (6, N), Pa/m, of the displacements at a hot spot: those of unit displacements near it.

    Of the corners of cells that meet there, that of the cell whose stresses the model has.
    """
    solid, place = structure.solid, np.asarray(hot_spots(model)[name]["coordinates"])
    nodes = np.argsort(np.linalg.norm(structure.matrices.coordinates - place, axis=1))[:NEAR]
    dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
    corners = np.flatnonzero(np.linalg.norm(solid.stress_points() - place, axis=1) < 1e-12)
    units = np.zeros((len(dofs), structure.matrices.mass.shape[0]))
    units[np.arange(len(dofs)), dofs] = 1.0
    own = model.output_rows[[model.outputs.index(f"{name}.{component}") for component in COMPONENTS]]
    found = []
    for stresses in np.moveaxis(solid.stress_components(units, corners), 2, 0):
        rows = np.zeros((6, units.shape[1]))
        rows[:, dofs] = stresses.T
        found.append((np.abs(rows @ model.recovery - own).max(), rows))
    distance, rows = min(found, key=lambda entry: entry[0])
    assert distance < 1e-9 * np.abs(own).max()
    return rows


def compare(folder, modes, shares=(0.9, 0.3)):
    """Amplitudes (spots, 6) of the components over PERIODS periods from rest: reduced, and the mesh with its steps."""
    from vanedamp.studies.case.stages import assemble, interface, with_hot_spots
    from vanedamp.studies.case.tables import Case

    path = folder / "case.toml"
    path.write_text(changed(DAMPED_BLOCK, ('generator = "block"', 'generator = "block"\ndegree = 1')))
    structure = assemble(Case.load(path))
    matrices = lumped(structure.matrices)
    labels = interface(structure.case, matrices)
    model = with_hot_spots(structure, reduce(matrices, labels, modes, keep_recovery=True), SPOTS)
    first = float(np.sqrt(model.squares[0]))
    # the mesh's damping is in proportion to its mass
    damping = 2 * matrices.damping_ratio * first * model.mass
    model = replace(model, damping=damping, damping_ratio=None)
    model.save(folder / "rom.h5")
    scene = validate(
        Scene,
        {"structure": {"model": "rom", "file": str(folder / "rom.h5")}, "gravity": {"acceleration": 0.0},
         "excitation": {"frequency": first / (2 * np.pi), "force": 20.0, "at": "tip"},
         "cavity": [{"name": "c", "gap": 2e-5, "floor": "tip"}], "contact": {"law": "compliant", "stiffness": 2e6},
         "damper": [{"cavity": "c", "mass": 0.01, "restitution": 0.7}],
         "time": {"periods": PERIODS, "transient": 0}},
        "scene",
    )  # fmt: skip
    response = simulate(scene, samples_per_period=480)  # impacts excite modes far above the excitation
    assert response.impacts_per_period > 1.0
    found = np.array([list(spot.amplitude.values()) for spot in response.stress])
    rows = np.concatenate([stress_rows(structure, model, name) for name in hot_spots(model)])
    meshes = []
    for share in shares:
        run = explicit_run(matrices, labels, scene, first, PERIODS, share, rows)
        meshes.append(0.5 * np.ptp(run.swing, axis=2).mean(axis=0).reshape(SPOTS, 6))
    return found, meshes


def test_stress_under_impacts_is_that_of_the_whole_mesh(tmp_path):
    found, (coarse, fine) = compare(tmp_path, 20)
    scale = fine.max(axis=1, keepdims=True)
    own, error = ((np.abs(one - fine) / scale).max() for one in (coarse, found))
    assert scale.min() > 1e6
    assert own < 0.004 and error < 0.004
