"""Run-up and run-down: the excitation's frequency, or the speed of rotation, changes at the start of every period.

Within a period both are constant (transients.ramp_course), so that the exact engine stays exact. Phase and force are
continuous, and the motion continues unchanged: a period begins with the state that the one before has left
(response.restart). Where the speed changes the stiffness, it changes the energy stored in it: work of the rotation.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.coupling.engine.backends import engine_run, reuse_subsystems
from vanedamp.coupling.methods.registry import final_state
from vanedamp.coupling.model_order.choices import NOTHING, choices_of, leaves_open, with_choices
from vanedamp.coupling.quantities.linear_peaks import half_power_width
from vanedamp.coupling.quantities.quantity import evaluated
from vanedamp.coupling.quantities.stress import LINEAR
from vanedamp.coupling.response.evaluation import Outcome, Run, closed_status, exchanged_energy, residual, together
from vanedamp.coupling.response.event_log import named_bodies
from vanedamp.coupling.response.figures import contact_gain
from vanedamp.coupling.response.records import EXCITATION, STORED, VISCOUS, new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import at_speed_of, start_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.scene_record import SceneCheckpoint
from vanedamp.coupling.response.static_deflection import deflects
from vanedamp.coupling.scene.ramp import Ramp as Table
from vanedamp.coupling.scene.rotation import SPEEDS, hertz_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import parts_of, simulate
from vanedamp.coupling.strength.spots import samples_of, spots_of
from vanedamp.coupling.system.assembly import assemble, at_frequency
from vanedamp.coupling.system.engine_order import crossings
from vanedamp.coupling.system.linear_response import (
    LinearPeak,
    LinearResponse,
    linear_amplitudes,
    linear_peaks,
    linear_responses,
)
from vanedamp.coupling.system.reduced_model_file import hot_spots_in_file
from vanedamp.coupling.system.system import System
from vanedamp.coupling.transients.no_meaning import NOT_IN_RAMPS
from vanedamp.coupling.transients.periods import Periods
from vanedamp.coupling.transients.ramp_course import Course, courses, ramped, scene_at, table_of
from vanedamp.coupling.transients.ramp_record import CURVES, WORKS, Ramp, RampRun
from vanedamp.files.store import Variable, frozen
from vanedamp.files.toml_input import InputError

#: fraction of the gap, and of its product with the angular frequency, below which a body counts as at rest
_AT_REST = 1e-9
#: below this fraction of a point's largest motion by a mode, another is negligible
_UNSEEN = 1e-11
#: points of the linear curves from end to end, and around their peaks, in half-power widths
_EVEN, _AROUND = 201, np.linspace(-3.0, 3.0, 25)
#: fraction of the range over which the detuning of a resonance is differentiated
_STEP = 1e-4
#: periods whose linear amplitudes are found together
_TOGETHER = 10_000


class _Checkpoint(SceneCheckpoint):
    """Finished runs on disk (path None: nowhere), with remarks on them; a run under way begins again."""

    def __init__(self, path: str | Path | None, scene: Scene, provenance: Mapping[str, Any]) -> None:
        """Take up the file's runs. Raises InputError for a file of other runs, or one that cannot be read."""
        super().__init__(path, "ramp-checkpoint", scene, provenance)
        self._scene, self._provenance = scene, provenance
        self.runs, self.notes = list[RampRun](), list[str]()
        if (saved := self.read()) is not None:
            stored = Ramp.of(*saved, str(path))
            self.runs, self.notes = list(stored.runs), list(stored.warnings)

    def content(self) -> tuple[Mapping[str, Variable], dict[str, Any], str]:
        """Return variables and attributes of the file, and how much is finished, in words."""
        nothing = {name: np.zeros(0) for name in CURVES}
        stored = Ramp(self._scene, tuple(self.runs), nothing, {}, tuple(self.notes), self._provenance)
        return stored.variables(), stored.attributes(), f"{len(self.runs)} runs are finished"


