"""Passages of scenes of sliders: the engine walked event by event, and the exact derivative of where it leads.

The engine decides everything: times, contact states, impulses. The derivative is built beside it from the equations of
motion (orbits.slider_dynamics) and checks itself: at the end of every segment and after every event the motion that its
own flows predict must be the engine's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.exact.event_driven import EngineRun
from vanedamp.coupling.exact.event_functions import RESOLUTION
from vanedamp.coupling.exact.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.exact.subsystem_assembly import Flows
from vanedamp.coupling.methods.registry import check_waveform
from vanedamp.coupling.numerics.codes import (
    BOUNDED,
    CARRIED,
    CLOSED,
    CLOSES,
    DONE,
    EVENT_BUDGET,
    EVENTS,
    FLOW,
    FORCE,
    OPEN,
    PERIOD,
    POSITION,
    ROOT,
    SLIP_LEFT,
    SLIP_RIGHT,
    SPRUNG,
    STICK,
    TOUCHING,
    VELOCITY,
)
from vanedamp.coupling.orbits.passage import Crossing, Passage, PassageStatus
from vanedamp.coupling.orbits.saltation import LinearFlow, kicked
from vanedamp.coupling.orbits.slider_dynamics import SliderDynamics
from vanedamp.coupling.orbits.slider_names import RowNames
from vanedamp.coupling.orbits.slider_symmetry import mirror_of
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS, new_records
from vanedamp.coupling.response.restart import restart_from
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import assemble, physical_scale
from vanedamp.coupling.system.restitution import restitutions_at
from vanedamp.files.store import frozen

#: events a period after which a passage gives up: each is a step of Python
EVENTS_A_PERIOD = 2000
#: largest difference of the engine's motion and that of the derivative's own flows, as a share of the coordinate's size
AGREEMENT = 1e-8
#: an event is tangential if its function would come back from beyond zero within this share of its scale
TANGENTIAL = 1e-12


#: points a period between which minima of event functions that do not vanish are sought
LOOKS = 32
#: step of the differences that find the slope of a restitution, as a share of the speed
_STEP = 1e-2


#: a force this close to its bound, as a share of its terms, is at it
_NEAR = 1e-9


#: share of a coordinate's typical size that counts as its size where it hardly moves
_LEAST = 1e-6


class _Guard(NamedTuple):
    """An event function before its event: row, gradient (k,), rate and second derivative in time, scale."""

    row: int
    gradient: np.ndarray
    speed: float
    bend: float
    scale: float


class Stopped(ArithmeticError):
    """The engine has not come to the end."""


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
        return SliderDynamics(system, physical_scale(self.scene, system), self.scale)

    @cached_property
    def _names_of_rows(self) -> RowNames:
        return RowNames(self.scene, self._dynamics.system)

    @cached_property
    def _flows(self) -> list[Flows]:
        """The engine's subsystems, which all passages of a map share."""
        return []

    def __call__(self, state: np.ndarray) -> Passage:
        """Return the passage that begins with a state (k,)."""
        walk = self._walk(state)
        passage = walk.passage()
        self._flows[:] = [walk.run.flows]
        return passage

    def _walk(self, state: np.ndarray) -> _Walk:
        walk = _Walk(self._dynamics, self._names_of_rows, self.restart_of(state), self.periods)
        if self._flows:
            walk.run.flows = self._flows[0]
        return walk

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
        amplitude = dynamics.glued_amplitude()
        weight = system.of_bodies.weight @ system.floor
        p = amplitude.sum(axis=0).real + weight / system.of_structure.stiffness
        rate = ((1j * system.frequency) @ amplitude).real
        place = np.array([damper.position for damper in self.scene.damper])
        return np.r_[dynamics.scale * p, dynamics.scale * rate, place, np.zeros(b + len(dynamics.springs))].reshape(
            2 * n + 2 * b + len(dynamics.springs)
        )

    def mirrored(self, state: np.ndarray) -> np.ndarray | None:
        """Return the mirror image of a state half a period later, (k,); None for a scene without that symmetry.

        None, too, where the engine does not come so far.
        """
        mirror = self._mirror
        if mirror is None:
            return None
        walk = self._walk(state)
        if walk.passage().status is PassageStatus.STOPPED or walk.middle is None:
            return None
        flow, u, time = walk.middle
        half, _ = flow.propagate(u, time, 0.5 * self._dynamics.system.period - time)
        return mirror @ self._dynamics.to_state @ half

    @cached_property
    def _mirror(self) -> np.ndarray | None:
        return mirror_of(self._dynamics)


