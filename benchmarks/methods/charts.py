"""One chart of speed against accuracy: a scene by every method and by other programs, a row a run, the times in turns.

The error of the steady response is that of its mean amplitude, with the 95 % confidence intervals of both means; where
the structure's motion is prescribed, that of the bodies' mean swing. Scenes that repeat also have the error of the
state, in the first periods from the exact steady state: the largest of response and slips at ten times of every period,
relative to their ranges, against the exact engine, whose own error is against 40 digits for one mode. It does not
include the drift to the method's own steady state. Times are CPU times per excitation period, without set-up.
Other programs (bench.methods.peers) take part where they are installed and can express the scene.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from benchmarks.engine.hand_written_loop import ImpactOscillator
from benchmarks.engine.inside import time_of_a_period
from benchmarks.engine.reference_solutions import truth
from benchmarks.methods import scenes
from benchmarks.methods.full_mesh_comparison import CurveEffort
from benchmarks.methods.peers import PEERS, PeerRun, run_peer, settings_of_peers, version
from benchmarks.methods.scenes import Key
from benchmarks.rows import Contest, Rows
from benchmarks.timing import Clock, in_turns, spread
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.steady_state import mean_confidence
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import SteppingOptions
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

SEED = 20_260_102
#: samples a period by which periodic responses are compared, as many as solve_ivp's least steps there; more for means
_SAMPLES, _LEAST = 10, 40
#: error of a state that is as good as zero
_FLOOR = 1e-13
#: status of a run that was left out, and the one tolerance for means
DEAR, ONE = "too dear for a mean", 1e-4
#: start of the status of a run that would have taken too long
DROPPED = "dropped: "
#: about what a row takes, s: a run of a scene that repeats, of another; of that by tolerance; the times
_RUN, _MEAN, _DEAR_MEAN, _TIMES = 1.5, 1.5, 10.0, 6.0


@dataclass(frozen=True)
class Settings:
    """Rounds of timing, steps per period, tolerances of solve_ivp, periods of comparison, of means, of the reference.

    ivp: periods of solve_ivp's means; dearest: steps that a mean may cost; timed: steps of a timed run; modes:
    fixed-interface modes of the cluster (None: no finite elements); ladder: those of the model ladder; peers: steps a
    period of other programs; others: periods of their means; curve: the damped curve of a whole mesh; longest: time
    of a run from which on a method is not tried with a finer setting, s.
    """

    rounds: int
    steps: tuple[int, ...]
    tolerances: tuple[float, ...]
    checked: int
    means: int
    reference: int
    ivp: int
    dearest: float
    timed: int
    modes: int | None
    ladder: tuple[int, ...]
    peers: tuple[int, ...] = ()
    others: int = 0
    curve: CurveEffort | None = None
    longest: float = 300.0


@dataclass(frozen=True)
class Chart:
    """A scene by every method, made when it is first needed. repeats: whether its response does."""

    name: str
    make: Callable[[], Scene]
    repeats: bool
    effort: Settings

    def rows(self) -> dict[str, float]:
        """Return the rows in their order, and about what each takes, s."""
        run = _RUN if self.repeats else _MEAN
        settings = [*_settings(self.effort), *_peer_settings(self.effort)]
        rows = {self._row("reference"): 2.0} | dict.fromkeys((self._row(*key) for key in settings), run)
        if not self.repeats:
            rows |= {self._row(*key): _DEAR_MEAN for key in settings if key[1] == ONE}
        return rows | {self._row("times"): _TIMES}

    def measure(self, rows: Rows, number: int) -> dict[str, Any]:
        """Return times and errors of every method. number: of the chart, for the order of the turns."""
        reference = rows.take(self._row("reference"), self._reference)
        contest = Contest("exact engine", float("inf"), self.effort.longest)
        points = [self._taken(rows, contest, key, self._point) for key in _settings(self.effort)]
        if self.repeats and reference["own_error"] is not None:
            points[0] |= dict.fromkeys(("error", "steady"), reference["own_error"])
        absent: dict[str, str] = {}
        for key in _peer_settings(self.effort):
            if key[0] in absent:
                rows.leave_out(self._row(*key), absent[key[0]])
                continue
            point = self._taken(rows, contest, key, self._peer_point)
            if "absent" in point:
                absent[key[0]] = point["absent"]
            else:
                points.append(point)
        good = [point for point in points if point["status"] == "ok"]
        times = rows.take(self._row("times"), partial(self._times, good, number))
        for point, values in zip(good, times, strict=True):
            point["time"] = spread(np.maximum(values, 1e-9))
        return {
            "scene": reference["scene"], "repeats": self.repeats, "classification": reference["classification"],
            "impacts_per_period": reference["impacts_per_period"], "points": points,
            "dominated_by": _better(points[0], good), "absent": absent,
        }  # fmt: skip

    @cached_property
    def scene(self) -> Scene:
        """The scene."""
        return self.make()

    @cached_property
    def exact(self) -> Response:
        """The reference: the exact engine, over the most periods."""
        return self._run(self.scene, self._compared)

    @cached_property
    def settled(self) -> np.ndarray:
        """The series of the exact engine's steady response: one entry per evaluated period."""
        return self._series(self._steady_run(self.scene, self._means))

    @property
    def _means(self) -> int:
        """Periods of a mean: half of them where runs begin in the exact steady state and repeat."""
        return self.effort.means // (2 if self.repeats else 1)

    @property
    def _compared(self) -> int:
        return self.effort.checked if self.repeats else self.effort.reference

    def _row(self, what: str, setting: float = 0.0) -> str:
        return f"{self.name}: {what}" + (f", {setting:g}" if setting else "")

    def _taken(
        self, rows: Rows, contest: Contest, key: Key, measure: Callable[[Key], dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the point of a run, unless its method takes too long."""
        method, setting = key
        if method in contest.dropped or self._too_dear(key):
            status = DROPPED + contest.dropped[method] if method in contest.dropped else DEAR
            rows.leave_out(self._row(*key), status)
            return _new_point(key, status)
        inputs = asdict(self.effort) | ({"version": version(method)} if method in PEERS else {})
        point: dict[str, Any] = rows.take(self._row(*key), partial(measure, key), inputs=inputs, tell=_text)
        growth = 1.0 if _by_tolerance(method) else _growth(setting, self.effort.steps)
        contest.judge(f"setting {setting:g}", {method: point.pop("spent")}, growth)
        return point

    def _too_dear(self, key: Key) -> bool:
        """Say whether a mean would cost too much: none, rather than that of a run too short for its transient."""
        method, setting = key
        if self.repeats:
            return False
        if _by_tolerance(method):
            return setting != ONE
        solver = self._variant(key).solver if method not in PEERS else None
        steps = solver.smallest_steps if isinstance(solver, SteppingOptions) else 0
        return steps * self.effort.means > self.effort.dearest

    def _variant(self, key: Key) -> Scene:
        """Return the scene by a method with a setting."""
        return scenes.solved(self.scene, key, _SAMPLES if self.repeats else _LEAST)

    def _run(self, scene: Scene, periods: int) -> Response:
        return simulate(
            scene.replace({"time.periods": periods, "time.transient": 0 if self.repeats else _dropped(periods)}),
            samples_per_period=_SAMPLES if self.repeats else 0,
        )

    def _reference(self) -> dict[str, Any]:
        scene, response = self.scene, self.exact
        own = _own_error(scene, response) if self.repeats and isinstance(scene.structure, Rigid) else None
        return {
            "scene": scene.to_dict(), "classification": response.classification, "own_error": own,
            "impacts_per_period": response.impacts_per_period,
        }  # fmt: skip

    def _point(self, key: Key) -> dict[str, Any]:
        """Return the status and error of one run, and what it took, s."""
        scene, started = self._variant(key), time.thread_time()
        means = self.effort.ivp if _by_tolerance(key[0]) else self._means
        response = self._run(scene, self._compared if self.repeats else means)
        point = _new_point(key, response.status.value) | {"spent": time.thread_time() - started}
        point |= {"energy_residual": response.energy_residual, "penetration": response.penetration}
        # few periods that have not settled have a mean all the same, as those of other programs have
        if point["status"] not in (Status.OK.value, Status.NOT_STEADY.value):
            return point
        # a method may fail later than in the periods that are compared
        point["status"] = status_after(scene, _lengths(key, self.effort)[1])
        if self.repeats:
            samples = np.column_stack([response.displacement, response.body_displacement])
            point |= {"error": _state_error(samples, self.exact), "floor": _FLOOR}
            settled = self._steady_run(scenes.solved(self.scene, key, _LEAST), means)
            point |= {"penetration": settled.penetration}
            if settled.status in (Status.OK, Status.NOT_STEADY):
                point |= _steady_error(self._series(settled), self.settled)
            return point | {"spent": time.thread_time() - started}
        found = _mean_error(response.amplitude_mean, response.amplitude_mean_confidence, self.exact)
        return point | found | {"steady": found["error"]}

    def _steady_run(self, scene: Scene, periods: int) -> Response:
        kept = {"time.periods": periods, "time.transient": _dropped(periods)}
        return simulate(scene.replace(kept), samples_per_period=_SAMPLES if self._prescribed else 0)

    @property
    def _prescribed(self) -> bool:
        return isinstance(self.scene.structure, Prescribed)

    def _series(self, run: Response | PeerRun) -> np.ndarray:
        """Return the amplitudes (k,), m, of the evaluated periods; of a prescribed structure the bodies' swings."""
        series = run.peak
        if self._prescribed:
            slips = run.samples[:, 1:] if isinstance(run, PeerRun) else run.body_displacement
            series = np.ptp(slips.reshape(-1, _SAMPLES, slips.shape[1]), axis=1).sum(axis=1)
        return series[_dropped(len(series)) :]

    def _peer_point(self, key: Key) -> dict[str, Any]:
        """Return the status and error of a peer's run, and what it took, s; or why it is absent."""
        effort, (name, setting), started = self.effort, key, time.thread_time()
        peer, samples = PEERS[name], _SAMPLES if self.repeats else 0
        means = self._means if peer.compiled else effort.ivp if peer.tolerance else effort.others
        try:
            run = run_peer(name, self.scene, effort.checked if self.repeats else means, setting, samples)
        except InputError as refused:
            return {"absent": str(refused), "status": str(refused), "spent": 0.0}
        point = _new_point(key, run.status)
        if run.status == "ok" and self.repeats:
            point |= {"error": _state_error(run.samples, self.exact), "floor": _FLOOR}
            run = run_peer(name, self.scene, means, setting, _SAMPLES if self._prescribed else 0)
            point |= _steady_error(self._series(run), self.settled) if run.status == "ok" else {}
        elif run.status == "ok":
            late = self._series(run)
            found = _mean_error(float(late.mean()), mean_confidence(late), self.exact)
            point |= found | {"steady": found["error"]}
        return point | {"penetration": run.penetration, "spent": time.thread_time() - started}

    def _times(self, good: list[dict[str, Any]], number: int) -> list[list[float]]:
        """Return the seconds a period of every round, for each good point."""
        clocks: dict[str, Clock] = {}
        for i, point in enumerate(good):
            key = (point["method"], point["setting"])
            lengths = _lengths(key, self.effort)
            if key[0] in PEERS:
                clocks[str(i)] = partial(_peer_time, self.scene, key, lengths[1])
            else:
                clocks[str(i)] = partial(time_of_a_period, self._variant(key), lengths)
        turns = np.random.default_rng([SEED, number])
        return [values.tolist() for values in in_turns(clocks, self.effort.rounds, turns).values()]


def status_after(scene: Scene, periods: int) -> str:
    """Return the status of a run of that length: whether it fails, not whether so few periods have settled."""
    return simulate(scene.replace({"time.periods": periods, "time.transient": 0})).status.value


def _settings(effort: Settings) -> list[Key]:
    return scenes.settings(effort.steps, effort.tolerances)


def _peer_settings(effort: Settings) -> list[Key]:
    return settings_of_peers(effort.peers, effort.tolerances)


def _growth(setting: float, steps: tuple[int, ...]) -> float:
    """Return by how much more steps the next setting has."""
    return min((step / setting for step in steps if setting and step > setting), default=1.0)


def _by_tolerance(label: str) -> bool:
    """Whether the setting of a method or a peer is a tolerance."""
    return PEERS[label].tolerance if label in PEERS else scenes.charted()[label][1].tolerance


def _better(exact: Mapping[str, Any], good: list[dict[str, Any]]) -> list[str]:
    """Return the points that are faster than the exact engine and no less exact."""
    return [
        f"{point['method']}, {point['setting']:g}"
        for point in good[1:]
        if point["time"]["median"] < exact["time"]["median"] and point["error"] <= max(exact["error"], exact["floor"])
    ]


def _text(point: Mapping[str, Any]) -> str:
    return point["status"] if point.get("error") is None else f"error {point['error']:.2g}"


def _peer_time(scene: Scene, key: Key, periods: int) -> float:
    return run_peer(key[0], scene, periods, key[1]).seconds / periods


def _dropped(periods: int) -> int:
    """Return the periods of a transient before a mean."""
    return max(periods // 4, min(500, periods // 2))


def _new_point(key: Key, status: str) -> dict[str, Any]:
    """Return a point without figures; `floor`: the error below which the comparison is undecided.

    steady: error of the steady response, None of a run that fails before; error: that, or the error of the state.
    """
    return {
        "method": key[0], "setting": key[1], "status": status, "error": None, "steady": None, "interval": None,
        "floor": 0.0,
        "energy_residual": 0.0, "penetration": 0.0, "time": None,
    }  # fmt: skip


def _own_error(scene: Scene, response: Response) -> float:
    """Return the error of the exact engine at the periods' ends over the ranges of x, x', r, r', against 40 digits."""
    exact = truth(ImpactOscillator.of(scene), len(response.section) - 1)
    ours = np.column_stack([response.section, response.slip, response.slip_velocity])
    return float((np.abs(ours - exact) / np.abs(exact).max(axis=0)).max())


def _state_error(samples: np.ndarray, reference: Response) -> float:
    """Return the largest deviation of samples (k, 1 + b) relative to the ranges."""
    exact = np.column_stack([reference.displacement, reference.body_displacement])
    size = np.ptp(exact, axis=0)
    return float((np.abs(samples - exact)[:, size > 0] / size[size > 0]).max())


def _mean_error(mean: float, confidence: float | None, reference: Response) -> dict[str, float]:
    interval = (confidence or 0.0) / reference.amplitude_mean
    theirs = (reference.amplitude_mean_confidence or 0.0) / reference.amplitude_mean
    error = abs(mean / reference.amplitude_mean - 1)
    return {"error": error, "interval": interval, "floor": float(np.hypot(interval, theirs))}


def _steady_error(series: np.ndarray, exact: np.ndarray) -> dict[str, float]:
    """Return the error of the mean of a series (k,), and the half width of its confidence interval, both relative."""
    mean, interval = series.mean() / exact.mean(), (mean_confidence(series) or 0.0) / exact.mean()
    return {"steady": float(abs(mean - 1)), "interval": float(interval)}


def _lengths(key: Key, effort: Settings) -> tuple[int, int]:
    """Return two lengths of a run in periods, so that the longer takes some tenths of a second."""
    if _by_tolerance(key[0]):
        return 1, 300 if key[0] in PEERS and PEERS[key[0]].compiled else 3
    long = effort.timed / (key[1] or 25)
    if key[0] in PEERS:
        return 0, max(int(long / 10), 2)
    long = int(np.clip(long, 12, 20_000))
    return max(long // 6, 1), long
