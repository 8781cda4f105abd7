"""The exact flow against the matrix exponential of the whole constrained system, no modes and no reduction in it.

The matrix exponential knows masses, springs, dampers, loads and the closed rows as constraints on accelerations; the
flow knows complex modes of what remains. They share the matrix of rows alone.
"""

import itertools

import numpy as np
import pytest
from scipy.linalg import expm, null_space

from tests.tools.tiers import cases, seeds
from vanedamp.coupling.engine.known import IllConditioned, with_place
from vanedamp.coupling.engine.line.flow_assembly import fill, new_assembly_scratch
from vanedamp.coupling.engine.line.subsystem_assembly import empty_flows
from vanedamp.coupling.engine.line.subsystems import new_known
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.modal_basis import ModalBasis
from vanedamp.files.toml_input import validate

OMEGA = 1.3


def add_flow(flows, system, closed):
    """The flows with that of the closed rows (r,), at a place that was free."""
    known = new_known(system)
    k = known.place(system, closed)
    flows = with_place(flows, known, k)
    s = int(np.flatnonzero(flows.subsystem == 0)[0])
    if not fill(system, known.stack, k, flows, s, new_assembly_scratch(system)):
        raise IllConditioned("its modes cancel, it rests too far away, or nothing damps its resonance")
    return flows


def random_system(seed, modes, bodies, labels, proportional=False):
    """A random system: `labels` is "one" or "three" functionals a cavity; two bodies share the first one."""
    rng = np.random.default_rng([seed, modes, bodies])
    cavities = max(bodies - 1, 1)
    sides = ("floor",) if labels == "one" else ("left", "right", "floor")
    scene = validate(
        Scene,
        {
            "structure": {"model": "rom", "file": "not read"},
            "excitation": {"frequency": OMEGA / (2 * np.pi), "at": "force", "force": 1.0},
            "gravity": {"acceleration": 1.0, "orientation_deg": 40.0},
            "cavity": [{"name": f"c{i}", "gap": 1.0} | {side: f"{side}{i}" for side in sides} for i in range(cavities)],
            "damper": [
                {"cavity": f"c{max(i - 1, 0)}", "mass": rng.uniform(0.05, 0.5), "friction": 0.3, "position": 0.1 * i}
                for i in range(bodies)
            ],
        },
        "scene",
    )
    half = rng.normal(size=(modes, modes))
    damping = np.diag(rng.uniform(0.01, 0.3, modes)) if proportional else 0.05 * half @ half.T + 0.01 * np.eye(modes)
    rows = {"force": rng.uniform(-1.0, 1.0, modes)}
    rows |= {f"{side}{i}": rng.uniform(-1.0, 1.0, modes) for side in sides for i in range(cavities)}
    along = dict.fromkeys(rows, np.array([1.0, 0.0, 0.0]))
    unknown = dict.fromkeys(rows, np.zeros(3))
    stiffness = np.sort(rng.uniform(0.5, 25.0, modes))
    basis = ModalBasis(stiffness, damping, np.zeros((modes, 3)), rows, along, unknown)
    system = line_system(assemble(scene, basis))
    # a base that moves at an angle of its own to each cavity
    shaken = 0.4j * system.of_bodies.mass * np.cos(np.maximum(np.arange(bodies) - 1, 0))
    return system._replace(load=np.r_[-1j * rng.uniform(-1.0, 1.0, modes), shaken][None], alike=False), rng


def keys(system):
    """Every set of independent closed rows, as flags (r,) and as numbers."""
    jacobian = system.J
    for flags in itertools.product([False, True], repeat=len(jacobian)):
        key = np.array(flags[::-1])
        closed = np.flatnonzero(key)
        if len(closed) == 0 or np.linalg.matrix_rank(jacobian[closed], tol=1e-6) == len(closed):
            yield key, closed


def by_exponential(system, closed, loads, q, qd, times):
    """(q, q', constraint forces) at `times`: the generator of (q, q', 1, sin, cos) with constraints on q''."""
    n, b = system.modes, system.bodies
    size = n + b
    jacobian = system.J[closed]
    inverse = np.diag(1 / system.mass)
    free = np.zeros((size, 2 * size + 3))
    free[:n, :n], free[:n, size : size + n] = -np.diag(system.of_structure.stiffness), -system.of_structure.damping
    free[:, -3] = loads
    # harmonic loads are the real part of (amplitude exp(i omega t)), in phase with the sine
    free[:, -2] = -system.load[0].imag
    multiplier = -np.linalg.solve(jacobian @ inverse @ jacobian.T, jacobian @ inverse @ free)
    generator = np.zeros((2 * size + 3, 2 * size + 3))
    generator[:size, size : 2 * size] = np.eye(size)
    generator[size : 2 * size] = inverse @ (free + jacobian.T @ multiplier)
    generator[-2, -1], generator[-1, -2] = OMEGA, -OMEGA
    start = np.r_[q, qd, 1.0, 0.0, 1.0]
    states = np.array([expm(generator * t) @ start for t in times])
    return states[:, :size], states[:, size : 2 * size], states @ multiplier.T