def slider_map(scene: Scene, parameter: str, periods: int) -> SliderMap:
    """Return the period map of a scene of sliders. Raises InputError for one that the exact engine cannot run."""
    check_waveform(scene, "exact")
    system = assemble(scene)
    return SliderMap(scene, parameter, periods, SliderDynamics(system, physical_scale(scene, system)).sizes)


class _Walk:
    """One passage on its way: the engine's run, and the derivative of its state so far."""

    def __init__(self, dynamics: SliderDynamics, names: RowNames, start: RestartState, periods: int) -> None:
        self.dynamics, self.names, self.periods = dynamics, names, periods
        system = dynamics.system
        self.start = start
        self.initial = restart_from(system, dynamics.scale, start)
        self.budget = EVENTS_A_PERIOD * periods
        self.run = EngineRun(system, self.initial, new_records(system, periods, 0), True, self.budget)
        self.crossings: list[Crossing] = []
        self.clearance = (np.inf, "")
        self.status = PassageStatus.OK
        #: size of each coordinate so far, and least one that it is compared by
        self.size = _LEAST * np.abs(dynamics.from_state) @ dynamics.sizes
        #: largest derivative so far of each coordinate
        self.reach = np.abs(dynamics.from_state).max(axis=1)
        #: flow, state and time at the start of the segment that holds the middle of the first period
        self.middle: tuple[LinearFlow, np.ndarray, float] | None = None
        #: saltation matrix of the last event, and when it was
        self.last: tuple[np.ndarray, float] = np.eye(dynamics.k), -np.inf

    def passage(self) -> Passage:
        """Walk to the end of the periods."""
        derivative = np.full((self.dynamics.k, self.dynamics.k), np.nan)
        try:
            derivative = self._walk()
        except Stopped:
            self.status = PassageStatus.STOPPED
        except Untrusted:
            arrived = self.run.advance(self.periods, self.budget) == DONE
            self.status = PassageStatus.UNDETERMINED if arrived else PassageStatus.STOPPED
        return Passage(
            self.dynamics.to_state @ self._state(), derivative, tuple(self.crossings), self.clearance, self.status,
            self.run.records.peak[: self.periods].copy(),
        )  # fmt: skip

    def _walk(self) -> np.ndarray:
        dynamics, run, st, period = self.dynamics, self.run, self.run.state, self.dynamics.system.period
        if run.begin(self.budget) != DONE:
            raise Stopped
        u, M = self._begin()
        while st.counters[PERIOD] < self.periods:
            state, applied, time = st.state.copy(), st.applied_force.copy(), float(st.time[0])
            flow = dynamics.flow(state, applied)
            if st.counters[PERIOD] == 0 and time <= 0.5 * period:
                self.middle = flow, u, time
            # what is left there of other segments is no root of this one
            run.event_functions.status[int(st.counters[CARRIED]) :] = BOUNDED
            run.log.chunks.clear()
            loss = float(st.ledger[IMPACT_LOSS])
            code = run.advance(int(st.counters[PERIOD]) + 1, int(st.counters[EVENTS]) + 1)
            if code == DONE:
                self._look_around(flow, state, applied, u, time, period - time)
                u, power = flow.propagate(u, time, period - time)
                u, M = self._agreed(u), power @ M
                continue
            if code != EVENT_BUDGET or st.counters[EVENTS] > self.budget:
                raise Stopped
            event, tau = self._event(float(st.time[0]) - time)
            self._look_around(flow, state, applied, u, time, tau)
            u, power = flow.propagate(u, time, tau)
            u, S, name, speed = self._across(event, flow, state, u)
            M = S @ power @ M
            self._check_rank(M)
            if name:
                moment = int(st.counters[PERIOD]) * period + float(st.time[0])
                self.crossings.append(Crossing(moment, name, speed, float(st.ledger[IMPACT_LOSS]) - loss))
        derivative: np.ndarray = dynamics.to_state @ M
        return derivative

    def _look_around(
        self, flow: LinearFlow, state: np.ndarray, applied: np.ndarray, u: np.ndarray, time: float, duration: float
    ) -> None:
        """Keep the smallest distance to an event that does not happen in a segment."""
        functionals, rows, orders = self.dynamics.distances(state, applied)
        share, which = flow.least(functionals, u, time, duration, self.dynamics.system.period / LOOKS)
        if share < self.clearance[0]:
            self.clearance = max(share, 0.0), self.names.missed(rows[which], orders[which])

    def _begin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return state and derivative after the decision of the initial state."""
        dynamics, initial, b = self.dynamics, self.initial, self.dynamics.system.bodies
        given = dynamics.from_state @ np.r_[
            dynamics.scale * initial.p, dynamics.scale * initial.p_rate, initial.displacement[:b],
            initial.velocity[:b], initial.displacement[dynamics.springs],
        ]  # fmt: skip
        u, hit = self._state(), np.flatnonzero(self.run.scratch.impulse)
        M = dynamics.from_state @ self._clipped()
        before, left = dynamics.speed[hit] @ given, dynamics.speed[hit] @ u
        if np.any(np.abs(before) > 1e-12 * np.abs(dynamics.speed[hit]) @ np.abs(given)):
            self.status = PassageStatus.GRAZING  # an impact at the very start, which another state has a period before
            M = self._jump(hit, before, left) @ M
        if self._loose(u):
            self.status = PassageStatus.GRAZING
        return u, dynamics.settled(self.run.state.state) @ M

    def _loose(self, u: np.ndarray) -> bool:
        """Whether a row begins at rest that nothing keeps there: a gap closed without force, a stick at its bound.

        A body that friction and a wall hold at once is kept at the wall by what friction could not hold.
        """
        dynamics, system, st = self.dynamics, self.dynamics.system, self.run.state
        rows = dynamics.constraints(st.state)
        if not len(rows):
            return False
        free = dynamics.free_flow(st.state, st.applied_force).rate(u, 0.0)[dynamics.rates]
        share = np.array([dynamics.force(st.state, r) for r in rows])
        force, size = np.array(st.applied_force), np.zeros(len(system.J))
        force[rows], size[rows] = share @ free, np.abs(share) @ np.abs(free)
        for r in rows[rows < system.friction_rows]:
            if abs(force[r]) >= (1.0 - _NEAR) * system.limit[r] and not self._at_wall(r):
                return True
        for r in np.flatnonzero((st.state == CLOSED) | (st.state == TOUCHING)):
            press, held = force[r], 0.0
            for body in (int(system.left_body[r]), int(system.right_body[r])):
                if body >= 0 and st.state[body] >= STICK:
                    press += force[body] * system.J[r, system.modes + body]
                    held += system.limit[body]
            if press <= held + _NEAR * max(held, size[rows].max(initial=0.0)):
                return True
        return False

    def _at_wall(self, body: int) -> bool:
        """Whether a gap of a body is closed."""
        system, state = self.dynamics.system, self.run.state.state
        beside = (system.left_body == body) | (system.right_body == body)
        return bool(np.any(beside & ((state == CLOSED) | (state == TOUCHING))))

    def _clipped(self) -> np.ndarray:
        """Return the derivative (k, k) of the state that the run begins with: outside of walls and of bounds."""
        dynamics, system, initial, start = self.dynamics, self.dynamics.system, self.initial, self.start
        n, b = system.modes, system.bodies
        kept = np.eye(dynamics.k)
        if np.any(initial.p * dynamics.scale != start.displacement):
            self.status = PassageStatus.GRAZING  # the structure would begin beyond a stop
        elongation = initial.displacement[dynamics.springs]
        moved = np.flatnonzero(elongation != start.elongation[dynamics.springs - b])
        kept[2 * (n + b) + moved, 2 * (n + b) + moved] = 0.0
        pushed = np.flatnonzero(np.abs(initial.displacement[:b] - start.slip) > 0.0)
        if len(pushed):
            # gaps of bodies that were pushed and are closed now stay closed
            gap = dynamics.place @ dynamics.from_state
            rows = np.arange(system.friction_rows, len(system.J))
            slips = 2 * n + np.arange(b)
            shut = np.abs(initial.displacement[rows]) <= SIMULTANEOUS * system.free_travel[rows]
            rows = rows[shut & np.any(gap[np.ix_(rows, slips[pushed])] != 0.0, axis=1)]
            follow = -np.linalg.pinv(gap[np.ix_(rows, slips[pushed])]) @ gap[rows]
            follow[:, slips[pushed]] = 0.0
            kept[slips[pushed]] = follow
        return kept

    def _state(self) -> np.ndarray:
        """Return u (k,) as the engine has it now."""
        run, st, dynamics, system = self.run, self.run.state, self.dynamics, self.dynamics.system
        n, b, s = system.modes, system.bodies, int(st.counters[FLOW])
        m = int(run.flows.modes[s])
        y = (run.flows.shape[s, :, :m] @ st.amplitude[:m]).real
        y[:n] += st.constant
        slip = st.displacement[:b] + st.low_word[:b]
        u: np.ndarray = (
            dynamics.from_state @ np.r_[dynamics.scale * y, slip, st.velocity[:b], st.displacement[dynamics.springs]]
        )
        return u

    def _agreed(self, predicted: np.ndarray) -> np.ndarray:
        """Return the engine's state. Raises Untrusted if the prediction is another."""
        u, dynamics = self._state(), self.dynamics
        # a body's place is slip plus structure, which may cancel
        size = np.abs(dynamics.from_state) @ np.abs(dynamics.to_state @ u)
        half = len(dynamics.root)
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
        self, event: int, flow: LinearFlow, old: np.ndarray, u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, str, float]:
        """Return the state after an event, its saltation matrix (k, k), its name and the rate of its function.

        u: (k,) state before it; old: (r,) states of the rows then.
        """
        dynamics, run, st = self.dynamics, self.run, self.run.state
        watched, time = run.event_functions, float(st.time[0])
        row, order, meaning = (int(part[event]) for part in (watched.row, watched.order, watched.meaning))
        collides = order == POSITION and meaning == CLOSES and bool(np.isinf(dynamics.system.spring[row]))
        impulse = run.scratch.impulse if collides else np.zeros(len(old))
        hit, kicked = np.flatnonzero(impulse), dynamics.kick(impulse)
        after = self._agreed(u + kicked)
        # speeds of rows as the engine has them, not as small differences
        met = self._met()
        before = np.array([met.get(int(r), 0.0) for r in hit])
        jump = self._jump(hit, before, st.velocity[hit])
        rate, rate_after = flow.rate(u, time), dynamics.flow(st.state, st.applied_force).rate(after, time)
        kick = rate_after - jump @ rate
        # what only reaches its bound is the same on both sides of it, but for the round-off of large terms
        same = 1e-9 if order == FORCE else 1e-13
        kick[np.abs(kick) <= same * (np.abs(rate_after) + np.abs(rate))] = 0.0
        size = len(dynamics.root)
        if collides:
            kick[:size] = dynamics.rate * kicked[dynamics.rates]
        guards = self._guards(row, order, old, hit, met, flow, rate, time)
        moment = int(st.counters[PERIOD]) * dynamics.system.period + time
        if order == VELOCITY and moment <= SIMULTANEOUS * dynamics.system.period:
            S = dynamics.settled(st.state)  # a row at rest to round-off: the passage begins with it at rest
        elif len(guards) > 1:
            S = self._at_once(jump, kick, guards)
        elif np.any(kick):
            S = self._at_one(jump, kick, guards[0])
        else:
            S = jump
        self._check_order(S, moment)
        return after, S, self.names.event(old, st.state, hit), guards[0].speed

    def _guards(
        self, row: int, order: int, old: np.ndarray, hit: np.ndarray, met: dict[int, float], flow: LinearFlow,
        rate: np.ndarray, time: float,
    ) -> list[_Guard]:  # fmt: skip
        """Return the event functions that vanish in an event: of its row first, then of others at the same time."""
        guards = [self._guard(row, order, old, flow, rate, time)]
        if order == POSITION:
            others = [int(r) for r in hit if r != row and old[r] == OPEN and met.get(int(r), 0.0) < 0.0]
            guards += [self._guard(r, order, old, flow, rate, time) for r in others]
            # speeds as the engine has them, not as small differences
            rows = [row, *others]
            return [guard._replace(speed=met.get(r, guard.speed)) for r, guard in zip(rows, guards, strict=True)]
        if order == VELOCITY:
            friction = np.arange(self.dynamics.system.friction_rows)
            slid = (old[friction] == SLIP_LEFT) | (old[friction] == SLIP_RIGHT)
            turned = friction[slid & (old[friction] != self.run.state.state[friction]) & (friction != row)]
            guards += [self._guard(int(r), order, old, flow, rate, time) for r in turned]
        return guards

    def _at_one(self, jump: np.ndarray, kick: np.ndarray, guard: _Guard) -> np.ndarray:
        """Return the saltation matrix of an event with one event function."""
        turns_back = guard.speed * guard.bend < 0.0
        if turns_back and guard.speed**2 <= 2.0 * TANGENTIAL * guard.scale * abs(guard.bend):
            self.status = PassageStatus.GRAZING
        if guard.speed == 0.0:
            raise Untrusted
        return kicked(jump, kick, guard.gradient, guard.speed)

    def _met(self) -> dict[int, float]:
        """Return the relative speed of approach, below zero, of each contact that the last event's log has hit."""
        return {
            int(entry[2]): float(entry[3]) for chunk in self.run.log.chunks for entry in chunk if entry[1] == IMPACT
        }

    def _at_once(self, jump: np.ndarray, kick: np.ndarray, guards: list[_Guard]) -> np.ndarray:
        """Return the saltation matrix of events that coincide: gaps that close, slips that end together.

        On a prescribed motion cavities do not feel each other: each has its own time. Where they do, the map has
        another derivative for each order of the events: COINCIDENT, with that of the first. A chatter that ends leaves
        nothing of gaps and speeds, in any order.
        """
        dynamics, cavity = self.dynamics, self.dynamics.cavity
        contacts = [guard.row for guard in guards if guard.row >= dynamics.system.friction_rows]
        if len(contacts) == len(guards) and not self.run.state.velocity[contacts].any():
            return dynamics.closed(self.run.state.state) @ jump
        owners = [dynamics.owner(guard.row) for guard in guards]
        if dynamics.system.modes or len(set(owners)) < len(owners):
            self.status = PassageStatus.COINCIDENT
            return self._at_one(jump, kick, guards[0])
        S = jump
        for guard, owner in zip(guards, owners, strict=True):
            own = np.r_[cavity == owner, cavity == owner]
            S = S + self._at_one(np.zeros_like(jump), np.where(own, kick, 0.0), guard)
        return S

    def _check_order(self, S: np.ndarray, time: float) -> None:
        """Find a kink: two events at one time whose order matters."""
        before, then = self.last
        if time - then <= SIMULTANEOUS * self.dynamics.system.period:
            one, other = S @ before, before @ S
            if np.abs(one - other).max() > 1e-9 * np.abs(one).max():
                self.status = PassageStatus.COINCIDENT
        self.last = S, time

    def _jump(self, rows: np.ndarray, before: np.ndarray, left: np.ndarray) -> np.ndarray:
        """Return the derivative (k, k), at a fixed time, of the impact at rows (m,) with their speeds on both sides."""
        dynamics = self.dynamics
        if not len(rows):
            return np.eye(dynamics.k)
        restitution = restitutions_at(dynamics.system, rows, -before)
        fastest = np.abs(np.r_[before, left]).max()
        newton = np.abs(left + restitution * before) <= 1e-9 * fastest
        plastic = np.abs(left) <= 1e-9 * fastest
        if not np.all(newton | plastic):
            raise Untrusted
        slope = np.where(newton & ~plastic, restitution + self._steepness(rows, before), 0.0)
        return dynamics.impulse(rows, slope)

    def _steepness(self, rows: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return speed times the derivative of the restitution by the speed, (m,): by differences of sixth order."""
        system = self.dynamics.system
        total = np.zeros(len(rows))
        if system.restitution_at == 0:
            return total
        for j, weight in enumerate((3 / 4, -3 / 20, 1 / 60), start=1):
            ahead, back = (restitutions_at(system, rows, -before * (1 + way * j * _STEP)) for way in (1, -1))
            total += weight * (ahead - back) / _STEP
        return total

    def _guard(self, row: int, order: int, old: np.ndarray, flow: LinearFlow, rate: np.ndarray, time: float) -> _Guard:
        """Return the event function of a row before the event."""
        dynamics, system = self.dynamics, self.dynamics.system
        scale: float
        if order == POSITION:
            gradient, scale = dynamics.place[row], system.free_travel[row]
        elif order == VELOCITY:
            gradient = dynamics.speed[row]
            scale = float(np.abs(gradient) @ self.size)
        elif old[row] == SPRUNG:
            gradient = dynamics.push(row)
            scale = system.limit[row] if row < system.friction_rows else system.spring[row] * system.free_travel[row]
        else:
            share, free = dynamics.force(old, row), dynamics.free_flow(old, self.run.state.applied_force)
            on_rates = share @ free.A[dynamics.rates]
            speed = on_rates @ rate + share @ free.drift(time)[dynamics.rates]
            return _Guard(row, on_rates, float(speed), 0.0, 1.0)
        second = flow.A @ rate + flow.drift(time)
        return _Guard(row, gradient, float(gradient @ rate), float(gradient @ second), scale)

    def _check_rank(self, M: np.ndarray) -> None:
        """Raise Untrusted if the derivative moves rows that are at rest now."""
        dynamics = self.dynamics
        rows = dynamics.constraints(self.run.state.state)
        closed = rows[rows >= dynamics.system.friction_rows]
        still = np.vstack([dynamics.speed[rows], dynamics.place[closed]])
        self.reach = np.maximum(self.reach, np.abs(M).max(axis=1))
        if np.any(np.abs(still @ M).max(axis=1, initial=0.0) > 1e-7 * np.abs(still) @ self.reach):
            raise Untrusted
