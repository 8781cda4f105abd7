"""Jenkins elements beside bodies in the plane: the slider engine, closed forms, an integrator, laws."""

import math

import numpy as np
import pytest

from tests.coupling.methods.test_planar_bodies import imbalance, last, run_by
from tests.tools.closed_form_compliant_scenes import jenkins, jenkins_turns, scene
from tests.tools.planar import ledger, planar_scene, run_planar
from tests.tools.planar_laws import check_laws, image_parts, tables
from tests.tools.planar_laws import jenkins as tables_with_elements
from tests.tools.random_scenes import random_jenkins
from tests.tools.tiers import cases
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET
from vanedamp.coupling.response.records import FRICTION, SLIPS, STICKS, new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import validate

#: what makes a scene one in the plane: a body far from all walls, in flight or on a floor, or a law of impact
BODIES = {
    "disc": {"cavity": [{"name": "far", "gap": 1.0, "play": 1.0}],
             "damper": [{"cavity": "far", "shape": "disc", "radius": 0.01, "mass": 1e-3, "lift": 0.5}]},
    "block": {"cavity": [{"name": "far", "gap": 1.0, "play": 1.0}],
              "damper": [{"cavity": "far", "shape": "block", "length": 0.1, "height": 0.05, "mass": 1e-3}]},
    "slider": {"cavity": [{"name": "far", "gap": 1.0}], "damper": [{"cavity": "far", "mass": 1e-3, "dashpot": 0.0}]},
    "none": {"contact": {"law": "poisson"}},
}  # fmt: skip


def events(response):
    """Slips and sticks of the elements: time, number and speed of each."""
    return [(e.kind, e.time, e.damper, e.relative_velocity_after) for e in response.event_list if e.side == "casing"]


@pytest.mark.parametrize("beside", BODIES)
def test_free_decay(beside):
    """Turning points and their times: the exact piecewise solution; a section of the response at each of them."""
    displacement, limit, stiffness = 5e-3, 5.0, 3e3
    for time, value in jenkins_turns(displacement, limit, stiffness, 4)[1:]:
        start = {"initial": {"displacement": displacement}, "excitation": {"frequency": 1 / time}}
        case = jenkins(limit, stiffness, **start, **BODIES[beside], time={"periods": 1, "transient": 0})
        response = simulate(case, events=True)
        assert response.section[-1] == pytest.approx([value, 0.0], rel=1e-9, abs=1e-9 * displacement)
        assert response.energy_residual < 1e-12
        assert abs(response.final.elongation[0]) == pytest.approx(limit / stiffness, rel=1e-9)


@pytest.mark.parametrize(("limit", "stiffness"), [(2.0, 1e5), (30.0, 1e5), (1e-3, 10.0), (99.0, 1e5)])
def test_hysteresis_loop(limit, stiffness):
    """A motion X cos(w t) that nothing can stop encloses 4 R (X - R / k) in every period: Jenkins (1962)."""
    size, mass = 1e-3, 1e15
    case = scene(
        structure={"model": "rigid", "mass": mass, "stiffness": mass * (2 * math.pi) ** 2, "damping": 0.0},
        initial={"displacement": size}, excitation={"frequency": 0.25}, **BODIES["disc"],
        friction_damper=[{"normal_force": 2 * limit, "friction": 0.5, "stiffness": stiffness}],
        time={"periods": 2, "transient": 1},
    )  # fmt: skip
    response = simulate(case, events=True)
    loop = 4 * limit * (size - limit / stiffness)
    assert response.energy["friction"] == pytest.approx(4 * loop, rel=1e-9)
    found = events(response)
    # from a turning point the spring goes over both limits, the first time only over one
    first = math.acos(1 - limit / stiffness / size) / (2 * math.pi)
    later = math.acos(1 - 2 * limit / stiffness / size) / (2 * math.pi)
    times = [first, *(0.5 * half + later for half in range(1, 16))]
    assert [time for kind, time, *_ in found if kind == "slip"] == pytest.approx(times, rel=1e-9)
    sticks = [time for kind, time, *_ in found if kind == "stick"]
    assert sticks[:15] == pytest.approx(0.5 * np.arange(1, 16), rel=1e-9)
    assert {number for _, _, number, _ in found} == {0}