def by_flow(system, closed, flows, loads, q, qd, times):
    """The same from the records of one subsystem, as coupling.engine.line.subsystem_assembly documents them."""
    n, m = system.modes, flows.modes[0]
    p, rate = np.r_[q[:n], qd[:n]], flows.eigenvalue[0, :m]
    constant = (flows.static[0] @ loads + flows.constrained[0] @ q[:n])[:n]
    shape = flows.shape[0, :m].T
    amplitude = np.r_[1.0, flows.project[0, 1:m] @ (p - np.r_[constant, np.zeros(n)] - shape[:, 0].real)]
    coordinates, displacement, force = [], [], []
    drift = system.of_bodies.J @ flows.body_acceleration[0] @ loads[n:]
    speed = system.J @ qd
    on_structure = loads[:n] - system.of_structure.stiffness * constant
    acceleration = system.J @ np.r_[on_structure, loads[n:] / system.of_bodies.mass]
    level = -flows.closed_inverse[0] @ acceleration
    for t in times:
        now = amplitude * np.exp(rate * t)
        coordinates.append(np.r_[constant, np.zeros(n)] + (shape @ now).real)
        line = amplitude * (np.exp(rate * t) - 1 - rate * t)
        displacement.append(speed * t + drift * t**2 / 2 + (flows.motion[0, :, :m] @ line).real)
        force.append((level + (flows.force[0, :, :m] @ now).real)[closed])
    return np.array(coordinates), np.array(displacement), np.array(force)


def check(system, rng):
    n, b = system.modes, system.bodies
    jacobian = system.J
    times = np.array([1e-3, 0.3, 2.0, 10.0])
    checked = 0
    for key, closed in keys(system):
        allowed = null_space(jacobian[closed]) if len(closed) else np.eye(n + b)
        if allowed.shape[1] == 0:
            continue
        q, qd = rng.normal(size=n + b), allowed @ rng.normal(size=allowed.shape[1])
        loads = np.r_[rng.normal(size=n) * 0.3, system.of_bodies.weight + 0.1 * rng.normal(size=b)]
        flows = add_flow(empty_flows(system), system, key)
        expected_q, expected_qd, expected_force = by_exponential(system, closed, loads, q, qd, times)
        coordinates, displacement, force = by_flow(system, closed, flows, loads, q, qd, times)
        size = np.abs(np.hstack([expected_q, expected_qd])).max()
        # closed rows that are nearly parallel have large forces, whose round-off the exponential carries along
        # scipy's has errors of its own: 1e-13 in 1.10, 4e-13 in 1.18
        tolerance = 1e-12 * np.linalg.cond(system.delassus[np.ix_(closed, closed)]) if len(closed) else 1e-12
        assert np.abs(coordinates[:, :n] - expected_q[:, :n]).max() < tolerance * size
        assert np.abs(coordinates[:, n:] - expected_qd[:, :n]).max() < tolerance * size
        assert np.abs(displacement - (expected_q - q) @ jacobian.T).max() < tolerance * size
        if len(closed):
            assert np.abs(force - expected_force).max() < tolerance * np.abs(expected_force).max()
        checked += 1
    return checked


@pytest.mark.parametrize("seed", seeds(3, fast=[0]))
@pytest.mark.parametrize("labels", ["one", "three"])
@pytest.mark.parametrize(
    ("modes", "bodies"), cases([(1, 1), (2, 1), (1, 2), (3, 2), (4, 3), (6, 3)], fast=[(2, 1), (1, 2), (3, 2), (4, 3)])
)
def test_flow_equals_the_matrix_exponential(modes, bodies, labels, seed):
    """Every subsystem of bodies that stick, rest at walls and push each other, under non-proportional damping."""
    assert check(*random_system(seed, modes, bodies, labels)) >= 2**bodies


def test_flow_of_a_proportionally_damped_structure():
    assert check(*random_system(0, 5, 2, "three", proportional=True)) >= 4


def test_steps_compose():
    """Two steps are one: the flow of a subsystem forgets nothing (a semigroup)."""
    system, rng = random_system(7, 4, 3, "three")
    n = system.modes
    key, closed = next((key, closed) for key, closed in keys(system) if len(closed) == 2)
    q = rng.normal(size=n + system.bodies)
    qd = null_space(system.J[closed]) @ rng.normal(size=len(q) - 2)
    loads = np.r_[np.zeros(n), system.of_bodies.weight]
    flows = add_flow(empty_flows(system), system, key)
    m, period = flows.modes[0], 2 * np.pi / OMEGA
    at_once, _, _ = by_flow(system, closed, flows, loads, q, qd, np.array([3 * period]))
    for _ in range(3):
        step, _, _ = by_flow(system, closed, flows, loads, q, qd, np.array([period]))
        q, qd = np.r_[step[0, :n], q[n:]], np.r_[step[0, n:], qd[n:]]
    assert m > n
    assert np.r_[q[:n], qd[:n]] == pytest.approx(at_once[0], abs=1e-13 * np.abs(at_once).max())
