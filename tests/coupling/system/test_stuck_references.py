"""Free and stuck structures against constrained matrices, and against sweeps without and with huge friction."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space

import vanedamp as vd
from tests.coupling.scene.elements.test_joint import JOINT, matrices, scene
from tests.tools.rings import LumpedDisk
from vanedamp.coupling.model_order.selection import choices_of, with_choice
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import fixed_mode, linear_responses, receptance
from vanedamp.files.toml_input import InputError
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.reduction import reduce_ring

HERTZ = np.linspace(15.0, 40.0, 6)
ALONG, ACROSS = np.array([[1.0, 0, -1, 0]]), np.array([[0, 1.0, 0, -1]])
NONE = np.zeros((0, 4))


def held(mass, stiffness, damping, rows, load):
    """Complex motions (f, N) of a structure with rows (r, N) at rest."""
    left, omega = null_space(rows) if len(rows) else np.eye(len(mass)), 2 * np.pi * HERTZ[:, None, None]
    dynamic = left.T @ (stiffness + 1j * omega * damping - omega**2 * mass) @ left
    return np.linalg.solve(dynamic, np.tile(left.T @ load, (len(omega), 1))[..., None])[..., 0] @ left.T


@pytest.mark.parametrize(
    ("joint", "more", "rigid", "spring"),
    [
        ({"preload": 5.0, "normal_stiffness": 1e5}, {}, ALONG, 1e5 * ACROSS.T @ ACROSS),
        (
            {"friction": 0.0, "preload": 5.0, "normal_stiffness": 1e5, "tangential_stiffness": 3e4}, {}, NONE,
            1e5 * ACROSS.T @ ACROSS + 3e4 * ALONG.T @ ALONG,
        ),
        ({"friction": 0.0}, {}, np.vstack([ALONG, ACROSS]), 0.0),
        ({"gap": 1e-5, "normal_stiffness": 1e5}, {}, NONE, 0.0),
        ({"preload_by_speed": 1e-3}, {"rotation": {"speed": 0.0}}, np.vstack([ALONG, ACROSS]), 0.0),
        ({"between": ["casing", "a"], "normal": ["casing", "a_across"]}, {}, np.eye(4)[:2], 0.0),
        (None, {"friction_damper": [{"at": "a", "normal_force": 1.0, "friction": 0.0}]}, np.eye(4)[:1], 0.0),
        (
            None, {"friction_damper": [{"at": "a", "to": "b", "normal_force": 1.0, "friction": 0.3, "stiffness": 2e4}]},
            NONE, 2e4 * ALONG.T @ ALONG,
        ),
    ],
)  # fmt: skip
def test_references_are_constrained_matrices(joint, more, rigid, spring):
    structure = matrices(3)
    made = scene(structure, joint and JOINT | joint, **more)
    load = np.array([60.0, 0, 0, 0])
    expected = [
        np.abs(held(structure.mass, structure.stiffness, structure.damping, NONE, load)[:, 0]),
        np.abs(held(structure.mass, structure.stiffness + spring, structure.damping, rigid, load)[:, 0]),
    ]
    for response, amplitude in zip(linear_responses(made), expected, strict=True):
        assert response.amplitude(HERTZ) == pytest.approx(amplitude, rel=1e-10, abs=1e-18)
        assert [response.amplitude(HERTZ[k : k + 1])[0] for k in range(6)] == response.amplitude(HERTZ).tolist()
    assert 60.0 * np.abs(receptance(made, HERTZ, True)) == pytest.approx(expected[1], rel=1e-10, abs=1e-18)
    left = null_space(rigid) if len(rigid) else np.eye(4)
    squares = eigh(left.T @ (structure.stiffness + spring) @ left, left.T @ structure.mass @ left, eigvals_only=True)
    assert np.abs(fixed_mode(assemble(made), np.eye(4)[0])[0] / np.sqrt(squares) - 1).min() < 1e-10


def test_sweeps_without_contact_and_with_huge_friction_are_the_references():
    made = scene(matrices(2), JOINT | {"normal_stiffness": 1e5}, ((0, 60.0, 0.0), (1, 5.0, 90.0)))
    axes = {"time": {"periods": 300, "transient": 280}, "sweep": {"excitation.frequency": HERTZ.tolist()}}
    stuck = vd.sweep(made.replace(axes | {"joint.0.preload": 1e3, "joint.0.friction": 10.0}))
    assert stuck.amplitude_mean == pytest.approx(stuck.amplitude_fixed, rel=1e-6)
    free = vd.sweep(made.replace(axes | {"joint.0.gap": 1.0}))
    assert free.amplitude_mean == pytest.approx(free.amplitude_undamped, rel=1e-6)
    assert free.amplitude_fixed == pytest.approx(free.amplitude_undamped, rel=1e-12)  # a gap is open at rest
    ratio = stuck.amplitude_fixed / stuck.amplitude_undamped
    assert ratio.max() > 1.2 and ratio.min() < 0.5


def test_joints_around_a_ring_hold_each_other_once(tmp_path):
    """Six constraints along, one of them the others' sum."""
    disk = LumpedDisk(6)
    points = [
        InterfaceCoordinate(name, "tip", axis, "node") for name, axis in (("along", (0, 1, 0)), ("out", (1, 0, 0)))
    ]
    reduce_ring(disk.sector(), points, 15).save(tmp_path / "ring.h5")
    joint = {"between": ["along", "along@+1"], "normal": ["out", "out@+1"], "sectors": "all"}
    ring = vd.Scene(
        structure={"model": "ring", "file": str(tmp_path / "ring.h5")},
        joint=[joint | {"friction": 0.3, "preload": 2.0, "normal_stiffness": 1e6}],
        excitation={"frequency": 500.0, "force": 20.0, "at": "along", "wave": 2},
    )
    stiffness, mass, place = disk.whole()
    along, out = (np.array([place[j][row] for j in range(6)]) for row in (16, 15))
    apart, across = (row - np.roll(row, -1, axis=0) for row in (along, out))
    squares, shapes = eigh(stiffness, mass)
    damping = mass @ shapes @ np.diag(2 * 0.002 * np.sqrt(squares)) @ shapes.T @ mass
    load = 20.0 * np.exp(-2j * np.pi / 3 * np.arange(6)) @ along
    expected = np.abs(held(mass, stiffness + 1e6 * across.T @ across, damping, apart, load) @ along[0])
    assert linear_responses(ring)[1].amplitude(HERTZ) == pytest.approx(expected, rel=1e-7)


