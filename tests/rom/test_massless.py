"""The massless boundary against the published equations, and contact on it against the differential-algebraic system.

Monjaraz-Tec, Gross and Krack (2022), Computers and Structures 259, 106698, and their public code.
"""

import numpy as np
import pytest

from tests.reference.massless_boundary import Boundary, craig_bampton, frequencies, macneal
from tests.tools.small_structures import rod, truss
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduction import reduce
from vanedamp.rom.truncation import boundary_form, massless

TIP = [InterfaceCoordinate("tip", "tip", (1, 0, 0))]
NODES = [InterfaceCoordinate(label, label, (0, 1, 0), kind="node") for label in ("a", "c")]


def dense(matrices, coordinates):
    """(interface, M, K, indices of the boundary coordinates) over the free degrees of freedom."""
    interface = Interface.on_patches(matrices, coordinates)
    stiffness, mass, vectors = interface.restrict(matrices)
    return interface, mass.toarray(), stiffness.toarray(), np.argmax(vectors, axis=0)


@pytest.mark.parametrize("basis", ["macneal", "massless"])
def test_form_is_the_published_one(basis):
    matrices = truss()
    interface, mass, stiffness, boundary = dense(matrices, NODES)
    # "massless" takes a Craig-Bampton model's own modes: here one with all 28 fixed-interface modes
    modes = 14 if basis == "massless" else 5
    model = reduce(matrices, interface, basis, modes)
    published, at = macneal(mass, stiffness, boundary, modes)
    singular, _, own = boundary_form(model)
    assert np.allclose(singular, np.diag(np.r_[0, 0, np.ones(modes)]), atol=1e-9)
    signs = np.r_[1, 1, np.sign((model.selection * at).sum(axis=0))]
    assert np.allclose(signs[:, None] * own * signs, published, rtol=0, atol=1e-8 * np.abs(published).max())
    assert frequencies(own, 2) == pytest.approx(frequencies(published, 2), rel=1e-8)


def test_published_craig_bampton_form_loses_the_inertia_of_the_boundary():
    """Its statics are exact, its first frequency only of first order: why "massless" takes the model's own modes."""
    matrices = rod(60)
    interface, mass, stiffness, boundary = dense(matrices, TIP)
    errors = []
    for modes in (5, 10, 20):
        published = craig_bampton(mass, stiffness, boundary, modes)
        flexibility = np.linalg.inv(published)[0, 0]
        assert flexibility == pytest.approx(1.0, rel=1e-9)
        errors.append(frequencies(published, 1)[0] / (np.pi / 2) - 1)
        own = reduce(matrices, interface, "massless", modes).natural_frequencies_hz[0]
        assert own == pytest.approx(0.25, rel=1e-5)
    assert np.array(errors) * [5, 10, 20] == pytest.approx(0.2, rel=0.05)


def rod_scene(file, modes, **body):
    return validate(
        Scene,
        {
            "structure": {"model": "rom", "file": file, "modes": modes, "natural": True},
            "excitation": {"frequency": 0.24, "force": 0.05, "at": "tip"},
            "cavity": [{"name": "c", "gap": 0.5, "floor": "tip"}],
            "damper": [{"cavity": "c", "mass": 0.05} | body],
            "gravity": {"acceleration": 0.0},
            "contact": {"law": "massless"},
            "time": {"periods": 4, "transient": 0},
        },
        "scene",
    )


@pytest.mark.parametrize("modes", [1, 4])
def test_engine_follows_the_differential_algebraic_system(tmp_path, modes):
    matrices = rod(100, damping_ratio=0.01)
    model = reduce(matrices, Interface.on_patches(matrices, TIP), modes=20)
    file = str(tmp_path / "rom.h5")
    model.save(file)
    response = simulate(rod_scene(file, modes, position=0.1, velocity=0.3), samples_per_period=16)
    assert response.status == "ok"
    assert response.impacts_per_period * 4 > 3
    contacts = [("tip", 0, 1, 0.25), ("tip", 0, -1, 0.25)]
    natural = massless(model, modes)
    system = Boundary(natural, [0.05], contacts, 0.05, 2 * np.pi * 0.24, "tip", coupled=False)
    states = system.run(([0.1], [0.3]), response.time, max_step=0.05)
    displacement = states[:, :modes] @ natural.row("tip")
    assert response.displacement == pytest.approx(displacement, abs=1e-5 * np.abs(displacement).max())