def test_an_iwan_model():
    """Elements in parallel slip one after the other, and those that do lose their loops (Iwan 1966)."""
    size, mass = 1e-3, 1e15
    limit, stiffness = np.array([5.0, 20.0, 40.0, 300.0]), np.array([2e4, 5e4, 5e4, 1e5])
    elements = [{"normal_force": r, "friction": 1.0, "stiffness": k} for r, k in zip(limit, stiffness, strict=True)]
    case = scene(
        structure={"model": "rigid", "mass": mass, "stiffness": mass * (2 * math.pi) ** 2, "damping": 0.0},
        initial={"displacement": size}, excitation={"frequency": 0.25}, **BODIES["block"],
        friction_damper=elements, time={"periods": 2, "transient": 1},
    )  # fmt: skip
    response = simulate(case, events=True)
    loops = 4 * limit * np.maximum(size - limit / stiffness, 0.0)
    assert response.energy["friction"] == pytest.approx(4 * loops.sum(), rel=1e-9)
    first = [number for kind, _, number, _ in events(response)[:3] if kind == "slip"]
    assert first == [0, 1, 2]
    # at the end, a quarter of the way ahead of where it began: all but the last at their bounds
    assert response.final.elongation[:3] == pytest.approx(limit[:3] / stiffness[:3], rel=1e-9)


def test_an_element_that_never_slips_is_a_spring():
    """Unloaded at the initial displacement: free vibration about k x0 / (c + k)."""
    start, stiffness = 1e-3, 3e4
    case = jenkins(
        1e3, stiffness, initial={"displacement": start}, excitation={"frequency": 11.0}, **BODIES["disc"],
        time={"periods": 3, "transient": 0},
    )  # fmt: skip
    response = simulate(case, events=True, samples_per_period=16)
    centre = stiffness * start / (1e4 + stiffness)
    exact = centre + (start - centre) * np.cos(200.0 * response.time)
    assert response.displacement == pytest.approx(exact, abs=1e-14)
    assert events(response) == []
    assert response.energy["friction"] == 0.0


def test_a_stiff_spring_is_den_hartogs_friction():
    """Den Hartog (1931): X c / F = 1.55060285 at r = 0.6 and R = 0.2 F; the error falls as k^(-1/2)."""
    r, ratio = 0.6, 0.2
    v, u = 1 / (1 - r**2), math.sin(math.pi / r) / (r * (1 + math.cos(math.pi / r)))
    limit = math.sqrt(v**2 - (ratio * u) ** 2)
    stiffness, errors = np.array([1e6, 1e7, 1e8, 1e9]), []
    for spring in stiffness:
        case = jenkins(
            ratio, spring, structure={"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.0},
            excitation={"frequency": 0.6 * 100 / (2 * math.pi), "force": 1.0}, **BODIES["none"],
            time={"periods": 2000, "transient": 1950},
        )  # fmt: skip
        response = simulate(case)
        assert response.status == Status.OK
        assert response.energy_residual < 1e-10
        errors.append(abs(response.amplitude_max * 1e4 - limit))
    assert np.polyfit(np.log(stiffness), np.log(errors), 1)[0] == pytest.approx(-0.5, abs=0.02)
    assert errors[-1] < 1e-3


SAME = [("rigid", 0, 1, 4), ("rom", 0, 2, 5), ("rigid", 1, 2, 6), ("rom", 2, 2, 7), ("rom", 1, 2, 9)]


@pytest.mark.parametrize(("structure", "bodies", "elements", "seed"), SAME)
def test_the_slider_engine_finds_the_same(structure, bodies, elements, seed, tmp_path):
    """Random scenes with elements about as stiff as the structure, until impacts have amplified round-off."""
    case, reduced = random_jenkins(seed, structure, bodies, "newton", elements)
    changes = {"time": {"periods": 3, "transient": 0}, "sweep": {}}
    if reduced is not None:
        reduced.save(tmp_path / "rom.h5")
        changes["structure.file"] = str(tmp_path / "rom.h5")
    case = case.replace(changes)
    plane = case.replace({"damper.dashpot": 0.0}) if bodies else case.replace({"contact": {"law": "poisson"}})
    one, other = simulate(case, events=True), simulate(plane, events=True)
    first, second = events(one), events(other)
    count = 4 if bodies else len(first)
    assert len(first) >= 4
    for ours, theirs in zip(first[:count], second[:count], strict=True):
        assert ours[0] == theirs[0]
        assert ours[2] == theirs[2]
        assert theirs[1] == pytest.approx(ours[1], rel=1e-8)
        assert theirs[3] == pytest.approx(ours[3], rel=1e-7, abs=1e-9 * np.abs(one.section[:, 1]).max())
    if not bodies:
        scale = np.abs(one.section).max(axis=0)
        np.testing.assert_allclose(other.section / scale, one.section / scale, rtol=0, atol=1e-9)
        np.testing.assert_allclose(other.final.elongation, one.final.elongation, rtol=1e-8, atol=1e-15)
        for name in ("friction", "excitation", "viscous"):
            assert other.energy[name] == pytest.approx(one.energy[name], rel=1e-9)
    assert other.energy_residual < 1e-10


#: a block thrown about its cavity on a structure with two Jenkins elements, one of them soft, and a rigid one
HELD = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 400.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 3.1, "force": 2.0}, "initial": {"velocity": 0.3}, "gravity": {"acceleration": 0.05},
    "friction_damper": [
        {"normal_force": 2.0, "friction": 0.3, "stiffness": 300.0}, {"normal_force": 0.1, "friction": 0.5},
        {"normal_force": 1.0, "friction": 0.2, "stiffness": 40.0},
    ],
}  # fmt: skip


