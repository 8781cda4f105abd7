"""Passages of scenes of sliders: the engine walked event by event, and the exact derivative of where it leads.

The engine decides everything: times, contact states, impulses. The derivative is built beside it from the equations of
motion (orbits.slider_dynamics) and checks itself: at the end of every segment and after every event the motion that its
own flows predict must be the engine's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vanedamp.coupling.exact.event_driven import EngineRun
from vanedamp.coupling.exact.event_functions import RESOLUTION
from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.numerics.codes import (
    BOUNDED,
    CARRIED,
    CLOSES,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    PERIOD,
    POSITION,
    ROOT,
    SPRUNG,
    VELOCITY,
)
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.saltation import LinearFlow
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.orbits.slider_names import RowNames
from vanedamp.coupling.response.records import IMPACT_LOSS, new_records
from vanedamp.coupling.response.restart import restart_from
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble, physical_scale
from vanedamp.coupling.system.linear_response import glued_mass
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.files.store import frozen

#: events a period after which a passage gives up: each is a step of Python
EVENTS_A_PERIOD = 2000
#: largest difference of the engine's motion and that of the derivative's own flows, as a share of the coordinate's size
AGREEMENT = 1e-8
#: an event is tangential if its function would come back from beyond zero within this share of its scale
TANGENTIAL = 1e-12


class Untrusted(ArithmeticError):
    """The derivative's own motion has left that of the engine."""


