"""The cost of runs, extrapolated from a few periods of each that are measured within a bounded time.

No formula predicts the number of events per period from bodies, contact laws and modes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from vanedamp.coupling.engine.backends import reuse_subsystems
from vanedamp.coupling.methods.registry import run_of, why_no_restart
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.sweep.worker import OF_A_POINT
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.store import frozen
from vanedamp.studies.jobs.budget import RUN
from vanedamp.studies.jobs.engine import compile_engine
from vanedamp.studies.terminal import stage

#: scenes of a set that are tried, and the time for all of them, s
_SCENES, _SECONDS = 12, 4.0


def mean_cost(scenes: Sequence[Scene], begins: float = RUN) -> float:
    """Return the mean processor time of the runs of some scenes without open choices, s, from trials of a few seconds.

    begins: of each in addition to its periods, s. Scenes that cannot run are left out; nan if none can.
    """
    compile_engine([*scenes[:1], *scenes[-1:]])
    costs, seconds_left = [], _SECONDS
    with stage("trial of the cost"):
        for number, scene in enumerate(scenes):
            begun = time.process_time()
            with suppress(*OF_A_POINT):
                costs.append(begins + _cost(scene, seconds_left / (len(scenes) - number)))
            seconds_left = max(seconds_left - (time.process_time() - begun), 0.0)
    return float(np.mean(costs)) if costs else float("nan")


def tried(count: int) -> list[int]:
    """Return the indices of scenes that represent all `count`: one at a random position in each of equal intervals."""
    if count <= _SCENES:
        return list(range(count))
    positions = (np.arange(_SCENES) + np.random.default_rng(0).random(_SCENES)) * count / _SCENES
    return [int(position) for position in positions]


def _cost(scene: Scene, seconds: float) -> float:
    """Return the processor time of the periods of a run, s, from a trial of about `seconds`.

    A longer run is tried from near its steady state, since few events occur at its beginning. Where contacts close in
    a new combination, the exact engines assemble a contact configuration. A second trial, in which all are assembled,
    separates this cost, a power of the number of periods as combinations recur, from that of the motion.
    """
    periods = scene.time.simulated
    whole = _follow(run_of(scene), periods, 0.3 * seconds)
    if whole[-1][0] == periods or whole[-1] == whole[-2]:
        return whole[-1][1]
    start = _near_steady(scene)
    run, again = run_of(scene, start=start), run_of(scene, start=start)
    first = _follow(run, periods, 0.5 * seconds)
    last = first[-1][0]
    reuse_subsystems(again, run)
    if first[-1] == first[-2]:  # the run has ended early
        return first[-1][1]
    motion = _follow(again, last, math.inf, [mark for mark, _ in first])
    half = max(number for number, (mark, _) in enumerate(first[:-1]) if 2 * mark <= last or number == 1)
    before = first[half][0]
    moving = (motion[-1][1] - motion[half][1]) / (last - before)
    assembled, earlier = (max(first[number][1] - motion[number][1], 1e-9) for number in (-1, half))
    growth = min(max(math.log(assembled / earlier) / math.log(last / before), 0.0), 1.0)
    return motion[-1][1] + (periods - last) * moving + assembled * (periods / last) ** growth


def _follow(run: Run, periods: int, seconds: float, marks: Sequence[int] = ()) -> list[tuple[int, float]]:
    """Return periods done and the processor time since the begin, s, until all are done, the run ends, or time is up.

    marks: the numbers of periods, from 0; without them, twice as many each time.
    """
    begun, measured = time.process_time(), [(0, 0.0)]
    while (done := measured[-1][0]) < periods and (measured[-1][1] < seconds or len(measured) < 4):
        pace = max(measured[-1][1], 1e-6) / max(done, 1)
        most = int((seconds - measured[-1][1]) / pace) if seconds < math.inf else periods
        target = marks[len(measured)] if marks else min(done + min(max(done, 1), max(most, 1)), periods)
        ok = run.advance_to(target) is Status.OK
        measured.append((target, time.process_time() - begun))
        if not ok:
            return [*measured, measured[-1]]
    return measured


def _near_steady(scene: Scene) -> RestartState | None:
    """Return the linear steady state, of the smaller amplitude without bodies and with bodies fixed.

    None if there is none, or if the scene's method cannot start from it.
    """
    if scene.excitation.signal is not None or isinstance(scene.structure, Prescribed) or why_no_restart(scene):
        return None
    system, frequency = assemble(scene), np.array([scene.frequency])
    free, fixed = linear_responses(scene, system)
    wave = free.motion(scene.frequency)[0]
    amplitudes = [float(response.amplitude(frequency)[0]) for response in (free, fixed)]
    wave = wave * min(amplitudes[1] / amplitudes[0], 1.0) if amplitudes[0] else wave
    start = start_of(scene, system)
    displacement, velocity = system.scale * wave.imag, system.scale * system.omega * wave.real
    return replace(start, displacement=frozen(displacement), velocity=frozen(velocity))