def two_chains(file, blades=10):
    """Two blades of masses in a row on a common root, with a joint between them above the middle."""
    size = 2 * blades
    stiffness = np.zeros((2 * size, 2 * size))
    for first, scale in ((0, 1e6), (size, 1.1e6)):
        for k in range(size):
            spring = scale * (3.0 if k % 2 else 1.0)
            row = np.eye(2 * size)[first + k] - (np.eye(2 * size)[first + k - 2] if k > 1 else 0.0)
            stiffness += spring * np.outer(row, row)
        for k in range(0, size, 2):
            stiffness[first + k : first + k + 2, first + k : first + k + 2] += (
                0.2 * scale * np.array([[1, 0.5], [0.5, 1]])
            )
    for k in range(2):
        row = np.eye(2 * size)[k] - np.eye(2 * size)[size + k]
        stiffness += 3e5 * np.outer(row, row)
    labels = {"tip": size - 2, "a": 12, "a_across": 13, "b": size + 12, "b_across": size + 13}
    ReducedModel.from_matrices(0.05 * np.eye(2 * size), stiffness, labels, damping_ratio=0.003).save(file)


def test_auto_modes_hold_free_and_stuck_structure(tmp_path):
    two_chains(tmp_path / "rom.h5")
    frequencies = np.linspace(245.0, 320.0, 16)

    def made(frequency=250.0, **structure):
        return vd.Scene(
            structure={"model": "rom", "file": str(tmp_path / "rom.h5"), **structure},
            excitation={"frequency": frequency, "force": 5.0, "at": "tip"},
            joint=[JOINT | {"normal_stiffness": 5e6, "preload": 20.0}], time={"periods": 2000, "transient": 1500},
        )  # fmt: skip

    scenes = [made(one, modes="auto", tolerance=0.02) for one in frequencies]
    chosen = with_choice(scenes[0], choices_of(scenes))
    assert chosen.scene.structure.modes < 15 and "in runs from equal starts" in chosen.estimate["sentence"]
    few = made(modes=chosen.scene.structure.modes, natural=True)
    errors = [
        [
            np.linalg.norm(one.amplitude(frequencies) - whole.amplitude(frequencies))
            / np.linalg.norm(whole.amplitude(frequencies))
            for one, whole in zip(linear_responses(other), linear_responses(made()), strict=True)
        ]
        for other in (chosen.scene, few)
    ]
    assert max(errors[0]) < 0.02 < errors[1][1]  # natural modes alone do not hold the stuck structure
    with pytest.raises(InputError, match="of joints without normal_stiffness"):
        choices_of([made(modes="auto").replace({"joint": [JOINT]})])
