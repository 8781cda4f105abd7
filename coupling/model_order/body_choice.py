"""Which body is enough: may a block in its cavity be run as a slider?

A block that hits its walls flat, with both corners of a face at once, moves as the slider does, exactly. Of an impact
that is tilted, however little, the corners take unequal parts, and the rotation that they leave does not depend on how
small the tilt was: the floor restores the aligned motion before the next impact, or it is left for good. `judge` tries
this where the body is going to be. In the steady motion of the slider it tilts the blocks, by far less than their play
allows and far more than round-off, lifts them, so that they do not lie flat at once, and watches for some tens of
periods whether tilts persist. Some starts have a large tilt, since aligned and tilted motion can both be steady.

Where no tilt persists, slider and block have one steady motion. Where some do, these runs continue, and their mean
amplitude compared with the slider's gives its error. A tilt may live for hundreds of periods and then die, leaving the
structure in another steady motion than the slider's: before it is accepted despite lasting tilts, all runs continue
for three times as long, and the error is the larger one of both windows. A block that tilts further than its run
allows has no amplitude to compare with.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.special import stdtrit

from vanedamp.coupling.engine.backends import reuse_subsystems
from vanedamp.coupling.methods.registry import final_state, run_of, why_no_restart
from vanedamp.coupling.response.evaluation import Run
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.static_deflection import about_mean
from vanedamp.coupling.response.steady_state import mean_confidence
from vanedamp.coupling.scene.bodies import Cavity
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.system.body_loads import greatest_pull
from vanedamp.coupling.system.transient import short_transient
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError

#: periods up to which blocks run without a check: it takes some 1500 periods of a block where tilts persist, and at
#: five points of a sweep, where they do not, 2500 to 8000 (docs/which_body.md)
WORTH = 6_000
#: default tolerance of the mean amplitude, relative
TOLERANCE = 0.05
#: tilts that blocks begin with, as fractions of the largest that their cavity allows; fraction above which it has grown
_SMALL, _LARGE, _GROWN = 1e-4, 0.3, 0.05
_TILTS = (_SMALL, -_SMALL, _LARGE, _SMALL, -_SMALL, -_LARGE)
#: heights above the floor over the play: of large tilts, and the least of small ones
_LIFT, _BARELY = 0.4, 1e-3
#: periods for which the small tilts would fall freely, the longest; others take equal steps to it
_FALL = 2.0
#: periods between two starts
_APART = 7
#: events per period and body, beyond which a run of the check is not worth its time
_EVENTS = 1000
#: periods after which a tilt can have died, can be said to persist, and persists unless it has died
_EARLY, _WATCH, _LONGEST = 20, 60, 240
#: tilts that persist after which no more are tried, periods over which means are taken, and batches of each block's
_ENOUGH, _WINDOW, _SLIDER_WINDOW, _BATCHES = 3, 240, 480, 3
#: periods for which runs continue before a slider is accepted despite persisting tilts
_LATER = 480


@dataclass(frozen=True)
class Advice:
    """Which body is enough for a scene, and why.

    shape: "slider" or "block"; sentence: both in words; tilts, persisting: starts with a tilt, and those from which it
    persists; smallest_tilt: of them, rad; error: of the slider's mean amplitude, relative to the block's, with the half
    width of its 95 % confidence interval, 0 where no tilt persists and None where it was not measured; tolerance: of
    the error; slider_periods, block_periods: simulated for it; points: of a sweep that were tried.
    """

    shape: str
    sentence: str
    tilts: int
    persisting: int
    smallest_tilt: float
    error: float | None
    confidence: float | None
    tolerance: float
    slider_periods: int
    block_periods: int
    points: int = 1

    def to_json(self) -> dict[str, Any]:
        """Return the advice as plain data."""
        return asdict(self)


class _Ended(Exception):
    """A run of the check that ended before its time; its text is the status."""


def needs_body(scene: Scene) -> bool:
    """Whether a scene leaves the shape of a body open."""
    return any(damper.shape == "auto" for damper in scene.damper)


def with_sliders(scene: Scene) -> Scene:
    """Return the scene with its bodies of shape "auto" as sliders."""
    none = dict.fromkeys(("length", "inertia"))
    still = dict.fromkeys(("lift", "tilt", "lift_velocity", "tilt_rate"), 0.0)
    return _changed(scene, {"shape": "slider"} | none | still)


def with_blocks(scene: Scene, share: float = _LARGE) -> tuple[Scene, RestartState | None]:
    """Return the scene with its bodies of shape "auto" as blocks, and the state that it begins with.

    That is the sliders' settled motion with a tilt, `share` times the largest: started from rest, a block can lie flat
    before it meets a wall, and is a slider for good. None, the scene's own start, where that is across a cavity, and
    where sliders do not settle because of a numerical failure.
    """
    blocks, sliders = _changed(scene, {"shape": "block"}), with_sliders(scene)
    bodies = [damper for damper in scene.damper if damper.shape == "auto"]
    if any(body.lift or body.tilt or body.lift_velocity or body.tilt_rate for body in bodies):
        return blocks, None
    settled = short_transient(sliders)
    slider = run_of(replace(sliders, time=Time(settled, 0)))
    if slider.advance_to(settled) is not Status.OK:
        return blocks, None
    return blocks, _tilted(scene, _state(sliders, slider), share, _LIFT)


def judge_all(scenes: Sequence[Scene]) -> Advice:
    """Return the advice that suits all of these scenes: blocks as soon as one needs blocks."""
    advices: list[Advice] = []
    for scene in scenes:
        advices.append(judge(scene))
        if advices[-1].shape == "block":
            break
    worst = max(advices, key=lambda item: (item.shape == "block", abs(item.error or 0.0)))
    return replace(
        worst, points=len(advices), slider_periods=sum(item.slider_periods for item in advices),
        block_periods=sum(item.block_periods for item in advices),
    )  # fmt: skip


def unjudged(scenes: Sequence[Scene], periods: int) -> Advice:
    """Return the advice to run blocks for so few periods that no check pays. Raises InputError."""
    return Advice(
        shape="block", sentence=f"blocks: without a check, which pays from {WORTH} periods on; {periods} are run",
        tilts=0, persisting=0, smallest_tilt=0.0, error=None, confidence=None,
        tolerance=min(map(_tolerance, scenes)), slider_periods=0, block_periods=0, points=0,
    )  # fmt: skip


def _tolerance(scene: Scene) -> float:
    """Return the tolerance of a scene with bodies of shape "auto". Raises InputError for one that cannot be tried."""
    if reason := why_no_restart(scene):
        raise InputError(f'damper.shape: "auto" {reason}; say which body it is')
    return min(damper.tolerance or TOLERANCE for damper in scene.damper if damper.shape == "auto")


def judge(scene: Scene) -> Advice:
    """Return the advice for a scene with bodies of shape "auto", all alike. Raises InputError."""
    tolerance = _tolerance(scene)
    sliders = with_sliders(scene)
    settled = short_transient(sliders)
    sliders = _watched(sliders, 2 * settled + _SLIDER_WINDOW + _LATER)
    slider = run_of(sliders)
    blocks: list[Run] = []
    persisting: list[Run] = []
    error, confidence, trouble = 0.0, 0.0, ""
    try:
        for index in range(len(_TILTS)):
            _advance(slider, settled + _APART * index)
            blocks.append(_begin(scene, index, _state(sliders, slider), settled + _WINDOW + _LATER, blocks))
            if _persists(blocks[-1], _largest_tilts(scene)):
                persisting.append(blocks[-1])
                if len(persisting) == _ENOUGH:
                    break
        if persisting:
            error = confidence = math.nan  # unknown of a prescribed motion, which is the same with any body
            if not isinstance(scene.structure, Prescribed):
                error, confidence = _error(slider, settled, persisting, tolerance)
    except _Ended as ended:
        error, trouble = math.nan, f"; a run ended as {ended}"
    why = f"of {len(blocks)} tilts given to them as their motion is steady, {len(persisting) or 'none'} persist"
    known = math.isfinite(error)
    if persisting and known:
        why += (
            f"; sliders change the mean amplitude by {100 * error:+.2g} +- {100 * confidence:.2g} % (95 %), "
            f"{100 * tolerance:g} % are allowed"
        )
    shape = "slider" if abs(error) + confidence <= tolerance else "block"
    return Advice(
        shape=shape, sentence=f"{shape}s: {why}{trouble}", tilts=len(blocks), persisting=len(persisting),
        smallest_tilt=_SMALL * float(_largest_tilts(scene).min()), error=error if known else None,
        confidence=confidence if known else None, tolerance=tolerance, slider_periods=slider.outcome().periods,
        block_periods=sum(block.outcome().periods for block in blocks),
    )  # fmt: skip


def _watched(scene: Scene, periods: int) -> Scene:
    """Return the scene as the check runs it."""
    most = min(scene.solver.max_events, _EVENTS * periods * len(scene.damper))
    return replace(scene, time=Time(periods, 0), solver=scene.solver.model_copy(update={"max_events": most}))


def _advance(run: Run, periods: int) -> None:
    status = run.advance_to(periods)
    if status is not Status.OK:
        raise _Ended(status.value)


def _begin(scene: Scene, index: int, state: RestartState, periods: int, earlier: Sequence[Run]) -> Run:
    """Return a run of blocks that begins with the sliders' state and with tilt number `index`.

    earlier: runs of the same scene, whose flows serve again.
    """
    share, lift = _TILTS[index], _LIFT
    if abs(share) == _SMALL:
        play = min(cavity.play for cavity in scene.cavity if cavity.play is not None)
        fallen = greatest_pull(scene) / 2 * (_FALL / scene.frequency * (index + 1) / len(_TILTS)) ** 2
        lift = min(max(fallen / play, _BARELY), _LIFT)
    blocks = _watched(_changed(scene, {"shape": "block"}), periods)
    run = run_of(blocks, start=_tilted(scene, state, share, lift))
    reuse_subsystems(run, earlier[-1] if earlier else None)
    return run


def _state(sliders: Scene, slider: Run) -> RestartState:
    """Return the state of the sliders at the end of a period."""
    state = final_state(sliders, slider)
    assert state is not None  # runs that went well have one
    return state


def _persists(run: Run, largest: np.ndarray) -> bool:
    """Whether bodies stay tilted; one that is neither flat nor far from it in the end does."""
    for periods in (_EARLY, _WATCH, _LONGEST):
        _advance(run, periods)
        plane = run.outcome().plane
        assert plane is not None
        share = float((plane.tilt[periods * 3 // 4 : periods] / largest).max())
        if share < _SMALL:
            return False
        if share >= _GROWN and periods >= _WATCH:
            return True
    return True


def _error(slider: Run, settled: int, blocks: Sequence[Run], tolerance: float) -> tuple[float, float]:
    """Return the error of the slider's mean amplitude relative to the blocks', and its 95 % confidence.

    The runs end before they have settled as well, if they show by then that it exceeds the tolerance. Where it stays
    within, they continue, and the worse one of both windows counts. Raises _Ended.
    """
    periods = 2 * settled + _SLIDER_WINDOW
    early, last = max(settled, 2 * _WATCH), settled + _WINDOW
    error, confidence = _compared(slider, periods, blocks, early, early // 2)
    if abs(error) - confidence > tolerance:
        return error, confidence
    error, confidence = _compared(slider, periods, blocks, last, settled)
    if abs(error) + confidence > tolerance:
        return error, confidence
    later = _compared(slider, periods + _LATER, blocks, last + _LATER, last)
    return max((error, confidence), later, key=lambda found: abs(found[0]) + found[1])


def _peaks(run: Run, first: int, done: int) -> np.ndarray:
    """Return the largest distances of the periods from first to done from the static deflection, m."""
    outcome = run.outcome()
    return about_mean(outcome.records, first, done, outcome.system.period)[1]


def _compared(slider: Run, periods: int, blocks: Sequence[Run], done: int, dropped: int) -> tuple[float, float]:
    """Return error and confidence of the slider's last periods from the blocks', dropped to done."""
    _advance(slider, periods)
    for block in blocks:
        _advance(block, done)
        plane = block.outcome().plane
        assert plane is not None
        if np.nanmax(plane.neglected * plane.tilt[dropped:done] ** 2) > plane.bound:
            raise _Ended(Status.TILTED.value)
    peaks = _peaks(slider, periods - _SLIDER_WINDOW, periods)
    mean, width = float(peaks.mean()), mean_confidence(peaks) or 0.0
    size = (done - dropped) // _BATCHES
    series = np.array([_peaks(block, done - size * _BATCHES, done) for block in blocks])
    batches = series.reshape(-1, size).mean(axis=1)
    other = float(batches.mean())
    if not other > 0.0:
        return 0.0, 0.0  # nothing moves
    spread = stdtrit(len(batches) - 1, 0.975) * batches.std(ddof=1) / math.sqrt(len(batches))
    return mean / other - 1.0, math.hypot(width, mean / other * spread) / other


def _tilted(scene: Scene, state: RestartState, share: float, lift: float) -> RestartState:
    """Return a state of the sliders with a tilt and a lift of the blocks, which are moved to where they fit.

    share: tilt over the largest one; lift: of the lowest corner over the play.
    """
    largest, slips = _largest_tilts(scene), np.array(state.slip)
    tilts = np.where(np.isfinite(largest), share * largest, 0.0)
    extents = np.array([damper.half_extent for damper in scene.damper])
    lifts, still = np.abs(tilts) * extents[:, 0], np.zeros(len(tilts))
    for cavity in scene.cavity:
        inside = _blocks_in(scene, cavity)
        if not inside:
            continue
        lifts[inside] += lift * (cavity.play or 0.0)
        half = np.abs(tilts[inside]) * extents[inside, 1]
        apart = np.abs(np.diff(half))
        for order, end, sign in ((1, half[0], 1.0), (-1, half[-1], -1.0)):
            reached = end - cavity.gap / 2  # of the wall that the bodies are pushed from, mirrored for the right one
            for k, room in zip(inside[::order], [0.0, *apart[::order]], strict=True):
                reached = max(sign * slips[k], reached + room)
                slips[k] = sign * reached
    return replace(
        state, slip=frozen(slips), lift=frozen(lifts), lift_velocity=frozen(still), tilt=frozen(tilts),
        tilt_rate=frozen(still),
    )  # fmt: skip


def _changed(scene: Scene, values: dict[str, Any]) -> Scene:
    """Return the scene with other values of the bodies of shape "auto", which they lose."""
    bodies = [
        replace(damper, tolerance=None, **values) if damper.shape == "auto" else damper for damper in scene.damper
    ]
    return replace(scene, damper=tuple(bodies))


def _largest_tilts(scene: Scene) -> np.ndarray:
    """Return the largest tilt (b,) of the blocks, rad, one for all of a cavity; inf for other bodies."""
    largest = np.full(len(scene.damper), np.inf)
    for cavity in scene.cavity:
        inside = _blocks_in(scene, cavity)
        halves = [scene.damper[k].half_extent for k in inside]
        largest[inside] = min((min(cavity.gap / b, (cavity.play or 0.0) / a) / 2 for a, b in halves), default=np.inf)
    return largest


def _blocks_in(scene: Scene, cavity: Cavity) -> list[int]:
    """Return the numbers of the bodies of shape "auto" in a cavity, from left to right."""
    return [k for k in scene.bodies_in(cavity) if scene.damper[k].shape == "auto"]
