"""A forced response under way in worker processes: coarse first, then fine, cancelled when no longer wanted."""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from threading import Condition, Lock
from typing import Any

import numpy as np

from vanedamp.coupling.engine.columns import columned
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.scene.paths import Range
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Continuation, Scene, Time
from vanedamp.coupling.scene.structures import Prescribed
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.row import Row
from vanedamp.coupling.sweep.sweep import linear_tops, result_of
from vanedamp.coupling.sweep.worker import SweepTable, Task, TaskResult, broken, run_points
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.onset import onsets
from vanedamp.coupling.system.transient import left_over, settled_after
from vanedamp.files.toml_input import InputError
from vanedamp.studies.report.forced_response import LinearCurves, linear_between

#: frequencies of a curve, and the step from one to the next of its coarse form
POINTS, _COARSE = 60, 4
#: points that a worker runs at once where they run as one (sweep.alike)
_TOGETHER = 5
#: periods evaluated, the shortest and the longest transient, and the budget of events of a run, which no worker is lost
#: to for long
EVALUATED, _SHORTEST, _LONGEST, _EVENTS = 200, 50, 2000, 300_000
#: repetitions after which the frequency of an onset is known
_ROUNDS = 3
#: most periods that may be evaluated
_MOST_PERIODS = 10_000
#: tabs of the page whose curves are kept
_TABS = 32
#: s without a request after which a tab is taken for closed
_SILENT = 20.0

#: runs a call in a worker process
Submit = Callable[..., Future[Any]]


def explorable(scene: Scene) -> Scene:
    """Return the scene that is explored: without tables of other commands, with its open choices made.

    Raises InputError for a scene that has no forced response over the frequency of its excitation.
    """
    excitation = scene.excitation
    if isinstance(scene.structure, Prescribed):
        raise InputError("structure.model: a prescribed motion has no forced response; take a rigid or reduced model")
    if excitation.engine_order is not None:
        raise InputError("excitation.engine_order: the curve is drawn over excitation.frequency; give one in its place")
    if excitation.signal is not None or (excitation.waveform is not None and excitation.waveform.timed):
        raise InputError("excitation.waveform: the curve is drawn over excitation.frequency; give force and harmonics")
    plain = replace(scene, sweep={}, continuation=Continuation(), orbit=None, ramp=None, ring_down=None)
    return choose(plain, more=True).scene


@dataclass(frozen=True)
class Band:
    """Frequencies of a curve, Hz (None: around the resonance), and the periods that each run evaluates."""

    low: float | None = None
    high: float | None = None
    evaluated: int = EVALUATED


def seen(scene: Scene, band: Band) -> Scene:
    """Return the scene with the [sweep] over frequencies and the [time] of which its curve is made.

    The transient is as long as leaves `time.tolerance` of it at the highest frequency, or as is affordable
    (transient_note). Raises InputError.
    """
    if not scene.moved:
        raise InputError("excitation: nothing moves the structure; give a level above zero")
    low, high = _ends(scene, band)
    if not 1 <= band.evaluated <= _MOST_PERIODS:
        raise InputError(f"periods evaluated: expected 1 to {_MOST_PERIODS}, not {band.evaluated:g}")
    slowest = replace(scene.replace({FREQUENCY: high}), time=Time())
    transient = settled_after(slowest, range(_SHORTEST, _LONGEST, 10))
    return replace(
        scene.replace({"solver.max_events": min(scene.solver.max_events, _EVENTS)}),
        time=Time(periods=transient + band.evaluated, transient=transient),
        sweep={FREQUENCY: Range(start=low, stop=high, num=POINTS)},
    )


def impact_onset(scene: Scene, linear: LinearCurves) -> tuple[float, float] | None:
    """Return the lowest frequency, Hz, at which a motion that grows slowly brings impacts, and its amplitude, m.

    The amplitude without bodies reaches there that of a first impact (coupling.system.onset); nan: nowhere. None
    without a closed form.
    """
    at = float(linear.x[np.argmax(linear.undamped)])
    for _ in range(_ROUNDS):  # friction's part of the amplitude depends on the frequency
        found = [onset for onset in onsets(scene.replace({FREQUENCY: at})) if onset is not None]
        if len(found) < len(scene.damper) or not found:
            return None
        amplitude = min(onset.impact for onset in found)
        reached = linear.undamped >= amplitude
        if not reached.any():
            return math.nan, amplitude
        first = max(int(np.argmax(reached)), 1)
        ends = slice(first - 1, first + 1)
        at = float(np.interp(amplitude, linear.undamped[ends], linear.x[ends]))
    return at, amplitude


def transient_note(scene: Scene) -> str | None:
    """Return a warning where the transient of a `seen` scene has not ended before its runs are evaluated."""
    left = left_over(scene.replace({FREQUENCY: ends_of(scene)[1]}), scene.time.dropped)
    if left <= scene.time.tolerance:
        return None
    return (
        f"the structure is damped so little that after {scene.time.dropped} periods {min(left, 1.0):.0%} of its own "
        "transient is left unless the bodies have ended it: points may not be steady"
    )


