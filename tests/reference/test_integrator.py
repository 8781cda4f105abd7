"""The reference integrator against closed forms and conservation laws: what checks the engine is checked itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.reference.integrator import Event, Reference, agreement, integrate
from tests.reference.ledger import imbalance, ledger
from tests.tools.random_scenes import random_reduced, random_scene
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

UPRIGHT = {"acceleration": 9.81, "orientation_deg": 90.0}
LEVEL = {"acceleration": 10.0}
FREE = {"model": "rigid", "mass": 1.0, "stiffness": 1e-9, "damping": 0.0}


def scene(structure: dict, *dampers: dict, frequency: float = 1.0, gap: float = 1.0, **tables: object) -> Scene:
    """A scene with one cavity "c", or one per name that the dampers give."""
    dampers = tuple({"cavity": "c"} | damper for damper in dampers)
    data = {
        "structure": structure,
        "excitation": {"frequency": frequency} | tables.pop("excitation", {}),
        "cavity": [{"name": name, "gap": gap} for name in dict.fromkeys(damper["cavity"] for damper in dampers)],
        "damper": list(dampers),
    }
    return validate(Scene, data | tables, "scene")


def table(amplitude: float) -> dict:
    return {"model": "prescribed", "displacement_amplitude": amplitude}


def kinds(result: Reference, kind: str) -> list[Event]:
    return [event for event in result.events if event.kind == kind]


def test_ball_on_a_table_flies_on_parabolas():
    amplitude, restitution, omega, g = 0.01, 0.8, 2 * math.pi * 5, 9.81
    case = scene(table(amplitude), {"mass": 1.0, "restitution": restitution}, frequency=5.0, gap=0.4, gravity=UPRIGHT)
    impacts = kinds(integrate(case, 20), "impact")
    time, height, speed = 0.0, 0.0, amplitude * omega
    for event in impacts[:8]:

        def opening(t: float, time: float = time, height: float = height, speed: float = speed) -> float:
            fall = height + speed * (t - time) - g * (t - time) ** 2 / 2
            return fall + 0.2 - amplitude * math.sin(omega * t)

        landing = brentq(opening, event.time - 1e-4, event.time + 1e-4, xtol=1e-15)
        flight = np.linspace(time, landing, 400)[1:-1]
        assert np.all(np.vectorize(opening)(flight) > 0)
        assert event.time == pytest.approx(landing, rel=0, abs=1e-13)
        wall = amplitude * omega * math.cos(omega * landing)
        before = speed - g * (landing - time) - wall
        assert event.relative_velocity_before == pytest.approx(before, rel=1e-11)
        assert event.relative_velocity_after == pytest.approx(-restitution * before, rel=1e-11)
        height, speed, time = amplitude * math.sin(omega * landing) - 0.2, wall - restitution * before, landing
    assert len(impacts) > 8


@pytest.mark.parametrize("restitution", [0.3, 0.7, 0.9])
def test_chatter_ends_in_rest(restitution):
    speed = 2.0
    ball = {"mass": 1.0, "restitution": restitution, "position": -2.0, "velocity": speed}
    result = integrate(scene(table(1e-15), ball, gap=4.0, gravity=UPRIGHT), 5)
    (rest,) = kinds(result, "rest")
    assert rest.side == "left"
    assert rest.time == pytest.approx(2 * speed / (9.81 * (1 - restitution)), abs=2e-9)
    speeds = [event.relative_velocity_after for event in kinds(result, "impact")]
    assert speeds == pytest.approx(speed * restitution ** np.arange(1, len(speeds) + 1), rel=1e-7)
    assert result.events[-1] == rest


def test_grazing_contacts_are_told_apart():
    """A body at rest in space: r = -X sin(w t), with walls a hair inside and outside of its turning points."""
    amplitude = 1e-3
    body = {"mass": 1.0, "velocity": -amplitude * 2 * math.pi}
    for excess, hits in ((-1e-11, True), (1e-11, False)):
        case = scene(table(amplitude), body, gap=2 * amplitude * (1 + excess), gravity=LEVEL)
        assert bool(kinds(integrate(case, 1), "impact")) == hits


def test_free_decay_with_coulomb_friction():
    """Code_Aster SDND100: turning points (-1)^n (U0 - 2 n mu m g / c). The ground is a very heavy body."""
    ground = {"mass": 1e9, "friction": 0.1, "normal_load": 10.0}
    structure = {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping": 0.0}
    case = scene(structure, ground, frequency=100 / (2 * math.pi), gap=1e-2, initial={"displacement": 0.85e-3})
    result = integrate(case, 4)
    n = np.arange(5)
    assert result.x(n * math.pi / 100) == pytest.approx((-1.0) ** n * (0.85e-3 - 2e-4 * n), rel=1e-7)
    (stick,) = result.events
    assert (stick.kind, stick.time) == ("stick", pytest.approx(4 * math.pi / 100, rel=1e-8))
    assert result.x(result.time) == pytest.approx(5e-5, rel=1e-7)


@pytest.mark.parametrize(("acceleration", "kind"), [(0.999, None), (1.001, "stick"), (1.87, "slip")])
def test_block_on_a_shaking_table(acceleration, kind):
    """Code_Aster SDND104: sticks below mu g, slides without stop above sqrt(1 + pi^2 / 4) mu g."""
    block = {"mass": 1.0, "friction": 0.1}
    case = scene(table(acceleration / (2 * math.pi) ** 2), block, gravity=LEVEL, gap=2.0)
    result = integrate(case, 3)
    assert (result.events[-1].kind if result.events else None) == kind
    if kind == "slip":
        assert len(result.events) == 1


def test_friction_power_on_a_shaking_table():
    """Code_Aster SDND104: mean of N |v_rel| over 4 to 12 s at 1.01 m/s^2."""
    case = scene(table(1.01 / (2 * math.pi) ** 2), {"mass": 1.0, "friction": 0.1}, gravity=LEVEL)
    speed = np.abs(integrate(case, 12).rd(0, np.linspace(4.0, 12.0, 80001)))
    assert 10 * speed.mean() == pytest.approx(2.26164e-4, rel=1e-3)


def test_a_body_that_sticks_moves_with_the_structure():
    structure = {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0}
    body = {"mass": 0.3, "friction": 0.5, "normal_load": 100.0}
    result = integrate(scene(structure, body, frequency=0.2, initial={"displacement": 0.1}), 4)
    time = np.linspace(0.0, result.time, 50)
    assert result.events == ()
    assert result.x(time) == pytest.approx(0.1 * np.cos(time / math.sqrt(1.3)), abs=1e-13)


def test_cradle():
    """Equal elastic bodies hand the motion on, whether they touch or not."""
    bodies = [{"mass": 1.0, "position": position} for position in (-0.4, 0.1, 0.1)]
    bodies[0]["velocity"] = 1.0
    result = integrate(scene(table(1e-15), *bodies), 0.6)
    assert [(event.damper, event.side) for event in kinds(result, "impact")] == [(0, "neighbour"), (1, "neighbour")]
    assert result.velocity == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


@pytest.mark.parametrize(("pressed", "expected"), [(False, 0.3), (True, 0.0)])
def test_what_an_impact_does_to_a_body_at_rest_on_a_wall(pressed, expected):
    """A kick of the structure into a body that gravity holds on its wall: hit in its turn, or pressed along."""
    striker = {"cavity": "a", "mass": 0.5, "position": 0.4, "velocity": 3.0, "restitution": 0.5}
    rester = {"cavity": "b", "mass": 0.2, "position": -0.5, "restitution": 0.3}
    case = scene(FREE, striker, rester, gravity={"acceleration": 1e-3, "orientation_deg": 90.0})
    result = integrate(case, 0.05, pressed=pressed)
    first = result.events[0]
    arriving = first.relative_velocity_before
    moved = 1.2 if pressed else 1.0
    kick = 1.5 * arriving / (1 / 0.5 + 1 / moved) / moved
    assert first.relative_velocity_after == pytest.approx(-0.5 * arriving, rel=1e-12)
    leaving = result.rd(1, first.time + 1e-9)
    assert leaving == pytest.approx(expected * kick, rel=1e-5, abs=1e-12)


def test_one_mode_is_a_rigid_body():
    case = random_scene(1, "rigid", 2)
    structure = case.structure
    for scale in (1.0, 37.0):
        model = ReducedModel.from_matrices(
            mass=[[structure.mass * scale**2]],
            stiffness=[[structure.stiffness * scale**2]],
            damping=np.array([[structure.viscous * scale**2]]),
            interface={"a": [scale]},
            directions={"a": (0.0, 1.0, 0.0)},
            base_load=[[0.0, structure.mass * scale, 0.0]],
        )
        replaced = {"structure": {"model": "rom", "file": "one.h5"}, "excitation.at": "a", "cavity.floor": "a"}
        rigid = integrate(case.replace({"initial": {}}), 2)
        reduced = integrate(case.replace({"initial": {}} | replaced), 2, model)
        assert len(rigid.events) == len(reduced.events) > 0
        for one, other in zip(rigid.events, reduced.events, strict=True):
            assert other[1:4] == one[1:4]
            assert (other[0], *other[4:]) == pytest.approx((one[0], *one[4:]), rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    ("structure", "bodies", "shared"), [("rigid", 1, False), ("rigid", 2, False), ("rom", 2, False), ("rigid", 2, True)]
)
def test_energy_and_walls(structure, bodies, shared, seed):
    case = random_scene(seed, structure, bodies, shared=shared)
    result = integrate(case, 3, random_reduced(seed) if structure == "rom" else None)
    assert imbalance(ledger(result)) < 1e-12
    system = result.system
    time = np.linspace(0.0, result.time, 2000)
    openings = np.tensordot(system.G, result.states(time)[1], 1) / system.length + system.reach[:, None]
    assert openings.min() > -1e-11


def test_frictionless_elastic_scene_keeps_its_energy():
    case = random_scene(1, "rigid", 2).replace(
        {
            "damper.restitution": 1.0,
            "damper.friction": 0.0,
            "structure.damping_ratio": 0.0,
            "excitation": {"frequency": 100.0},
            "initial": {"displacement": 1e-4, "velocity": 0.05},
        }
    )
    result = integrate(case, 5)
    assert len(kinds(result, "impact")) > 10

    def energy(time: float) -> float:
        system = result.system
        q, r, qd, rd = result.states(time)
        v, height = rd + qd, system.weight * system.length * system.omega**2 * (r + q)
        elastic = case.structure.mass * qd**2 + case.structure.stiffness * q**2
        return float((elastic.sum() + system.m @ v**2) / 2 - system.m @ height)

    start = energy(0.0)
    assert [energy(time) for time in np.linspace(0.0, result.time, 50)] == pytest.approx([start] * 50, rel=1e-11)


@pytest.mark.parametrize("structure", ["rigid", "prescribed", "rom"])
def test_shorter_steps_change_round_off_alone(structure):
    for seed in (2, 3, 5):
        case = random_scene(seed, structure)
        reduced = random_reduced(seed) if structure == "rom" else None
        coarse, fine = integrate(case, 2, reduced), integrate(case, 2, reduced, rtol=1e-13, step=0.05)
        assert agreement(coarse, fine, 1e-9) == pytest.approx(coarse.time)
        for one, other in zip(coarse.events, fine.events, strict=True):
            assert (one.kind, one.damper, one.side) == (other.kind, other.damper, other.side)
            assert one.time == pytest.approx(other.time, rel=0, abs=1e-10 / case.excitation.frequency)
