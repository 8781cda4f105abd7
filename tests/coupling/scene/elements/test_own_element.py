"""Elements that this file adds: a tether with slack between a body and its cavity, and contact of two shrouds."""

import math
import re
from typing import ClassVar

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.contact_laws.law import Element
from vanedamp.coupling.scene.elements.element import SceneElement, Unit
from vanedamp.coupling.scene.registration import ELEMENTS, register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.files.reference import key_in, options, schema
from vanedamp.files.toml_input import STRICT, Fraction, InputError, NonNegative, Positive, Whole, validate
from vanedamp.rom.reduced import ReducedModel


@dataclass(frozen=True, config=STRICT)
class Tether(SceneElement):
    """A spring between a body and its cavity that pulls beyond a slack, on either side."""

    yields: ClassVar[bool] = True
    damper: Whole
    """number of the body, from 0"""
    slack: Positive
    """distance from mid-travel at which it begins to pull [m]"""
    stiffness: Positive
    """stiffness of the spring [N/m]"""
    dashpot: NonNegative = 0.0
    """viscous damping while it pulls [N s/m]"""

    def check(self, scene):
        if not 0 <= self.damper < len(scene.damper):
            raise ValueError(f"damper: there are only {len(scene.damper)} bodies, counted from 0")

    def units(self, number, parts):
        slip = parts.slip(self.damper)
        for side in (1.0, -1.0):
            spring = Element(1.0, self.stiffness, self.dashpot)
            yield Unit(side * slip, 0.0 * slip, self.slack, element=spring, play=self.slack, body=self.damper)


@dataclass(frozen=True, config=STRICT)
class Shroud(SceneElement):
    """Contact of two interlocking shrouds, which closes as one place of the structure moves on beyond another."""

    on_structure: ClassVar[bool] = True
    at: str
    """interface label of the place that moves on"""
    to: str
    """interface label of the place that it meets"""
    gap: NonNegative
    """distance at rest [m]"""
    restitution: Fraction = 1.0
    """coefficient of restitution [-]"""

    def labels(self):
        return {"at": self.at, "to": self.to}

    def units(self, number, parts):
        normal = parts.motion(self.to, f"shroud[{number}].to") - parts.motion(self.at, f"shroud[{number}].at")
        contact = parts.contact(normal, self.restitution, self.at, self.to)
        play = max(self.gap, parts.travel(normal))
        yield Unit(normal, 0.0 * normal, self.gap, element=contact, play=play, body=number)


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Both elements, for the tests of this file only."""
    register(Tether, "tether")
    register(Shroud, "shroud")
    yield
    del ELEMENTS.parts["tether"], ELEMENTS.parts["shroud"]


MASS, STIFFNESS, SLACK, SPEED = 0.3, 4e3, 1e-3, 0.05
METHODS = {
    "exact": ({"method": "exact"}, 1e-10),
    "moreau": ({"method": "moreau", "steps_per_period": 10000}, 1e-3),
    "penalty": ({"method": "penalty", "steps_per_period": 10000}, 1e-3),
    "solve_ivp": ({"method": "solve_ivp", "rtol": 1e-10, "steps_per_period": 100}, 1e-7),
}


def tethered(solver=METHODS["exact"][0], periods=1, **more):
    """A body that flies to and fro between the ends of its tether, on a table as good as still; no wall is in reach."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-15},
        "excitation": {"frequency": 5.0},
        "cavity": [{"name": "c", "gap": 0.1}],
        "damper": [{"cavity": "c", "mass": MASS, "velocity": SPEED}],
        "tether": [{"damper": 0, "slack": SLACK, "stiffness": STIFFNESS}],
        "time": {"periods": periods, "transient": 0}, "solver": solver,
    }  # fmt: skip
    return validate(Scene, data | more, "scene")


@pytest.mark.parametrize("method", METHODS)
def test_a_tether_throws_the_body_back(method):
    """Free flight over the slack at v; half a swing at sqrt(k/m), which returns v: 4 slack/v + 2 pi sqrt(m/k)."""
    solver, tolerance = METHODS[method]
    response = simulate(tethered(solver), events=True, samples_per_period=100)
    # a spring without loss makes or takes the truncation error of steps
    assert response.status in ({Status.OK} if tolerance < 1e-6 else {Status.OK, Status.ENERGY})
    begins = [event for event in response.event_list if event.kind == "impact"]
    assert {(event.damper, event.side) for event in begins} == {(0, "tether")}
    fly, swing = 2 * SLACK / SPEED, math.pi * math.sqrt(MASS / STIFFNESS)
    at = SLACK / SPEED + (fly + swing) * np.arange(len(begins))
    assert len(begins) == math.ceil((0.2 - at[0]) / (fly + swing))
    assert [event.time for event in begins] == pytest.approx(at, rel=tolerance)
    assert begins[0].relative_velocity_before == pytest.approx(SPEED, rel=tolerance)
    # as far as the energy goes
    reach = SLACK + SPEED * math.sqrt(MASS / STIFFNESS)
    assert np.abs(response.body_displacement).max() == pytest.approx(reach, rel=2e-3)
    assert abs(response.energy_residual) < {"exact": 1e-12, "solve_ivp": 1e-8}.get(method, 1e-3)


