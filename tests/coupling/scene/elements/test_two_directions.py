"""Joints with two directions along: each has its own limit, a box, under one normal force."""

import re

import numpy as np
import pytest
from numba import njit
from scipy.linalg import eigh

import vanedamp as vd
from tests.tools.tiers import cases
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_response
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel

LABELS = {"a": 0, "a_across": 1, "b": 2, "b_across": 3, "a_side": 4, "b_side": 5}
ROWS = np.array([[0, 1, 0, -1, 0, 0], [1, 0, -1, 0, 0, 0], [0, 0, 0, 0, 1, -1.0]])
SPRINGS = {"normal_stiffness": 1e5, "tangential_stiffness": 2e5}
JOINT = {
    "between": ["a", "b"], "normal": ["a_across", "b_across"], "sideways": ["a_side", "b_side"], "friction": 0.4,
    "preload": 20.0,
} | SPRINGS  # fmt: skip
#: amplitude along, N: it sticks for most of the time, it stays closed, it lifts off
AMPLITUDES = (10.0, 40.0, 120.0)


def matrices(seed):
    rng = np.random.default_rng(seed)
    mixed, pulled = rng.normal(size=(2, 6, 6))
    stiffness = np.diag([2e4, 3e4, 2.5e4, 5e4, 2.2e4, 3.3e4]) + 1e3 * (pulled + pulled.T)
    mass = np.eye(6) + 0.02 * mixed @ mixed.T
    return mass, stiffness, 2e-4 * stiffness + 2.0 * mass


def loads(amplitude):
    return [
        {"at": "a", "force": amplitude}, {"at": "a_side", "force": amplitude, "phase": 70.0},
        {"at": "a_across", "force": 0.5 * amplitude, "phase": 30.0},
    ]  # fmt: skip


def scene(seed, amplitude, joint=JOINT, **more):
    mass, stiffness, damping = matrices(seed)
    return vd.Scene(
        structure=ReducedModel.from_matrices(mass, stiffness, LABELS, damping=damping),
        excitation={"frequency": 20.0, "at": "a", "load": loads(amplitude)}, joint=[joint], **more,
    )  # fmt: skip