def thrown(periods=1, friction=0.3, **changes):
    block = {
        "shape": "block", "length": 0.03, "height": 0.02, "mass": 0.05, "friction": friction, "restitution": 0.8,
        "position": -0.006, "tilt": 0.01, "lift": 5e-4,
    }  # fmt: skip
    return planar_scene(HELD | changes, block, periods=periods, gap=0.02, play=0.002)


def test_solve_ivp_finds_the_same():
    """An integrator with states found by trying: motion, events and energies, over sticks, slips and impacts."""
    case = thrown()
    exact = run_planar(case, 1, samples=32)
    run, status = run_by(case, 32, method="solve_ivp")
    assert status is exact.status is Status.OK
    elements = exact.system.body[[int(r) for r in exact.events(SLIPS)[:, 2] if r >= exact.system.contacts]]
    assert {0, 2} <= set(elements)
    assert len(exact.events(STICKS)) >= 3
    assert len(exact.events(0)) == len(run.record.log) >= 3
    q, _ = last(run)
    np.testing.assert_allclose(q, exact.state.q, rtol=0, atol=1e-8 * np.abs(exact.state.q).max())
    np.testing.assert_allclose(run.record.records.samples, exact.records.samples, rtol=1e-7, atol=1e-10)
    for name in ("peak", "harmonic", "square", "momentum", "section", "ledger", "parts"):
        theirs = getattr(exact.records, name)
        np.testing.assert_allclose(
            getattr(run.record.records, name), theirs, rtol=1e-6, atol=1e-8 * np.abs(theirs).max(), err_msg=name
        )
    assert abs(ledger(exact)) <= 1e-12 * exact.state.ledger[FRICTION]


@pytest.mark.parametrize("method", ["moreau", "penalty"])
def test_steps_converge(method):
    """Of first order, since slips begin and end within steps; the ledger closes, of midpoints to the second order."""
    case = planar_scene(HELD, BODIES["disc"]["damper"][0] | {"cavity": "c1"})
    exact, errors = run_planar(case, 1), []
    for steps in (1000, 64_000):
        run, status = run_by(case, method=method, steps_per_period=steps)
        assert status is Status.OK
        errors.append(float(np.abs(last(run)[0] - exact.state.q).max()))
        assert imbalance(run) <= (1e-10 if method == "moreau" else 10 / steps**2)
    assert exact.state.ledger[FRICTION] >= 1e-2
    assert errors[1] <= 1e-6 * np.abs(exact.state.q).max()
    assert errors[1] <= 0.05 * errors[0]