@pytest.mark.parametrize("method", ["exact", "solve_ivp"])
def test_a_dashpot_in_the_tether_takes_energy(method):
    """A half swing of damping ratio z = sin a leaves exp(-(pi - 2 a) tan a) of the speed: it ends at zero force."""
    solver, _ = METHODS[method]
    ratio = 0.1
    dashpot = 2 * ratio * math.sqrt(STIFFNESS * MASS)
    tether = {"damper": 0, "slack": SLACK, "stiffness": STIFFNESS, "dashpot": dashpot}
    response = simulate(tethered(solver, 2, tether=[tether]), events=True)
    speeds = np.abs([event.relative_velocity_before for event in response.event_list if event.kind == "impact"])
    angle = math.asin(ratio)
    left = math.exp(-(math.pi - 2 * angle) * math.tan(angle))
    assert speeds == pytest.approx(SPEED * left ** np.arange(len(speeds)), rel=1e-6) and len(speeds) > 2
    # on such a table nothing else takes energy
    swings = len(speeds)
    assert response.energy["contact"] == pytest.approx(0.5 * MASS * SPEED**2 * (1 - left ** (2 * swings)), rel=1e-6)


SHAKEN = {
    "structure": {"model": "rigid", "mass": 2.0, "stiffness": 8e4, "damping_ratio": 0.02},
    "excitation": {"frequency": 31.0, "force": 40.0},
    "cavity": [{"name": "c", "gap": 4e-4, "play": 1e-3}],
    "tether": [{"damper": 0, "slack": 1e-4, "stiffness": 2e4, "dashpot": 3.0}],
}  # fmt: skip
BODIES = {
    "slider": {"cavity": "c", "mass": 0.2, "friction": 0.1, "restitution": 0.6},
    "disc": {"cavity": "c", "mass": 0.2, "friction": 0.1, "restitution": 0.6, "shape": "disc", "radius": 0.01},
}


@pytest.mark.parametrize("body", BODIES)
def test_engine_and_solve_ivp_agree_between_walls(body):
    """Walls that rebound, a floor that rubs and a tether, in one and the same engine."""
    data = SHAKEN | {"damper": [BODIES[body]], "time": {"periods": 2, "transient": 0}}
    runs = [
        simulate(validate(Scene, data | {"solver": solver}, "scene"), events=True, samples_per_period=100)
        for solver in ({"method": "exact"}, {"method": "solve_ivp", "rtol": 1e-10, "steps_per_period": 100})
    ]
    assert {"left", "right", "tether"} <= {event.side for event in runs[0].event_list if event.kind == "impact"}
    for run in runs:
        assert abs(run.energy_residual) < 1e-8
        np.testing.assert_allclose(run.displacement, runs[0].displacement, atol=1e-7 * run.amplitude_max)


def between_tethers(**more):
    """A body that a tether turns, far from its walls."""
    data = SHAKEN | {"damper": [BODIES["slider"]], "cavity": [{"name": "c", "gap": 0.1}]}
    return validate(Scene, data | {"time": {"periods": 12, "transient": 0}} | more, "scene")


def test_the_period_map_has_the_derivative_of_differences():
    scene = between_tethers()
    run, mapped = simulate(scene), period_map(scene)
    state = mapped.state_of(run.final)
    passage = mapped(state)
    assert passage.status is PassageStatus.OK and "impact c.tether.0" in " ".join(passage.sequence)
    scale, step = mapped.scale, 1e-6
    for j in range(len(state)):
        move = step * scale[j] * (np.arange(len(state)) == j)
        ends = [mapped(state + way * move) for way in (1, -1)]
        assert all(end.sequence == passage.sequence for end in ends)
        column = (ends[0].state - ends[1].state) / (2 * step * scale[j])
        np.testing.assert_allclose(
            column / scale, passage.derivative[:, j] / scale, atol=1e-6 * np.abs(column / scale).max()
        )


def test_it_rings_down():
    """After a blow, what the structure had is with the body, or taken by damping, friction and the tether's dashpot."""
    scene = between_tethers(ring_down={"start": "impulse", "impulse": 0.3, "periods": 12})
    found = ring_down(scene)
    assert found.status is Status.OK and found.impacts.sum() > 2
    assert abs(found.energy_residual) < 1e-9
    assert found.energies["contact"] > 0.0