def ramp(
    scene: Scene,
    progress: Callable[[int, int], None] | None = None,
    provenance: Mapping[str, Any] | None = None,
    checkpoint: str | Path | None = None,
) -> Ramp:
    """Run a scene up or down, or both, at all rates of its [ramp] table.

    progress: called with periods done and to do, of all runs; checkpoint: a file to which
    finished runs are written and from which an interrupted call resumes; the caller removes it once the result is safe
    (files.checkpoint_file.clear).
    Raises InputError for a scene without the table, or one that cannot be run so; numerical failure is a status of the
    run.
    """
    table, base, planned = table_of(scene), ramped(scene), courses(scene)
    ends = [scene_at(base, table, value) for value in (table.from_, table.to)]
    choices = choices_of(ends, more=True) if leaves_open(base) else NOTHING
    for end in ends:  # before the first run: a speed may be too high
        assemble(with_choices(end, choices).scene)
    total, before = sum(len(course.time) for course in planned), 0
    spots = hot_spots_in_file(scene.structure)
    data = dict(provenance or {}) | ({"hot_spots": spots} if spots else {})
    with _Checkpoint(checkpoint, scene, data) as saved:
        runs, notes = saved.runs, saved.notes
        for number, course in enumerate(planned):
            chosen = with_choices(scene_at(base, table, float(course.value[0])), choices)
            first, start = chosen.scene, chosen.start
            before += len(course.time)
            if number < len(runs):  # of the checkpoint
                continue
            if not runs:
                notes += chosen.warnings
            if table.start == "steady":
                start, warnings = _steady(first, start)
                notes += warnings
            run = _Run(first, table, course, start)
            for done in run.advance():
                if progress is not None:
                    progress(before - len(course.time) + done, total)
            runs.append(run.result())
            saved.changed()
    curves, tops = _stationary(first, table)
    return Ramp(scene, tuple(runs), curves, tops, tuple(dict.fromkeys(notes)), data)


def _steady(scene: Scene, start: RestartState | None) -> tuple[RestartState, list[str]]:
    """Return the end of a run of the scene, and remarks on it. Raises InputError if it ends early."""
    response = simulate(scene, start=start)
    if response.final is None:
        raise InputError(
            f'ramp.start: the run at {scene.frequency:.6g} Hz ends early ({response.status}); take start = "rest"'
        )
    ended = f"ramp.start: the run at {scene.frequency:.6g} Hz before the ramp is {response.status}; give more periods"
    return response.final, [] if response.status is Status.OK else [ended]


def seen_only(system: System) -> System:
    """Return a system without the loads on modes that that move neither response nor contacts.

    The engine lets such modes be: it carries no free motion of them from one period to the next. At rest they have no
    energy either, and the energies include all moving parts.
    """
    n = system.modes
    rows = np.abs(np.vstack([
        system.of_structure.response, system.floor[:, :n], system.casing[:, :n], system.of_structure.J
    ]))  # fmt: skip
    felt = (rows / np.maximum(rows.max(axis=1, initial=0.0), np.finfo(float).tiny)[:, None]).max(axis=0, initial=0.0)
    coupling = system.of_structure.damping - np.diag(np.diag(system.of_structure.damping))
    unseen = np.flatnonzero((felt < _UNSEEN) & ~coupling.any(axis=0))
    if not system.load[:, unseen].any():
        return system
    load = system.load.copy()
    load[:, unseen] = 0.0
    return system._replace(load=load)


