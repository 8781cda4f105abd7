"""Friction by contact against own solutions of stick and slip and the energy balance; in sweeps, files and pages."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import vanedamp as vd
from tests.coupling.scene.elements.test_joint import JOINT, LOADS, STICK, Piecewise, matrices, random_scene, scene
from tests.tools.tiers import cases
from vanedamp.coupling.quantities import joints
from vanedamp.coupling.sweep.runs import Ran, Runs
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import main

STIFFNESS, DAMPING, FREQUENCY, PRELOAD, FRICTION = 2e4, 8.0, 15.0, 20.0, 0.4
NAMES = [one.name for one in joints.QUANTITIES]


def own_solution(force, periods, counted):
    """Return friction, viscous loss, work of the excitation, J per period, and the fraction of time in stick.

    Of a unit mass on a spring and dashpot that rubs under a constant normal force, from rest: pieces of slip, which end
    as the speed vanishes, and of stick, which end as the other forces reach the bound.
    """
    omega, bound = 2 * np.pi * FREQUENCY, FRICTION * PRELOAD

    def pushes(t):
        return force * np.sin(omega * t) - STIFFNESS * z[0]

    def rates(t, y, way):
        load = force * np.sin(omega * t)
        speed, push = y[1], load - STIFFNESS * y[0] - DAMPING * y[1] - way * bound
        return [speed, push, bound * abs(speed), DAMPING * speed**2, load * speed]

    def stops(t, y, way):
        return way * y[1]

    stops.terminal, stops.direction = True, -1
    z, way, options = np.zeros(5), 0.0, {"rtol": 1e-10, "atol": 1e-13, "max_step": 0.01 / FREQUENCY}
    for t, end in itertools.pairwise((0.0, (periods - counted) / FREQUENCY, periods / FREQUENCY)):
        begin, sums, stuck = t, z[2:].copy(), 0.0
        while t < end:
            if way:
                piece = solve_ivp(rates, (t, end), z, events=stops, args=(way,), **options)
                t, z, stopped = piece.t[-1], piece.y[:, -1].copy(), piece.status == 1
                starts = stopped and abs(pushes(t)) > bound
            else:
                times = np.linspace(t, end, 1 + int(np.ceil((end - t) * FREQUENCY * 20000)))
                over, stopped = np.abs(pushes(times)) > bound, True
                starts = over.any()
                last = times[np.argmax(over)] if starts else end
                stuck, t = stuck + last - t, last
            if stopped:
                way = np.sign(pushes(t)) * starts
                z[1] = way * 1e-13  # out of the root
    return *(z[2:] - sums) / counted, stuck / (end - begin)


@pytest.mark.parametrize("force", [8.5, 10.0, 60.0])
def test_under_a_constant_force_it_is_the_own_solution(force):
    """The excitation's work in a period is the sum of what friction and the dashpot take."""
    friction, viscous, work, stuck = own_solution(force, 60, 10)
    assert work == pytest.approx(friction + viscous, rel=1e-6)
    model = ReducedModel.from_matrices(
        np.eye(2), np.diag([STIFFNESS, 1e5]), {"x": 0, "x_across": 1}, damping=np.diag([DAMPING, 10.0])
    )
    joint = {"between": ["x", "casing"], "normal": ["x_across", "casing"], "normal_stiffness": 1e6}
    response = vd.simulate(
        vd.Scene(
            structure=model,
            excitation={"frequency": FREQUENCY, "force": force, "at": "x"},
            joint=[joint | {"preload": PRELOAD, "friction": FRICTION}],
            time={"periods": 60, "transient": 50},
        )
    )
    (contact,) = response.contact_friction
    assert contact.energy == pytest.approx(friction, rel=1e-5)
    assert contact.power == pytest.approx(friction * FREQUENCY, rel=1e-5)
    assert contact.stick == pytest.approx(stuck, abs=1e-4)
    assert (contact.stick + contact.slip, contact.open) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert response.energy["excitation"] / 10 == pytest.approx(contact.energy + viscous, rel=1e-6)


@pytest.mark.parametrize(
    ("loads", "coupled", "more"),
    [
        ("in phase", False, {"preload": 20.0}),
        ("out of phase", False, {"preload": 100.0}),
        ("lifts off", False, {"preload": 20.0}),
        ("lifts off", True, {"preload": 12.0}),
        ("lifts off", True, {"gap": 2e-4}),
    ],
)
def test_fractions_of_the_time_are_those_of_the_piecewise_solution(loads, coupled, more):
    structure, periods = matrices(1, coupled), 12
    joint = JOINT | {"normal_stiffness": 1e5} | more
    reference = Piecewise(structure, joint, LOADS[loads], 20.0)
    _, events = reference.run(periods)
    # the piecewise solution turns the slip at once where it does not stick
    states = ["open" if "gap" in more else STICK]
    states += [{"detach": "open", "stick": STICK}.get(kind, "slips") for _, kind in events]
    edges = np.clip([0.0, *(time for time, _ in events), np.inf], 2 / 20.0, periods / 20.0)
    lasted = dict.fromkeys((STICK, "slips", "open"), 0.0)
    for state, (begin, end) in zip(states, itertools.pairwise(edges), strict=True):
        lasted[state] += (end - begin) / (10 / 20.0)
    made = scene(structure, joint, LOADS[loads], time={"periods": periods, "transient": 2})
    (contact,) = vd.simulate(made).contact_friction
    assert (contact.stick, contact.slip, contact.open) == pytest.approx(tuple(lasted.values()), abs=1e-9)