def test_tables_of_elements_are_read_written_and_described():
    scene = tethered()
    assert validate(Scene, scene.to_dict(), "again") == scene == Scene(**scene.to_dict())
    with pytest.raises(InputError, match=r"^scene: tether\[0\].slack: should be greater than 0"):
        Scene(**scene.to_dict() | {"tether": [{"damper": 0, "slack": -1.0, "stiffness": 1.0}]})
    assert scene.replace({"tether.0.slack": 2e-3}).to_dict()["tether"][0]["slack"] == 2e-3
    whole = schema(Scene)
    (table,) = options(whole, key_in(whole, "tether")["items"])
    assert key_in(table, "slack")["x-unit"] == "m" and "begins to pull" in key_in(table, "slack")["description"]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([{"damper": 1, "slack": SLACK, "stiffness": 1.0}], "tether[0].damper: there are only 1 bodies"),
        ([{"damper": 0, "slack": -1.0, "stiffness": 1.0}], "tether[0].slack: should be greater than 0"),
        ([{"damper": 0, "slak": 1.0, "stiffness": 1.0}], "tether[0].slak: unknown key; did you mean 'slack'?"),
        ({"damper": 0, "slack": 1.0, "stiffness": 1.0}, "tether: expected a list of tables, each headed [[tether]]"),
    ],
)
def test_refused(table, message):
    with pytest.raises(InputError, match=re.escape(message)):
        tethered(tether=table)


def test_a_body_beyond_its_tether_is_refused():
    body = {"cavity": "c", "mass": MASS, "position": 1.5 * SLACK}
    with pytest.raises(InputError, match=re.escape("damper[0]: begins 0.0005 m beyond the cavity's tether")):
        simulate(tethered(damper=[body]))


GAP = 2e-4


def shrouds(folder, solver=METHODS["exact"][0], **more):
    """Two masses on springs of their own, as a reduced model in these coordinates: they meet where a gap closes."""
    labels = {"one": [1.0, 0.0], "two": [0.0, 1.0]}
    model = ReducedModel.from_matrices(np.diag([1.0, 3.0]), np.diag([4e4, 1e9]), labels, damping_ratio=0.0)
    model.save(folder / "rom.h5")
    data = {
        "structure": {"model": "rom", "file": str(folder / "rom.h5")},
        "excitation": {"frequency": 20.0, "force": 40.0, "at": "one"},
        "shroud": [{"at": "one", "to": "two", "gap": GAP, "restitution": 0.5}],
        "time": {"periods": 1, "transient": 0}, "solver": solver,
    }  # fmt: skip
    return validate(Scene, data | more, "scene")


#: a body that weighs nothing beside the structure, and whose spring asks for the engine for the plane
PLANE = {
    "cavity": [{"name": "c", "gap": 0.1, "floor": "two"}],
    "damper": [{"cavity": "c", "mass": 1e-7, "stiffness": 1e-3}],
}  # fmt: skip


@pytest.mark.parametrize("engine", ["line", "plane"])
@pytest.mark.parametrize("method", METHODS)
def test_shrouds_meet_by_their_relative_motion(method, engine, tmp_path):
    """The first impact: undamped sine response to the gap, Newton's law of two masses."""
    solver, tolerance = METHODS[method]
    scene = shrouds(tmp_path, solver, **(PLANE if engine == "plane" else {}))
    assert scene.planar == (engine == "plane")
    response = simulate(scene, events=True)
    first = next(event for event in response.event_list if event.kind == "impact")
    assert (first.damper, first.side) == (0, "shroud")
    own, omega = 200.0, 40 * math.pi
    gain = 40.0 / (own**2 - omega**2)

    def motion(t):
        return gain * (math.sin(omega * t) - omega / own * math.sin(own * t)), gain * omega * (
            math.cos(omega * t) - math.cos(own * t)
        )

    place, speed = motion(first.time)
    step = 0.2 / scene.solver.steps_per_period if method in ("moreau", "penalty") else 0.0
    assert place == pytest.approx(GAP, rel=max(tolerance, 1e-8), abs=speed * step)
    assert abs(first.relative_velocity_before) == pytest.approx(speed, rel=max(2 * tolerance, 1e-6))
    if method != "penalty":  # whose contact lasts, while the force goes on
        reduced = 1 / (1 / 1.0 + 1 / 3.0)
        assert first.impulse == pytest.approx(1.5 * reduced * speed, rel=2e-2 if step else 1e-6)


def test_shrouds_are_named_rightly(tmp_path):
    mapped = period_map(shrouds(tmp_path))
    passage = mapped(np.zeros(len(mapped.scale)))
    assert passage.sequence[0] == "impact shroud.0"
    with pytest.raises(InputError, match=re.escape("shroud[0].to: no interface label 'three'; it has one, two")):
        simulate(shrouds(tmp_path, shroud=[{"at": "one", "to": "three", "gap": GAP}]))
    rigid = tethered().to_dict() | {"shroud": [{"at": "one", "to": "two", "gap": GAP}]}
    with pytest.raises(InputError, match=r"shroud\[0\].to: interface labels are a reduced model's"):
        validate(Scene, rigid, "scene")


@pytest.mark.parametrize("engine", ["line", "plane"])
def test_a_passage_names_its_impacts_by_the_element(engine, tmp_path):
    mapped = period_map(shrouds(tmp_path, **(PLANE if engine == "plane" else {})))
    passage = mapped(np.zeros(len(mapped.scale)))
    assert passage.sequence[0] == "impact shroud.0"
