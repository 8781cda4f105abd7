"""Laws that every motion obeys, over random scenes: Newton's laws, momentum, energy, walls, symmetry and units.

Scenes are compared with their images before chaos parts them (tests/images.py), and stepped through event by event
(tests/laws_by_event.py). Units and masses are compared over the first impacts alone: each impact multiplies a
difference by about (travel of the structure)/(gap), so these agree within 1e-8 where round-off begins at 1e-15.
"""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from images import compare, hairs, later, mirrored, record, renumbered, reordered, unmirrored
from laws_by_event import check_events
from worlds import between, scene_of, worlds

from coupling import automaton as auto
from coupling.engine import simulate
from coupling.response import Status

# what fails is a scene of its own for test_coupling_traps.py: no time is spent on making it small again
FAST = settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    report_multiple_bugs=False,
    suppress_health_check=list(HealthCheck),
)
FEW = settings(FAST, max_examples=6)
SLOW = settings(FAST, max_examples=1500)
LAWS = pytest.mark.parametrize("law", ["newton", "compliant"])
WORLDS = pytest.mark.parametrize(("law", "elements"), [("newton", False), ("newton", True), ("compliant", True)])
LOSSES = ("viscous", "friction", "impact", "contact")


def impacts(response):
    return [event for event in response.event_list if event.kind == "impact"]


def check_laws(data):
    """The ledger closes, nothing gives energy, and at every event the laws hold."""
    scene = scene_of(data)
    response = simulate(scene, events=True, samples_per_period=32)
    assume(not (hops(scene) and response.status == Status.EVENT_BUDGET))
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    largest = max(abs(value) for value in response.energy.values())
    assert min(response.energy[name] for name in LOSSES) >= -1e-12 * largest
    times = [event.time for event in response.event_list]
    assert times == sorted(times)
    if scene.contact.law == "newton":
        check_newton(scene, impacts(response))
        if data["structure"]["model"] != "rom" or "left" not in data["cavity"][0]:
            check_walls(scene, response)
    check_events(scene)


def hops(scene):
    """Whether a body is elastic: pressed on its wall it hops as often as it likes, and no chatter ends that."""
    return max(damper.restitution for damper in scene.damper) > 0.995


def restitutions(scene, event):
    """Restitution and reduced mass without the structure of an impact."""
    damper = scene.damper[event.damper]
    if event.side != "body":
        return damper.restitution, damper.mass
    other = scene.damper[event.damper + 1]
    restitution = math.sqrt(damper.restitution * other.restitution)
    return restitution, damper.mass * other.mass / (damper.mass + other.mass)


def check_newton(scene, found):
    """v+ = -k v- and impulse = m* (1 + k) |v-| at impacts alone in their instant; the last of a chatter is plastic."""
    fastest = max((abs(event.relative_velocity_before) for event in found), default=0.0)
    for index, event in enumerate(found):
        near = [e for e in found[max(index - 4, 0) : index + 5] if e is not event and abs(e.time - event.time) < 1e-9]
        before, after = event.relative_velocity_before, event.relative_velocity_after
        restitution, mass = restitutions(scene, event)
        assert event.impulse >= 0.0
        assert before * after <= 0.0
        if abs(before) < 1e-4 * fastest or near or after == 0.0:
            continue  # whether a plastic impact ends a chatter is judged by check_events, which knows the accelerations
        assert abs(after) >= restitution * abs(before) * (1 - 1e-12)
        if scene.structure.model == "rigid" and event.side != "body":
            mass = 1 / (1 / mass + 1 / scene.structure.mass)
        if scene.structure.model != "rom" and abs(after) <= restitution * abs(before) * (1 + 1e-12):
            # bodies at rest on other walls and neighbours take part in the impact: its mass is then larger
            assert event.impulse >= (1 + restitution) * mass * abs(before) * (1 - 1e-10)
            if len(scene.damper) == 1:
                assert event.impulse == pytest.approx((1 + restitution) * mass * abs(before), rel=1e-10)


