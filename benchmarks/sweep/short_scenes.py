"""Many short scenes on one core: vd.sweep, and heyoka's integrator of one mode and one body, in turns.

The scenes start in the steady state of two impacts per period at one frequency and have others near it. heyoka (Taylor
series to the last digit, terminal events, restitution in a Python callback) is compiled once and runs them one by one,
and in batches, a lane of the processor each. It gives the motion; vd.sweep also the measures of a sweep.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

import vanedamp as vd
from benchmarks.engine.hand_written_loop import ImpactOscillator
from benchmarks.engine.scenes import one_mode, settled
from benchmarks.timing import in_turns, spread
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import grid

OURS, ONE_BY_ONE, BATCHES = "vd.sweep", "heyoka, one by one", "heyoka, batches"
#: half the range of frequencies, over that of the steady state; periods until then; scenes whose motion is compared
_RANGE, _SETTLED, _COMPARED = 1e-3, 3000, 20
_SEED, _AXIS = 20_260_103, "excitation.frequency"


def scenes(count: int, periods: int) -> Scene:
    """Return one mode and one body, at frequencies near the regular two impacts per period."""
    scene = settled(one_mode(), _SETTLED)
    low, high = (scene.frequency * (1 + side * _RANGE) for side in (-1, 1))
    swept = {_AXIS: {"start": low, "stop": high, "num": count}}
    return scene.replace({"time.periods": periods, "time.transient": 0, "sweep": swept})


def measure(count: int, periods: int, rounds: int) -> dict[str, Any]:
    """Return scenes per second of each program, ratios to ours, and how far apart impacts and final states are."""
    scene, found = scenes(count, periods), dict[str, Any]()
    frequencies = np.array(grid(scene).axes[_AXIS])
    runs: dict[str, Callable[[], Any]] = {OURS: partial(vd.sweep, scene)}
    if find_spec("heyoka") is not None:
        case = ImpactOscillator.of(scene.replace({"sweep": {}}))
        runs |= {ONE_BY_ONE: OneByOne(case, frequencies, periods), BATCHES: Batches(case, frequencies, periods)}

    def seconds(name: str) -> float:
        started = time.process_time()
        found[name] = runs[name]()
        return time.process_time() - started

    times = in_turns({name: partial(seconds, name) for name in runs}, rounds, np.random.default_rng(_SEED))
    impacts = np.rint(found[OURS].impacts_per_period * periods).astype(int)
    places = np.unique(np.linspace(0, count - 1, _COMPARED).astype(int))
    exact = np.array([_final(scene, float(frequency)) for frequency in frequencies[places]])
    others = {name: found[name] for name in times if name != OURS}
    return {
        "points": count, "periods": periods, "impacts": int(impacts.sum()),
        "ok": int((found[OURS].status == "ok").sum()),
        "scenes_per_second": {name: spread(count / values) for name, values in times.items()},
        "ratio": {name: spread(times[name] / times[OURS]) for name in others},
        "scenes_with_other_impacts": {name: int((hits != impacts).sum()) for name, (_, hits) in others.items()},
        "difference": {
            name: float((np.abs(final[places] - exact) / np.abs(exact).max(axis=0)).max())
            for name, (final, _) in others.items()
        },
    }  # fmt: skip


def _final(scene: Scene, frequency: float) -> np.ndarray:
    """Return x, x', r, r' at the end, m and m/s."""
    run = simulate(scene.replace({"sweep": {}, _AXIS: frequency}))
    return np.r_[run.section[-1], run.slip[-1], run.slip_velocity[-1]]


class _Taylor:
    """The oscillator in heyoka's terms: time in radians of the mode, lengths over half the gap."""

    def __init__(self, case: ImpactOscillator, frequencies: np.ndarray, periods: int) -> None:
        import heyoka

        half, mode = 0.5 * case.gap, np.sqrt(case.stiffness / case.mass)
        x, v, y, w = heyoka.make_vars("x", "v", "y", "w")
        load = heyoka.par[0] * heyoka.sin(heyoka.par[1] * heyoka.time)
        rate = load - x - float(case.damping / case.mass / mode) * v
        self.equations = [(x, v), (v, rate), (y, w), (w, heyoka.expression(0.0))]
        self.gaps = [1.0 - (y - x), 1.0 + (y - x)]
        self.unit = half * np.array([1.0, mode, 1.0, mode])
        body = (case.displacement + case.slip, case.velocity + case.slip_velocity)
        self.start = np.array([case.displacement, case.velocity, *body]) / self.unit
        speed = 2 * np.pi * frequencies / mode
        self.parameters = np.column_stack([np.full(len(speed), case.force / case.stiffness / half), speed])
        self.ends = 2 * np.pi * periods / speed
        on_body = (1 + case.restitution) * case.mass / (case.mass + case.body)
        self.jump = (-on_body * case.body / case.mass, on_body)

    def events(self, event: Any, callback: Callable[..., bool]) -> list[Any]:
        """Return the two impacts: a gap that closes."""
        import heyoka

        return [event(gap, callback=callback, direction=heyoka.event_direction.negative) for gap in self.gaps]

    def motion(self, final: np.ndarray) -> np.ndarray:
        """Return x, x', r, r' (n, 4), m and m/s, of heyoka's states (n, 4)."""
        final = final * self.unit
        final[:, 2:] -= final[:, :2]
        return final


