"""The figures of a motion with their derivatives by numbers, taken segment by segment as the motion passes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from vanedamp.coupling.derivatives.derivative import Before
from vanedamp.coupling.derivatives.dynamics import Dynamics, Flow
from vanedamp.coupling.derivatives.flow_derivative import derivative_of
from vanedamp.coupling.derivatives.numbers import Numbers
from vanedamp.coupling.derivatives.series import Course
from vanedamp.coupling.response.segment import Segment
from vanedamp.coupling.sensitivity.integrands import POWERS, Functionals, Product, momentum_of, powers_of, response_of
from vanedamp.coupling.sensitivity.peaks import Peak, summits
from vanedamp.coupling.sensitivity.sensitivity_record import Dual, Impact

#: flows whose powers are kept; difference of speeds, relative to the fastest, that is round-off
_KEPT, _SAME = 1000, 1e-12


class Measures:
    """Takes what passes (derivatives.walk.Watch) from a period `first` on, and all peaks, impacts and samples.

    orders: of the harmonics; times: of samples, s since the start, rising; sampled: what they are of, in place of the
    response. Derivatives are by the sizes of the numbers.
    """

    def __init__(
        self, dynamics: Dynamics, numbers: Numbers, first: int, orders: Sequence[int] = (1,),
        times: Sequence[float] = (), sampled: Functionals | None = None,
    ) -> None:  # fmt: skip
        self.dynamics, self.numbers, self.first, self.orders = dynamics, numbers, first, tuple(orders)
        self._k, self._P = len(dynamics.scale), len(numbers)
        self._response, self._momentum = response_of(dynamics, numbers), momentum_of(dynamics, numbers)
        self._sampled = sampled or self._response
        self._square = Product(self._response, self._response)
        self._powers: dict[Flow, list[Product]] = {}
        n = 1 + len(POWERS)
        #: integrals of x^2 and of powers; of x and momentum with harmonics
        self._sums, self._waves = Dual(np.zeros(n), np.zeros((n, self._P))), _complex(1 + len(self.orders), self._P)
        self._ends: list[Dual] = []  # momentum at both ends of the periods that count
        self.lost = Dual(np.zeros(1), np.zeros((1, self._P)))  # energy of impacts
        self.peaks: list[Peak] = []
        self.impacts: list[Impact] = []
        self._unheld = np.zeros((0, self._P))
        self._times, self.samples = list(times), list[tuple[float, np.ndarray, np.ndarray]]()
        self._since: np.ndarray = np.zeros(self._P)
        self._begun: Before | None = None
        self._course: Course | None = None

    # --- what a walk calls

    def begin(self, unheld: np.ndarray) -> None:
        """Take the start as it is given: friction may take its momentum at once."""
        self._unheld = unheld

    def segment(self, begun: Before, course: Course) -> None:
        """Take the motion until the next event."""
        self._begun, self._course = begun, course

    def event(self, before: Before, new: Segment, M: np.ndarray, shift: np.ndarray) -> None:
        """Take an event, or a period's end, and what led there."""
        boundary = before.event.unit < 0
        moves = new.period * self.numbers.parts.period if boundary else shift
        self._passed(before, moves)
        self._since = moves
        if not boundary:
            self._struck(before, new, M, shift)

    def end(self, before: Before) -> None:
        """Take the end of the motion."""
        self._passed(before, (before.segment.period + 1) * self.numbers.parts.period)

    # ---

    def _passed(self, before: Before, shift: np.ndarray) -> None:
        """Take a segment whose end moves by `shift` (P,)."""
        begun, course = self._begun, self._course
        assert begun is not None and course is not None
        segment, duration = begun.segment, begun.segment.duration
        Z = self._whole(begun.M, segment.start)
        end = before.z, np.vstack([before.M[:, self._k :], course.end[self.dynamics.one :]])
        series = derivative_of(begun.flow, self.numbers).series
        while len(self.peaks) <= segment.period:
            self.peaks.append(Peak())
        peak = self.peaks[segment.period]
        for value, turns in summits(self._response, series, begun.z, Z, course, duration):
            peak.add(value, turns)
        for z, at, moves in ((begun.z, Z, self._since), (*end, shift)):
            x, of_x = self._response.of(z[None], at[None])
            rate = float(self._response.rows[0] @ begun.flow.X @ z)
            peak.add(float(x[0, 0]), of_x[0, 0] + rate * moves)
        self._sample(begun, Z)
        if segment.period >= self.first:
            self._integrate(begun, Z, course, end, shift)

    def _whole(self, M: np.ndarray, time: float) -> np.ndarray:
        """Return the derivatives (K, P) of z at a time since the start, s."""
        Z = self.numbers.harmonics(self.dynamics, time).T
        Z[: self.dynamics.one] = M[:, self._k :]
        return Z

    def _integrate(
        self, begun: Before, Z: np.ndarray, course: Course, end: tuple[np.ndarray, np.ndarray], shift: np.ndarray
    ) -> None:
        segment, flow = begun.segment, begun.flow
        if flow not in self._powers:
            if len(self._powers) > _KEPT:
                self._powers.clear()
            self._powers[flow] = powers_of(flow, self.numbers)
        z = np.vstack([begun.z, course.z, end[0]])
        at = np.concatenate([Z[None], course.Z, end[1][None]])
        # of the ends only the value counts, times how they move
        weight = np.concatenate([[0.0], course.weight, [0.0]])
        edges = np.zeros((len(weight), self._P))
        edges[0], edges[-1] = -self._since, shift
        for row, product in enumerate([self._square, *self._powers[flow]]):
            value, turns = product.of(z, at)
            self._sums.value[row] += weight @ value
            self._sums.turns[row] += weight @ turns + value @ edges
        time = segment.start + np.concatenate([[0.0], course.time, [segment.duration]])
        for row, (order, functional) in enumerate(
            [(1, self._momentum), *((order, self._response) for order in self.orders)]
        ):
            value, turns = functional.of(z, at)
            wave = np.exp(-1j * order * self.dynamics.system.omega * time)
            turning = -1j * order * np.multiply.outer(time, self._of_omega)
            whole = (turns[:, 0] + value * turning) * wave[:, None]
            self._waves.value[row] += weight @ (value[:, 0] * wave)
            self._waves.turns[row] += weight @ whole + (value[:, 0] * wave) @ edges
        if segment.start == 0.0:
            Z = np.vstack([self._unheld, Z[len(self._unheld) :]])
        for instant, turned, moves in ((begun.z, Z, self._since), (*end, shift)):
            value, turns = self._momentum.of(instant[None], turned[None])
            drift = self._momentum.rows @ flow.X @ instant
            found = Dual(value[0], turns[0] + np.multiply.outer(drift, moves))
            self._ends = [*self._ends[:1], found]

    @property
    def _of_omega(self) -> np.ndarray:
        """Derivatives (P,) of the angular frequency of order 1."""
        return -self.numbers.parts.period * self.dynamics.system.omega / self.dynamics.system.period

    def _struck(self, before: Before, new: Segment, M: np.ndarray, shift: np.ndarray) -> None:
        """Take the speed of an impact and the energy that it takes."""
        dynamics, event, k = self.dynamics, before.event, self._k
        w, w_after = before.u[dynamics.rates], dynamics.state(new)[dynamics.rates]
        massive = np.ones(len(w), bool)
        massive[dynamics.sliders] = False
        flow, z = dynamics.flow(new.state, new.open_force), dynamics.extended(dynamics.state(new), new.time)
        if new.period >= self.first:
            self._let_go(before, flow, shift)
        if new.period >= self.first and np.any(np.abs(w - w_after)[massive] > _SAME * np.abs(w).max()):
            turns = [
                (derivative[:, k:] + np.multiply.outer((own.X @ at)[: dynamics.one], shift))[dynamics.rates]
                for derivative, own, at in ((before.M, before.flow, before.z), (M, flow, z))
            ]
            self.lost.value[0] += 0.5 * float((w**2 - w_after**2)[massive].sum())
            self.lost.turns[0] += w[massive] @ turns[0][massive] - w_after[massive] @ turns[1][massive]
        if len(event.struck):
            r = int(event.struck[np.argmin(event.before)])
            row = dynamics.speed[r]
            Z = self._whole(before.M, new.start)
            turned = row @ Z + self.numbers.parts.speed[:, r] @ before.z + float(row @ before.flow.X @ before.z) * shift
            self.impacts.append(Impact(new.start, -float(event.before.min()), shift, -turned))

    def _let_go(self, before: Before, after: Flow, shift: np.ndarray) -> None:
        """Take the energy of springs whose force ends, or begins, while they are pressed: it is lost with contact."""
        dynamics, of = self.dynamics, self.numbers.parts
        own, new = before.flow.solved.springs, after.solved.springs
        Z = self._whole(before.M, before.segment.start + before.segment.duration)
        row = 1 + POWERS.index("contact")
        for r in np.setxor1d(own, new).tolist():
            way, spring = (1.0 if r in own else -1.0), float(dynamics.system.spring[r])
            gap, rate = float(dynamics.gap[r] @ before.z), float(dynamics.gap[r] @ before.flow.X @ before.z)
            turned = dynamics.gap[r] @ Z + of.gap[:, r] @ before.z + rate * shift
            self._sums.value[row] += way * 0.5 * spring * gap**2
            self._sums.turns[row] += way * (0.5 * of.spring[:, r] * gap**2 + spring * gap * turned)

    def _sample(self, begun: Before, Z: np.ndarray) -> None:
        """Take displacement, velocity and acceleration at the times within a segment."""
        start = begun.segment.start
        while self._times and self._times[0] <= start + begun.segment.duration:
            time = self._times.pop(0)
            moved = derivative_of(begun.flow, self.numbers)
            course = moved.series.course(begun.z, Z, max(time - start, 0.0), False)
            z, turns, X, D = course.last, course.end, begun.flow.X, moved.X
            values, found = [], []
            for _ in range(3):
                value, own = self._sampled.of(z[None], turns[None])
                values.append(float(value[0, 0]))
                found.append(own[0, 0])
                z, turns = X @ z, X @ turns + (D @ z).T
            self.samples.append((time, np.array(values), np.array(found)))

    # --- results

    @cached_property
    def heights(self) -> Dual:
        """The largest displacements of all periods (n,), m."""
        turns = [peak.derivatives(self._P)[0] for peak in self.peaks]
        return Dual(np.array([peak.value for peak in self.peaks]), np.reshape(turns, (-1, self._P)))

    @property
    def kinks(self) -> bool:
        """Whether those of the periods that count hold on one side only."""
        return any(peak.derivatives(self._P)[1] for peak in self.peaks[self.first :])

    def energies(self) -> dict[str, Dual]:
        """Return the work of the excitation and the losses over the periods that count, J."""
        return {name: self._sums[1 + row] for row, name in enumerate(POWERS)} | {"impact": self.lost[0]}

    def figures(self, periods: int) -> dict[str, Dual]:
        """Return the figures by name, over the periods that count, of `periods` in all."""
        system, of = self.dynamics.system, self.numbers.parts
        count = max(periods - self.first, 1)
        span = Dual(np.array([count * system.period]), count * of.period[None])
        heights = self.heights[self.first :]
        top = int(np.argmax(heights.value))
        found = {
            "amplitude_mean": Dual(heights.value.mean(), heights.turns.mean(axis=0)),
            "amplitude_max": Dual(heights.value[top], heights.turns[top]),
            "amplitude_rms": (self._sums[:1] / span).root()[0],
        }
        waves = [2.0 * (self._waves[row : row + 1] / span) for row in range(len(self.orders) + 1)]
        for order, wave in zip(self.orders, waves[1:], strict=True):
            size, phase = wave[0].polar()
            names = ("amplitude_harmonic", "phase") if order == 1 else tuple(
                f"harmonic.{order}.{name}" for name in ("amplitude", "phase")
            )  # fmt: skip
            found |= {names[0]: size, names[1]: phase}
        found |= {f"energy.{name}": energy for name, energy in self.energies().items()}
        if system.bodies and 1 in self.orders:
            found["attached_mass_fraction"] = self._attached(waves, span)
        return found

    def _attached(self, waves: list[Dual], span: Dual) -> Dual:
        """Return the attached mass over the bodies' mass (response.figures)."""
        system, of = self.dynamics.system, self.numbers.parts
        omega = Dual(np.array([system.omega]), self._of_omega[None])
        change = self._ends[-1] - self._ends[0]
        force = 2.0 * (change / span) + 1j * (omega * waves[0])
        load = Dual(system.load[:1, system.along].sum(axis=1), self._of_load)
        mass = Dual(system.mass[system.along].sum(keepdims=True), of.mass[:, system.along].sum(axis=1)[None])
        harmonic = waves[1 + self.orders.index(1)]
        felt = ((force - load) * harmonic.conjugate()).real()
        return (-1.0 * (felt / (omega * omega * (harmonic * harmonic.conjugate()).real()) / mass))[0]

    @property
    def _of_load(self) -> np.ndarray:
        """Derivatives (1, P) of the loads of order 1 on the bodies, together."""
        dynamics, of = self.dynamics, self.numbers.parts
        along, e = dynamics.system.along, len(dynamics.system.frequency)
        cosine, sine = dynamics.one + 1, dynamics.one + 1 + e
        root, size = dynamics.root[along], dynamics.size
        value = dynamics.load[along][:, [cosine, sine]] * size * root[:, None]
        turns = of.load[:, along][:, :, [cosine, sine]] * size * root[:, None]
        turns = turns + value * (of.root[:, along] / root)[:, :, None]
        return (turns[:, :, 0] - 1j * turns[:, :, 1]).sum(axis=1)[None]


def _complex(rows: int, number: int) -> Dual:
    return Dual(np.zeros(rows, complex), np.zeros((rows, number), complex))