@njit
def stepped(inverse, stiffness, damping, rows, load, joint, omega, periods, steps):
    """Displacement of the first, 100 times per period, work of friction, and closings, by own explicit steps."""
    preload, across, along, friction = joint
    h, kept, work, closings, closed = 2 * np.pi / omega / steps, np.zeros(100 * periods), 0.0, 0, True
    q, v, slider = np.zeros(len(inverse)), np.zeros(len(inverse)), np.zeros(2)
    for step in range(periods * steps):
        if step % (steps // 100) == 0:
            kept[step // (steps // 100)] = q[0]
        push = max(preload - across * (rows[0] @ q), 0.0)
        closings += push > 0.0 and not closed
        closed, bound = push > 0.0, friction * push / along
        force = (load * np.exp(1j * omega * h * step)).real - stiffness @ q - damping @ v + rows[0] * (push - preload)
        for j in range(2):
            driver = rows[1 + j] @ q
            there = min(max(slider[j], driver - bound), driver + bound)
            work += along * (driver - there) * (there - slider[j])
            slider[j] = there
            force -= rows[1 + j] * (along * (driver - there))
        v += (0.5 if step == 0 else 1.0) * h * (inverse @ force)
        q += h * v
    return kept, work, closings


@pytest.mark.parametrize("seed", cases(range(4), fast=range(2)))
@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_the_motion_is_that_of_own_steps(seed, amplitude):
    """So are the work of both directions and the impacts; wear is their work over the coefficient."""
    made = scene(seed, amplitude, time={"periods": 6, "transient": 0}, wear={"rate": 1e-15})
    response = vd.simulate(made, samples_per_period=100)
    assert response.status is vd.Status.OK
    assert abs(response.energy_residual) < 1e-12
    mass, stiffness, damping = matrices(seed)
    load = np.zeros(6, complex)
    for one in loads(amplitude):
        load[LABELS[one["at"]]] = -1j * one["force"] * np.exp(1j * np.deg2rad(one.get("phase", 0.0)))
    joint, errors = (20.0, *SPRINGS.values(), 0.4), []
    for steps in (4000, 16000):
        given = (np.linalg.inv(mass), stiffness, damping, ROWS, load, joint, 2 * np.pi * 20.0, 6, steps)
        own, work, closings = stepped(*given)
        errors.append(np.abs(own - response.displacement[:600]).max() / np.abs(own).max())
    assert errors[1] < 0.5 * errors[0] < 5e-4
    assert response.energy["friction"] == pytest.approx(work, rel=1e-3)
    assert 6 * response.impacts_per_period == pytest.approx(closings)
    assert sum(one.energy for one in response.contact_friction) == pytest.approx(response.energy["friction"] / 6)
    assert [one.name for one in response.contact_friction] == ["joint 0, along", "joint 0, sideways"]
    assert 0.4 * sum(one.sliding for one in response.wear) == pytest.approx(response.energy["friction"], rel=1e-9)


def test_alone_each_direction_is_a_joint_of_its_own():
    """Pushed along only, and with nothing that couples the directions, it is the joint without the second."""
    stiffness = np.diag([2e4, 3e4, 2.5e4, 5e4, 2.2e4, 3.3e4])
    model = ReducedModel.from_matrices(np.eye(6), stiffness, LABELS, damping=2e-4 * stiffness)
    single = {key: value for key, value in JOINT.items() if key != "sideways"}
    of_both, of_one = (
        vd.simulate(vd.Scene(
            structure=model, joint=[joint], time={"periods": 60, "transient": 50},
            excitation={"frequency": 20.0, "at": "a", "load": [loads(120.0)[0], loads(120.0)[2]]},
        ))
        for joint in (JOINT, single)
    )  # fmt: skip
    assert of_both.amplitude_mean == pytest.approx(of_one.amplitude_mean, rel=1e-10)
    assert of_both.impacts_per_period == of_one.impacts_per_period > 0
    assert of_both.contact_friction[1].energy == 0.0


@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_derivatives_are_those_of_differences(amplitude):
    made = scene(0, amplitude, time={"periods": 30, "transient": 20})
    paths = [f"joint.0.{key}" for key in ("friction", "preload", *SPRINGS)] + ["excitation.frequency"]
    known = vd.sensitivity(made, paths)
    assert known.status.value == "ok"
    for number, path in enumerate(paths):
        at, peaks = made.number(path), []
        for shift in (1e-5 * at, -1e-5 * at):
            peaks.append(vd.sensitivity(made.replace({path: at + shift}), [path]).peak[-1])
        difference = (peaks[0] - peaks[1]) / (2e-5 * at)
        assert known.peak_derivative[-1, number] == pytest.approx(difference, rel=1e-5, abs=1e-8 * known.peak[-1] / at)


@pytest.mark.parametrize("solver", [
    {"method": "solve_ivp", "rtol": 1e-10, "steps_per_period": 200},
    {"method": "moreau", "steps_per_period": 5000}, {"method": "penalty", "steps_per_period": 5000},
], ids=lambda solver: solver["method"])  # fmt: skip
def test_other_methods_converge_to_it(solver):
    made = scene(1, 120.0, time={"periods": 40, "transient": 30})
    exact, other = (vd.simulate(made.replace({"solver": given})) for given in ({"method": "exact"}, solver))
    assert other.amplitude_mean == pytest.approx(exact.amplitude_mean, rel=1e-4)
    assert other.energy["friction"] == pytest.approx(exact.energy["friction"], rel=1e-3)
    assert other.impacts_per_period == exact.impacts_per_period


def test_orbits_and_sweeps_have_it():
    made = scene(0, 40.0, time={"periods": 300, "transient": 290}, sweep={"excitation.frequency": [20.0, 21.0]})
    response, sweep, orbit = vd.simulate(made), vd.sweep(made), vd.find_orbit(made)
    assert orbit.status == "ok" and orbit.amplitude_mean == pytest.approx(response.amplitude_mean, rel=1e-9)
    along, sideways = response.contact_friction
    assert sweep.joint_power.shape == (2, 1)
    assert sweep.joint_power[0, 0] == pytest.approx(along.power + sideways.power, rel=1e-9)
    assert sweep.joint_slip[0, 0] == pytest.approx(max(along.slip, sideways.slip), rel=1e-6)


def test_stuck_it_holds_in_both_directions():
    made = scene(0, 40.0, time={"periods": 60, "transient": 50})
    mass, stiffness, _ = matrices(0)
    held = stiffness + ROWS.T @ np.diag([1e5, 2e5, 2e5]) @ ROWS
    squares = eigh(held, mass, eigvals_only=True)
    assert linear_response(assemble(made), True).natural[0] == pytest.approx(squares, rel=1e-10)


@pytest.mark.parametrize(("joint", "error"), [
    ({"normal_stiffness": None, "tangential_stiffness": None}, "sideways: needs normal_stiffness or residual"),
    ({"sideways": ["a_side", "a_side"]}, "sideways: 'a_side' does not rub on itself"),
    ({"sideways": True}, "sideways: true is of a pair"),
    ({"sideways": ["casing", "b_side"]}, 'sideways: expected "casing" in the same place as in between'),
    ({"sideways": ["a_side", "c_side"]}, "joint[0].sideways: no interface label 'c_side'"),
])  # fmt: skip
def test_bad_input_is_named(joint, error):
    with pytest.raises(InputError, match=re.escape(error)):
        vd.simulate(scene(0, 10.0, {key: value for key, value in (JOINT | joint).items() if value is not None}))