@pytest.mark.parametrize("cut", [1, 2])
def test_a_run_in_two_parts_is_the_run_in_one(cut):
    """The elongation goes on where it was, at its bound or below."""
    whole, first = simulate(thrown(3)), simulate(thrown(cut))
    state = RestartState.from_list(first.final.to_list())
    second = simulate(thrown(3 - cut), start=state)
    assert state.elongation[1] == 0.0
    assert np.all(np.abs(state.elongation[[0, 2]]) > 1e-6)
    scale = np.abs(whole.section).max(axis=0)
    np.testing.assert_allclose(second.section / scale, whole.section[cut:] / scale, rtol=0, atol=1e-8)
    np.testing.assert_allclose(second.final.elongation, whole.final.elongation, rtol=1e-7, atol=1e-12)


def test_a_smaller_bound_unloads_the_spring():
    """A spring beyond its new bound begins at it."""
    final = simulate(thrown(2)).final
    weak = [element | {"friction": 1e-3 * element["friction"]} for element in HELD["friction_damper"]]
    case = thrown(1, friction_damper=weak)
    system = assemble(case)
    run = engine_run(system, start_of(case, system, final), new_records(system, 1, 0), True, 10**6)
    assert run.advance_to(0) is Status.OK
    found = run.system.elongation @ run.state.q
    np.testing.assert_allclose(np.abs(found), run.system.limit[-2:] / run.system.tangential, rtol=1e-9)
    assert run.advance_to(1) is Status.OK


def test_continuation():
    """Each point of a sweep begins with the state of the one before."""
    linked = {"sweep": {"excitation.frequency": [3.0, 3.1]}, "continuation": {"direction": "up"}}
    data = thrown(2).to_dict() | linked
    result, state = sweep(validate(Scene, data, "scene")), None
    for k, frequency in enumerate((3.0, 3.1)):
        response = simulate(thrown(2).replace({"excitation.frequency": frequency}), start=state)
        assert result.amplitude_mean[k] == response.amplitude_mean
        state = response.final


@pytest.mark.parametrize(
    ("first", "count"), cases([(0, 6), (6, 14), *((first, 140) for first in range(20, 1000, 140))], fast=[(0, 6)])
)
def test_laws(first, count, tmp_path):
    """Event by event: bounds, energies, motion, on structures with stops, sliders and other friction dampers."""
    steps, ends = 0, 0
    for seed in range(first, first + count):
        worst, code = check_laws(seed, data=tables_with_elements(seed, tmp_path))
        ends += code not in (DONE, EVENT_BUDGET)
        steps += worst.steps if worst is not None else 0
    assert ends <= (1 if count < 20 else 3)  # of wedged bodies whose friction forces have no solution
    assert steps >= min(100 * count, 2000)


@pytest.mark.parametrize("first", cases(range(0, 12, 3), fast=[0]))
@pytest.mark.parametrize("law", ["poisson", "compliant"])
def test_laws_of_other_contacts(law, first, tmp_path):
    contact = {"law": law} | ({"stiffness": 1e3} if law == "compliant" else {})
    for seed in range(first, first + 3):
        _, code = check_laws(seed, data=tables_with_elements(seed, tmp_path) | {"contact": contact})
        assert code in (DONE, EVENT_BUDGET)


@pytest.mark.parametrize("first", cases(range(0, 60, 12), fast=[0]))
def test_mirror_images(first):
    """Left and right are alike."""
    compared = 0
    for seed in range(first, first + 12):
        data = tables(seed)
        if data["structure"]["model"] == "rigid":
            rng = np.random.default_rng([seed, 18])
            element = {"normal_force": 1.0, "friction": rng.uniform(0.02, 0.2), "stiffness": rng.uniform(0.2, 4.0)}
            compared += image_parts(seed, data | {"friction_damper": [element]})
    assert compared >= 60
