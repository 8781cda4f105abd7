"""Joints with a spring along under a normal force that varies, against own programs from event to event."""

import re

import numpy as np
import pytest
from numba import njit
from scipy.linalg import eigh

import vanedamp as vd
from tests.coupling.scene.elements.test_joint import JOINT, LOADS, OPEN, STICK, Matrices, Piecewise, matrices, scene
from tests.tools.rings import LumpedDisk
from tests.tools.tiers import cases
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError
from vanedamp.rom.interface import InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.reduction import reduce_ring

SPRINGS = {"normal_stiffness": 1e5, "tangential_stiffness": 3e4}


class Sprung(Piecewise):
    """The same with a spring before the slip: its force is one more state, k_t (along - slider)."""

    def __init__(self, structure, joint, loads, frequency):
        super().__init__(structure, joint, loads, frequency)
        self.stiffness = joint["tangential_stiffness"]
        self.gap, self.slip, self.push = (np.append(row, 0.0) for row in (self.gap, self.slip, self.push))
        self.drag = np.eye(12)[11]

    def force_rate(self, state):
        if state == OPEN:
            return np.zeros(12)
        if state == STICK:
            return self.stiffness * self.slip
        rate = np.zeros(12)
        rate[4:8] = -state * self.friction * self.spring * self.across
        return rate

    def slider(self, state):
        return self.slip - self.force_rate(state) / self.stiffness

    def generator(self, state):
        forces = np.hstack([self.free, np.zeros((4, 1))]) - np.outer(self.along, self.drag)
        if state != OPEN:
            forces += np.outer(self.across, self.push)
        turn = np.zeros((12, 12))
        turn[:11, :11] = self.turn
        turn[4:8], turn[11] = self.inverse @ forces, self.force_rate(state)
        return turn

    def after(self, z, event):
        if event == "detach":
            z[11] = 0.0
            return OPEN
        if event == "stick":
            return STICK
        way = np.sign((self.drag if event == "slip" else self.slip) @ z)
        return way if way * (self.slider(way) @ z) > 0.0 else STICK

    def start(self):
        return np.append(super().start(), 0.0)


@pytest.mark.parametrize(
    ("loads", "coupled", "more", "ends"),
    [
        ("in phase", False, {"preload": 20.0}, {"slip", "stick"}),
        ("out of phase", True, {"preload": 100.0}, {"slip", "stick"}),
        ("lifts off", False, {"preload": 20.0}, {"slip", "stick", "detach", "impact"}),
        ("lifts off", True, {"preload": 100.0}, {"slip", "stick"}),
        ("lifts off", False, {"gap": 2e-4}, {"detach", "impact"}),
        ("lifts off", False, {"preload": 20.0, "normal_stiffness": 1e4}, {"slip", "stick", "detach", "impact"}),
        ("out of phase", False, {"preload": 60.0, "tangential_stiffness": 1e6}, {"slip", "stick"}),
    ],
)
def test_the_motion_is_that_of_the_piecewise_solution(loads, coupled, more, ends):
    structure, periods, joint = matrices(1, coupled), 12, JOINT | SPRINGS | more
    reference = Sprung(structure, joint, LOADS[loads], 20.0)
    sections, expected = reference.run(periods)
    assert {kind for _, kind in expected} >= ends
    made = scene(structure, joint, LOADS[loads], time={"periods": periods, "transient": 0})
    response = vd.simulate(made, events=True, samples_per_period=1)
    assert abs(response.energy_residual) < 1e-10
    moved = sections[:-1, 0]
    assert response.displacement[1:periods] == pytest.approx(moved, rel=1e-9, abs=1e-9 * np.abs(moved).max())
    assert [event.kind for event in response.event_list] == [kind for _, kind in expected]
    times = [event.time for event in response.event_list]
    assert np.abs(np.subtract(times, [time for time, _ in expected])).max() < 1e-9 * reference.period