def _ends(scene: Scene, band: Band) -> tuple[float, float]:
    """Return lowest and highest frequency, Hz: as given, or round numbers beyond the resonances of both linear curves.

    With several modes, the mode nearest to the excitation frequency counts.
    """
    free, fixed = linear_responses(scene)
    natural, widths = free.resonances()
    order = np.argsort(natural)
    mode = int(np.argmin(np.abs(natural[order] - scene.frequency)))
    top, width = float(natural[order][mode]), float(widths[order][mode])
    # joints that stick leave fewer modes, with higher frequencies
    glued = float(([*np.sort(fixed.resonances()[0])[: mode + 1]] or [top])[-1])
    span = max(abs(top - glued), 4 * width, 1e-3 * top)
    step = 10.0 ** math.floor(math.log10(span))
    low = step * math.floor((min(glued, top) - 1.5 * span) / step) if band.low is None else band.low
    high = step * math.ceil((max(glued, top) + span) / step) if band.high is None else band.high
    low = max(low, 0.1 * glued) if band.low is None else low
    if not 0.0 < low < high:
        raise InputError(f"frequencies: expected two above zero, the lower one first, not {low:g} and {high:g} Hz")
    return float(f"{low:.12g}"), float(f"{high:.12g}")


def ends_of(scene: Scene) -> tuple[float | None, float | None]:
    """Return lowest and highest frequency that the [sweep] of a scene has, Hz; None without."""
    axis = scene.axes.get(FREQUENCY)
    if axis is None:
        return None, None
    values = [axis.start, axis.stop] if isinstance(axis, Range) else [float(value) for value in axis]
    return (min(values), max(values)) if min(values) < max(values) else (None, None)


class Curve:
    """The forced response of a `seen` scene under way: its points run in workers, coarse ones first.

    linear: its linear curves; onset: of impacts, by these (impact_onset); done, size: points so far, and of the whole
    curve; coarse: of its coarse form; note: a warning, of transient_note; asked: when a tab last asked for it, s of
    time.monotonic. Raises InputError.
    """

    def __init__(self, scene: Scene, submit: Submit) -> None:
        low, high = ends_of(scene)
        assert low is not None and high is not None
        self.scene, self.linear, self.note = scene, linear_between(scene, low, high), transient_note(scene)
        self.onset = impact_onset(scene, self.linear)
        self._grid = grid(scene)
        self._peaks = linear_tops(self._grid)
        self.size = self._grid.size
        self._table = SweepTable(self.size, Row(self._grid.base))
        self._news, self._cancelled, self.asked = Condition(), False, time.monotonic()
        first = [0, self.size - 1, *range(_COARSE, self.size - 1, _COARSE)]  # the ends belong to all its parts
        self.coarse = len(first)
        self._futures = list[Future[TaskResult]]()
        together = _TOGETHER if columned(self._grid.base, [FREQUENCY]) else 1
        for some in (first, sorted(set(range(self.size)) - set(first))):
            for start in range(0, len(some), together):
                task = Task(some[start : start + together])
                values = self._grid.table(task.points)
                future = submit(run_points, self._grid.base, self._grid.choices, values, task)
                self._futures.append(future)
                future.add_done_callback(partial(self._add, task))

    @property
    def done(self) -> int:
        """Points that are done."""
        return self._table.count

    @property
    def wanted(self) -> bool:
        """Whether it has not been cancelled."""
        return not self._cancelled

    def cancel(self) -> None:
        """Give up the points that no worker has begun with."""
        with self._news:
            self._cancelled = True
            self._news.notify_all()
        for future in self._futures:
            future.cancel()

    def wait(self, count: int, seconds: float) -> None:
        """Wait until `count` points are done, it is cancelled, or some time has passed."""
        with self._news:
            self._news.wait_for(lambda: self._cancelled or self.done >= count, seconds)

    def sweep(self) -> Sweep:
        """Return the sweep over the frequencies that are done, with the peaks of the whole linear curves."""
        with self._news:
            done = np.flatnonzero(self._table.done)
            part = SweepTable(len(done), self._table.row)
            codes = self._table.codes[done]
            part.put(slice(None), self._table.values[done].copy(), codes, self._table.texts)
        frequencies = self._grid.axes[FREQUENCY]
        axes = {FREQUENCY: [frequencies[point] for point in done]}
        return replace(result_of(replace(self._grid, axes=axes), part, {}), peaks=self._peaks)

    def _add(self, task: Task, future: Future[TaskResult]) -> None:
        if future.cancelled():
            return
        error = future.exception()
        result = future.result() if error is None else broken(error, self._table.row, len(task.points))
        with self._news:
            self._table.add(task, result, False)
            self._news.notify_all()


class Curves:
    """The curves of the tabs of a page: one each, the one before is cancelled."""

    def __init__(self, submit: Submit) -> None:
        self._submit = submit
        self._of_tab: OrderedDict[str, tuple[int, Curve]] = OrderedDict()
        self._lock = Lock()

    def take(self, tab: str, version: int, scene: Callable[[], Scene]) -> Curve | None:
        """Return a tab's curve of some version, begun if it is not there; then the tab's older one is cancelled.

        None if the tab has a newer one. Raises InputError, also what `scene` raises; the older one then continues.
        """
        with self._lock:
            known, curve = self._of_tab.get(tab, (-1, None))
            if known > version:
                return None
            now = time.monotonic()
            if curve is not None and known == version and curve.wanted:
                curve.asked = now
                return curve
            begun = Curve(scene(), self._submit)
            begun.asked = now
            self._of_tab[tab] = (version, begun)
            self._of_tab.move_to_end(tab)
            # a tab that is there asks until its curve is complete; one that comes back has it begun again
            forgotten = [curve, *(other for _, other in self._of_tab.values() if now - other.asked > _SILENT)]
            if len(self._of_tab) > _TABS:
                forgotten.append(self._of_tab.popitem(last=False)[1][1])
        for curve in filter(None, forgotten):
            curve.cancel()
        return begun
