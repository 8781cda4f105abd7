"""Integrals of a segment in closed form, of structures with many modes, against Gauss's rule."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel


def scene(folder, modes, periods):
    """A block and a sprung slider in a structure of so many modes, one pair as good as equal, with two harmonics."""
    rng = np.random.default_rng(4)
    omega = np.linspace(1.0, 1.0 + 1.3 * (modes - 1), modes)
    omega[2] = omega[1] * (1 + 1e-9)
    shapes = rng.uniform(-0.3, 0.3, (3, modes)) * [[1.0], [1.0], [0.3]]
    shapes[0, 0] = 1.0
    labels = ["a", "a.normal", "a.rotation"]
    model = ReducedModel.from_matrices(
        mass=np.eye(modes), stiffness=np.diag(omega**2), damping_ratio=0.01, base_load=rng.uniform(-1, 1, (modes, 3)),
        interface=dict(zip(labels, shapes, strict=True)), directions=dict.fromkeys(labels, (0.0, 1.0, 0.0)),
    )  # fmt: skip
    model.save(folder / "many.h5")
    data = {
        "structure": {"model": "rom", "file": str(folder / "many.h5")},
        "excitation": {
            "frequency": 0.98 / (2 * np.pi), "base_acceleration": 0.2, "at": "a",
            "harmonic": [{"order": 1, "amplitude": 1.0}, {"order": 3, "amplitude": 0.4, "phase": 30.0}],
        },
        "gravity": {"acceleration": 0.3, "orientation_deg": 20.0},
        "cavity": [{"name": "c", "gap": 0.8, "play": 0.2, "floor": "a"}, {"name": "d", "gap": 2.0, "floor": "a"}],
        "damper": [
            {
                "cavity": "c", "shape": "block", "length": 0.6, "height": 0.4, "mass": 0.1, "friction": 0.3,
                "restitution": 0.6, "tilt": 0.1, "position": -0.2,
            },
            {
                "cavity": "d", "mass": 0.05, "stiffness": 0.2, "dashpot": 0.01, "friction": 0.2, "normal_load": 0.05,
                "restitution": 0.7,
            },
        ],
        "time": {"periods": periods, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data, "scene")


#: the figures of runs whose integrals are taken in closed form from so many modes on
_SCRIPT = """
import json, sys
from pathlib import Path
from tests.coupling.engine.plane.test_integrals import scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.engine.plane import quadrature
for quadrature._MANY in (0, 1000):
    r = simulate(scene(Path(sys.argv[1]), 7, 1))
    others = r.amplitude_rms, r.amplitude_harmonic, r.attached_mass_fraction, r.peak[0]
    print(json.dumps([list(r.energy.values()), *others]))
"""


def test_closed_forms_are_what_quadrature_finds(tmp_path):
    """In plain Python, where the number of modes from which on they are taken can be set."""
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT, str(tmp_path)], capture_output=True, text=True, check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, cwd=os.getcwd(),
    )  # fmt: skip
    figures = []
    for energies, *others in map(json.loads, done.stdout.splitlines()):
        figures.append(np.array([np.array(energies) / max(map(abs, energies)), *[[other] for other in others]], object))
    assert len(figures) == 2
    for one, other in zip(*figures, strict=True):
        np.testing.assert_allclose(np.array(one, float), np.array(other, float), rtol=1e-11, atol=1e-12)


def test_a_structure_of_many_modes(tmp_path):
    """The ledger closes, and mean square and harmonic are those of the samples."""
    many = 2000
    response = simulate(scene(tmp_path, 12, 4), samples_per_period=many)
    assert response.energy_residual < 1e-11
    assert response.energy["friction"] > 0 and response.energy["viscous"] > 0
    x = response.displacement
    assert response.amplitude_rms == pytest.approx(np.sqrt((x**2).mean()), rel=1e-3)
    phase = np.exp(-2j * np.pi * np.arange(len(x)) / many)
    assert response.amplitude_harmonic == pytest.approx(abs(2 * (x * phase).mean()), rel=1e-3)
    assert response.peak.max() == pytest.approx(np.abs(x).max(), rel=1e-5)
    assert np.all(response.peak >= np.abs(x).reshape(4, many).max(axis=1) * (1 - 1e-12))
