"""Joints against an own piecewise solution, friction dampers, time stepping, and differences of whole runs."""

import re
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import vanedamp as vd
from tests.tools.rings import LumpedDisk
from tests.tools.tiers import cases
from vanedamp.files.toml_input import InputError
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.reduction import reduce_ring

OPEN, STICK = "open", "held"
LABELS = {"a": 0, "a_across": 1, "b": 2, "b_across": 3, "same": 1}
JOINT = {"between": ["a", "b"], "normal": ["a_across", "b_across"], "friction": 0.4}


class Matrices(NamedTuple):
    """A structure of two points that move along and across a joint."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


def matrices(seed, coupled=True):
    rng = np.random.default_rng(seed)
    mixed, pulled = rng.normal(size=(2, 4, 4)) * coupled
    mass = np.eye(4) + 0.02 * mixed @ mixed.T
    stiffness = np.diag([2e4, 3e4, 2.5e4, 5e4]) + 1e3 * (pulled + pulled.T)
    return Matrices(mass, stiffness, 2e-4 * stiffness + 2.0 * mass)


def scene(structure, joint, loads=((0, 60.0, 0.0),), frequency=20.0, **more):
    model = ReducedModel.from_matrices(structure.mass, structure.stiffness, LABELS, damping=structure.damping)
    names = list(LABELS)
    load = [{"at": names[at], "force": force, "phase": phase} for at, force, phase in loads]
    excitation = {"frequency": frequency, "at": "a", "load": load}
    return vd.Scene(structure=model, excitation=excitation, **({"joint": [joint]} if joint else {}), **more)


class Piecewise:
    """The motion with one joint on a spring, from state to state: matrix exponentials, and roots by bisection."""

    def __init__(self, structure, joint, loads, frequency, along=(1.0, 0, -1, 0), across=(0, 1.0, 0, -1)):
        omega, n = 2 * np.pi * frequency, len(along)
        self.along, self.across = np.array(along), np.array(across)
        self.spring, self.friction = joint["normal_stiffness"], joint["friction"]
        self.rest = joint.get("gap", 0.0) - joint.get("preload", 0.0) / self.spring
        self.inverse = np.linalg.inv(structure.mass)
        self.free = np.zeros((n, 2 * n + 3))  # forces by (q, q', cos, sin, 1)
        self.free[:, :n], self.free[:, n : 2 * n] = -structure.stiffness, -structure.damping
        self.free[:, -1] = -joint.get("preload", 0.0) * self.across
        for at, force, phase in loads:
            self.free[at, -3] += force * np.sin(np.deg2rad(phase))
            self.free[at, -2] += force * np.cos(np.deg2rad(phase))
        self.turn = np.zeros((2 * n + 3, 2 * n + 3))
        self.turn[:n, n : 2 * n], self.turn[-3, -2], self.turn[-2, -3] = np.eye(n), -omega, omega
        self.period = 2 * np.pi / omega
        # functionals of the state
        self.gap = np.r_[self.across, np.zeros(n + 2), self.rest]
        self.slip = np.r_[np.zeros(n), self.along, np.zeros(3)]
        self.push = -self.spring * self.gap
        held = self.free + np.outer(self.across, self.push)
        self.drag = -(self.along @ self.inverse @ held) / (
            self.along @ self.inverse @ self.along
        )  # that stops the slip
        self.step = self.period / 3000
        self.propagator = cache(lambda state: expm(self.generator(state) * self.step))

    def generator(self, state):
        forces = self.free.copy()
        if state != OPEN:
            forces += np.outer(self.across, self.push)
            forces += np.outer(self.along, self.drag if state == STICK else -state * self.friction * self.push)
        turn = self.turn.copy()
        turn[len(forces) : -3] = self.inverse @ forces
        return turn

    def guards(self, state):
        """Functionals that are not to fall below zero, and what ends then."""
        if state == OPEN:
            return [(self.gap, "impact")]
        if state == STICK:
            room = self.friction * self.push
            return [(self.push, "detach"), (room - self.drag, "slip"), (room + self.drag, "slip")]
        return [(self.push, "detach"), (state * self.slider(state), "stick")]

    def slider(self, state):
        """The speed of what slips in a state."""
        return self.slip

    def root(self, row, state, z, width):
        """Time at which a functional falls below zero, within a width."""
        generator = self.generator(state)
        return brentq(lambda t: row @ expm(generator * t) @ z, 0.0, width, xtol=1e-17)

    def after(self, z, event):
        if event == "detach":
            return OPEN
        if event == "impact":
            return np.sign(self.slip @ z)
        over = abs(self.drag @ z) - self.friction * (self.push @ z)
        return STICK if event != "slip" and over <= 0.0 else -np.sign(self.drag @ z)

    def start(self):
        return np.r_[np.zeros(len(self.turn) - 3), 1.0, 0.0, 1.0]

    def run(self, periods):
        """Return states at the ends of periods (periods, 2 n + 3), and events."""
        z = self.start()
        state = STICK if self.rest < 0.0 else OPEN
        sections, events, t = [], [], 0.0
        for period in range(1, periods + 1):
            while (left := period * self.period - t) > 1e-13 * self.period:
                width = min(self.step, left)
                moved = (self.propagator(state) if width == self.step else expm(self.generator(state) * width)) @ z
                ends = [
                    (self.root(row, state, z, width), name)
                    for row, name in self.guards(state)
                    if row @ moved < 0.0 < row @ z
                ]
                first = min(ends, default=None)
                if first is None:
                    z, t = moved, t + width
                    continue
                z, t = expm(self.generator(state) * first[0]) @ z, t + first[0]
                now = self.after(z, first[1])
                if first[1] == "stick" and now != STICK:
                    events.append((t, "reverses"))
                else:
                    events.append((t, first[1]))
                state = now
                # beyond the root, by less than what counts
                z = expm(self.generator(state) * 1e-12 * self.period) @ z
                t += 1e-12 * self.period
            sections.append(z)
        return np.array(sections), events


LOADS = {
    "in phase": ((0, 60.0, 0.0), (1, 10.0, 0.0)),
    "out of phase": ((0, 60.0, 0.0), (1, 10.0, 90.0), (3, 4.0, 200.0)),
    "lifts off": ((0, 60.0, 0.0), (1, 60.0, 60.0)),
}


@pytest.mark.parametrize(
    ("loads", "coupled", "more", "ends"),
    [
        ("in phase", False, {"preload": 20.0}, {"slip", "reverses"}),
        ("out of phase", False, {"preload": 100.0}, {"slip", "stick"}),
        ("lifts off", False, {"preload": 20.0}, {"slip", "stick", "detach", "impact"}),
        ("lifts off", True, {"preload": 12.0}, {"slip", "reverses", "detach", "impact"}),
        ("lifts off", True, {"gap": 2e-4}, {"reverses", "detach", "impact"}),
    ],
)
def test_the_motion_is_that_of_the_piecewise_solution(loads, coupled, more, ends):
    structure, periods = matrices(1, coupled), 12
    joint = JOINT | {"normal_stiffness": 1e5} | more
    reference = Piecewise(structure, joint, LOADS[loads], 20.0)
    sections, expected = reference.run(periods)
    assert {kind for _, kind in expected} >= ends
    made = scene(structure, joint, LOADS[loads], time={"periods": periods, "transient": 0})
    response = vd.simulate(made, events=True, samples_per_period=1)
    assert {event.side for event in response.event_list} == {"joint"}
    assert abs(response.energy_residual) < 1e-10
    moved = sections[:-1, 0]
    assert response.displacement[1:periods] == pytest.approx(moved, rel=1e-9, abs=1e-9 * np.abs(moved).max())
    expected = [(time, kind) for time, kind in expected if kind != "reverses"]
    assert [event.kind for event in response.event_list] == [kind for _, kind in expected]
    times = [event.time for event in response.event_list]
    assert np.abs(np.subtract(times, [time for time, _ in expected])).max() < 1e-9 * reference.period


@pytest.mark.parametrize("other", ["b", "casing"])
def test_under_a_constant_force_it_is_a_friction_damper(other):
    """Nothing moves across the joint: the line's engine has the damper, the plane's the joint."""
    structure, periods = matrices(0, coupled=False), {"periods": 40, "transient": 20}
    points = {"between": ["a", other], "normal": ["a_across", {"b": "b_across"}.get(other, other)]}
    joint = points | {"friction": 0.4, "preload": 30.0, "normal_stiffness": 1e6}
    damper = {"at": "a", "friction": 0.4, "normal_force": 30.0} | ({"to": "b"} if other == "b" else {})
    by_joint = vd.simulate(scene(structure, joint, time=periods), events=True)
    by_damper = vd.simulate(scene(structure, None, time=periods, friction_damper=[damper]), events=True)
    assert by_joint.amplitude_mean == pytest.approx(by_damper.amplitude_mean, rel=1e-11)
    assert by_joint.energy["friction"] == pytest.approx(by_damper.energy["friction"], rel=1e-10)
    slips = [[event.time for event in one.event_list if event.kind == "slip"] for one in (by_joint, by_damper)]
    assert slips[0] == pytest.approx(slips[1], rel=1e-10)


def random_scene(seed):
    """A structure with one or two joints of any kind, and often a body and a stop."""
    rng = np.random.default_rng((7, seed))

    def joint(points):
        stiffness, rigid = {"normal_stiffness": 10 ** rng.uniform(4, 7)}, {"restitution": rng.uniform(0, 0.8)}
        load, gap = {"preload": rng.uniform(0, 40)}, {"gap": rng.uniform(0, 5e-4)}
        kinds = (stiffness | load, rigid | load, rigid | gap, stiffness | gap)
        kind = kinds[rng.integers(4)] | {"friction": rng.uniform(0, 0.9)}
        if "normal_stiffness" in kind and rng.random() < 0.5:
            kind |= {"tangential_stiffness": 10 ** rng.uniform(3.5, 7)}
        return points | kind

    joints = [joint({"between": ["a", "b"], "normal": ["a_across", "b_across"]})]
    if rng.random() < 0.6:
        joints.append(joint({"between": ["casing", "b"], "normal": ["casing", "b_across"]}))
    more = {}
    if rng.random() < 0.6:
        surfaces = dict.fromkeys(("floor", "left", "right"), "a")
        more["cavity"] = [{"name": "c", "gap": rng.uniform(5e-5, 2e-3), **surfaces}]
        friction, restitution = rng.choice([0.0, 0.2]), rng.uniform(0.1, 0.9)
        more["damper"] = [{"cavity": "c", "mass": 0.05, "friction": friction, "restitution": restitution}]
    if rng.random() < 0.5:
        more["stop"] = [{"side": "right", "gap": rng.uniform(1e-3, 2e-2), "at": "a", "restitution": 0.5}]
    made = scene(matrices(seed), joints[0], ((0, rng.uniform(5, 150), 0.0),), rng.uniform(12, 45), **more)
    return made.replace({"joint": joints, "time": {"periods": 40, "transient": 0}})


@pytest.mark.parametrize("seed", cases(range(300), fast=range(12)))
def test_energy_of_random_scenes_is_balanced(seed):
    response = vd.simulate(random_scene(seed))
    assert response.status is vd.Status.OK
    assert abs(response.energy_residual) < 1e-10


@pytest.mark.parametrize("kind", [{"normal_stiffness": 1e5}, {"restitution": 0.3}])
@pytest.mark.parametrize(
    ("solver", "tolerance"),
    cases(
        [
            ({"method": "solve_ivp", "rtol": 1e-10, "steps_per_period": 200}, 1e-8),
            ({"method": "moreau", "steps_per_period": 20000}, 1e-3),
            ({"method": "penalty", "steps_per_period": 20000}, 3e-3),
        ],
        fast=(),
    ),
)
def test_other_methods_converge_to_it(kind, solver, tolerance):
    made = scene(matrices(0), JOINT | {"preload": 8.0} | kind, time={"periods": 40, "transient": 30})
    exact, other = (vd.simulate(made.replace({"solver": given})) for given in ({"method": "exact"}, solver))
    assert other.amplitude_mean == pytest.approx(exact.amplitude_mean, rel=tolerance)


@pytest.mark.parametrize("along", [{}, {"tangential_stiffness": 3e4}])
def test_a_sweep_is_its_runs(along):
    joint = JOINT | {"normal_stiffness": 1e5, "preload": 8.0} | along
    made = scene(matrices(0), joint, time={"periods": 30, "transient": 20})
    axes = {"joint.0.preload": [0.0, 8.0, 40.0], "joint.0.friction": [0.0, 0.4], "excitation.frequency": [17.0, 22.0]}
    swept = vd.sweep(made.replace({"sweep": axes}))
    for place in np.ndindex(swept.shape):
        numbers = {path: values[index] for (path, values), index in zip(axes.items(), place, strict=True)}
        assert swept.amplitude_mean[place] == vd.simulate(made.replace(numbers)).amplitude_mean


@pytest.mark.parametrize("kind", [{"normal_stiffness": 1e5, "preload": 40.0}, {"preload": 40.0}])
def test_derivatives_are_those_of_differences(kind):
    """Of a motion that slips and sticks without impacts, by central differences of whole runs."""
    made = scene(matrices(0), JOINT | kind, frequency=22.0, time={"periods": 60, "transient": 50})
    paths = ["joint.0.friction", "joint.0.preload", "excitation.frequency"]
    known = vd.sensitivity(made, paths)
    assert known.status.value == "ok"
    for number, path in enumerate(paths):
        at = made.number(path)
        step = 1e-6 * at
        above, below = (vd.sensitivity(made.replace({path: at + d}), [path]).peak[-1] for d in (step, -step))
        assert known.peak_derivative[-1, number] == pytest.approx((above - below) / (2 * step), rel=1e-6)


def test_a_joint_in_each_sector_of_a_ring_against_the_matrices_of_the_whole_ring(tmp_path):
    sectors, disk = 6, LumpedDisk(6)
    points = [
        InterfaceCoordinate(name, "tip", axis, "node") for name, axis in (("along", (0, 1, 0)), ("out", (1, 0, 0)))
    ]
    reduce_ring(disk.sector(), points, 15).save(tmp_path / "ring.h5")
    stiffness, mass, place = disk.whole()
    labels = {f"{name}{j}": place[j][row] for j in range(sectors) for name, row in (("along", 16), ("out", 15))}
    whole = ReducedModel.from_matrices(mass, stiffness, labels, damping_ratio=0.002)
    kind = {"friction": 0.3, "preload": 2.0, "normal_stiffness": 1e6}
    joint = kind | {"between": ["along", "along@+1"], "normal": ["out", "out@+1"], "sectors": "all"}
    each = [
        kind | {"between": [f"along{j}", f"along{(j + 1) % 6}"], "normal": [f"out{j}", f"out{(j + 1) % 6}"]}
        for j in range(sectors)
    ]
    more = {"time": {"periods": 12, "transient": 6}}
    ring = vd.Scene(
        structure={"model": "ring", "file": str(tmp_path / "ring.h5")}, joint=[joint], **more,
        excitation={"frequency": 500.0, "force": 20.0, "at": "along", "wave": 2},
    )  # fmt: skip
    loads = [{"at": f"along{j}", "force": 20.0, "phase": -120.0 * j} for j in range(sectors)]
    written = vd.Scene(
        structure=whole, joint=each, **more, excitation={"frequency": 500.0, "at": "along0", "load": loads}
    )
    one, other = vd.simulate(ring), vd.simulate(written)
    assert one.amplitude_mean == pytest.approx(other.amplitude_mean, rel=1e-7)
    assert one.energy["friction"] == pytest.approx(other.energy["friction"], rel=1e-6)
    assert one.energy["friction"] > 0.01 * one.energy["excitation"]
    assert abs(one.energy_residual) < 1e-10


def test_wear_is_friction_work_over_friction():
    joint = JOINT | {"normal_stiffness": 1e5, "preload": 20.0}
    made = scene(matrices(0), joint, time={"periods": 60, "transient": 50}, wear={"rate": 2e-15})
    response = vd.simulate(made)
    slipped = response.energy["friction"] / 0.4 / 0.5  # N m/s, normal force times slip, over half a second
    (contact,) = response.wear
    assert contact.side == "joint"
    assert contact.volume_rate == pytest.approx(3600.0 * 2e-15 * slipped, rel=1e-9)


@pytest.mark.parametrize(
    ("joint", "error"),
    [
        ({"between": ["a", "a"]}, "between: 'a' does not rub on itself"),
        ({"between": ["a", "casing"]}, 'normal: expected "casing" in the same place as in between'),
        ({"gap": 1e-4, "preload": 2.0}, "gap: a joint that is open at rest has no preload"),
        ({"between": ["a", "x"]}, "joint[0].between: no interface label 'x'"),
        ({"friction": -0.1}, "friction: "),
        ({"normal": ["a_across", "same"]}, "joint[0].normal: a_across and same do not move on each other"),
        ({"friction": 50.0, "preload": 1.0}, "joint[0].friction: 50 lets the structure jam"),
    ],
)
def test_bad_input_is_named(joint, error):
    with pytest.raises(InputError, match=re.escape(error)):
        vd.simulate(scene(matrices(0), JOINT | joint))


def test_a_structure_without_points_has_no_joint():
    tables = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping": 1.0},
        "excitation": {"frequency": 10.0, "force": 1.0},
    }  # fmt: skip
    with pytest.raises(InputError, match="interface labels are a reduced model's"):
        vd.Scene(**tables, joint=[JOINT])