@pytest.mark.parametrize("seed", cases(range(100), fast=range(8)))
def test_energies_of_contacts_are_the_friction_of_the_balance(seed):
    response = vd.simulate(random_scene(seed))
    assert {contact.side for contact in response.contact_friction} >= {"joint"}
    total = sum(contact.energy for contact in response.contact_friction)
    assert total == pytest.approx(response.energy["friction"] / 40, rel=1e-8, abs=1e-14)
    for contact in response.contact_friction:
        assert contact.stick + contact.slip + contact.open == pytest.approx(1.0, abs=1e-12)
        assert contact.power == pytest.approx(contact.energy * response.frequency, rel=1e-12)


def test_a_run_that_goes_on_has_the_states_it_begins_with():
    """Nothing happens before the second run's first event but what the first run left."""
    made = scene(matrices(1), JOINT | {"normal_stiffness": 1e5, "preload": 20.0}, LOADS["in phase"])
    first = vd.simulate(made.replace({"time": {"periods": 200, "transient": 180}}))
    later = vd.simulate(made.replace({"time": {"periods": 20, "transient": 0}}), start=first.final)
    for one, other in zip(first.contact_friction, later.contact_friction, strict=True):
        assert (other.stick, other.slip, other.open) == pytest.approx((one.stick, one.slip, one.open), abs=1e-6)
        assert other.energy == pytest.approx(one.energy, rel=1e-6)


@pytest.mark.parametrize("seed", [1, 4])  # one joint, and two with a body
def test_points_of_sweeps_have_what_runs_have(seed):
    made = random_scene(seed).replace({"time": {"periods": 30, "transient": 10}})
    axes = {"joint.0.friction": [0.0, 0.3], "excitation.frequency": [17.0, 22.0, 27.0]}
    found = vd.sweep(made.replace({"sweep": axes}))
    for place in np.ndindex(found.shape):
        numbers = {path: values[index] for (path, values), index in zip(axes.items(), place, strict=True)}
        run = vd.simulate(made.replace(numbers))
        for name in NAMES:
            assert found.quantities[name].shape == (2, 3, len(made.added["joint"]))
            np.testing.assert_array_equal(found.quantities[name][place], getattr(run, name), err_msg=name)


def test_a_search_runs_scenes_with_joints_in_compiled_code():
    made, numbers = random_scene(4), {"joint.0.friction": 0.3, "excitation.frequency": 22.0}
    (found,) = Runs(made, list(numbers)).run_all([numbers], [None])
    assert isinstance(found, Ran) and found.amplitude_mean == vd.simulate(made.replace(numbers)).amplitude_mean


def test_files_and_pages_have_it(tmp_path):
    made = random_scene(4).replace({"time": {"periods": 30, "transient": 10}})
    run = vd.simulate(made)
    run.save(tmp_path / "run.h5")
    again = vd.Response.load(tmp_path / "run.h5")
    assert again.contact_friction == run.contact_friction
    assert again.to_json()["contact_friction"][0]["power"] == run.contact_friction[0].power
    assert run.to_xarray().joint_power.values.tolist() == run.joint_power.tolist()
    vd.sweep(made.replace({"sweep": {"excitation.frequency": [17.0, 22.0, 27.0]}})).save(tmp_path / "sweep.h5")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "friction of the contacts, and fractions of the time" in page
    assert f"<td>{run.contact_friction[0].power:.4g}</td>" in page
    assert "Friction of the joints at the largest mean amplitude" in page and "sticks, fraction of time" in page


def test_a_page_without_bodies_speaks_of_free_and_stuck(tmp_path):
    made = scene(matrices(0), JOINT | {"normal_stiffness": 1e5, "preload": 8.0}, time={"periods": 30, "transient": 20})
    vd.sweep(made.replace({"sweep": {"excitation.frequency": [17.0, 22.0, 27.0]}})).save(tmp_path / "sweep.h5")
    assert main(["report", str(tmp_path / "sweep.h5"), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<th>free maximum, µm</th>" in page and "stuck the maximum would be" in page
    assert "with the bodies" not in page and "without bodies" not in page


def test_scenes_without_joints_and_methods_with_steps_have_none():
    joint = JOINT | {"normal_stiffness": 1e5, "preload": 20.0}
    time = {"periods": 4, "transient": 2}
    stepped = scene(matrices(0), joint, time=time, solver={"method": "moreau", "steps_per_period": 200})
    for made in (scene(matrices(0), None, time=time), stepped):
        assert vd.simulate(made).contact_friction is None
