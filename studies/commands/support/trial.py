"""The cost of runs, measured: a few periods of each, within a bounded time, and the rest in proportion.

No formula knows how many events bodies, contact laws and modes make of a period.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from vanedamp.coupling.engine.backends import reuse_subsystems
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.worker import OF_A_POINT
from vanedamp.studies.commands.support.budget import RUN
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import stage

#: scenes of a set that are tried, and the time for all of them, s
_SCENES, _SECONDS = 12, 4.0


def mean_cost(scenes: Sequence[Scene]) -> float:
    """Return the mean processor time of the runs of some scenes without open choices, s, from trials of a few seconds.

    Scenes that cannot run are left out; nan if none can.
    """
    compile_engine([scenes[0], scenes[-1]])
    found, left = [], _SECONDS
    with stage("trial of the cost"):
        for number, scene in enumerate(scenes):
            begun = time.process_time()
            with suppress(*OF_A_POINT):
                found.append(_cost(scene, left / (len(scenes) - number)))
            left = max(left - (time.process_time() - begun), 0.0)
    return float(np.mean(found)) if found else float("nan")


def tried(count: int) -> list[int]:
    """Return the numbers of those of `count` scenes that stand for all: one of each part, at no regular distance."""
    if count <= _SCENES:
        return list(range(count))
    places = (np.arange(_SCENES) + np.random.default_rng(0).random(_SCENES)) * count / _SCENES
    return [int(place) for place in places]


def _cost(scene: Scene, seconds: float) -> float:
    """Return the processor time of a run, s, from a trial of about `seconds`.

    Where contacts close in a new combination, the exact engines assemble a subsystem. A second trial, which has them
    all, tells this cost, which grows as a power of the periods as combinations return, from that of the motion.
    """
    periods, marks, run, begun = scene.time.simulated, [0, 1], run_of(scene), time.process_time()
    first = [0.0]
    while run.advance_to(marks[-1]) is Status.OK:
        first.append(time.process_time() - begun)
        if marks[-1] >= periods or (first[-1] > 0.7 * seconds and len(first) > 2):
            break
        pace = first[-1] / marks[-1]
        most = int((seconds - first[-1]) / max(pace, 1e-7))
        marks.append(min(2 * marks[-1], marks[-1] + max(most, 1), periods))
    else:
        return RUN + time.process_time() - begun
    if marks[-1] >= periods:
        return RUN + first[-1]
    again, motion = run_of(scene), [0.0]
    reuse_subsystems(again, run)
    begun = time.process_time()
    for mark in marks[1:]:
        again.advance_to(mark)
        motion.append(time.process_time() - begun)
    left, last = periods - marks[-1], marks[-1]
    half = min(next(number for number, mark in enumerate(marks) if 2 * mark >= last), len(marks) - 2)
    moving = (motion[-1] - motion[half]) / (last - marks[half])
    assembled, before = (max(first[number] - motion[number], 1e-9) for number in (-1, half))
    growth = min(max(math.log(assembled / before) / math.log(last / marks[half]), 0.0), 1.0)
    return RUN + motion[-1] + left * moving + assembled * (periods / last) ** growth
