"""Laws that every motion obeys, over random scenes: Newton's laws, momentum, energy, walls, symmetry and units.

Scenes are compared with their images before chaos parts them (tests/tools/scene_symmetries.py), and stepped through
event by event (tests/tools/laws_by_event.py). Units and masses are compared over the first impacts only: each impact
multiplies a difference by about (travel of the structure)/(gap), so these agree within 1e-8 where round-off begins at
1e-15.
"""

import math
from itertools import zip_longest

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.tools.laws_of_runs import KINDS, SETTINGS, impacts, laws_of, symmetries_of, whole
from tests.tools.scene_strategies import between, scene_of, scene_tables
from tests.tools.tiers import cases
from vanedamp.coupling.simulation import simulate

FAST = settings(SETTINGS, max_examples=15, derandomize=True)
#: seeds of the slow tier, and scenes of each
SEEDS, EACH = range(14), 250
LAWS = pytest.mark.parametrize("law", ["newton", "compliant"])


@pytest.mark.parametrize("scenes", cases([5, 15], fast=[5]))
@pytest.mark.parametrize("kind", KINDS)
def test_laws(kind, scenes):
    worst = laws_of(kind, 0, scenes, longest=None)
    assert worst.scenes >= scenes - 2
    assert worst.impacts >= 7 * scenes  # what is drawn depends on the numbers in the source code, too


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", KINDS)
def test_laws_of_thousands(kind, seed):
    """One part of the thousands; the same again: pytest -m slow with this test's name, kind and seed."""
    assert laws_of(kind, seed, EACH).scenes >= 0.9 * EACH


@LAWS
def test_symmetries(law):
    assert symmetries_of(law, 0, 6) >= 100


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS[:4])
@LAWS
def test_symmetries_of_thousands(law, seed):
    assert symmetries_of(law, seed, EACH) >= 20 * EACH


def agree(one, other, length=1.0, time=1.0):
    """The first impacts of `other` are those of `one` times the factors, and so is the motion up to the next.

    Returns the number of impacts compared. Whether a slow one happens is decided by round-off: there it ends.
    """
    first, second = impacts(one), impacts(other)
    speed = length / time
    fastest = max((abs(event.relative_velocity_before) for event in first), default=1.0)
    compared, until = 0, one.periods
    for a, b in zip_longest(first, second):
        speeds = [abs(e.relative_velocity_before) / s for e, s in ((a, 1.0), (b, speed)) if e is not None]
        if compared == 4 or min(speeds) < 1e-3 * fastest:
            until = min(e.time / t * one.frequency for e, t in ((a, 1.0), (b, time)) if e is not None)
            break
        assert a is not None and b is not None
        assert (a.damper, a.side) == (b.damper, b.side)
        assert b.time == pytest.approx(a.time * time, rel=1e-8)
        # a slow impact is told from a miss by the square root of round-off
        assert b.relative_velocity_before == pytest.approx(
            speed * a.relative_velocity_before, abs=1e-7 * speed * fastest
        )
        compared += 1
    motion = one.section[: math.ceil(until), 0]
    assert len(motion)
    assert other.section[: len(motion), 0] == pytest.approx(length * motion, abs=1e-7 * length)
    return compared


ONE_EACH = scene_tables(structures=("rigid",), laws=("newton",), cavities="own", elements=False)


def in_units(data, length, time):
    """Values of the scene with these as the units of length and time."""
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
    return values


def in_unit_of_mass(data, mass):
    """Values of the scene with this as the unit of mass."""
    values = {"structure.mass": mass, "structure.stiffness": mass}
    if "force" in data["excitation"]:
        values["excitation.force"] = data["excitation"]["force"] * mass
    for index, damper in enumerate(data["damper"]):
        values[f"damper.{index}.mass"] = damper["mass"] * mass
        if "normal_load" in damper:
            values[f"damper.{index}.normal_load"] = damper["normal_load"] * mass
    return values


def test_units_do_not_matter():
    """Lengths times 2^power and times 2^stretch: the same events, scaled."""
    compared = []

    @FAST
    @given(data=ONE_EACH, power=st.integers(-12, 12), stretch=st.integers(-12, 12))
    def check(data, power, stretch):
        length, time = 2.0**power, 2.0**stretch
        scene = scene_of(data)
        one, other = (simulate(s, events=True) for s in (scene, scene.replace(in_units(data, length, time))))
        compared.append(agree(one, other, length, time))

    check()
    assert sum(compared) >= 25


def test_only_ratios_of_masses_matter():
    compared = []

    @FAST
    @given(data=ONE_EACH, mass=between(1e-6, 1e6))
    def check(data, mass):
        scene = scene_of(data)
        one, other = (simulate(s, events=True) for s in (scene, scene.replace(in_unit_of_mass(data, mass))))
        compared.append(agree(one, other))

    check()
    assert sum(compared) >= 25


@FAST
@given(data=scene_tables(structures=("rigid",)), cut=st.integers(1, 2))
def test_shorter_run_is_the_beginning_of_the_longer(data, cut):
    """The state at a period's start does not depend on how far the run goes, to the last bit."""
    scene = scene_of(data)
    longer, shorter = simulate(scene), simulate(scene.replace({"time.periods": cut}))
    assume(whole(scene, longer) and whole(scene, shorter))
    assert np.array_equal(shorter.section, longer.section[: cut + 1])
    assert np.array_equal(shorter.slip, longer.slip[: cut + 1])
