"""heyoka: Taylor series of high order, compiled for the equations, with isolation of all events (Biscani, Izzo 2021).

One integrator holds structure and bodies. What contacts and friction do are terminal events, after which a callback in
Python goes on: an impact changes velocities, a soft wall switches its spring and dashpot. The force of friction, and of
a rigid contact that stays closed, is a sum over the state whose factors are parameters: callbacks decide anew what
sticks and what stays closed, and nothing is compiled again. Peaks are events of the response's velocity.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.methods.heyoka_states import Model, States
from benchmarks.methods.peers import DEEPEST, PeerRun, one_restitution
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Coordinates, assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.files.toml_input import InputError

#: events per period after which a run is given up
_MOST = 10_000
#: a gap or slip that leaves zero with its second derivative, or a higher one, counts from this: it begins as round-off
_APART = 1e-11
#: angle after an event without the same one; what begins at zero leaves it, and impacts of a chatter are soon repeated
_COOLDOWN = 1e-12

#: what an event does; True: the run goes on
_Callback = Callable[[Any, int], bool]


def run(scene: Scene, periods: int, setting: float, samples: int) -> PeerRun:
    """Run with the tolerance `setting`.

    Raises InputError for friction dampers and for a restitution that depends on the speed.
    """
    one_restitution("heyoka", scene)
    whole = assemble(scene)
    system = line_system(whole)
    if system.dampers:
        raise InputError("heyoka: this set-up knows no friction dampers")
    return _Run(Model(system), motion_of(whole, start_of(scene, whole)), setting).result(periods, samples)


class _Run:
    """An integrator of a model."""

    def __init__(self, model: Model, motion: Coordinates, tolerance: float) -> None:
        import heyoka

        self.model, self.states, n = model, States(model), model.n
        self.events, self.limit, self.peaks = 0, _MOST, list[tuple[float, float]]()
        self.u, self.rate = ([heyoka.expression(f"{name}{i}") for i in range(n)] for name in ("u", "v"))
        waves = [function(float(k) * heyoka.time) for function in (heyoka.cos, heyoka.sin) for k in model.order]
        self.z = [*self.u, *self.rate, *waves, heyoka.expression(1.0)]
        #: values of the parameters; places of the switches of a row's events, and of the factors of its force
        self.parameters, self.switches, self.factors = list[float](), dict[int, int](), dict[int, int]()
        #: forces of rows; rigid contacts that are closed, as their switches say
        self.forces, self.shut = dict[int, Any](), set[int]()
        guards = [guard for row in model.rubs for guard in self._friction(row)]
        guards += [self._rigid(row) for row in model.hard] + [self._spring(row) for row in model.soft]
        accelerations = [
            _sum([1.0, *model.push[list(self.forces), i]], [_sum(model.free[i], self.z), *self.forces.values()])
            for i in range(n)
        ]
        options = {"direction": heyoka.event_direction.negative, "cooldown": _COOLDOWN}
        self.integrator = heyoka.taylor_adaptive(
            [*zip(self.u, self.rate, strict=True), *zip(self.rate, accelerations, strict=True)], model.start(motion),
            tol=tolerance, pars=self.parameters,
            t_events=[heyoka.t_event(guard, callback=callback, **options) for guard, callback in guards],
            nt_events=[heyoka.nt_event(_sum(model.speed / model.length, self.z), callback=self._peak())],
        )  # fmt: skip
        # views, made once: making one takes as long as an impact
        self.state, self.pars = self.integrator.state, self.integrator.pars
        for row in model.soft:
            if model.row[row] @ self.state[:n] + model.rest[row] < 0:
                self.states.closed.add(row)
                self._set(row, 1.0)
        self._go_on()

    # -- event functions, zero where they end falling. Callbacks are functions: heyoka copies methods with their object

    def _friction(self, row: int) -> list[tuple[Any, _Callback]]:
        """Return when a slip ends, or its force reaches a bound: two functions, as there are two bounds."""
        force, slide = self._held(row), _sum(self.model.row[row], self.rate)
        sign, lower, first, upper, second = self._switches(row, 5)

        def turn(_: Any, __: int) -> bool:
            return self._go_on()

        return [(sign * slide + lower * force + first, turn), (upper * force + second, turn)]

    def _rigid(self, row: int) -> tuple[Any, _Callback]:
        """Return when a gap closes, or the force of a contact that stayed closed ends."""
        gap = _sum(self.model.row[row], self.u) + float(self.model.rest[row])
        if not self.model.rests:
            return gap, self._impact(row)
        force, (shut, apart) = self._held(row), self._switches(row, 2)

        def hit(integrator: Any, _: int) -> bool:
            states, model = self.states, self.model
            if row not in states.closed:
                rate = self.state[model.n :]
                before = model.response @ rate
                rate += states.collide(row, self._now())
                self._set(row, 0.0, 0.0)
                self._note_turn(before, model.response @ rate)
            return self._go_on()

        return gap + shut * (force - gap) + apart, hit

    def _spring(self, row: int) -> tuple[Any, _Callback]:
        """Return when a gap closes, or the force ends: before it pulls."""
        gap, (shut,) = _sum(self.model.row[row], self.u) + float(self.model.rest[row]), self._switches(row, 1)
        force = -gap - float(self.model.damped[row]) * _sum(self.model.row[row], self.rate)
        self.forces[row] = shut * force

        def switch(_: Any, __: int) -> bool:
            self.states.closed ^= {row}
            self._set(row, float(row in self.states.closed))
            return self._go_on()

        return gap + shut * (force - gap), switch

    def _impact(self, row: int) -> _Callback:
        """Return an impact where nothing sticks or stays closed: loops over few numbers, faster than arrays."""
        model, n = self.model, self.model.n
        push = model.push[row] * -(1 + model.system.restitution[row]) / (model.row[row] @ model.push[row])
        pairs = [(n + int(j), float(model.row[row, j]), float(push[j])) for j in np.flatnonzero(model.row[row])]
        moving = [(n + int(j), float(model.response[j])) for j in np.flatnonzero(model.response)]

        def impact(_: Any, __: int) -> bool:
            state, speed, before, after = self.state, 0.0, 0.0, 0.0
            for j, a in moving:
                before += a * state[j]
            for j, clear, _push in pairs:
                speed += clear * state[j]
            for j, _clear, change in pairs:
                state[j] += change * speed
            for j, a in moving:
                after += a * state[j]
            self._note_turn(before, after)
            self.events += 1
            return self.events < self.limit

        return impact

    def _peak(self) -> Callable[[Any, float, int], None]:
        response, n = self.model.response, self.model.n

        def peak(integrator: Any, angle: float, _: int) -> None:
            integrator.update_d_output(angle)
            self.peaks.append((angle, float(response @ integrator.d_output[:n])))

        return peak

    def _note_turn(self, before: float, after: float) -> None:
        """Note a peak at which the velocity jumps over zero."""
        if before * after < 0:
            self.peaks.append((self.integrator.time, float(self.model.response @ self.state[: self.model.n])))

    # -- parameters

    def _places(self, count: int) -> tuple[int, list[Any]]:
        import heyoka

        first = len(self.parameters)
        self.parameters += [0.0] * count
        return first, [heyoka.par[first + i] for i in range(count)]

    def _switches(self, row: int, count: int) -> list[Any]:
        self.switches[row], symbols = self._places(count)
        return symbols

    def _held(self, row: int) -> Any:
        """Return the force of a row, a sum over z."""
        self.factors[row], symbols = self._places(len(self.z))
        self.forces[row] = _sum(symbols, self.z)
        return self.forces[row]

    def _set(self, row: int, *switches: float) -> None:
        self.pars[self.switches[row] : self.switches[row] + len(switches)] = switches

    def _now(self) -> np.ndarray:
        return self.model.extended(self.state, self.integrator.time)

    def _go_on(self) -> bool:
        """Enter what sticks and stays closed. Returns whether the run goes on."""
        self.events += 1
        if self.factors:
            states, z = self.states, self._now()
            forces = states.decide(z)
            for row, place in self.factors.items():
                self.pars[place : place + len(z)] = forces.get(row, 0.0)
            for row, sign in states.slips.items():
                if sign:
                    self.pars[self.factors[row] + len(z) - 1] = -sign
                self._set(row, *((sign, 0.0, _APART, 0.0, 1.0) if sign else (0.0, -1.0, 1.0, 1.0, 1.0)))
            closed = states.closed.intersection(self.model.hard)
            for row in closed ^ self.shut:
                self._set(row, *((1.0, 0.0) if row in closed else (0.0, _APART)))
            self.shut = closed
        return self.events < self.limit

    def result(self, periods: int, samples: int) -> PeerRun:
        """Run a number of periods."""
        model, per, self.limit = self.model, max(samples, 1), _MOST * periods
        angles = 2 * np.pi * np.arange(periods * per + 1) / per
        started = time.thread_time()
        *_, states = self.integrator.propagate_grid(angles)
        seconds = time.thread_time() - started
        if len(states) < len(angles):
            return PeerRun(Status.EVENT_BUDGET.value, np.zeros(0), np.zeros((0, 0)), 0.0, seconds)
        u = states[:, : model.n]
        x = u @ model.response + model.base(angles)
        peak = np.maximum(np.abs(x[:-1]).reshape(periods, per).max(axis=1), np.abs(x[per::per]))
        at, values = np.array(self.peaks).reshape(-1, 2).T
        places = np.minimum((at / (2 * np.pi)).astype(int), periods - 1)
        np.maximum.at(peak, places, np.abs(values + model.base(at)))
        deep = float(-(u @ model.row[model.hard].T + model.rest[model.hard]).min(initial=0.0))
        slips = (u * model.size) @ model.system.J[: model.system.bodies].T
        sampled = np.column_stack([x, slips])[: -1 if samples else 0]
        return PeerRun((Status.OK if deep <= DEEPEST else Status.PENETRATION).value, peak, sampled, deep, seconds)


def _sum(factors: Sequence[Any], terms: Sequence[Any]) -> Any:
    """Return the sum of products, without those whose factor is the number zero."""
    import heyoka

    pairs = zip(factors, terms, strict=True)
    numbers = ((float(a) if isinstance(a, float) else a, term) for a, term in pairs)
    return heyoka.sum([a * term for a, term in numbers if not isinstance(a, float) or a])
