"""Planar bodies by every method that takes them: closed forms, orders, and agreement with the exact engine."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from tests.coupling.system.test_surfaces import FOUR, HEIGHT, INCLINED, LENGTH, cavity_scene, rigid_cavity
from tests.tools.planar import planar_scene, run_planar, still_table
from tests.tools.planar_laws import scene_of, tables
from tests.tools.tiers import cases
from vanedamp.coupling.methods import moreau, penalty, scipy_ivp
from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.evaluation import residual
from vanedamp.coupling.response.event_log import events_of
from vanedamp.coupling.response.observers import samples
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.coupling.scene.registration import register
from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import STRICT, InputError
from vanedamp.rom.reduced import ReducedModel

G = 9.81
METHODS = {"moreau": moreau, "penalty": penalty, "solve_ivp": scipy_ivp}
#: solver tables, with the error that a closed form may have: steps are of first order over contacts
SOLVERS = [
    ({"method": "moreau", "steps_per_period": 10_000}, 1e-3),
    ({"method": "moreau", "steps_per_period": 10_000, "contacts": "exact"}, 1e-3),
    ({"method": "penalty", "steps_per_period": 100_000}, 1e-2),
    ({"method": "penalty", "steps_per_period": 100_000, "scheme": "newmark"}, 1e-2),
    ({"method": "solve_ivp", "steps_per_period": 512}, 1e-8),
]


def run_by(scene, samples=0, **solver):
    """The run of a scene's one period by a method, and its status."""
    method = METHODS[solver["method"]]
    system = assemble(scene)
    records, start = new_records(system, 1, samples), start_of(scene, system)
    run = method.begin(scene.replace({"solver": solver}), system, records, True, start)
    status = run.advance_to(1)
    return run, status


def last(run):
    """Coordinates and velocities at the end of a run."""
    if hasattr(run, "motion") and hasattr(run.motion, "q"):
        return run.motion.q, run.motion.v
    return run.y[run.free.q], run.y[run.free.v]


def imbalance(run):
    records = run.outcome().records
    return residual(records.ledger[:2], records.parts[:2])


@pytest.mark.parametrize(("solver", "within"), SOLVERS)
def test_a_disc_slides_and_then_rolls(solver, within):
    """It rolls after v/(3 mu g) with 2/3 of its speed."""
    mu, speed = 0.2, 0.3
    disc = {"shape": "disc", "radius": 0.01, "mass": 0.7, "friction": mu, "velocity": speed}
    run, status = run_by(planar_scene(still_table(1.0), disc, gap=10.0), **solver)
    assert status is Status.OK
    q, v = last(run)
    slide = speed / (3 * mu * G)
    assert v[0] == pytest.approx(2 / 3 * speed, rel=within)
    assert q[0] == pytest.approx(2 / 3 * speed + slide * speed / 6, rel=within)


@pytest.mark.parametrize(("solver", "within"), SOLVERS)
def test_a_block_slides_on_a_table_that_accelerates(solver, within):
    """From where the table's acceleration is mu g, friction alone moves the block."""
    amplitude, frequency, mu = 1e-3, 50.0, 0.4
    omega = 2 * math.pi * frequency
    body = {"shape": "block", "length": 0.02, "height": 0.04, "mass": 1.3, "friction": mu}
    run, status = run_by(planar_scene(still_table(frequency, amplitude), body), samples=2, **solver)
    assert status is Status.OK
    begin = math.asin(mu * G / (omega**2 * amplitude)) / omega
    for_ = math.pi / omega - begin
    slip = amplitude * (math.sin(omega * begin) + omega * math.cos(omega * begin) * for_) - mu * G * for_**2 / 2
    assert run.outcome().records.samples[1, 1] == pytest.approx(slip, rel=within)