#: forces along and across, angular frequency, lead of the latter; at time zero displacements and speeds of both, and
#: the force along: by Newton's method on an own map from event to event, closed to 1e-14
ORBITS = [
    (8, 2, 2.4, 0, (-1.659033422353, 0.041459328769745, 12.6455078463549, 9.9007352320e-05, -10.1990031280)),
    (8, 4, 2.6, 60, (-1.764075468865, 0.042417669849259, 10.1657954320647, -0.190536183963, 1.95467830143)),
    (8, 6, 2.2, 180, (2.559768627069, -0.122050349744922, 9.6907019376870, -2.4032697019e-04, -2.84106759481)),
    (4, 9, 2.5, 90, (2.220362109700, 2.710158406405e-04, 8.6709010234221, -0.485065622754, -6.91194628503)),
    (4, 30, 1.5, 60, (1.821670066528, 0.957987762810478, 0.717429947475, -12.5769366234514, -4.28580848422)),
]


@pytest.mark.parametrize(("along", "across", "omega", "lead", "motion"), ORBITS)
def test_orbits_of_two_oscillators_are_those_of_another_program(along, across, omega, lead, motion):
    """Masses 1 on springs 4 that meet a joint of 50 across and 5 along, pressed on by 10 N; the last two lift off."""
    model = ReducedModel.from_matrices(np.eye(2), 4.0 * np.eye(2), {"t": 0, "n": 1}, damping=0.02 * np.eye(2))
    loads = [{"at": "t", "force": along, "phase": 90.0}, {"at": "n", "force": across, "phase": 90.0 + lead}]
    preload = 500.0 / 54.0
    joint = {"between": ["casing", "t"], "normal": ["casing", "n"], "friction": 0.9, "preload": preload}
    made = vd.Scene(
        structure=model, excitation={"frequency": omega / (2 * np.pi), "at": "t", "load": loads},
        joint=[joint | {"normal_stiffness": 50.0, "tangential_stiffness": 5.0}],
        time={"periods": 400, "transient": 390},
        orbit={"parameter": "joint.0.preload", "from": preload, "to": preload + 0.01, "max_points": 2},
    )  # fmt: skip
    (branch,) = vd.orbits(made).branches
    system = assemble(made)
    rows = -np.array([system.elongation[0, :2], system.J[0, :2]])  # of modes, whose signs are open
    places, rates, elongation = np.split(branch.state[0], [2, 4])
    found, wanted = np.r_[rows @ places, rows @ rates, elongation], np.r_[motion[:4], motion[4] / 5.0]
    assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()


def test_under_a_constant_force_it_is_a_friction_damper_with_a_spring():
    """Nothing moves across the joint: the line's engine has the damper, the plane's the joint."""
    structure, periods = matrices(0, coupled=False), {"periods": 40, "transient": 20}
    joint = JOINT | SPRINGS | {"preload": 30.0}
    damper = {"at": "a", "to": "b", "friction": 0.4, "normal_force": 30.0, "stiffness": 3e4}
    by_joint = vd.simulate(scene(structure, joint, time=periods))
    by_damper = vd.simulate(scene(structure, None, time=periods, friction_damper=[damper]))
    assert by_joint.amplitude_mean == pytest.approx(by_damper.amplitude_mean, rel=1e-11)
    assert by_joint.energy["friction"] == pytest.approx(by_damper.energy["friction"], rel=1e-10)


@pytest.mark.parametrize("more", cases([{"preload": 8.0}, {"gap": 2e-4}], fast=()))
@pytest.mark.parametrize(
    "solver",
    [
        {"method": "solve_ivp", "rtol": 1e-10, "steps_per_period": 200},
        {"method": "moreau", "steps_per_period": 5000},
        {"method": "penalty", "steps_per_period": 5000},
        {"method": "penalty", "scheme": "newmark", "steps_per_period": 5000},
    ],
    ids=lambda solver: solver.get("scheme", solver["method"]),
)
def test_other_methods_converge_to_it(more, solver):
    made = scene(matrices(0), JOINT | SPRINGS | more, LOADS["lifts off"], time={"periods": 40, "transient": 30})
    exact, other = (vd.simulate(made.replace({"solver": given})) for given in ({"method": "exact"}, solver))
    assert other.amplitude_mean == pytest.approx(exact.amplitude_mean, rel=1e-5)
    assert other.energy["friction"] == pytest.approx(exact.energy["friction"], rel=1e-4)


