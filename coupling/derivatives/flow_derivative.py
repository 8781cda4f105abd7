"""Derivatives of flows by numbers of the scene."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from vanedamp.coupling.derivatives.dynamics import Flow
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.derivatives.series import Series
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.system.unit_laws import wrenches

#: flows whose derivatives are kept
_KEPT = 1000


class FlowDerivative:
    """Derivatives of a flow by P numbers: X (P, K, K), and forces (P, 2u, K) of the units."""

    def __init__(self, flow: Flow, numbers: Parameters) -> None:
        self.flow, self.numbers = flow, numbers
        dynamics, s, of = flow.dynamics, flow.solved, numbers.parts
        system, rates, one = dynamics.system, dynamics.rates, dynamics.one
        u, way = len(flow.state), flow.way
        drag, turned = (way * system.friction)[:, None], (way * of.friction)[:, :, None]
        n, m = s.pressed, s.closed
        self.forces = np.zeros((len(numbers), *flow.forces.shape))
        self.forces[:, n] = -self._pushes(n)
        self.forces[:, u + n] = -turned[:, n] * flow.forces[n] - drag[n] * self.forces[:, n]
        self.forces[:, u + s.slides, one] = -(way * of.limit)[:, s.slides] / dynamics.size
        acts = of.rows.copy()
        acts[:, u + dynamics.sprung] += of.pulled
        free = of.load + acts.transpose(0, 2, 1) @ flow.known + s.drawn.T @ self.forces
        stretch, pull, spring = dynamics.pulled[s.holds], of.pulled[:, s.holds], system.tangential[s.holds, None]
        turns = pull.transpose(0, 2, 1) @ (spring * stretch)
        turns = turns + turns.transpose(0, 2, 1) + stretch.T @ (of.tangential[:, s.holds, None] * stretch)
        free[:, :, dynamics.places] -= turns / dynamics.rate
        # the projector P = 1 + W C along wrenches W onto the rows R's null space, C: their part of loads
        of_rows, held = of.rows[:, s.kept], np.eye(len(s.root)) - s.oblique
        of_wrench = wrenches(of.rows, m, drag[m, 0], s.stick)
        of_wrench[..., : len(m)] -= (turned[:, m] * dynamics.rows[u + m]).swapaxes(1, 2)
        oblique = s.oblique @ of_wrench @ s.carried - held @ s.inverse @ of_rows @ s.oblique
        moved = oblique @ flow.free + s.oblique @ free
        carried = s.carried @ (free + of_wrench @ flow.carried - moved)
        if s.undetermined.size:  # they may move free directions
            more = self._least(carried, of_rows, of_rows @ s.wrench + s.rows[s.kept] @ of_wrench)
            carried, moved = carried + more, moved + s.wrench @ more
        self.forces[:, s.kept] += carried
        self.forces[:, u + m] -= turned[:, m] * flow.carried[: len(m)] + drag[m] * carried[:, : len(m)]
        self.X = of.turn.copy()
        self.X[:, rates] = np.reshape([s.followed(each) for each in moved], moved.shape)
        moves = flow.state[dynamics.sprung] != codes.STICK
        at, unit = dynamics.sliders[moves], dynamics.sprung[moves]
        ease, of_ease = (part[..., moves] / dynamics.rate[at] for part in (dynamics.ease, of.ease))
        eased = of_ease[..., None] * dynamics.rows[unit] + ease[:, None] * of.rows[:, unit]
        follows = of.follows[:, moves, rates] + way[unit, None] * eased
        self.X[:, rates][:, at] += follows @ (s.oblique @ flow.free)

    def _least(self, carried: np.ndarray, of_rows: np.ndarray, mobility: np.ndarray) -> np.ndarray:
        """Return what derivatives of the kept rows' forces (P, k, K) lack for these to stay the least.

        The least are normal to those that are open, in units of the rows' lengths, and numbers turn both.
        of_rows (P, k, N), mobility (P, k, k): derivatives of the rows, and of their response to forces.
        """
        s, forces = self.flow.solved, self.flow.carried
        rows, free = s.rows[s.kept], s.undetermined
        square, stretch = (rows * rows).sum(axis=1), 2.0 * (of_rows * rows).sum(axis=2)
        moved = s.carried @ s.inverse @ mobility @ free
        turned = free.T * stretch[:, None] + moved.swapaxes(1, 2) * square
        return np.asarray(-free @ ((free.T * square) @ carried + turned @ forces))

    def _pushes(self, n: np.ndarray) -> np.ndarray:
        """Return the derivatives (P, m, K) of the pressures of springs and dashpots of contacts (m,)."""
        dynamics, of, system = self.flow.dynamics, self.numbers.parts, self.flow.dynamics.system
        springs = of.spring[:, n, None] * dynamics.gap[n] + system.spring[n, None] * of.gap[:, n]
        dashpots = of.dashpot[:, n, None] * dynamics.speed[n] + system.dashpot[n, None] * of.speed[:, n]
        return np.asarray(springs + dashpots)

    @cached_property
    def series(self) -> Series:
        """The motions of the flow with their derivatives."""
        return self.flow.series.by(self.X)


def derivative_of(flow: Flow, numbers: Parameters) -> FlowDerivative:
    """Return the derivatives of a flow, which are found once."""
    if flow not in numbers.flows:
        if len(numbers.flows) > _KEPT:
            numbers.flows.clear()
        numbers.flows[flow] = FlowDerivative(flow, numbers)
    return numbers.flows[flow]