class OneByOne(_Taylor):
    """Scenes one after the other. A call returns their final states (n, 4) and impacts (n,)."""

    def __init__(self, case: ImpactOscillator, frequencies: np.ndarray, periods: int) -> None:
        import heyoka

        super().__init__(case, frequencies, periods)
        on_structure, on_body = self.jump

        def impact(_: Any, __: int) -> bool:
            speed = state[1] - state[3]
            state[1] += on_structure * speed
            state[3] += on_body * speed
            self.impacts += 1
            return True

        self.integrator = heyoka.taylor_adaptive(
            self.equations, self.start, pars=self.parameters[0], t_events=self.events(heyoka.t_event, impact)
        )
        self.impacts, self.state = 0, self.integrator.state
        state = self.state  # a view, made once: making one takes as long as an impact

    def __call__(self) -> tuple[np.ndarray, np.ndarray]:
        final, impacts, one = np.empty((len(self.ends), 4)), np.zeros(len(self.ends), int), self.integrator
        parameters = one.pars
        for i, end in enumerate(self.ends):
            self.state[:], parameters[:], one.time, self.impacts = self.start, self.parameters[i], 0.0, 0
            one.reset_cooldowns()
            one.propagate_until(end)
            final[i], impacts[i] = self.state, self.impacts
        return self.motion(final), impacts


class Batches(_Taylor):
    """As many scenes at a time as the processor has lanes. A call returns what OneByOne does."""

    def __init__(self, case: ImpactOscillator, frequencies: np.ndarray, periods: int) -> None:
        import heyoka

        super().__init__(case, frequencies, periods)
        self.lanes = heyoka.recommended_simd_size()
        on_structure, on_body = self.jump

        def impact(_: Any, __: int, lane: int) -> bool:
            speed = state[1, lane] - state[3, lane]
            state[1, lane] += on_structure * speed
            state[3, lane] += on_body * speed
            self.impacts[lane] += 1
            return True

        self.integrator = heyoka.taylor_adaptive_batch(
            self.equations, np.tile(self.start[:, None], self.lanes), pars=np.zeros((2, self.lanes)),
            t_events=self.events(heyoka.t_event_batch, impact),
        )  # fmt: skip
        self.impacts, self.state = [0] * self.lanes, self.integrator.state
        state = self.state

    def __call__(self) -> tuple[np.ndarray, np.ndarray]:
        count, many = len(self.ends), self.integrator
        final, impacts, parameters = np.empty((count, 4)), np.zeros(count, int), many.pars
        for first in range(0, count, self.lanes):
            # the last batch fills up with its last scene
            at = np.minimum(np.arange(first, first + self.lanes), count - 1)
            self.state[:], parameters[:], self.impacts = self.start[:, None], self.parameters[at].T, [0] * self.lanes
            many.set_time(0.0)
            many.reset_cooldowns()
            many.propagate_until(self.ends[at])
            final[at], impacts[at] = self.state.T, self.impacts
        return self.motion(final), impacts
