"""Laws that every motion obeys, over random scenes: Newton's laws, momentum, energy, walls, symmetry and units.

Scenes are compared with their images before chaos parts them (tests/tools/scene_symmetries.py), and stepped through
event by event (tests/tools/laws_by_event.py). Units and masses are compared over the first impacts only: each impact
multiplies a difference by about (travel of the structure)/(gap), so these agree within 1e-8 where round-off begins at
1e-15.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.tools.laws_of_runs import KINDS, SETTINGS, check_laws, check_symmetries, impacts, laws_of, symmetries_of
from tests.tools.scene_strategies import between, scene_of, scene_tables
from vanedamp.coupling.engine import simulate
from vanedamp.coupling.response.response import Status

FAST = settings(SETTINGS, max_examples=15, derandomize=True)
FEW = settings(FAST, max_examples=6)
#: seeds of the slow tier, and scenes of each
SEEDS, EACH = range(14), 250
LAWS = pytest.mark.parametrize("law", ["newton", "compliant"])


@pytest.mark.parametrize("kind", KINDS)
@FAST
@given(data=st.data())
def test_laws(kind, data):
    law, elements = KINDS[kind]
    check_laws(data.draw(scene_tables(laws=(law,), elements=elements)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_laws_of_thousands(kind, seed):
    """One part of the thousands; the same again: pytest -m slow with this test's name, kind and seed."""
    assert laws_of(kind, seed, EACH).scenes >= 0.9 * EACH


@LAWS
@FEW
@given(data=st.data())
def test_symmetries(law, data):
    check_symmetries(data.draw(scene_tables(laws=(law,))))


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS[:4])
@LAWS
def test_symmetries_of_thousands(law, seed):
    symmetries_of(law, seed, EACH)


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
    data=scene_tables(structures=("rigid",), laws=("newton",), cavities="own", elements=False),
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
@given(
    data=scene_tables(structures=("rigid",), laws=("newton",), cavities="own", elements=False), mass=between(1e-6, 1e6)
)
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
@given(data=scene_tables(structures=("rigid",)), cut=st.integers(1, 2))
def test_shorter_run_is_the_beginning_of_the_longer(data, cut):
    """The state at a period's start does not depend on how far the run goes, to the last bit."""
    scene = scene_of(data)
    whole, part = simulate(scene), simulate(scene.replace({"time.periods": cut}))
    assume(whole.status == part.status == Status.OK)
    assert np.array_equal(part.section, whole.section[: cut + 1])
    assert np.array_equal(part.slip, whole.slip[: cut + 1])