@pytest.mark.parametrize(("loads", "more"), [("out of phase", {"preload": 40.0}), ("lifts off", {"preload": 20.0})])
def test_derivatives_are_those_of_differences(loads, more):
    made = scene(matrices(0), JOINT | SPRINGS | more, LOADS[loads], 22.0, time={"periods": 30, "transient": 20})
    paths = [f"joint.0.{key}" for key in ("friction", "preload", *SPRINGS)] + ["excitation.frequency"]
    known = vd.sensitivity(made, paths)
    assert known.status.value == "ok"
    for number, path in enumerate(paths):
        at, peaks = made.number(path), []
        step = 1e-5 * at
        for shift in (step, -step):
            peaks.append(vd.sensitivity(made.replace({path: at + shift}), [path]).peak[-1])
        assert known.peak_derivative[-1, number] == pytest.approx((peaks[0] - peaks[1]) / (2 * step), rel=3e-6)


def test_a_run_goes_on_from_the_elongation_of_its_spring():
    """Two halves of a run, and a run under less preload, whose spring unloads to its bound."""
    made = scene(matrices(0), JOINT | SPRINGS | {"preload": 40.0}, LOADS["out of phase"])
    times = [{"time": {"periods": periods, "transient": 0}} for periods in (20, 7, 13)]
    whole, first = (vd.simulate(made.replace(time), samples_per_period=1) for time in times[:2])
    second = vd.simulate(made.replace(times[2]), start=first.final, samples_per_period=1)
    assert abs(first.final.elongation[0]) > 1e-5
    assert second.displacement == pytest.approx(whole.displacement[7:20], rel=1e-10)
    looser = vd.simulate(made.replace(times[2] | {"joint.0.preload": 0.5}), start=first.final)
    assert looser.status is vd.Status.OK
    assert abs(looser.energy_residual) < 1e-10


def blades(points=12):
    """Two blades of masses in a row, bent along and across a joint at a third of their height; mass and stiffness."""
    row = 4e5 * (2.0 * np.eye(points) - np.eye(points, k=1) - np.eye(points, k=-1))
    row[-1, -1] = 4e5
    mixed, none = 6e4 * np.eye(points), np.zeros((points, points))
    parts = []
    for blade in (1.0, 1.06):
        parts.append([blade * row + mixed, mixed, none, none, blade * 3.0 * row + mixed])
    (a, mix, _, _, a_across), (b, _, _, _, b_across) = parts
    stiffness = np.block([
        [a, mix, none, none], [mix, a_across, none, none], [none, none, b, mix], [none, none, mix, b_across],
    ])  # fmt: skip
    return Matrices(0.02 * np.eye(4 * points), stiffness, np.zeros((4 * points, 4 * points)))


def test_residual_flexibility_makes_up_for_modes_that_are_left_out(tmp_path):
    """Natural frequencies with the joint stuck, against those of the whole matrices."""
    points, (mass, stiffness, _) = 12, blades()
    places = {f"{name}{end}": points * block + 4 for block, (name, end) in enumerate(
        [("a", ""), ("a", "_across"), ("b", ""), ("b", "_across")])}  # fmt: skip
    ReducedModel.from_matrices(mass, stiffness, places, damping_ratio=0.002).save(tmp_path / "blades.h5")
    stuck, unit = stiffness.copy(), np.eye(4 * points)
    for spring, first, second in ((1e6, "a", "b"), (2e6, "a_across", "b_across")):
        apart = unit[places[first]] - unit[places[second]]
        stuck += spring * np.outer(apart, apart)
    exact = np.sqrt(np.linalg.eigvalsh(stuck / 0.02))[:3]
    errors = {}
    for residual in (False, True):
        system = assemble(vd.Scene(
            structure={"model": "rom", "file": str(tmp_path / "blades.h5"), "natural": True, "modes": 16},
            excitation={"frequency": 100.0, "force": 1.0, "at": "a"},
            joint=[JOINT | {
                "preload": 5.0, "normal_stiffness": 2e6, "tangential_stiffness": 1e6, "residual": residual
            }],
        ))  # fmt: skip
        n = system.modes
        matrix = np.diag(system.squares) + system.spring[0] * np.outer(system.J[0, :n], system.J[0, :n])
        matrix += system.tangential[0] * np.outer(system.elongation[0, :n], system.elongation[0, :n])
        errors[residual] = np.abs(np.sqrt(np.linalg.eigvalsh(matrix))[:3] / exact - 1.0).max()
    assert errors[True] < 1e-3 < 0.03 < errors[False]


