"""Integrals of a segment in closed form, of structures with many modes, against Gauss's rule."""

import numpy as np
import pytest

from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import SLIP_LEFT, SLIP_RIGHT
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.response.records import EXCITATION, FRICTION, VISCOUS
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel


def scene(folder, modes, periods, stiffness=0.2, dashpot=0.01):
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
                "cavity": "d", "mass": 0.05, "stiffness": stiffness, "dashpot": dashpot, "friction": 0.2,
                "normal_load": 0.05, "restitution": 0.7,
            },
        ],
        "time": {"periods": periods, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data, "scene")


def by_quadrature(run, periods):
    """Energies, momentum, harmonic and mean square of a run, by Gauss's rule on its segments."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    system, u, total = run.system, len(run.system.rest), np.zeros(6, complex)
    rubs = (np.arange(u) >= system.contacts) | (system.friction > 0)
    for segment in Walk(run, periods):
        pieces = int(np.ceil(segment.duration * np.abs(segment.rate).max())) or 1
        h = segment.duration / pieces
        slips = rubs & np.isin(segment.state, (SLIP_LEFT, SLIP_RIGHT))
        for start in h * np.arange(pieces):
            for node, weight in zip(start + 0.5 * h * (1 + nodes), 0.5 * h * weights, strict=True):
                q, v = segment.at(node)
                phase = np.exp(1j * system.frequency * (segment.time + node))
                x, back = system.response @ q + (system.table @ phase).real, phase[0].conj()
                slip, force = (system.J @ v)[u:][slips], segment.forces(node)[u:][slips]
                momentum = system.mass[system.along] @ v[system.along]
                power = (phase @ system.load).real @ v, v @ system.damping @ v, -slip @ force
                total += weight * np.array([*power, momentum * back, x * back, x * x])
    return total


@pytest.mark.parametrize(
    ("stiffness", "dashpot", "bound"), [(0.2, 0.01, 1e-11), (2e-8, 0.0, 1e-8)], ids=["sprung", "slow mode"]
)
def test_closed_forms_are_what_quadrature_finds(tmp_path, stiffness, dashpot, bound):
    """Of modes as good as equal, and of one that hardly moves within a period.

    The slow mode's amplitude, speed over frequency, is 1e5 times the motion: so are the last bits of its shape.
    """
    several = scene(tmp_path, 7, 2, stiffness, dashpot)
    run = run_of(several, [EVENT_LIST])
    expected, records = by_quadrature(run, 2), run.records
    energies = records.ledger[2, [EXCITATION, VISCOUS, FRICTION]]
    np.testing.assert_allclose(energies, expected[:3].real, rtol=0, atol=bound * np.abs(energies).max())
    for found, wanted in zip((records.momentum, records.harmonic, records.square), expected[3:], strict=True):
        np.testing.assert_allclose(found.sum(), wanted, rtol=10 * bound)


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


@pytest.mark.parametrize("excess", [1e-7, 1e-9])
def test_energies_near_critical_damping(excess):
    """Amplitudes cancel, energies do not: ledgers close, and a light block in another cavity changes little."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 1.0 + excess},
        "excitation": {"frequency": 0.7 / (2 * np.pi), "force": 1.0},
        "cavity": [{"name": "c", "gap": 1.0}, {"name": "d", "gap": 1.0, "play": 0.1}],
        "damper": [{"cavity": "c", "mass": 0.05, "friction": 0.01, "restitution": 0.8, "velocity": 0.5}],
        "time": {"periods": 3, "transient": 0},
    }  # fmt: skip
    slider = simulate(validate(Scene, data, "scene"))
    far = {"cavity": "d", "shape": "block", "length": 0.1, "height": 0.1, "mass": 1e-9, "restitution": 0.5}
    planar = simulate(validate(Scene, data | {"damper": [*data["damper"], far]}, "scene"))
    assert slider.energy_residual < 1e-12 and planar.energy_residual < 1e-10
    assert slider.impacts_per_period > 0 and slider.energy["friction"] > 0
    for name, value in slider.energy.items():
        assert planar.energy[name] == pytest.approx(value, rel=1e-7, abs=1e-7)
