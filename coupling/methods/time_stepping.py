"""Runs of methods that take time steps: the same system in, the same records out as of the exact engine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vanedamp.coupling.methods import equations_of_motion as sy
from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.assembly import InitialMotion
from vanedamp.coupling.system.system import System

_STATUS = {
    sy.DONE: Status.OK,
    sy.DIVERGED: Status.DIVERGED,
    sy.UNDECIDED: Status.UNDECIDED,
    sy.PENETRATION: Status.PENETRATION,
    sy.EVENT_BUDGET: Status.EVENT_BUDGET,
}

#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 0.1
#: entries of the log of impacts between two looks at it
_LOG = 100_000

#: step the motion to the end of so many periods with this log; returns a code of methods.equations_of_motion
March = Callable[[sy.Motion, np.ndarray, int], int]


class SteppedRun:
    """A run of a stepping method: the system as the method has it, its march, the motion and the records."""

    def __init__(self, system: System, march: March, initial: InitialMotion, records: Records, events: bool) -> None:
        self.system, self.march, self.records = system, march, records
        self.motion = sy.start(system, initial)
        self.log = np.zeros((_LOG if events else 0, 6))
        self.chunks: list[np.ndarray] = []

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, or to what ends the run."""
        counters = self.motion.counters
        while True:
            # with a log, period by period, so that it can be emptied
            target = min(periods, int(counters[sy.PERIOD]) + 1) if len(self.log) else periods
            code = self.march(self.motion, self.log, target)
            self.chunks.append(self.log[: counters[sy.LOGGED]].copy())
            counters[sy.LOGGED] = 0
            if code != sy.DONE:
                return _STATUS[code]
            if counters[sy.PERIOD] >= periods:
                break
        return Status.OK

    def outcome(self) -> Outcome:
        """What the run leaves behind."""
        counters = self.motion.counters
        numbers = {
            "impacts": int(counters[sy.IMPACTS]), "steps": int(counters[sy.STEPS]), "solves": int(counters[sy.SOLVES])
        }  # fmt: skip
        return Outcome(
            self.system, self.records, int(counters[sy.PERIOD]), numbers["impacts"], _OPEN_LEDGER, numbers,
            [chunk for chunk in self.chunks if len(chunk)], float(self.motion.deepest[0]),
        )  # fmt: skip

    def final(self) -> None:
        """None: the state between two steps is no state that another run could begin with."""
