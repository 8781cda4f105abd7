"""Runs of methods that take time steps, from the same system to the same records as those of the exact engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from vanedamp.coupling.methods.equations_of_motion import Motion
from vanedamp.coupling.numerics.codes import DONE, IMPACTS, LOGGED, PERIOD, SOLVES, STEPS
from vanedamp.coupling.response.evaluation import STATUS_OF, Outcome
from vanedamp.coupling.response.event_log import LINE_WIDTH, WIDTH, rows_of_units
from vanedamp.coupling.response.recorder import plane_of
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.system.system import System

#: imbalance of the ledger above which a response is not to be used
_OPEN_LEDGER = 0.1
#: steps of all contacts after which compiled functions return to Python, which sees interrupts and empties the log
_SLICE = 100_000

#: step the motion until a number of steps is done, with this log; returns a code of numerics.codes
March = Callable[[np.ndarray, int], int]


class SteppedRun:
    """A run of a stepping method, which marches a motion by its steps per period and fills the records."""

    def __init__(
        self, system: System, march: March, motion: Motion, records: Records, events: bool, options: Any
    ) -> None:
        self.system, self.march, self.motion, self.records = system, march, motion, records
        self.steps = options.smallest_steps
        self.plane = plane_of(system, motion, options.linearisation) if system.in_plane else None
        # a contact logs at most one impact per step
        self.slice = max(_SLICE // max(system.contacts, 1), 1)
        self.log = np.zeros((_SLICE if events else 0, WIDTH))
        self.chunks: list[np.ndarray] = []

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        counters = self.motion.counters
        while counters[PERIOD] < periods:
            until = min(periods * self.steps, int(counters[STEPS]) + self.slice)
            code = self.march(self.log, until)
            self.chunks.append(self.log[: counters[LOGGED], : WIDTH if self.plane else LINE_WIDTH].copy())
            counters[LOGGED] = 0
            if code != DONE:
                return STATUS_OF[code]
        return Status.OK

    def outcome(self) -> Outcome:
        """Return the results of the run."""
        counters = self.motion.counters
        numbers = {
            "impacts": int(counters[IMPACTS]), "steps": int(counters[STEPS]), "solves": int(counters[SOLVES])
        }  # fmt: skip
        return Outcome(
            self.system, self.records, int(counters[PERIOD]), numbers["impacts"], _OPEN_LEDGER, numbers,
            [chunk for chunk in self.chunks if len(chunk)], rows_of_units(self.system),
            float(self.motion.deepest[0]), self.plane,
        )  # fmt: skip

    def final(self) -> None:
        """Return None: the state between two steps is no state that another run could begin with."""
