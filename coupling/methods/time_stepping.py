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
#: steps of all contacts after which compiled functions return to Python, which sees interrupts and empties the log
_SLICE = 100_000

#: step the motion until a number of steps is done, with this log; returns a code of numerics.codes
March = Callable[[Any, np.ndarray, int], int]


class Stepped(Protocol):
    """What a run reads of its motion."""

    @property
    def counters(self) -> np.ndarray:
        """Counters (COUNTERS,) of numerics.codes."""

    @property
    def active(self) -> np.ndarray:
        """Whether each row or unit (r,) is in contact."""

    @property
    def deepest(self) -> np.ndarray:
        """Largest penetration (1,), relative to the free travel."""


class SteppedRun:
    """A run of a stepping method, which marches a motion by its steps per period and fills the records."""

    def __init__(
        self,
        system: System,
        march: March,
        motion: Stepped,
        records: Records,
        events: bool,
        steps: int,
        plane: Plane | None = None,
    ) -> None:
        self.system, self.march, self.motion, self.records, self.plane = system, march, motion, records, plane
        self.steps = steps
        # a contact logs at most one impact per step
        self.slice = max(_SLICE // max(len(motion.active), 1), 1)
        self.log = np.zeros((_SLICE if events else 0, 6 if plane is None else LOG_WIDTH))
        self.chunks: list[np.ndarray] = []

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of `periods`, unless the run ends before."""
        counters = self.motion.counters
        while counters[PERIOD] < periods:
            until = min(periods * self.steps, int(counters[STEPS]) + self.slice)
            code = self.march(self.motion, self.log, until)
            self.chunks.append(self.log[: counters[LOGGED]].copy())
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
            [chunk for chunk in self.chunks if len(chunk)], float(self.motion.deepest[0]), self.plane,
        )  # fmt: skip

    def final(self) -> None:
        """Return None: the state between two steps is no state that another run could begin with."""
