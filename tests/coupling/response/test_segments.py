"""Segments of runs of both engines: they join at their events, and their motion obeys Newton's second law."""

import itertools

import numpy as np
import pytest

from tests.tools.periodic_scenes import scene_of
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics.codes import CLOSES, STOPS
from vanedamp.coupling.response.observers import EVENT_LIST
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.simulation import simulate

PERIODS = 2
#: sliders with stick and slip, with impacts, with Jenkins elements; blocks and discs of three laws, on springs too
SEEDS = [7, 20, 17, 11, 16, 21]


def walked(seed, folder):
    scene = scene_of(seed, folder)[1].replace({"time.periods": PERIODS})
    walk = Walk(run_of(scene, [EVENT_LIST]), PERIODS)
    segments = list(walk)
    assert walk.status is Status.OK and len(segments) > 2 * PERIODS
    return scene, walk.run, segments


def unbalanced(segment, t):
    """By how much forces and accelerations of all that has mass miss each other, as a share of the largest term."""
    system, (q, v), h = segment.system, segment.at(t), 1e-4 * segment.duration
    massive = slice(len(q) - len(system.tangential))
    phase = np.exp(1j * system.frequency * (segment.time + t))
    terms = [
        system.weight, (phase @ system.load).real, -system.stiffness @ q, -system.damping @ v,
        segment.forces(t) @ system.J, -(system.tangential * (system.elongation @ q)) @ system.elongation,
        -system.mass * (segment.at(t + h)[1] - segment.at(t - h)[1]) / (2 * h),
    ]  # fmt: skip
    return np.abs(np.sum(terms, axis=0)[massive]).max() / max(np.abs(term).max() for term in terms)


@pytest.mark.parametrize("seed", SEEDS)
def test_segments_join_and_obey_newtons_second_law(seed, tmp_path):
    scene, run, segments = walked(seed, tmp_path)
    for one, other in itertools.pairwise(segments):
        system, (q, v) = one.system, one.at(one.duration)
        v = v + one.event.impulse @ system.J / system.mass
        massive = slice(len(q) - len(system.tangential))  # the rate of a slider jumps where it begins to follow
        assert np.abs(q - other.q).max() <= 1e-11 * np.abs(other.q).max()
        assert np.abs(v - other.v)[massive].max() <= 1e-6 * one.speed  # a chatter that ends has lost its last flights
        if one.duration > 1e-3 * system.period:
            assert unbalanced(one, 0.4 * one.duration) < 1e-6
    ends = [segment for segment in segments if segment.event.unit < 0]
    assert [segment.start + segment.duration for segment in ends] == pytest.approx(
        [segments[0].system.period * (1 + k) for k in range(PERIODS)], rel=1e-14
    )
    # a run that is walked goes where a plain one goes
    final = simulate(scene).final
    if final is not None:
        assert run.final().displacement == pytest.approx(final.displacement, rel=1e-10)


def test_events_are_those_of_the_contacts(tmp_path):
    """A gap that closes is zero there, with the speeds of its impact on both sides; a slip that stops is none."""
    closed = stopped = 0
    for seed in (20, 7, 11):
        for segment in walked(seed, tmp_path)[2]:
            system, event, (q, v) = segment.system, segment.event, segment.at(segment.duration)
            u, r = len(system.rest), event.unit
            if event.what == CLOSES:
                assert abs(system.rest[r] + system.J[r] @ q) <= 1e-11 * system.play[r]
                assert system.J[event.struck] @ v == pytest.approx(event.before, abs=1e-11 * segment.speed)
                after = v + event.impulse @ system.J / system.mass
                assert system.J[event.struck] @ after == pytest.approx(event.after, abs=1e-11 * segment.speed)
                closed += 1
            elif event.what == STOPS:
                assert abs(system.J[u + r] @ v) <= 1e-9 * segment.speed
                stopped += 1
    assert closed > 10 and stopped