@pytest.mark.parametrize(
    ("joint", "error"),
    [
        ({"tangential_stiffness": 1e4}, "tangential_stiffness: needs normal_stiffness"),
        ({"residual": True}, "joint[0].residual: the modes lack none between a_across and b_across"),
    ],
)
def test_bad_input_is_named(joint, error):
    with pytest.raises(InputError, match=re.escape(error)):
        vd.simulate(scene(matrices(0), JOINT | joint))


@pytest.mark.parametrize("more", [{}, {"restitution": 0.5}])
def test_rigid_joints_all_round_are_rejected(more):
    """Their closing loads cancel, and the equations do not tell their normal forces: on springs they do."""
    points = [("a", "a_across"), ("b", "b_across"), ("casing", "casing")]
    joints = [
        {"between": [one[0], two[0]], "normal": [one[1], two[1]], "friction": 0.3, "preload": 20.0}
        for one, two in zip(points, points[1:] + points[:1], strict=True)
    ]
    made = scene(matrices(0), None, time={"periods": 5, "transient": 0})
    with pytest.raises(InputError, match="joint: the modes do not tell normal forces"):
        vd.simulate(made.replace({"joint": [joint | more for joint in joints]}))
    # equal ones would slip at one instant, which last bits decide
    sprung = [joint | {"normal_stiffness": 1e6, "preload": 20.0 + at} for at, joint in enumerate(joints)]
    pressed = vd.simulate(made.replace({"joint": sprung}))
    assert pressed.energy["friction"] > 0.0


