"""One passage of a motion: the segments of a run, and with them the derivative of where they lead."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.derivatives.derivative import Before, Derivative, Guard, begins
from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.frame import Frame
from vanedamp.coupling.derivatives.jump import Untrusted
from vanedamp.coupling.derivatives.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.derivatives.start import Start
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.segment import EventRun, Segment, Walk


class PassageWalk:
    """One passage from a state (k,), with its derivative or without.

    half_way: the state (k,) half a period after the start, and its derivative (k, k), which is one only in a passage
    with its derivative; None if the engine has not come so far.
    """

    def __init__(
        self, frame: Frame, dynamics: Dynamics, names: EventNames, state: np.ndarray, derivative: bool
    ) -> None:
        self._frame, self._dynamics, self._names, self._whole = frame, dynamics, names, derivative
        self._derivative = Derivative(dynamics, Start(frame, dynamics, state))
        self._crossings, self._clearance = list[Crossing](), (np.inf, "")
        self.half_way: tuple[np.ndarray, np.ndarray] | None = None

    def passage(self, run: EventRun, periods: int) -> Passage:
        """Walk a run to the end of the periods."""
        walk, k, made = Walk(run, periods), len(self._dynamics.scale), self._derivative
        state, derivative = np.full(k, np.nan), np.full((k, k), np.nan)
        with np.errstate(invalid="ignore"):  # a derivative that is not known is nan
            before = self._walked(walk)
            final = run.final() if walk.status is Status.OK else None
            if before is None or final is None:
                made.worsen(PassageStatus.STOPPED)
            else:
                state = self._frame.state_of(final)
                if self._whole:
                    derivative = made.end(before, state, periods * self._frame.system.period)
        peaks = run.records.peak[:periods].copy()
        return Passage(state, derivative, tuple(self._crossings), self._clearance, made.status, peaks)

    def _walked(self, walk: Walk) -> Before | None:
        """Walk to the end. Returns the end of the last segment, None without any."""
        dynamics, half = self._dynamics, 0.5 * self._frame.system.period
        before: Before | None = None
        for segment in walk:
            assert segment.event is not None
            flow, u = dynamics.flow(segment.state, segment.open_force), dynamics.state(segment)
            M = self._next(walk, before, segment, flow, u)
            z = dynamics.extended(u, segment.time)
            if segment.period == 0 and segment.time <= half <= segment.time + segment.duration:
                middle, power = flow.after(z, half - segment.time)
                self.half_way = dynamics.to_state @ middle[: dynamics.one], dynamics.to_state @ power @ M / dynamics.scale
            if not self._whole:
                before = Before(segment, segment.event, flow, z, M)
                continue
            least, unit, what = flow.least(z, segment.duration, (segment.event.unit, segment.event.what))
            if least < self._clearance[0]:
                self._clearance = least, self._names.possible(unit, what)
            z, power = flow.after(z, segment.duration)
            before = Before(segment, segment.event, flow, z, power @ M)
        return before

    def _next(self, walk: Walk, before: Before | None, segment: Segment, flow: Flow, u: np.ndarray) -> np.ndarray:
        """Return the derivative as a segment begins, nan where it is unknown, and keep the event before it."""
        made, guards = self._derivative, list[Guard]()
        if before is not None and before.event.unit >= 0:
            guards = made.guards(before, segment) if self._whole else []
            name = self._names.event(before.flow.named, flow.named, before.event.struck)
            if name and (before.event.impulse.any() or not begins(segment)):
                speed = guards[0].rate if guards else np.nan
                self._crossings.append(Crossing(segment.start, name, speed, before.event.loss))
        if not self._whole:
            return self._dynamics.from_state
        try:
            if before is None:
                return made.begin(walk.start, segment, flow, u)
            return made.after(before, segment, flow, u, guards)
        except Untrusted:
            made.worsen(PassageStatus.UNDETERMINED)
            return np.full_like(self._dynamics.from_state, np.nan)