@pytest.mark.parametrize(("solver", "within"), SOLVERS)
def test_a_block_tips_on_a_table_that_accelerates(solver, within):
    """It tips at a = g b/h about its corner; the restoring moment m g b is constant. Both sides of it in a period."""
    frequency, b, h, over = 50.0, 0.01, 0.02, 1.1
    omega = 2 * math.pi * frequency
    scene = planar_scene(
        still_table(frequency, over * G * b / h / omega**2),
        {"shape": "block", "length": 2 * b, "height": 2 * h, "mass": 1.3, "friction": 0.9, "restitution": 0.02},
    )
    run, status = run_by(scene, **solver)
    assert status is Status.OK
    # (4/3) (b^2 + h^2) theta'' = h a - g b with a = over g (b/h) sin(omega t), from where that is positive on
    start = math.asin(1 / over)
    angle = start + np.linspace(0.0, 2.0, 100_001)
    since = angle - start
    shape = over * math.cos(start) * since - over * (np.sin(angle) - math.sin(start)) - since**2 / 2
    highest = 3 * G * b / (4 * (b * b + h * h)) * shape.max() / omega**2
    assert run.outcome().plane.tilt[0, 0] == pytest.approx(highest, rel=10 * within)


@pytest.mark.parametrize(("solver", "within"), SOLVERS)
def test_housners_first_impact(solver, within):
    """It leaves 1 - 1.5 sin^2(alpha) of the rate: seen in the middle of the second flight."""
    tilt, b, slenderness = 1e-4, 0.01, 3.0
    h = slenderness * b
    ratio = 1 - 1.5 / (1 + slenderness**2)
    pull = 3 * G * b / (4 * (b * b + h * h))
    quarter = math.sqrt(2 * tilt / pull)
    end = quarter * (1 + 1.5 * ratio)
    body = {
        "shape": "block", "length": 2 * b, "height": 2 * h, "mass": 1.3, "friction": 0.5, "tilt": tilt,
        "restitution": 0.0 if solver["method"] != "penalty" else 0.01,
    }  # fmt: skip
    run, status = run_by(planar_scene(still_table(1 / end), body), **solver)
    assert status is Status.OK
    _, v = last(run)
    assert v[2] == pytest.approx(-(ratio * pull * quarter - 1.5 * ratio * quarter * pull), rel=10 * within)


def in_flight(friction):
    """A block thrown into a narrow cavity, which it hits with single corners."""
    body = {
        "shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "friction": friction, "restitution": 0.6,
        "lift": 3e-4, "velocity": 0.3, "tilt": 2e-4, "tilt_rate": 0.02,
    }  # fmt: skip
    return planar_scene(still_table(60.0), body, gap=1e-3, play=2e-3)


def test_penalty_converges_where_nothing_rubs():
    """Of order 2/3: contacts of 2 steps^(1/3) steps. Friction within a contact is another law than Newton's."""
    scene = in_flight(0.0)
    exact = run_planar(scene, 1)
    reach = np.abs(exact.system.J).max(axis=0)
    errors = []
    for steps in (10_000, 80_000, 640_000):
        run, status = run_by(scene, method="penalty", steps_per_period=steps)
        assert status is Status.OK
        errors.append(float((np.abs(run.motion.q - exact.state.q) * reach).max() / 1e-3))
        assert imbalance(run) <= 1e-3
    assert exact.events(0)[:, 5].any()
    # eight impacts with 0.3 m/s and less, 172 steps each
    assert errors[2] <= 8 * 0.3 * 172 / 640_000 / 60 / 1e-3
    assert errors[2] <= 0.1 * errors[0]


@pytest.mark.parametrize(
    "solver",
    [
        {"method": "moreau"}, {"method": "moreau", "contacts": "exact"}, {"method": "penalty"},
        {"method": "penalty", "scheme": "newmark"}, {"method": "penalty", "scheme": "hht"},
    ],
)  # fmt: skip
def test_springs_at_corners_converge(solver):
    """Soft corners with friction: the motion has no impacts, and no law of them that methods could differ in."""
    scene = in_flight(0.3).replace({"contact": {"law": "compliant", "stiffness": 1e5}})
    exact = run_planar(scene, 1, samples=20)
    assert exact.status is Status.OK
    assert exact.records.impacts[0] > 3
    errors = []
    for steps in (4000, 40_000):
        run, status = run_by(scene, 20, steps_per_period=steps, **solver)
        assert status is Status.OK
        errors.append(np.abs(run.records.samples - exact.records.samples).max() / 1e-3)
    assert errors[1] <= 1e-3
    assert errors[1] <= 0.2 * errors[0]