@njit
def stepped(mass, stiffness, damping, rows, joint, load, watched, periods, steps):
    """Displacement of a row (n,), 100 times per period, by own explicit steps; rows: across and along, by joint.

    mass (n,); load: complex amplitudes (n,).
    """
    preload, across, along, friction, omega = joint
    h, kept = 2 * np.pi / omega / steps, []
    q, v, slider = np.zeros(len(mass)), np.zeros(len(mass)), np.zeros(len(rows))
    for step in range(periods * steps):
        if step % (steps // 100) == 0:
            kept.append(watched @ q)
        force = (load * np.exp(1j * omega * h * step)).real - stiffness @ q - damping @ v
        for j in range(len(rows)):
            push, driver = max(preload - across * (rows[j, 0] @ q), 0.0), rows[j, 1] @ q
            bound = friction * push / along
            slider[j] = min(max(slider[j], driver - bound), driver + bound)
            force += rows[j, 0] * (push - preload) - rows[j, 1] * (along * (driver - slider[j]))
        v += (0.5 if step == 0 else 1.0) * h * force / mass
        q += h * v
    return np.array(kept)


@pytest.mark.parametrize(("load", "frequency"), [(20.0, 128.0), (5.0, 127.0)])
def test_a_wedge_between_platforms_is_a_part_with_two_joints(load, frequency):
    """Its centrifugal load presses it on both faces; under the smaller one it flies."""
    sine, cosine, unit = np.sin(np.deg2rad(40.0)), np.cos(np.deg2rad(40.0)), np.eye(8)
    blade = 1e5 * np.array([[3.0, -1.0, 0.3], [-1.0, 1.0, 0.0], [0.3, 0.0, 20.0]])  # platform, tip, platform's height
    mass, stiffness = np.r_[np.full(6, 0.1), 0.02, 0.02], np.zeros((8, 8))
    stiffness[:3, :3] = stiffness[3:6, 3:6] = blade
    stiffness[6, 6] = stiffness[7, 7] = 10.0
    damping = 2e-5 * stiffness
    labels, rows = {"tip": 1, "tip_b": 4}, np.zeros((2, 2, 8))
    for j, (platform, side) in enumerate(((0, 1.0), (3, -1.0))):
        for across, (x, y) in enumerate(((side * cosine, sine), (side * sine, -cosine))):
            end = "_across" * across
            labels[f"platform_{j}{end}"] = x * unit[platform] + y * unit[platform + 2]
            labels[f"wedge_{j}{end}"] = x * unit[6] + y * unit[7]
            rows[j, 1 - across] = labels[f"wedge_{j}{end}"] - labels[f"platform_{j}{end}"]
    preload, periods = load / (2 * cosine), 4
    springs = {"normal_stiffness": 4e6, "tangential_stiffness": 3e6}
    made = vd.Scene(
        structure=ReducedModel.from_matrices(np.diag(mass), stiffness, labels, damping=damping),
        excitation={
            "frequency": frequency, "at": "tip",
            "load": [{"at": "tip", "force": 6.0}, {"at": "tip_b", "force": 6.0, "phase": 180.0}],
        },
        joint=[
            springs | {"friction": 0.3, "preload": preload} | {
                key: [f"wedge_{j}{end}", f"platform_{j}{end}"] for key, end in (("between", ""), ("normal", "_across"))
            }
            for j in range(2)
        ],
        time={"periods": periods, "transient": 0},
    )  # fmt: skip
    response = vd.simulate(made, samples_per_period=100)
    assert response.status is vd.Status.OK
    assert abs(response.energy_residual) < 1e-10
    joint = (preload, *springs.values(), 0.3, 2 * np.pi * frequency)
    force = -6.0j * (unit[1] - unit[4])
    own = [stepped(mass, stiffness, damping, rows, joint, force, unit[1], periods, steps) for steps in (10000, 40000)]
    errors = [np.abs(one - response.displacement[: 100 * periods]).max() / np.abs(one).max() for one in own]
    assert errors[1] < 0.5 * errors[0] < 1e-4


def test_joints_of_a_tuned_ring_that_all_slip(tmp_path):
    """As all slip, pairs of its modes are one: against own steps with springs along that are ever stiffer."""
    disk, sectors, periods = LumpedDisk(6), 6, 3
    points = [
        InterfaceCoordinate(name, "tip", axis, "node") for name, axis in (("along", (0, 1, 0)), ("out", (1, 0, 0)))
    ]
    reduce_ring(disk.sector(), points, 15).save(tmp_path / "ring.h5")
    made = vd.Scene(
        structure={"model": "ring", "file": str(tmp_path / "ring.h5"), "modes": 18},
        joint=[{"between": ["along", "along@+1"], "normal": ["out", "out@+1"], "friction": 0.3, "preload": 2.0,
                "normal_stiffness": 1e6, "sectors": "all"}],
        excitation={"frequency": 300.0, "force": 20.0, "at": "along", "wave": 1},
        time={"periods": periods, "transient": 0},
    )  # fmt: skip
    response = vd.simulate(made, samples_per_period=100)
    assert response.status is vd.Status.OK
    assert abs(response.energy_residual) < 1e-10
    stiffness, mass, place = disk.whole()
    squares, shapes = eigh(stiffness, mass)
    squares, along, out = squares[:18], place[:, 16] @ shapes[:, :18], place[:, 15] @ shapes[:, :18]
    rows = np.stack([out - np.roll(out, -1, axis=0), along - np.roll(along, -1, axis=0)], axis=1)
    load = -20.0j * np.exp(-2j * np.pi * np.arange(sectors) / sectors) @ along
    damping, errors = np.diag(2 * 0.002 * np.sqrt(squares)), []
    for spring in (1e7, 1e8, 1e9):
        joint = (2.0, 1e6, spring, 0.3, 2 * np.pi * 300.0)
        own = stepped(np.ones(18), np.diag(squares), damping, rows, joint, load, along[0], periods, 80000)
        errors.append(np.abs(own - response.displacement[: 100 * periods]).max() / np.abs(own).max())
    assert errors[2] < 0.4 * errors[1] < 0.16 * errors[0] < 0.004  # as the root of their flexibility