@dataclass(frozen=True, eq=False)
class SliderMap:
    """The period map of a scene of sliders (orbits.passage.PeriodMap).

    parameter: dotted path in the scene; scale: (k,) sizes of the coordinates, the same along a branch.
    """

    scene: Scene
    parameter: str
    periods: int
    scale: np.ndarray

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (k,) of the coordinates."""
        modes, bodies = range(self._dynamics.system.modes), range(self._dynamics.system.bodies)
        springs = self._dynamics.springs - self._dynamics.system.bodies
        return (
            *(f"mode {i}" for i in modes), *(f"mode {i} rate" for i in modes), *(f"body {i} slip" for i in bodies),
            *(f"body {i} slip rate" for i in bodies), *(f"friction damper {i} elongation" for i in springs),
        )  # fmt: skip

    @cached_property
    def _dynamics(self) -> SliderDynamics:
        system = assemble(self.scene)
        return SliderDynamics(system, physical_scale(self.scene, system))

    @cached_property
    def _names_of_rows(self) -> RowNames:
        return RowNames(self.scene, self._dynamics.system)

    @cached_property
    def _flows(self) -> list[object]:
        """The engine's subsystems, which all passages of a map share."""
        return []

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        walk = _Walk(self._dynamics, self._names_of_rows, self.restart_of(state), self.periods)
        if self._flows:
            walk.run.flows = self._flows[0]  # type: ignore[assignment]
        passage = walk.passage()
        self._flows[:] = [walk.run.flows]
        return passage

    def at(self, value: float) -> SliderMap:
        """Return the map with the parameter at a value. Raises InputError for a value that makes it no scene."""
        return replace(self, scene=self.scene.replace({self.parameter: value}))

    def over(self, periods: int) -> SliderMap:
        """Return the map of the same scene over another number of periods."""
        return replace(self, periods=periods)

    def state_of(self, restart: RestartState) -> np.ndarray:
        """Return the state (k,) that a run has left."""
        springs = restart.elongation[self._dynamics.springs - self._dynamics.system.bodies]
        return np.r_[restart.displacement, restart.velocity, restart.slip, restart.slip_velocity, springs]

    def restart_of(self, state: np.ndarray) -> RestartState:
        """Return the state with which a run of the scene begins as the passage does."""
        system = self._dynamics.system
        n, b, friction = system.modes, system.bodies, system.friction_rows
        parts = np.split(np.asarray(state, float), np.cumsum([n, n, b, b]))
        elongation = np.zeros(friction - b)
        elongation[self._dynamics.springs - b] = parts[4]
        return RestartState(*map(frozen, (*parts[:4], elongation, system.free_travel[friction:])))

    def linear_orbit(self) -> np.ndarray:
        """Return the state (k,) of the motion without contact, where all bodies are at rest on their floors."""
        dynamics, system = self._dynamics, self._dynamics.system
        n, b = system.modes, system.bodies
        amplitude = _glued_amplitude(dynamics)
        weight = system.of_bodies.weight @ system.floor
        p = amplitude.sum(axis=0).real + weight / system.of_structure.stiffness
        rate = ((1j * system.frequency) @ amplitude).real
        place = np.array([damper.position for damper in self.scene.damper])
        return np.r_[dynamics.scale * p, dynamics.scale * rate, place, np.zeros(b + len(dynamics.springs))].reshape(
            2 * n + 2 * b + len(dynamics.springs)
        )

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry."""
        raise NotImplementedError


def slider_map(scene: Scene, parameter: str, periods: int) -> SliderMap:
    """Return the period map of a scene of sliders. Raises InputError for one that the exact engine cannot run."""
    check_waveform(scene, "exact")
    system = assemble(scene)
    return SliderMap(scene, parameter, periods, _sizes(SliderDynamics(system, physical_scale(scene, system))))


def _glued_amplitude(dynamics: SliderDynamics) -> np.ndarray:
    """Return the complex amplitudes (e, n) of p with all bodies at rest on their floors."""
    system = dynamics.system
    modes, bodies = system.of_structure, system.of_bodies
    load = modes.load + bodies.load @ system.floor
    omega = system.frequency[:, None, None]
    dynamic = np.diag(modes.stiffness) + 1j * omega * modes.damping - omega**2 * glued_mass(system)
    amplitude: np.ndarray = np.linalg.solve(dynamic, load[:, :, None])[:, :, 0]
    return amplitude


def _sizes(dynamics: SliderDynamics) -> np.ndarray:
    """Return sizes (k,) of the coordinates: linear response, free travel, and these times omega."""
    system, omega = dynamics.system, dynamics.system.omega
    reach = dynamics.scale * np.abs(_glued_amplitude(dynamics)).sum(axis=0)
    travel = np.r_[dynamics.free_travel, system.free_travel[system.friction_rows :]]
    travel = travel[np.isfinite(travel) & (travel > 0)]
    # a structure that nothing excites moves by its start and the bodies
    largest = reach.max(initial=0.0) or float(travel.max(initial=0.0)) or 1.0
    reach = np.maximum(reach, 1e-6 * largest)
    springs = system.limit[dynamics.springs] / system.spring[dynamics.springs]
    return frozen(np.r_[reach, omega * reach, dynamics.free_travel, omega * dynamics.free_travel, springs])


class _Walk:
    """One passage on its way: the engine's run, and the derivative of its state so far."""

    def __init__(self, dynamics: SliderDynamics, names: RowNames, start: RestartState, periods: int) -> None:
        self.dynamics, self.names, self.periods = dynamics, names, periods
        system = dynamics.system
        self.initial = restart_from(system, dynamics.scale, start)
        budget = EVENTS_A_PERIOD * periods
        self.run = EngineRun(system, self.initial, new_records(system, periods, 0), False, budget)
        self.budget = budget
        self.crossings: list[Crossing] = []
        self.clearance = (np.inf, "")
        self.status = PassageStatus.OK
        self.size = np.zeros(dynamics.k)

    def passage(self) -> Passage:
        """Walk to the end of the periods."""
        derivative = np.full((self.dynamics.k, self.dynamics.k), np.nan)
        try:
            derivative = self._walk()
        except Untrusted:
            self.status = PassageStatus.STOPPED
        return Passage(
            self.dynamics.to_state @ self._state(), derivative, tuple(self.crossings), self.clearance, self.status,
            self.run.records.peak[: self.periods].copy(),
        )  # fmt: skip

    def _walk(self) -> np.ndarray:
        dynamics, run, st = self.dynamics, self.run, self.run.state
        nothing = np.full((dynamics.k, dynamics.k), np.nan)
        if run.begin(self.budget) != DONE:
            self.status = PassageStatus.STOPPED
            return nothing
        if run.scratch.impulse.any():
            self.status = PassageStatus.GRAZING  # the period begins with an impact
        u = self._state()
        M = dynamics.settled(st.state) @ dynamics.from_state
        while st.counters[PERIOD] < self.periods:
            state, time = st.state.copy(), float(st.time[0])
            loss = float(st.ledger[IMPACT_LOSS])
            flow = dynamics.flow(state, st.applied_force)
            self.run.event_functions.status[int(st.counters[CARRIED]) :] = BOUNDED
            code = run.advance(int(st.counters[PERIOD]) + 1, min(int(st.counters[EVENTS]) + 1, self.budget + 1))
            if code == DONE:
                u, power = flow.propagate(u, time, dynamics.system.period - time)
                u, M = self._agreed(u), power @ M
                continue
            if code != EVENT_BUDGET or st.counters[EVENTS] > self.budget:
                self.status = PassageStatus.STOPPED
                return nothing
            event, tau = self._event(float(st.time[0]) - time)
            u, power = flow.propagate(u, time, tau)
            u, M = self._across(event, flow, state, u, power @ M, loss)
        derivative: np.ndarray = dynamics.to_state @ M
        return derivative

    def _state(self) -> np.ndarray:
        """Return u (k,) as the engine has it now."""
        run, st, dynamics, system = self.run, self.run.state, self.dynamics, self.dynamics.system
        n, b, s = system.modes, system.bodies, int(st.counters[FLOW])
        m = int(run.flows.modes[s])
        y = (run.flows.shape[s][:, :m] @ st.amplitude[:m]).real
        y[:n] += st.constant
        p, rate = dynamics.scale * y[:n], dynamics.scale * y[n:]
        slip = st.displacement[:b] + st.low_word[:b]
        u: np.ndarray = dynamics.from_state @ np.r_[p, rate, slip, st.velocity[:b], st.displacement[dynamics.springs]]
        return u

    def _agreed(self, predicted: np.ndarray) -> np.ndarray:
        """Return the engine's state. Raises Untrusted if the prediction is another."""
        u = self._state()
        size = np.maximum(np.abs(u), np.abs(predicted))
        half = len(self.dynamics.root)
        # a coordinate and its rate have one size, since either may pass through zero
        size[:half] = size[half : 2 * half] = np.maximum(size[:half], size[half : 2 * half])
        self.size = np.maximum(self.size, size)
        if not np.all(np.abs(u - predicted) <= AGREEMENT * self.size):
            raise Untrusted
        return u

    def _event(self, elapsed: float) -> tuple[int, float]:
        """Return the event function that has just vanished, and the time since the segment's start."""
        watched, period = self.run.event_functions, self.dynamics.system.period
        roots = np.flatnonzero(watched.status == ROOT)
        k = int(roots[np.argmin(np.abs(watched.no_root_before[roots] - elapsed))])
        tau = float(watched.no_root_before[k])
        return k, tau if tau > RESOLUTION * period else 0.0

    def _across(
        self, event: int, flow: LinearFlow, old: np.ndarray, u: np.ndarray, M: np.ndarray, loss: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return state and derivative after an event; u, M before it."""
        dynamics, st, run = self.dynamics, self.run.state, self.run
        row, order, meaning = (
            int(part[event])
            for part in (run.event_functions.row, run.event_functions.order, run.event_functions.meaning)
        )
        time, new = float(st.time[0]), st.state
        collides = order == POSITION and meaning == CLOSES and bool(np.isinf(dynamics.system.spring[row]))
        impulse = run.scratch.impulse if collides else np.zeros(len(new))
        after = self._agreed(u + dynamics.kick(impulse))
        rate = flow.rate(u, time)
        jump = self._jump(np.flatnonzero(impulse), old, u, after)
        gradient, speed, bend, scale = self._guard(row, order, meaning, old, flow, rate, time)
        rate_after = dynamics.flow(new, st.applied_force).rate(after, time)
        kick = rate_after - jump @ rate
        kick[np.abs(kick) <= 1e-12 * (np.abs(rate_after) + np.abs(rate))] = 0.0
        if np.any(kick):
            if speed * speed <= 2.0 * TANGENTIAL * scale * abs(bend) and speed * bend < 0.0:
                self.status = PassageStatus.GRAZING
            if speed == 0.0:
                raise Untrusted
            M = jump @ M + np.multiply.outer(kick / speed, gradient @ M)
        else:
            M = jump @ M
        self._check_rank(new, M)
        name = self.names.event(old, new, np.flatnonzero(impulse))
        if name:
            taken = float(st.ledger[IMPACT_LOSS]) - loss
            period = int(st.counters[PERIOD])
            self.crossings.append(Crossing(period * dynamics.system.period + time, name, speed, taken))
        return after, M

    def _jump(self, rows: np.ndarray, old: np.ndarray, u: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k) of the impact at the rows (m,) that got an impulse, at a fixed time."""
        dynamics = self.dynamics
        if not len(rows):
            return np.eye(dynamics.k)
        before, left = dynamics.speed[rows] @ u, dynamics.speed[rows] @ after
        restitution = restitutions_at(dynamics.system, rows, -before)
        fastest = np.abs(np.r_[before, left]).max()
        newton = np.abs(left + restitution * before) <= 1e-9 * fastest
        plastic = np.abs(left) <= 1e-9 * fastest
        if not np.all(newton | plastic):
            raise Untrusted
        slope = np.where(newton & ~plastic, restitution + self._steepness(rows, before), 0.0)
        return dynamics.impulse(rows, slope)

    def _steepness(self, rows: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return speed times the derivative of the restitution by the speed, (m,): by differences of high order."""
        system = self.dynamics.system
        if system.restitution_at == 0:
            return np.zeros(len(rows))
        step = 1e-2
        weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
        total = np.zeros(len(rows))
        for j, weight in weights.items():
            ahead, back = (restitutions_at(system, rows, -before * (1 + sign * j * step)) for sign in (1, -1))
            total += weight * (ahead - back) / step
        return total

    def _guard(
        self, row: int, order: int, meaning: int, old: np.ndarray, flow: LinearFlow, rate: np.ndarray, time: float
    ) -> tuple[np.ndarray, float, float, float]:
        """Return gradient (k,), rate, second derivative and scale of an event function before the event."""
        dynamics, system = self.dynamics, self.dynamics.system
        second = flow.A @ rate + flow.drift(time)
        if order == POSITION:
            gradient, scale = dynamics.place[row], system.free_travel[row]
            return gradient, float(gradient @ rate), float(gradient @ second), float(scale)
        if order == VELOCITY:
            gradient = dynamics.speed[row]
            return gradient, float(gradient @ rate), float(gradient @ second), float(self.fastest(row))
        if old[row] == SPRUNG:
            gradient = dynamics.push(row)
            scale = system.limit[row] if row < system.friction_rows else system.spring[row] * system.free_travel[row]
            return gradient, float(gradient @ rate), float(gradient @ second), float(scale)
        share, free = dynamics.force(old, row), dynamics.free_flow(old, self.run.state.applied_force)
        on_rates = share @ free.A[dynamics.rates]
        speed = on_rates @ rate + share @ free.drift(time)[dynamics.rates]
        return on_rates, float(speed), 0.0, 1.0

    def fastest(self, row: int) -> float:
        """Return a speed that a slip has at its fastest, as far as is known, m/s."""
        return float(np.abs(self.dynamics.speed[row]) @ self.size)

    def _check_rank(self, state: np.ndarray, M: np.ndarray) -> None:
        """Raise Untrusted if the derivative moves rows that are at rest now."""
        rows = self.dynamics.constraints(state)
        moved = np.abs(self.dynamics.speed[rows] @ M)
        size = np.abs(self.dynamics.speed[rows]) @ np.abs(M)
        closed = rows[rows >= self.dynamics.system.friction_rows]
        opened, room = np.abs(self.dynamics.place[closed] @ M), np.abs(self.dynamics.place[closed]) @ np.abs(M)
        if np.any(moved > 1e-6 * size) or np.any(opened > 1e-6 * room):
            raise Untrusted