def test_viscous_friction_of_corners_is_explicit():
    scene = in_flight(0.3)
    solver = {"method": "penalty", "slip_velocity": 1e-3, "steps_per_period": 10_000}
    assert run_by(scene, **solver)[1] is Status.OK
    with pytest.raises(InputError, match="slip_velocity"):
        run_by(scene, **solver, scheme="newmark")
    assert run_by(in_flight(0.0), **solver, scheme="newmark")[1] is Status.OK


def test_penalty_with_friction_carries_a_warning():
    rubbing, smooth = (in_flight(friction).replace({"time": {"periods": 1, "transient": 0}}) for friction in (0.3, 0.0))
    for scene, method, said in ((rubbing, "penalty", 1), (smooth, "penalty", 0), (rubbing, "moreau", 0)):
        response = simulate(scene.replace({"solver": {"method": method, "steps_per_period": 10_000}}))
        assert len([warning for warning in response.warnings if "Newton's law" in warning]) == said


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_solve_ivp_and_the_exact_engine_agree(friction):
    scene = in_flight(friction)
    exact = run_planar(scene, 1, samples=32)
    run, status = run_by(scene, 32, method="solve_ivp")
    assert status is Status.OK
    theirs, ours = exact.events(0), np.array(run.record.log)
    assert len(theirs) == len(ours) > 3
    np.testing.assert_array_equal(ours[:, 2], theirs[:, 2])
    np.testing.assert_allclose(ours[:, 0], theirs[:, 0], rtol=1e-8)
    np.testing.assert_allclose(ours[:, 3:], theirs[:, 3:], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(run.record.records.samples, exact.records.samples, rtol=1e-8, atol=1e-12)
    np.testing.assert_array_equal(run.record.records.shut, exact.records.shut)
    np.testing.assert_allclose(run.record.records.sampled, exact.records.sampled, rtol=1e-8, atol=1e-12)
    for name in ("peak", "harmonic", "square", "momentum", "section", "collided", "ledger", "parts"):
        theirs = getattr(exact.records, name)
        np.testing.assert_allclose(
            getattr(run.record.records, name), theirs, rtol=1e-7, atol=1e-9 * np.abs(theirs).max(), err_msg=name
        )
    assert run.record.records.tilt[0, 0] == pytest.approx(exact.records.tilt[0, 0], rel=1e-7)
    assert run.record.records.lifted[0, 0] == pytest.approx(exact.records.lifted[0, 0], rel=1e-7)


def random_errors(seeds, samples=32, **solver):
    """Errors of samples over their ranges, each the median over a period, of random scenes that can begin."""
    errors = []
    for seed in seeds:
        try:
            scene = scene_of(tables(seed)).replace({"time.periods": 1, "time.transient": 0})
            exact = run_planar(scene, 1, samples=samples)
        except InputError:
            continue
        run, status = run_by(scene, samples, **solver)
        assert exact.status is Status.OK
        if status is not Status.OK:
            errors.append(np.inf)
            continue
        theirs = exact.records.samples
        off = np.abs(run.outcome().records.samples - theirs) / np.maximum(np.ptp(theirs, axis=0), 1e-9)
        errors.append(float(np.median(off.max(axis=1))))
        if solver["method"] == "solve_ivp":
            assert imbalance(run) <= 1e-7
    return np.array(errors)


def test_solve_ivp_on_random_scenes():
    """One to three bodies with friction and up to hundreds of impacts.

    Impacts of several contacts with friction may have more than one solution, and an infinite sequence of them may be
    ended at another instant: a few scenes part.
    """
    errors = random_errors((3, 5, 8, 9, 10, 11, 12, 13, 15, 17, 18, 19, 21, 26), method="solve_ivp")
    assert len(errors) == 14
    assert np.quantile(errors, 0.5) <= 1e-9
    assert np.quantile(errors, 0.8) <= 1e-5


@pytest.mark.slow
def test_solve_ivp_on_more_random_scenes():
    errors = random_errors(range(14, 60), method="solve_ivp")
    assert len(errors) >= 30
    assert np.quantile(errors, 0.5) <= 1e-9
    assert np.quantile(errors, 0.8) <= 1e-5
    assert np.isinf(errors).sum() <= 2


@pytest.mark.parametrize("seed", [9, 11, 17, 25, 29])
def test_solve_ivp_on_compliant_contacts_with_friction(seed):
    """Motion, impulses and energies of one to three blocks, by springs whose ends the integrator finds for itself."""
    data = tables(seed) | {"contact": {"law": "compliant", "stiffness": 1e3}}
    for damper in data["damper"]:
        damper["restitution"] = max(damper["restitution"], 0.2)
    scene = scene_of(data).replace({"time.periods": 1, "time.transient": 0})
    exact = run_planar(scene, 1, samples=32)
    run, status = run_by(scene, 32, method="solve_ivp")
    assert status is exact.status is Status.OK
    np.testing.assert_allclose(
        run.record.records.samples, exact.records.samples, rtol=0, atol=1e-5 * np.ptp(exact.records.samples)
    )
    ours, theirs = (
        [
            (event.damper, event.side, event.corner, event.relative_velocity_before, event.impulse)
            for event in events_of(other.rows, other.log)
            if event.kind == "impact" and event.impulse > 0.0  # one that goes on may have begun earlier by round-off
        ]
        for other in (run.outcome(), exact.outcome())
    )
    assert len(ours) >= 2 and [event[:3] for event in ours] == [event[:3] for event in theirs]
    np.testing.assert_allclose(*([event[3:] for event in events] for events in (ours, theirs)), rtol=1e-4, atol=1e-7)
    for name in ("ledger", "parts"):
        expected = getattr(exact.records, name)
        np.testing.assert_allclose(getattr(run.record.records, name), expected, rtol=0, atol=1e-5 * np.ptp(expected))
    assert imbalance(run) <= 1e-7


@register
@dataclass(frozen=True, config=STRICT)
class Softer(ContactLaw):
    """Restitution k/(1 + v/c) with c = 0.05 m/s."""

    law: Literal["softer"] = "softer"

    @staticmethod
    def restitution_at(speed, coefficient):
        return coefficient / (1.0 + speed / 0.05)

    def element(self, restitution, mass, flexibility=None):
        return Element(restitution)


def test_restitution_of_blocks_that_falls_with_the_speed():
    scene = in_flight(0.3).replace({"contact": {"law": "softer"}})
    exact = run_planar(scene, 1)
    run, status = run_by(scene, method="solve_ivp")
    assert status is exact.status is Status.OK
    theirs, ours = exact.events(0), np.array(run.record.log)
    # each ends a chatter by its own rule
    fast = np.count_nonzero(theirs[:, 3] < 1e-3 * theirs[:, 3].min())
    assert fast > 3
    theirs, ours = theirs[:fast], ours[:fast]
    speed = -ours[0, 3]
    assert ours[0, 4] == pytest.approx(0.6 / (1.0 + speed / 0.05) * speed, rel=1e-12)
    np.testing.assert_allclose(ours[:, 3:], theirs[:, 3:], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("count", cases((12, 24), fast=[12]))
def test_moreau_on_random_scenes(count):
    """Of first order: a scene may part where steps take two impacts as one."""
    coarse, fine = (random_errors(range(count), method="moreau", steps_per_period=steps) for steps in (3200, 12_800))
    assert len(fine) >= 2 * count / 3
    assert np.quantile(fine, 0.5) <= 1e-3
    assert np.quantile(fine, 0.7) <= 0.5 * np.quantile(coarse, 0.7)


@pytest.mark.parametrize("method", ["exact", "moreau", "penalty", "solve_ivp"])
def test_events_are_listed_and_those_on_walls_counted(method):
    """A block on a rigid structure: `events` is the length of the list, `wall_impacts` its impacts on walls."""
    block = {"cavity": "c1", "mass": 3e-3, "shape": "block", "length": 4e-3, "height": 3e-3, "restitution": 0.7}
    scene = scene_of({
        "structure": {"model": "rigid", "mass": 0.157, "stiffness": 3.6e7, "damping_ratio": 0.002},
        "excitation": {"frequency": 2382.0, "resonance_amplitude": 7e-5},
        "cavity": [{"name": "c1", "gap": 4e-6, "play": 5e-6}], "damper": [block | {"friction": 0.4}],
        "time": {"periods": 14, "transient": 4}, "solver": {"method": method},
    })  # fmt: skip
    response = simulate(scene, events=True)
    assert response.events == len(response.event_list) == simulate(scene).events
    begin, end = response.transient / scene.frequency, response.periods / scene.frequency
    hits = [e for e in response.event_list if e.kind == "impact" and begin <= e.time < end]
    walls = [event for event in hits if event.side in ("left", "right")]
    assert response.wall_impacts == (pytest.approx(len(walls) / 10),)
    assert len(walls) >= 10
    assert response.impacts_per_period == pytest.approx(len(hits) / 10)


def test_statuses_of_a_tilt_too_large():
    """Every method says it."""
    body = {"shape": "block", "length": 0.02, "height": 0.01, "mass": 1.3, "tilt": 2e-3, "restitution": 0.5}
    for method, options in (
        ("exact", {}),
        ("moreau", {}),
        ("penalty", {"steps_per_period": 10_000}),
        ("solve_ivp", {}),
    ):
        solver = {"method": method, "linearisation": 1e-9} | options
        scene = planar_scene(still_table(20.0) | {"solver": solver}, body)
        assert respond(scene).status is Status.TILTED


@register
@dataclass(frozen=True, config=STRICT)
class SampledSine(Waveform):
    """A sine that is known by its values only."""

    shape: Literal["sampled sine"] = "sampled sine"

    def values(self, angle):
        return np.sin(angle)


@pytest.mark.parametrize("method", ["moreau", "penalty"])
def test_loads_of_a_waveform_act_across_the_cavity(tmp_path, method):
    """A block that touches nothing lags behind a base that moves across, too.

    By a sine, by the values of one, or by a history with a row for every step.
    """
    file = rigid_cavity(tmp_path / "rom.h5", INCLINED)
    model = ReducedModel.load(file)
    directions = np.array(model.directions)
    directions[model.interface.index("all")] = [0.0, 1.0, 0.0]  # of the base
    replace(model, directions=directions).save(file)
    excitation = {"frequency": 29.0, "base_acceleration": 10.0, "at": "all"}
    block = {"cavity": "c1", "shape": "block", "length": LENGTH, "height": HEIGHT, "mass": 0.05, "lift": 5.0}
    turn = np.arange(2001) / 2000
    rows = [
        f"{at / 29.0!r},{value!r}" for at, value in zip(turn.tolist(), np.sin(2 * np.pi * turn).tolist(), strict=True)
    ]
    (tmp_path / "sine.csv").write_text("\n".join(["time,value", *rows]))
    history = {"shape": "history", "file": str(tmp_path / "sine.csv")}
    runs = []
    for signal in ({}, {"waveform": {"shape": "sampled sine"}}, {"waveform": history}):
        scene = cavity_scene(
            file, FOUR, excitation=excitation | signal, solver={"method": method, "steps_per_period": 2000},
            cavity=[{"name": "c1", "gap": 20.0, "play": 10.0} | FOUR], damper=[block],
            time={"periods": 2, "transient": 0},
        )  # fmt: skip
        runs.append(respond(scene, [samples(8)]))
    assert {run.status for run in runs} == {Status.OK}
    lift = [run.in_plane.body_lift[:, 0] for run in runs]
    assert np.ptp(lift[0]) > 1e-4
    for other in lift[1:]:
        np.testing.assert_allclose(other, lift[0], rtol=0, atol=1e-12)
