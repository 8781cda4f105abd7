"""Inputs of quantities of a motion, with derivatives by numbers, taken segment by segment as the motion passes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import null_space

from vanedamp.coupling.derivatives.dynamics import Flow, ScaledDynamics
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.numbers import Parameters
from vanedamp.coupling.derivatives.series import Trajectory
from vanedamp.coupling.derivatives.walk import Before
from vanedamp.coupling.engine.trace import Leg
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.segment import EventRun
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.sensitivity.integrands import (
    POWERS,
    Functionals,
    Products,
    integrands_of,
    joined,
    momentum_of,
    response_of,
    slipping,
)
from vanedamp.coupling.sensitivity.peaks import Swing
from vanedamp.coupling.sensitivity.sensitivity_record import Impact
from vanedamp.coupling.sensitivity.strength import Struck
from vanedamp.coupling.sensitivity.wear import Wearing
from vanedamp.coupling.system.system import FLOOR
from vanedamp.coupling.system.unit_laws import SINGULAR
from vanedamp.coupling.tangents.dual import Dual, zeros

#: flows whose powers are kept; difference of speeds, relative to the fastest, that is round-off
_KEPT, _SAME = 1000, 1e-12


class Measures:
    """Observes a passage (derivatives.walk.WalkObserver) from a period `first` on, and all peaks, impacts and samples.

    orders: of the harmonics; times: of samples, s since the start, rising; sampled: functionals, instead of the
    response; run: the engine's, once it has begun. Derivatives are by the sizes of the numbers.
    """

    run: EventRun
    nears = False

    def __init__(
        self, dynamics: ScaledDynamics, numbers: Parameters, first: int, orders: Sequence[int] = (1,),
        times: Sequence[float] = (), sampled: Functionals | None = None,
    ) -> None:  # fmt: skip
        self.dynamics, self.numbers, self.first, self.orders = dynamics, numbers, first, tuple(orders)
        self._k, self._P = len(dynamics.scale), len(numbers)
        response, of, one = response_of(dynamics, numbers), numbers.parts, dynamics.one
        scene, self._deflected = dynamics.frame.scene, deflects(dynamics.frame.scene, dynamics.system)
        #: (P,) whether numbers bring a static load where there is none: distances count from the mean then
        self.begins = np.array([
            not self._deflected and load.any() and deflects(scene, dynamics.system._replace(weight=load))
            for load in dynamics.size * (of.load[:, :, one] * dynamics.root + dynamics.load[:, one] * of.root)
        ], bool)  # fmt: skip
        outputs, tilts = (
            [Functionals(rows[[k]], own[:, [k]]) for k in range(len(rows))]
            for rows, own in ((dynamics.outputs, of.outputs), (dynamics.tilts, of.tilts))
        )
        #: followed over the whole motion: momentum, and swings
        self._sampled = sampled or response
        self._seen = joined([momentum_of(dynamics, numbers), response, *outputs, *tilts])
        self.response = Swing(response, self._deflected)
        self.outputs = [Swing(one, self._deflected) for one in outputs]
        self.tilts = [Swing(one, False) for one in tilts]
        self.wear = Wearing(dynamics, numbers) if scene.wear is not None else None
        self.contacts = Struck(dynamics, numbers) if Struck.wanted(scene) else None
        self._integrands: dict[Flow, Products] = {}
        n = 1 + len(POWERS)
        #: integrals of x^2 and of powers; of momentum and of x with harmonics
        self.sums, self.waves = zeros(n, self._P), zeros(1 + len(self.orders), self._P, complex)
        self.lifted = zeros(dynamics.system.bodies, self._P)  # time off the floor, s
        self.hits = np.zeros(len(dynamics.system.rest))
        self.ends: list[Dual] = []  # momentum at both ends of the periods that count
        self.lost = zeros(1, self._P)  # energy of impacts
        self.impacts: list[Impact] = []
        self._unheld = np.zeros((0, self._P))
        self._times, self.samples = list(times), list[tuple[float, np.ndarray, np.ndarray]]()
        self._since: np.ndarray = np.zeros(self._P)
        self._begun: Before | None = None

    # --- called by a walk

    def begin(self, unheld: np.ndarray) -> None:
        """Take the start as it is given: friction may take its momentum at once."""
        self._unheld = unheld[:, self._k :]

    def segment(self, begun: Before, duration: float) -> None:
        """Take the motion until the next event."""
        self._begun = begun._replace(segment=begun.segment._replace(duration=duration))

    def event(self, before: Before, new: Leg, M: np.ndarray, shift: np.ndarray) -> None:
        """Take an event, or a period's end, and the flow before."""
        boundary = before.event.unit < 0
        moves = new.period * self.numbers.parts.period if boundary else shift[self._k :]
        self._passed(before, moves)
        self._since = moves
        if not boundary:
            self._struck(before, new, M, moves)

    def end(self, before: Before) -> None:
        """Take the end of the motion."""
        self._passed(before, (before.segment.period + 1) * self.numbers.parts.period)

    # ---

    def _passed(self, before: Before, shift: np.ndarray) -> None:
        """Take a segment whose end moves by `shift` (P,)."""
        begun = self._begun
        assert begun is not None
        segment, whole = begun.segment, begun.segment.duration
        Z, series = self._whole(begun.M, segment.start), derivative_of(begun.flow, self.numbers).series
        self._sample(begun, Z)
        z, since = begun.z, self._since
        for start, stop, course in series.pieces(z, Z, whole):
            piece = segment._replace(time=segment.time + start, duration=stop - start)
            end, moves = (course.last, course.end), np.zeros(self._P)
            if stop == whole:
                end, moves = (before.z, np.vstack([before.M[:, self._k :], course.end[self.dynamics.one :]])), shift
            self._take(begun._replace(segment=piece, z=z), Z, course, end, (since, moves))
            z, Z, since = course.last, course.end, moves
        if segment.period < self.first:
            return
        floor = self.dynamics.system.surface == FLOOR
        stands = floor & (segment.state != codes.OPEN) & (segment.state != codes.LEAVING)
        up = np.ones(len(self.lifted.value), bool)
        up[self.dynamics.system.body[stands]] = False
        self.lifted.value[up] += whole
        self.lifted.turns[up] += shift - self._since

    def _take(
        self, begun: Before, Z: np.ndarray, course: Trajectory, end: tuple[np.ndarray, np.ndarray],
        moves: tuple[np.ndarray, np.ndarray],
    ) -> None:  # fmt: skip
        """Take a piece of a segment. end: z (K,), Z (K, P) there; moves: (P,) of its start and end in time."""
        segment, series = begun.segment, derivative_of(begun.flow, self.numbers).series
        z = np.vstack([begun.z, course.z, end[0]])
        at = np.concatenate([Z[None], course.Z, end[1][None]])
        x, turns = self._seen.of(z, at)
        rates, counts = z[[0, -1]] @ begun.flow.X.T @ self._seen.rows.T, segment.period >= self.first
        ends = turns[[0, -1]] + rates[:, :, None] * np.reshape(moves, (2, 1, -1))
        for row, swing in enumerate((self.response, *(self.outputs + self.tilts if counts else ())), 1):
            both = zip(x[[0, -1], row].tolist(), ends[:, row], rates[:, row].tolist(), strict=True)
            period = segment.period - (self.first if row > 1 else 0)
            swing.passed(period, series, course, segment.duration, (begun.z, Z), x[1:-1, row], both)
        if not counts:
            return
        # of the ends only the value counts, times how they move
        weight = np.concatenate([[0.0], course.weight, [0.0]])
        edges = np.zeros((len(weight), self._P))
        edges[0], edges[-1] = -moves[0], moves[1]
        self._integrate(begun.flow, z, at, weight, edges)
        time = segment.start + np.concatenate([[0.0], course.time, [segment.duration]])
        self._add_waves(time, x, turns, weight, edges)
        for row, swing in enumerate((self.response, *self.outputs) if self._deflected else (), 1):
            swing.integral = swing.integral + Dual(weight @ x[:, row], weight @ turns[:, row] + x[:, row] @ edges)
        if not self.ends:
            begins = ends[0, 0]
            if segment.start == 0.0:
                unheld = np.vstack([self._unheld, Z[len(self._unheld) :]])
                begins = begins + self._seen.rows[0] @ (unheld - Z)
            self.ends.append(Dual(x[0, 0], begins))
        self.ends[1:] = [Dual(x[-1, 0], ends[1, 0])]

    def _whole(self, M: np.ndarray, time: float) -> np.ndarray:
        """Return the derivatives (K, P) of z at a time since the start, s."""
        Z = self.numbers.harmonics(self.dynamics, time).T
        Z[: self.dynamics.one] = M[:, self._k :]
        return Z

    def _integrate(self, flow: Flow, z: np.ndarray, at: np.ndarray, weight: np.ndarray, edges: np.ndarray) -> None:
        """Add the integrals of x^2 and of powers. edges: (n, P) by how much of the values at nodes the ends move."""
        if flow not in self._integrands:
            if len(self._integrands) > _KEPT:
                self._integrands.clear()
            self._integrands[flow] = integrands_of(flow, self.numbers)
        products = self._integrands[flow]
        value, turns = products.of(z, at)
        each = weight @ value, np.tensordot(weight, turns, 1) + value.T @ edges
        self.sums.value += products.adds @ each[0]
        self.sums.turns += products.adds @ each[1]
        if self.wear is not None:
            rubs = products.adds[1 + POWERS.index("friction")] > 0.0
            self.wear.friction.value[slipping(flow)] += each[0][rubs]
            self.wear.friction.turns[slipping(flow)] += each[1][rubs]

    def _add_waves(
        self, time: np.ndarray, x: np.ndarray, turns: np.ndarray, weight: np.ndarray, edges: np.ndarray
    ) -> None:
        """Add the integrals of momentum and of x with harmonics: of their values x (n, m), turns (n, m, P)."""
        rows = [0, *(1 for _ in self.orders)]
        angle = -1j * np.multiply.outer(time, (1, *self.orders))
        wave = np.exp(angle * self.dynamics.system.omega)
        value = x[:, rows] * wave
        whole = turns[:, rows] * wave[:, :, None] + (value * angle)[:, :, None] * self.omega.turns
        self.waves.value += weight @ value
        self.waves.turns += np.tensordot(weight, whole, 1) + value.T @ edges

    @property
    def omega(self) -> Dual:
        """Angular frequency of order 1, rad/s."""
        system, of = self.dynamics.system, self.numbers.parts
        return Dual(system.omega, -of.period * system.omega / system.period)

    def _struck(self, before: Before, new: Leg, M: np.ndarray, shift: np.ndarray) -> None:
        """Take impacts: their speeds, and their energy."""
        dynamics, event, of, k = self.dynamics, before.event, self.numbers.parts, self._k
        w, w_after = before.u[dynamics.rates], dynamics.state(new)[dynamics.rates]
        massive = np.ones(len(w), bool)
        massive[dynamics.sliders] = False
        flow, z = dynamics.flow(new.state, new.open_force), dynamics.extended(dynamics.state(new), new.time)
        turns = [
            (derivative[:, k:] + np.multiply.outer((own.X @ at)[: dynamics.one], shift))[dynamics.rates]
            for derivative, own, at in ((before.M, before.flow, before.z), (M, flow, z))
        ]
        counts = new.period >= self.first
        if counts:
            self._let_go(before, flow, shift)
        if counts and np.any(np.abs(w - w_after)[massive] > _SAME * np.abs(w).max()):
            self.lost.value[0] += 0.5 * float((w**2 - w_after**2)[massive].sum())
            self.lost.turns[0] += w[massive] @ turns[0][massive] - w_after[massive] @ turns[1][massive]
        if not len(event.struck):
            return

        def speed(r: int, value: float, own: np.ndarray, turned: np.ndarray) -> Dual:
            """Return the speed of a row, m/s, without its sign."""
            return Dual(abs(value), np.sign(value) * (dynamics.rows[r] @ turned + of.rows[:, r] @ own))

        units = [int(r) for r in event.struck]
        met = [speed(r, value, w, turns[0]) for r, value in zip(units, event.before.tolist(), strict=True)]
        first = met[int(np.argmin(event.before))]
        self.impacts.append(Impact(new.start, float(first.value), shift, first.turns))
        if not counts:
            return
        np.add.at(self.hits, event.struck, 1.0)
        rigid = [index for index, r in enumerate(units) if np.isinf(dynamics.system.spring[r])]
        for index in rigid if self.wear is not None else ():
            r = units[index]
            mobility = Dual(dynamics.rows[r] @ dynamics.rows[r], 2.0 * of.rows[:, r] @ dynamics.rows[r])
            if met[index].value > 0.0:
                self.wear.strike(r, 0.5 * met[index] * met[index] / mobility)  # type: ignore[union-attr]
        if self.contacts is not None and rigid:
            impulse = self._impulses(event.impulse, (turns[1] - turns[0])[massive], massive)
            for index in rigid:
                r = units[index]
                if met[index].value > 0.0 and impulse.value[r] != 0.0:
                    after = speed(r, float(event.after[index]), w_after, turns[1])
                    self.contacts.strike(met[index], after, abs(impulse[r]))

    def _impulses(self, impulse: np.ndarray, turns: np.ndarray, massive: np.ndarray) -> Dual:
        """Return impulses (2u,), N s, by how the speeds that they change turn; nan where undetermined."""
        acts = np.flatnonzero(impulse)
        rows, slopes = self.dynamics.rows[acts][:, massive], np.full((len(impulse), self._P), np.nan)
        length = np.linalg.norm(rows, axis=1)
        left = turns - (impulse[acts] @ self.numbers.parts.rows[:, acts][:, :, massive]).T
        unique = np.linalg.norm(null_space((rows / length[:, None]).T, SINGULAR), axis=1) <= SINGULAR
        slopes[acts[unique]] = (np.linalg.pinv(rows.T / length, SINGULAR) @ left / length[:, None])[unique]
        return Dual(impulse, slopes)

    def _let_go(self, before: Before, after: Flow, shift: np.ndarray) -> None:
        """Take the energy of springs whose force ends, or begins, while they are pressed: it is lost with contact."""
        dynamics, of = self.dynamics, self.numbers.parts
        pressed, new = set(before.flow.solved.pressed.tolist()), set(after.solved.pressed.tolist())
        if pressed == new:
            return
        Z = self._whole(before.M, before.segment.start + before.segment.duration)
        row = 1 + POWERS.index("contact")
        for r in sorted(pressed ^ new):
            way, spring = (1.0 if r in pressed else -1.0), float(dynamics.system.spring[r])
            gap, rate = float(dynamics.gap[r] @ before.z), float(dynamics.gap[r] @ before.flow.X @ before.z)
            turned = dynamics.gap[r] @ Z + of.gap[:, r] @ before.z + rate * shift
            self.sums.value[row] += way * 0.5 * spring * gap**2
            self.sums.turns[row] += way * (0.5 * of.spring[:, r] * gap**2 + spring * gap * turned)

    def _sample(self, begun: Before, Z: np.ndarray) -> None:
        """Take displacement, velocity and acceleration at the times within a segment."""
        start = begun.segment.start
        while self._times and self._times[0] <= start + begun.segment.duration:
            time = self._times.pop(0)
            moved = derivative_of(begun.flow, self.numbers)
            course = moved.series.course(begun.z, Z, max(time - start, 0.0), False)
            z, turns, X, D = course.last, course.end, begun.flow.X, moved.X
            values, slopes = [], []
            for _ in range(3):
                value, slope = self._sampled.of(z[None], turns[None])
                values.append(float(value[0, 0]))
                slopes.append(slope[0, 0])
                z, turns = X @ z, X @ turns + (D @ z).T
            self.samples.append((time, np.array(values), np.array(slopes)))

    # --- results

    @property
    def heights(self) -> Dual:
        """The largest displacements of all periods (n,), m."""
        return self.response.distances(zeros((), self._P))[0]

    def energies(self) -> dict[str, Dual]:
        """Return the work of the excitation and the losses over the periods that count, J."""
        return {name: self.sums[1 + row] for row, name in enumerate(POWERS)} | {"impact": self.lost[0]}
