"""The table of events against motions of both engines, whose functions do not read it; and where laws stand."""

import ast
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.tools.periodic_scenes import scene_of
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.system.unit_laws import EVENTS, possible_events, presses, signals_of, ways

ROOT = Path(__file__).parents[3]
#: sliders with stick and slip, with impacts, with springs, Jenkins elements; planar bodies of several laws
SEEDS = (7, 20, 17, 11, 16, 21, 22)
#: shorter segments have no room to tell signs from round-off, in periods
SHORT = 1e-4


def value(event, unit, segment, t):
    """An event function a time after a segment's start, and the size that its round-off is relative to."""
    system, (q, v), u = segment.system, segment.at(t), len(segment.system.rest)
    gap, speed, force = system.rest + system.J[:u] @ q, system.J @ v, segment.forces(t)
    signals = signals_of(unit, gap[:, None], speed[:, None], force[:, None], np.ones(1))
    factors = event.factors(system, unit, ways(segment.state)[unit])
    swing = (np.abs(segment.force) + np.abs(segment.force_shape) @ np.abs(segment.amplitude)).max()
    own = {"gap": system.play[unit], "one": 1.0, "push": swing, "drag": swing}
    sizes = [abs(factor) * own.get(name, segment.speed) for factor, (name, _) in zip(factors, event.terms, strict=True)]
    return event.function(factors, signals)[0], max(sizes)


def test_events_of_runs_are_those_of_the_table(tmp_path):
    """An event of the engine can end the state that it ends, by a function that falls through zero there."""
    met = Counter()
    for seed in SEEDS:
        scene = scene_of(seed, tmp_path)[1].replace({"time.periods": 4})
        before, unit = None, -1
        for segment in Walk(run_of(scene, [EVENT_LIST]), 4):
            system, event, end = segment.system, segment.event, segment.duration
            possible = {(r, int(each.code)) for r, each in possible_events(system, segment.state)}
            if before is not None and before.code in (codes.OPENS, codes.PARTS):
                assert segment.state[unit] in (before.after, codes.LEAVING, codes.TOUCHING)
            before = None
            if event.unit < 0 or end < SHORT * system.period:
                continue
            unit, before = event.unit, EVENTS[event.what]
            assert (unit, event.what) in possible or segment.state[unit] == codes.TOUCHING
            now, size = value(before, unit, segment, end)
            earlier, _ = value(before, unit, segment, 0.99 * end)
            assert abs(now) <= 1e-9 * size and earlier >= -1e-12 * size
            met[before.name] += 1
            # no other function has passed through zero before
            for r, other in possible_events(system, segment.state):
                middle, size = value(other, r, segment, 0.5 * end)
                held = other.order == codes.VELOCITY and abs(middle) <= 1e-9 * size
                assert middle >= -1e-9 * size or held
    assert {"impact", "sticks", "slips", "leaves"} <= met.keys() and min(met.values()) >= 5


def test_the_table_has_every_event_once_and_a_state_that_can_follow():
    assert {*EVENTS} == {*map(int, (codes.CLOSES, codes.OPENS, codes.RECLOSES, codes.PARTS, codes.AT_LOW,
                                    codes.AT_HIGH, codes.STOPS))}  # fmt: skip
    for event in EVENTS.values():
        assert event.after not in event.states and event.order in (codes.FORCE, codes.VELOCITY, codes.POSITION)
        assert not event.contact or presses(event.after) or event.after == codes.OPEN


@pytest.mark.parametrize("bound", ["AT_LOW", "AT_HIGH"])
def test_friction_at_a_bound_opposes_the_slip_that_follows(bound):
    """Coulomb's law: T = -mu N sign(slip), where the room of friction to its bound vanishes."""
    event = EVENTS[int(getattr(codes, bound))]
    slip, push = float(event.after), 3.0
    signals = {"push": np.array([push]), "drag": np.array([-0.4 * push * slip]), "one": np.array([1.0])}
    factors = [{"friction": 0.4, "limit": 0.0}.get(factor, factor) for _, factor in event.terms]
    assert event.function(factors, signals) == pytest.approx(0.0, abs=1e-15)


#: how often files name the codes of events, or compare with a direction of slip: fewer are better, more need a reason.
#: Compiled functions of the engines set up their functions by the code; complementarity has the bounds of its own rows
NAMED = {
    "coupling/system/unit_laws.py": 12, "coupling/numerics/complementarity.py": 12,
    "coupling/derivatives/saltation.py": 4, "coupling/system/unit_kinematics.py": 2,
    "coupling/engine/line/automaton.py": 4, "coupling/engine/line/compliant_contacts.py": 11,
    "coupling/engine/line/contact_states.py": 10, "coupling/engine/line/event_driven.py": 3,
    "coupling/engine/line/event_functions.py": 16, "coupling/engine/line/impacts.py": 1,
    "coupling/engine/line/tracing.py": 3,
    "coupling/engine/plane/automaton.py": 13, "coupling/engine/plane/event_functions.py": 10,
    "coupling/engine/plane/subsystems.py": 2, "coupling/engine/plane/scenes.py": 1,
}  # fmt: skip


def product():
    """The files of the product that may import the codes, as trees."""
    for folder in ("coupling", "studies", "rom", "modal", "files", "meshes"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "codes" in (text := path.read_text(encoding="utf-8")):
                yield path.relative_to(ROOT).as_posix(), ast.parse(text)


def named(tree):
    """How often a file names a code of an event, or compares with a state of slip."""
    events, slips = {"CLOSES", "OPENS", "RECLOSES", "PARTS", "STOPS", "AT_LOW", "AT_HIGH"}, {"SLIP_LEFT", "SLIP_RIGHT"}
    imported = {
        each.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
        and (node.module or "").endswith("numerics.codes") for each in node.names
    }  # fmt: skip

    def name_of(node):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "codes":
            return node.attr
        return node.id if isinstance(node, ast.Name) and node.id in imported else ""

    compared = [
        part for node in ast.walk(tree) if isinstance(node, ast.Compare) for part in (node.left, *node.comparators)
    ]
    return sum(name_of(node) in events for node in ast.walk(tree)) + sum(name_of(part) in slips for part in compared)


def test_laws_of_events_stand_in_few_files():
    found = {name: count for name, tree in product() if (count := named(tree))}
    more = {name: count for name, count in found.items() if count > NAMED.get(name, 0)}
    assert not more, f"{more}: read coupling/system/unit_laws.py"
