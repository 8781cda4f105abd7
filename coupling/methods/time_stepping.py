"""Runs of methods that take time steps, from the same system to the same records as those of the exact engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from vanedamp.coupling.numerics.codes import DONE, IMPACTS, LOGGED, PERIOD, SOLVES, STEPS
from vanedamp.coupling.response.evaluation import LOG_WIDTH, STATUS_OF, Outcome, Plane
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.system import System

#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 0.1
#: entries of the log of impacts between two looks at it
_LOG = 100_000

#: steps after which compiled functions return to Python, which sees interrupts, at a period's end
_SLICE = 100_000

#: step the motion to the end of a number of periods with this log; returns a code of numerics.codes
March = Callable[[Any, np.ndarray, int], int]


class Stepped(Protocol):
    """What a run reads of its motion."""

    @property
    def counters(self) -> np.ndarray:
        """Counters (COUNTERS,) of numerics.codes."""

    @property
    def deepest(self) -> np.ndarray:
        """Largest penetration (1,), relative to the free travel."""


class SteppedRun:
    """A run of a stepping method: the system as the method has it, its march, the motion and the records."""

    def __init__(
        self, system: System, march: March, motion: Stepped, records: Records, events: bool, plane: Plane | None = None
    ) -> None:
        self.system, self.march, self.motion, self.records, self.plane = system, march, motion, records, plane
        self.log = np.zeros((_LOG if events else 0, 6 if plane is None else LOG_WIDTH))
        self.chunks: list[np.ndarray] = []

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        counters = self.motion.counters
        while True:
            done = int(counters[PERIOD])
            # with a log, period by period, so that it can be emptied
            more = 1 if len(self.log) or not done else max(1, _SLICE * done // int(counters[STEPS]))
            code = self.march(self.motion, self.log, min(periods, done + more))
            self.chunks.append(self.log[: counters[LOGGED]].copy())
            counters[LOGGED] = 0
            if code != DONE:
                return STATUS_OF[code]
            if counters[PERIOD] >= periods:
                break
        return Status.OK

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.motion.counters
        numbers = {
            "impacts": int(counters[IMPACTS]), "steps": int(counters[STEPS]), "solves": int(counters[SOLVES])
        }  # fmt: skip
        return Outcome(
            self.system, self.records, int(counters[PERIOD]), numbers["impacts"], _OPEN_LEDGER, numbers,
            [chunk for chunk in self.chunks if len(chunk)], float(self.motion.deepest[0]), self.plane,
        )  # fmt: skip

    def final(self) -> None:
        """Return None: the state between two steps is no state that another run could begin with."""
