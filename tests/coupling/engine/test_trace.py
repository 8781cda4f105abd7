"""The course of a run: segments and events as they are met one by one, whatever it has held and run before."""

import numpy as np
import pytest

from tests.tools.sensitive_scenes import KINDS, scene_of
from vanedamp.coupling.engine.backends import engine_run
from vanedamp.coupling.engine.trace import COUNT
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.segment import Walk
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError

PERIODS = 3
SEGMENT = ("period", "time", "duration", "speed", "state", "q", "v", "open_force")
EVENT = ("unit", "what", "impulse", "compression", "loss", "reduced")
HITS = ("struck", "before", "after")


def runs_of(seed, folder):
    """Return a function that makes runs of a scene, keeping their events or not, and its start."""
    try:
        _, scene = scene_of(seed, folder)
        system = assemble(scene)
        start = start_of(scene, system)
    except InputError:
        pytest.skip("no scene")
    return lambda events: engine_run(system, start, new_records(system, PERIODS, 0), events, 4000), start


def rows_of(run, periods, segments=256):
    """Return the segments of a course with their events, each as arrays by name."""
    found = []
    for trace in run.course(periods, segments):
        for i in range(bool(found), int(trace.at[COUNT])):
            hits = slice(int(trace.first[i + 1]), int(trace.first[i + 2]))
            row = {name: np.array(getattr(trace, name)[i]) for name in SEGMENT}
            row |= {name: np.array(getattr(trace, name)[i + 1]) for name in EVENT}
            found.append(row | {name: np.array(getattr(trace, name)[hits]) for name in HITS})
    return found


@pytest.mark.parametrize("seed", range(len(KINDS)))
def test_a_course_is_the_motion_from_event_to_event(seed, tmp_path):
    made, _ = runs_of(seed, tmp_path)
    walk, run, whole = Walk(made(True), PERIODS), made(False), made(False)
    segments, found = list(walk), rows_of(run, PERIODS)
    assert len(found) == len(segments) and run.status is walk.status
    for row, segment in zip(found, segments, strict=True):
        for name in (*SEGMENT, *EVENT, *HITS):
            expected = np.asarray(getattr(segment if name in SEGMENT else segment.event, name), float)
            size = np.abs(segment.v).max(initial=segment.speed) if name == "v" else np.abs(expected).max(initial=0.0)
            assert row[name].shape == expected.shape, name
            assert np.all(np.abs(row[name] - expected) <= 1e-13 * size), name
    whole.advance_to(PERIODS)
    assert np.array_equal(whole.records.section, run.records.section)  # nor does it change the motion


@pytest.mark.parametrize("seed", range(0, len(KINDS), 3))
def test_a_course_depends_neither_on_its_room_nor_on_what_ran_before(seed, tmp_path):
    made, start = runs_of(seed, tmp_path)
    run, expected = made(False), rows_of(made(False), PERIODS)
    for segments in (3, 3, 2):
        run.begin_from(start)
        found = rows_of(run, PERIODS, segments)
        assert len(found) == len(expected)
        for row, other in zip(found, expected, strict=True):
            assert all(np.array_equal(row[name], other[name]) for name in row)
