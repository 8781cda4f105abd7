"""Any number of bodies and friction elements: more rows than an integer has bits, and the same laws."""

import numpy as np
import pytest

from tests.coupling.orbits.test_waves import ring
from tests.tools.laws_by_event import check_events
from tests.tools.tiers import cases
from vanedamp.coupling.engine import known
from vanedamp.coupling.engine.line import subsystem_assembly, subsystems
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import validate

BODIES = [33, 65, 100, 200]


def cluster(bodies, spread=0.0, periods=3, **tables) -> Scene:
    """A rigid structure near resonance with one body of the same total mass, shared by so many cavities."""
    places = 5e-6 * spread * np.linspace(-1.0, 1.0, bodies)
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi * 2414) ** 2, "damping_ratio": 0.002},
        "excitation": {"frequency": 2414 * 0.995, "resonance_amplitude": 30e-6},
        "initial": {"displacement": 20e-6},
        "gravity": {"acceleration": 9.81},
        "cavity": [{"name": f"c{i}", "gap": 15e-6} for i in range(bodies)],
        "damper": [
            {"cavity": f"c{i}", "mass": 0.02 / bodies, "friction": 0.4, "restitution": 0.7, "position": float(place)}
            for i, place in enumerate(places)
        ],
        "time": {"periods": periods, "transient": 0},
    }
    return validate(Scene, data | tables, "scene")


def joint(elements, **tables) -> Scene:
    """An Iwan joint: Jenkins elements in parallel that begin to slide one after the other."""
    limits = 0.02 * 50 / elements * np.arange(1, elements + 1) / elements
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
        "excitation": {"frequency": 0.15, "force": 1.0},
        "initial": {"displacement": 0.3},
        "gravity": {"acceleration": 0.0},
        "friction_damper": [
            {"normal_force": 1.0, "friction": float(limit), "stiffness": 1.0 / elements} for limit in limits
        ],
        "time": {"periods": 1, "transient": 0},
    }
    return validate(Scene, data | tables, "scene")


def test_subsystems_that_memory_does_not_hold_are_found_again(monkeypatch):
    """A ring of eight bodies that stick and rest at walls: with room for four subsystems only, the same to the bit."""
    scene = ring(8, 1, periods=20).replace({f"cavity.{s}.gap": 3e-5 for s in range(4)})
    whole = simulate(scene)
    assert whole.counters["subsystems"] > 12
    monkeypatch.setattr(known, "_STRUCTURES", known._Structures())
    for module, name in ((subsystems, "ROOM"), (subsystem_assembly, "_ROOM"), (known, "ROOM")):
        monkeypatch.setattr(module, name, 0)
    few = simulate(scene)
    assert few.counters["subsystems"] <= 4 and few.counters["impacts"] == whole.counters["impacts"]
    assert np.array_equal(few.section, whole.section)
    assert few.energy_residual == whole.energy_residual < 1e-9


@pytest.mark.parametrize("bodies", cases(BODIES, fast=[33, 65, 100]))
def test_equal_bodies_are_one(bodies):
    """Equal bodies in equal cavities do what one body of their mass does, one impact of it being one of each."""
    one, many = simulate(cluster(1)), simulate(cluster(bodies))
    assert many.status == Status.OK
    assert many.counters["impacts"] == bodies * one.counters["impacts"]
    assert many.section == pytest.approx(one.section, rel=1e-9)
    assert np.ptp(many.slip, axis=1).max() < 1e-9 * 15e-6
    assert many.slip[:, 0] == pytest.approx(one.slip[:, 0], abs=1e-9 * 15e-6)
    assert many.energy_residual < 1e-10


@pytest.mark.parametrize("bodies", cases((33, 100), fast=[33]))
def test_equal_bodies_on_springs_are_one(bodies):
    """Elastic springs: the dashpot of a damped contact belongs to the reduced mass, which is another for a part."""

    def sprung(count):
        scene = cluster(count, periods=2, contact={"law": "compliant", "stiffness": 2e6 / count})
        return simulate(scene.replace({f"damper.{i}.restitution": 1.0 for i in range(count)}))

    one, many = sprung(1), sprung(bodies)
    assert many.status == Status.OK
    assert many.section == pytest.approx(one.section, rel=1e-8)
    assert many.slip[:, 0] == pytest.approx(one.slip[:, 0], abs=1e-8 * 15e-6)


@pytest.mark.parametrize("bodies", cases(BODIES, fast=[33]))
def test_bodies_at_different_places_equal_time_stepping(bodies):
    """Moreau's scheme beside the engine over one period: its error is of the first order in the step."""
    exact = simulate(cluster(bodies, spread=1.0, periods=1))
    assert exact.status == Status.OK
    assert np.abs(exact.slip).max() <= 7.5e-6 * (1 + 1e-12)
    errors = []
    for steps in (2000, 8000):
        solver = {"method": "moreau", "steps_per_period": steps}
        stepped = simulate(cluster(bodies, spread=1.0, periods=1, solver=solver))
        # an impact may lie beyond the end
        assert stepped.counters["impacts"] == pytest.approx(exact.counters["impacts"], abs=2)
        errors.append(np.abs(stepped.slip[-1] - exact.slip[-1]).max() / 15e-6)
    assert errors[1] < 0.05
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("elements", cases((33, 65, 100), fast=[33]))
def test_an_iwan_joint_equals_time_stepping(elements):
    """Newmark's scheme converges to the engine with the square of its step."""
    exact = simulate(joint(elements))
    assert exact.status == Status.OK
    assert exact.energy_residual < 1e-12
    errors = []
    for steps in (400, 1600):
        solver = {"method": "penalty", "scheme": "newmark", "steps_per_period": steps}
        stepped = simulate(joint(elements, solver=solver))
        errors.append(abs(stepped.amplitude_max - exact.amplitude_max))
    assert errors[1] < 5e-5 * exact.amplitude_max
    assert np.log(errors[0] / errors[1]) / np.log(4) == pytest.approx(2.0, abs=0.2)


def test_every_law_holds_at_every_event_of_many():
    worst = check_events(cluster(40, spread=1.0, periods=2))
    assert worst.impacts > 200