class _Run:
    """A run over the periods of a course."""

    def __init__(self, scene: Scene, table: Table, course: Course, start: RestartState | None) -> None:
        self.scene, self.table, self.course, self.state = scene, table, course, start
        self.over_speed = table.quantity != "frequency"
        self.system = seen_only(assemble(scene))
        self.run: Run | None = None
        self.status, self.done, self.events, self.tilted, self.open_ledger = Status.OK, 0, 0, False, np.inf
        p, b = len(course.time), self.system.bodies
        travel = {cavity.name: cavity.gap for cavity in scene.cavity}
        self.travel = np.array([travel[damper.cavity] for damper in scene.damper])
        self.linear, self.collided = np.full((2, p), np.nan), np.zeros(p)
        ends = [scene_at(scene, table, float(value)) for value in course.value[[0, -1]]]
        self.deflected = any(deflects(end, assemble(end)) for end in ends)
        self.stuck = np.zeros((p, b), bool)
        spots = spots_of(scene)
        #: samples of a period, for stress
        self.each = 0 if spots is None else max(samples_of(end, assemble(end), spots) for end in ends)
        self.periods = Periods(scene, NOT_IN_RAMPS, self.each)
        self.section, self.parts = np.zeros((p + 1, 2)), np.zeros((p + 1, 1 + b))
        # the energies without the work of the rotation, which is counted apart
        self.ledger, self.stored, self.rotation = np.zeros((p + 1, STORED + 1)), 0.0, 0.0

    def advance(self) -> Iterator[int]:
        """Run all periods, or until one fails (`status`). Yields the number of those done."""
        for k in range(len(self.course.time)):
            earlier, run = self.run, self._begin(k)
            if earlier is not None and self.scene.yields and run.advance_to(0) is Status.OK:
                _carry_impulses(run, earlier)
            self.status = run.advance_to(1)
            if self.status is not Status.OK:
                return
            self._record(k, run.outcome())
            self.state = final_state(self.scene, run)
            self.done = k + 1
            yield self.done

    def _begin(self, k: int) -> Run:
        """Return a run of period k that begins with the motion so far."""
        state = self.state
        if self.over_speed:
            self.scene = scene_at(self.scene, self.table, float(self.course.value[k]))
            self.system = seen_only(assemble(self.scene))
            if self.state is not None:
                state = at_speed_of(self.scene, self.state)
                # fewer modes than the model has may not hold the motion: their loss is no work of the rotation
                self.rotation -= 0.5 * (_square(state.velocity) - _square(self.state.velocity))
        else:
            self.system = at_frequency(self.system, float(self.course.frequency[k]))
        solver: Any = self.scene.solver
        scene, system = self.scene, self.system
        exponent = together(one.needs for one in parts_of(scene)).exponent
        records = new_records(system, 1, self.each, bool(self.each), self.deflected, exponent, outputs=True)
        left = solver.max_events - self.events
        start = start_of(scene, system, state)
        run = engine_run(system, start, records, True, left, solver.linearisation)
        reuse_subsystems(run, self.run)
        self.run = run
        return run

    def _scene_of(self, k: int) -> Scene:
        """Return the scene of period k; the one of another frequency will do where nothing reads that."""
        reads = not self.over_speed and (self.scene.wear is not None or self.system.outputs.size)
        return scene_at(self.scene, self.table, float(self.course.value[k])) if reads else self.scene

    def _record(self, k: int, outcome: Outcome) -> None:
        records, b = outcome.records, self.system.bodies
        (begun, ended), section = records.ledger, records.section
        if k == 0:
            self.section[0], self.parts[0], self.ledger[0] = section[0, :2], records.parts[0], begun
        elif self.over_speed:
            # impacts at the very start of the period come after the change of the speed
            self.rotation += begun[STORED] + begun[VISCOUS:STORED].sum() - begun[EXCITATION] - self.stored
        self.stored = ended[STORED]
        self.section[k + 1], self.parts[k + 1] = section[1, :2], records.parts[1]
        self.ledger[k + 1] = ended
        self.ledger[k + 1, :STORED] += self.ledger[k, :STORED] if k else 0.0
        self.ledger[k + 1, STORED] -= self.rotation
        self.collided[k] = records.collided[0]
        self.periods.add(self._scene_of(k), outcome)
        if self.over_speed and self.scene.excitation.signal is None:
            at = self.course.frequency[k : k + 1]
            self.linear[:, k] = [one.amplitude(at)[0] for one in linear_responses(self.scene, self.system)]
        slow = np.abs(section[:, 3 + b :]) <= _AT_REST * self.system.omega * self.travel
        same = np.abs(section[1, 3 : 3 + b] - section[0, 3 : 3 + b]) <= _AT_REST * self.travel
        self.stuck[k] = slow.all(axis=0) & same & ~named_bodies(outcome.rows, outcome.log, b)
        self.events, self.open_ledger = self.events + outcome.counters["changes"], outcome.open_ledger
        if outcome.plane is not None:
            neglected = outcome.plane.neglected * outcome.plane.tilt[0] ** 2  # nan for sliders
            self.tilted = self.tilted or bool(np.any(neglected > outcome.plane.bound))

    def result(self) -> RampRun:
        """Return the record of the periods done."""
        p, course, status = self.done, self.course, self.status
        exchanged = exchanged_energy(self.system, self.collided)
        balance = residual(self.ledger[: p + 1], self.parts[: p + 1], exchanged)
        gain = contact_gain(self.ledger, self.parts, 0, p, exchanged)
        status = closed_status(status, balance, gain, self.open_ledger)
        if status is Status.OK and self.tilted:
            status = Status.TILTED
        change = self.ledger[p] - self.ledger[0]
        works = *change[:STORED], self.rotation, change[STORED] + self.rotation
        return RampRun(
            rate=course.rate, status=status.value, time=course.time[:p], frequency=course.frequency[:p],
            speed=course.speed[:p], stuck=frozen(self.stuck[:p], bool), displacement=frozen(self.section[: p + 1, 0]),
            velocity=frozen(self.section[: p + 1, 1]),
            energy={name: float(value) for name, value in zip(WORKS, works, strict=True)}, energy_residual=balance,
            **self._measured(p),
        )  # fmt: skip

    def _measured(self, p: int) -> dict[str, Any]:
        """Return quantities, stress and strength of the p periods done."""
        if not self.over_speed and self.scene.excitation.signal is None:
            for begin in range(0, p, _TOGETHER):
                some = slice(begin, min(begin + _TOGETHER, p))
                self.linear[:, some] = linear_amplitudes(self.scene, self.course.frequency[some])
        return self.periods.results(dict(zip(LINEAR, self.linear[:, :p], strict=True)))