def check_walls(scene, response):
    """No body leaves its cavity or its place in the row, to 1e-12 of the gap and of the motion."""
    for cavity in scene.cavity:
        row = [index for index, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        ends = np.full((len(response.time), 1), cavity.gap / 2)
        openings = np.diff(np.hstack([-ends, response.body_displacement[:, row], ends]), axis=1)
        assert openings.min() >= -1e-12 * cavity.gap


@WORLDS
@FAST
@given(data=st.data())
def test_laws(law, elements, data):
    check_laws(data.draw(worlds(laws=(law,), elements=elements)))


@pytest.mark.slow
@WORLDS
@SLOW
@given(data=st.data())
def test_laws_of_thousands(law, elements, data):
    check_laws(data.draw(worlds(laws=(law,), elements=elements)))


def check_images(data):
    """Mirror image, cavities in another order, and a start at another phase: the same motion."""
    one = record(data)
    apart = [record(near) for near in hairs(data)]
    codes = {run.code for run in (one, *apart)}
    assume(not (hops(scene_of(data)) and auto.EVENT_BUDGET in codes))
    assert codes == {auto.DONE}
    image, change = mirrored(data)
    compare(one, unmirrored(record(image, change)), apart)
    moved, old = reordered(data, list(range(len(data["cavity"])))[::-1])
    compare(one, renumbered(record(moved), old), apart)
    start = later(data)
    if start is not None:
        time, change = start
        compare(one, record(data, change), apart, shift=time, sections=False)


@LAWS
@FEW
@given(data=st.data())
def test_images(law, data):
    check_images(data.draw(worlds(laws=(law,))))


@pytest.mark.slow
@LAWS
@SLOW
@given(data=st.data())
def test_images_of_thousands(law, data):
    check_images(data.draw(worlds(laws=(law,))))


def agree(one, other, sign=1.0, length=1.0, speed=1.0, time=1.0, order=None):
    """The first impacts of `other` are those of `one` times the factors. Sides are not compared: they may swap."""
    first, second = impacts(one), impacts(other)
    assert abs(len(first[:4]) - len(second[:4])) <= 1
    fastest = max((abs(event.relative_velocity_before) for event in first), default=1.0)
    for a, b in zip(first[:4], second[:4], strict=False):
        if abs(a.relative_velocity_before) < 1e-3 * fastest:
            return  # grazing and the end of chatter are decided by round-off
        assert b.time == pytest.approx(a.time * time, rel=1e-8)
        # a slow impact is told from a miss by the square root of round-off
        assert b.relative_velocity_before == pytest.approx(
            sign * speed * a.relative_velocity_before, abs=1e-7 * speed * fastest
        )
        if order is not None:
            assert b.damper == order[a.damper]
    until = 2
    if len(first) > 4:
        until = min(until, int(first[4].time * one.frequency))
    if until and first[:1] and first[0].time * one.frequency > 1:
        assert other.section[:until, 0] == pytest.approx(sign * length * one.section[:until, 0], abs=1e-8 * length)


@FAST
@given(
    data=worlds(structures=("rigid",), laws=("newton",), cavities="own", elements=False),
    power=st.integers(-12, 12),
    stretch=st.integers(-12, 12),
)
def test_units_do_not_matter(data, power, stretch):
    """Lengths times 2^power and times 2^stretch: the same events, exactly scaled."""
    length, time = 2.0**power, 2.0**stretch
    scene = scene_of(data)
    values = {
        "structure.stiffness": 1.0 / time**2,
        "initial.displacement": data["initial"]["displacement"] * length,
        "initial.velocity": data["initial"]["velocity"] * length / time,
        "excitation.frequency": data["excitation"]["frequency"] / time,
        "gravity.acceleration": data["gravity"]["acceleration"] * length / time**2,
    }
    for kind in ("force", "base_acceleration"):
        if kind in data["excitation"]:
            values[f"excitation.{kind}"] = data["excitation"][kind] * length / time**2
    for cavity in data["cavity"]:
        values[f"cavity.{cavity['name']}.gap"] = cavity["gap"] * length
    for index, damper in enumerate(data["damper"]):
        values[f"damper.{index}.position"] = damper["position"] * length
        values[f"damper.{index}.velocity"] = damper["velocity"] * length / time
        if "normal_load" in damper:
            values[f"damper.{index}.normal_load"] = damper["normal_load"] * length / time**2
    one, other = simulate(scene, events=True), simulate(scene.replace(values), events=True)
    agree(one, other, length=length, speed=length / time, time=time)


@FAST
@given(data=worlds(structures=("rigid",), laws=("newton",), cavities="own", elements=False), mass=between(1e-6, 1e6))
def test_only_ratios_of_masses_matter(data, mass):
    scene = scene_of(data)
    values = {"structure.mass": mass, "structure.stiffness": mass}
    if "force" in data["excitation"]:
        values["excitation.force"] = data["excitation"]["force"] * mass
    for index, damper in enumerate(data["damper"]):
        values[f"damper.{index}.mass"] = damper["mass"] * mass
        if "normal_load" in damper:
            values[f"damper.{index}.normal_load"] = damper["normal_load"] * mass
    agree(simulate(scene, events=True), simulate(scene.replace(values), events=True))


@FAST
@given(data=worlds(structures=("rigid",)), cut=st.integers(1, 2))
def test_shorter_run_is_the_beginning_of_the_longer(data, cut):
    """The state at a period's start does not depend on how far the run goes, to the last bit."""
    scene = scene_of(data)
    whole, part = simulate(scene), simulate(scene.replace({"time.periods": cut}))
    assume(whole.status == part.status == Status.OK)
    assert np.array_equal(part.section, whole.section[: cut + 1])
    assert np.array_equal(part.slip, whole.slip[: cut + 1])
