"""The flows that motions of a system have met, indexed in one stack for compiled functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Flow, ScaledDynamics
from vanedamp.coupling.derivatives.equations import FlowStack, equations_of, turns_of
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.matrices import new_room
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.derivatives.saltation import LEAST
from vanedamp.coupling.derivatives.series import TERMS
from vanedamp.coupling.derivatives.walking import WALKING, Walking
from vanedamp.coupling.engine.trace import COURSE
from vanedamp.coupling.numerics.compiler.record import room

#: bytes that flows may take before the one that was used least lately goes
_MOST = 1 << 28
#: bytes kept of a course
_KEPT = 1 << 26
#: matrices that an event takes at most, and points of a motion
_MATRICES, _POINTS = 200, 300


class FlowTable:
    """The flows that motions of a system have met, by index.

    equations, turns: of the system and its numbers; stack: those flows.
    """

    def __init__(self, dynamics: ScaledDynamics, numbers: Parameters | None) -> None:
        self.dynamics, self.numbers = dynamics, numbers
        self.equations, self.turns = equations_of(dynamics), turns_of(dynamics, numbers)
        self.flows = list[Flow]()
        eq, count = self.equations, self.turns.numbers
        k, K, units = len(eq.scale), len(eq.typical), len(eq.rest)
        #: of a course: derivatives at both ends of each take some room
        self.segments = int(np.clip(_KEPT // max(16 * len(eq.unit) * (k + count), 1), 8, COURSE))
        long, wide = max(K, 2 * units, k), max(K, 2 * units, k + count)
        moved = np.abs(dynamics.from_state) * eq.scale
        #: sizes (2N,) by which coordinates are compared that hardly move, and their largest derivatives at the start
        self.least, self.reach = LEAST * moved.sum(axis=1), moved.max(axis=1, initial=0.0)
        self._walking: dict[bool, Walking] = {}
        #: of compiled functions
        self.room = new_room(_MATRICES * long * wide + _POINTS * K)
        self.stack = self._room(4, 16, 16 if numbers is not None else 0, 8)

    def _room(self, places: int, entries: int, turned: int, events: int) -> FlowStack:
        d = self.dynamics
        sizes = {
            "f": places, "n": entries, "d": turned, "m": events, "u": len(d.gap), "K": len(d.turn),
            "P": self.turns.numbers,
        }  # fmt: skip
        return room(FlowStack, sizes)

    def walking(self, keeps: bool) -> Walking:
        """Return room for a passage, in turn. keeps: whether the passage is kept."""
        if keeps not in self._walking:
            eq, P, segments = self.equations, self.turns.numbers, self.segments
            C, K = len(eq.scale) + P, len(eq.typical)
            self._walking[keeps] = room(Walking, {
                "numbers": WALKING, "k": len(eq.scale), "P": P, "N": len(eq.root), "C": C, "u": len(eq.rest), "K": K,
                "P1": 1 + P, "g": eq.parts + 1, "T": TERMS, "W": max(C, K), "s": segments, "t": segments * keeps,
            })  # fmt: skip
        return self._walking[keeps]

    def add(self, state: np.ndarray, open_force: np.ndarray) -> None:
        """Find the flow with units in states (u,); of many it replaces the least recently used."""
        flow = self.dynamics.flow(state, open_force)
        x, events = np.argwhere(flow.X), flow.possible
        D = np.zeros((0, *flow.X.shape)) if self.numbers is None else derivative_of(flow, self.numbers).X
        d = np.argwhere(D)
        self._make_room(len(x), len(d), len(events))
        if len(self.flows) < len(self.stack.state):
            index = len(self.flows)
            self.flows.append(flow)
        else:
            index = int(np.argmin(self.stack.used))
            self.flows[index] = flow
        stack = self.stack
        stack.used[index] = stack.clock[0]
        stack.counts[index] = len(x), len(d), len(events)
        stack.state[index], stack.open_force[index], stack.way[index] = state, open_force, flow.way
        stack.slips_held[index], stack.stuck[index] = flow.slips_held, flow.stuck
        stack.most[index], stack.forces[index] = flow.possible_forces, flow.forces
        stack.norm[index], stack.fastest[index] = flow.series.norm, flow.fastest
        if self.numbers is not None:
            stack.of_forces[index] = derivative_of(flow, self.numbers).forces
        for name, entries in zip(("x", "row", "column"), (flow.X[tuple(x.T)], *x.T), strict=True):
            getattr(stack, name)[index, : len(x)] = entries
        for name, entries in zip(("d", "number", "to", "of"), (D[tuple(d.T)], *d.T), strict=True):
            getattr(stack, name)[index, : len(d)] = entries
        stack.possible[index, : len(events)] = np.reshape(events, (-1, 2))
        stack.margin[index, : len(events)], stack.slope[index, : len(events)] = flow.margins

    def _make_room(self, entries: int, turned: int, events: int) -> None:
        """Make the stack as large as one more flow needs."""
        old = self.stack
        places, wide, of_turns, many = len(old.x), old.x.shape[1], old.d.shape[1], old.possible.shape[1]
        each = sum(array[0].nbytes for array in old)
        more = 2 * places if len(self.flows) == places and 2 * places * each <= _MOST else places
        asked = more, max(wide, entries), max(of_turns, turned), max(many, events)
        if asked == (places, wide, of_turns, many):
            return
        self.stack = self._room(*asked)
        for array, before in zip(self.stack, old, strict=True):
            array[tuple(slice(size) for size in before.shape)] = before


def table_of(dynamics: ScaledDynamics, numbers: Parameters | None) -> FlowTable:
    """Return the flows of a system with some numbers, which are found once."""
    tables: dict[Any, FlowTable] = dynamics.tables if numbers is None else numbers.tables
    if dynamics not in tables:
        tables[dynamics] = FlowTable(dynamics, numbers)
    return tables[dynamics]
