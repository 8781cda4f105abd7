"""Stress at hot spots of reduced models against solutions with the whole mesh's matrices."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres

from tests.tools.input_files import CLUSTER, DAMPED_BLOCK
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.linear_stress import linear_stresses
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.files.toml_input import validate
from vanedamp.modal.algebra import von_mises
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel

SPOTS = 3


def proportional(mass, stiffness, first):
    """Rayleigh damping of 0.4 % at the first angular frequency and 0.6 % at its triple."""
    both = np.linalg.solve([[1 / first, first], [1 / (3 * first), 3 * first]], [0.008, 0.012])
    return both[0] * mass + both[1] * stiffness


def reduced(folder, text, modes):
    """A case's structure, its interface, and the reduced model with its hot spots and Rayleigh damping, in a file."""
    from vanedamp.studies.case.stages import assemble, interface, reduction
    from vanedamp.studies.case.tables import Case

    path = folder / "case.toml"
    path.write_text(text)
    structure = assemble(Case.load(path))
    model = reduction(structure, modes, spots=SPOTS)
    first = np.sqrt(model.squares[0])
    damping = proportional(model.mass, model.stiffness, first)
    replace(model, damping=damping, damping_ratio=None).save(folder / "rom.h5")
    return structure, interface(structure.case, structure.matrices), folder / "rom.h5"


def places_of(structure, model):
    """The corner of a cell of each hot spot, with the stress of its cell."""
    points, found = structure.solid.stress_points(), []
    shape = hot_spots(model)
    for facts in shape.values():
        found.append(np.flatnonzero(np.linalg.norm(points - facts["coordinates"], axis=1) < 1e-12))
    return found


def full_stress(structure, interface, at, body, frequency, first, places):
    """Complex stresses (6, k), Pa, of the whole mesh under a unit force at an interface coordinate.

    body: interface coordinate and mass, kg, of a body fixed there; its matrix has the entries of the patch.
    """
    from vanedamp.modal.eigen import factorize

    matrices = structure.matrices
    free, omega = matrices.free, 2 * np.pi * frequency
    vectors = {label: interface.vectors[:, place] for place, label in enumerate(interface.labels)}
    mass, stiffness = (sparse.csr_array(matrix)[free][:, free] for matrix in (matrices.mass, matrices.stiffness))
    damping = proportional(mass, stiffness, first)
    if body is not None:
        floor = sparse.csr_array(vectors[body[0]][free][:, None])
        mass = mass + body[1] * (floor @ floor.T)
    dynamic = sparse.csr_array(stiffness + 1j * omega * damping - omega**2 * mass)
    # the factors of a neighbour without damping leave few steps to the solution: one for each mode near it
    with factorize(sparse.csr_array(stiffness - (0.99 * omega) ** 2 * mass), definite=False) as near:
        inverse = LinearOperator(dynamic.shape, lambda x: near.solve(x.real) + 1j * near.solve(x.imag), dtype=complex)
        load = vectors[at][free].astype(complex)
        motion = np.zeros(matrices.mass.shape[0], complex)
        for _ in range(2):  # each takes 1e-5 of what is left, the default tolerance: its name is another in newer scipy
            motion[free] += gmres(dynamic, load - dynamic @ motion[free], M=inverse, atol=0.0)[0]
    assert np.linalg.norm(dynamic @ motion[free] - load) < 1e-7 * np.linalg.norm(load)
    real, imaginary = structure.solid.stress_components(np.array([motion.real, motion.imag]), places)
    return real + 1j * imaginary


def amplitudes(stress):
    """Amplitudes (6,) of the components and of von Mises stress of a complex stress (6,)."""
    turns = np.exp(2j * np.pi * np.arange(2000) / 2000)
    return np.append(np.abs(stress), von_mises((stress[:, None] * turns).real).max())


def largest_error(folder, text, modes, at, floor, mass, ratios=(0.97, 1.0)):
    """The largest error of the linear curves at all spots, relative to the spot's amplitude of von Mises stress.

    ratios: of the frequency to the resonance, without bodies and with the body fixed.
    """
    structure, interface, file = reduced(folder, text, modes)
    model = ReducedModel.load(file)
    first = np.sqrt(model.squares[0])
    held = np.sqrt(model.with_masses([(floor, mass)]).squares[0])
    places, errors = places_of(structure, model), []
    for body, omega in ((None, first), ((floor, mass), held)):
        for ratio in ratios:
            frequency = float(ratio * omega / (2 * np.pi))
            scene = validate(
                Scene,
                {"structure": {"model": "rom", "file": str(file)},
                 "excitation": {"frequency": frequency, "force": 1.0, "at": at},
                 "cavity": [{"name": "c", "gap": 1e-5, "floor": floor}],
                 "damper": [{"cavity": "c", "mass": mass}], "gravity": {"acceleration": 0.0}},
                "scene",
            )  # fmt: skip
            found = linear_stresses(scene, spots_of(scene))["undamped" if body is None else "fixed"]
            full = full_stress(structure, interface, at, body, frequency, first, np.concatenate(places))
            ends = np.cumsum([len(some) for some in places])
            for spot, corners in enumerate(np.split(full, ends[:-1], axis=1)):
                # a corner of several cells has the stress of each: the spot's is one of them
                expected = np.array([amplitudes(corner) for corner in corners.T])
                error = np.abs(expected - found[spot, :7]).max(axis=1) / expected[:, 6]
                errors.append(error.min())
    return max(errors)


def test_linear_stresses_of_a_block_are_those_of_its_whole_mesh(tmp_path):
    assert largest_error(tmp_path, DAMPED_BLOCK, 12, "tip", "top", 0.01) < 0.01


@pytest.mark.slow
def test_linear_stresses_of_the_cluster_are_those_of_its_whole_mesh(tmp_path):
    assert largest_error(tmp_path, CLUSTER, 12, "c1", "c1", 0.003, ratios=(1.0,)) < 0.01