def _carry_impulses(run: Any, earlier: Any) -> None:
    """Let compliant contacts that stay closed over the end of a period keep the impulses since they closed."""
    for name in ("contact_impulse", "pushed"):  # of the engines of sliders, and of planar bodies
        if hasattr(run.state, name):
            getattr(run.state, name)[:] = getattr(earlier.state, name)


def _square(values: np.ndarray) -> float:
    return float(values @ values)


def _stationary(scene: Scene, table: Table) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Return the amplitudes of the linear structure in steady state over the ramp, and their peaks: see Ramp."""
    low, high = min(table.from_, table.to), max(table.from_, table.to)
    hertz, unit = hertz_of(table.path, scene.excitation.engine_order), SPEEDS.get(table.path, 1.0)
    if np.isfinite(hertz):
        peaks = list(linear_peaks(scene, low * unit, high * unit))
        near = [peak.frequency + peak.width * _AROUND for peak in peaks]
        if table.quantity == "frequency":
            near = [response.grid(low, high) for response in linear_responses(scene)]
        lines = np.linspace(low, high, _EVEN) * hertz
        frequency = np.unique(np.clip(np.concatenate([lines, *near]), lines[0], lines[-1]))
        value, (undamped, fixed) = frequency / hertz, linear_amplitudes(scene, frequency)
        top = peaks[0].frequency / hertz
    else:
        value, undamped, fixed = _at_one_frequency(scene, table, low, high)
        peaks = [LinearPeak(scene.frequency, float(heights.max()), 0.0) for heights in (undamped, fixed)]
        frequency, top = np.full(len(value), scene.frequency), float(value[np.argmax(undamped)])
    speed = value * unit if table.path in SPEEDS else np.full(len(value), scene.speed)
    width, leaving = _crossing(scene, table, top, low, high)
    tops = dict(evaluated(dict(zip(("undamped_top", "fixed_top"), peaks, strict=True))))
    tops |= {half_power_width.name: width, "detuning_rate": leaving}
    curves = {"frequency": frequency, "speed": speed, "undamped": undamped, "fixed": fixed}
    return {name: frozen(values) for name, values in curves.items()}, tops


def _at_one_frequency(scene: Scene, table: Table, low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values (k,) of a speed, resonances among them, and amplitudes (k,) without bodies and with them fixed."""

    @cache
    def responses(value: float) -> tuple[LinearResponse, LinearResponse]:
        return linear_responses(scene_at(scene, table, value))

    def natural(curve: int, value: float) -> np.ndarray:
        return np.sort(responses(value)[curve].resonances()[0])

    tops = [crossings(partial(natural, curve), lambda _: scene.frequency, low, high, _EVEN) for curve in range(2)]
    values = sorted({*np.linspace(low, high, _EVEN).tolist(), *itertools.chain(*tops)})
    at = np.array([scene.frequency])
    undamped, fixed = np.array([[one.amplitude(at)[0] for one in responses(value)] for value in values]).T
    return np.array(values), undamped, fixed


def _crossing(scene: Scene, table: Table, value: float, low: float, high: float) -> tuple[float, float]:
    """Return half-power width and detuning rate of the resonance at a value of the quantity: see Ramp."""

    def detuning(value: float) -> tuple[np.ndarray, np.ndarray]:
        here = scene_at(scene, table, value)
        natural, widths = linear_responses(here)[0].resonances()
        return here.frequency - natural, widths

    apart, widths = detuning(value)
    mode = int(np.argmin(np.abs(apart)))
    if detuning(low)[0][mode] * detuning(high)[0][mode] >= 0.0:
        return 0.0, 0.0
    ends = (max(value - _STEP * (high - low), low), min(value + _STEP * (high - low), high))
    before, behind = (float(detuning(end)[0][mode]) for end in ends)
    return float(widths[mode]), abs(behind - before) / (ends[1] - ends[0])
