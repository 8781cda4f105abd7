"""The exact engine: a scene in, a response out. Event-driven, closed-form between events, no time step."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from coupling import automaton as auto
from coupling import state as st
from coupling.choice import settle
from coupling.flow import add_flow, empty_flows
from coupling.response import Event, Response, Status, classify
from coupling.rows import Rows, rows_of
from coupling.scene import Scene
from coupling.statistics import mean_confidence, transient_length
from coupling.structure import linear_structure

_STATUS = {
    auto.DONE: Status.OK,
    auto.EVENT_BUDGET: Status.EVENT_BUDGET,
    auto.ACCURACY_LOST: Status.ACCURACY_LOST,
    auto.UNDECIDED: Status.UNDECIDED,
}

#: periods between two looks at whether the response is steady
_CHUNK = 100


def simulate(scene: Scene, events: bool = False, samples_per_period: int = 0) -> Response:
    """Run a scene from time zero over `scene.time.periods` excitation periods.

    events: keep the list of events; samples_per_period: keep that many equidistant samples of each period.
    Raises InputError for a scene that the model does not allow; numerical trouble is a status of the response.
    """
    started = time.perf_counter()
    settled = settle(scene)
    scene = settled.scene
    run = _Run(scene, events, samples_per_period)
    code = run.begin(scene.solver.max_events)
    transient, status = scene.time.dropped, _STATUS[code]
    if status is Status.OK and scene.time.steady == "auto":
        status, transient = _until_steady(run, scene)
    elif status is Status.OK:
        status = _STATUS[run.advance(scene.time.periods, scene.solver.max_events)]
    return replace(_response(scene, run, status, transient, started), estimate=settled.estimate)


def run_with_response(scene: Scene, functional: np.ndarray, samples_per_period: int) -> Response:
    """A run whose response is another functional (n,) of the structure's modes; with a fixed number of periods.

    `scene` has no open choices. Raises InputError as `simulate` does.
    """
    started = time.perf_counter()
    run = _Run(scene, False, samples_per_period, functional)
    status = _STATUS[run.begin(scene.solver.max_events)]
    if status is Status.OK:
        status = _STATUS[run.advance(scene.time.periods, scene.solver.max_events)]
    return _response(scene, run, status, scene.time.dropped, started)


def _until_steady(run: _Run, scene: Scene) -> tuple[Status, int]:
    """Advance until the mean amplitude is known well enough. Returns the status and the length of the transient."""
    status, dropped = Status.NOT_STEADY, scene.time.dropped
    for periods in range(_CHUNK, scene.time.periods + _CHUNK, _CHUNK):
        code = run.advance(min(periods, scene.time.periods), scene.solver.max_events)
        if code != auto.DONE:
            return _STATUS[code], dropped
        peaks = run.records.peak[: run.state.counters[st.PERIOD]]
        transient = transient_length(peaks)
        if transient is None:
            status, dropped = Status.NOT_STEADY, scene.time.dropped
            continue
        confidence = mean_confidence(peaks[transient:])
        if confidence is not None and confidence <= scene.time.tolerance * peaks[transient:].mean():
            return Status.OK, transient
        status, dropped = Status.UNCERTAIN, transient
    return status, dropped


@dataclass
class _Log:
    """Events as they come: chunks of the compiled log, kept or thrown away."""

    keep: bool
    chunks: list[np.ndarray]

    def take(self, log: np.ndarray, count: int) -> None:
        if self.keep and count:
            self.chunks.append(log[:count].copy())


class _Run:
    """The mutable state of one run and the subsystems it has met."""

    def __init__(
        self, scene: Scene, events: bool, samples_per_period: int, functional: np.ndarray | None = None
    ) -> None:
        structure = linear_structure(scene)
        if functional is not None:
            structure = replace(structure, response=functional)
        self.rows, displacement, velocity = rows_of(scene, structure)
        self.flows = empty_flows(self.rows)
        self.log = _Log(events, [])
        modes = self.flows.eigenvalue.shape[1]
        self.state = st.new_state(self.rows, modes, displacement, velocity)
        self.state.coordinates[:] = np.r_[structure.displacement, structure.velocity]
        self.channels = st.new_channels(self.rows, modes)
        self.records = st.new_records(self.rows, scene.time.periods, samples_per_period)
        self.scratch = st.new_scratch(self.rows, modes)

    def begin(self, max_events: int) -> int:
        """Decide the initial state and record it. Returns the automaton's code."""
        if not auto.begin(self.rows, self.state, self.records, self.scratch):
            return auto.UNDECIDED
        return self.advance(0, max_events)

    def advance(self, periods: int, max_events: int) -> int:
        """Advance to the end of `periods`. Returns the automaton's code."""
        while True:
            code = auto.advance(
                self.rows, self.flows, self.state, self.channels, self.records, self.scratch, periods, max_events
            )
            if code == auto.NEEDS_FLOW:
                key = (int(self.state.key[0]), int(self.state.key[1]))
                self.flows = add_flow(self.flows, self.rows, key)
                continue
            self.log.take(self.records.log, int(self.state.counters[st.LOGGED]))
            self.state.counters[st.LOGGED] = 0
            if code != auto.LOG_FULL:
                return int(code)


def _response(scene: Scene, run: _Run, status: Status, transient: int, started: float) -> Response:
    rows, records, counters = run.rows, run.records, run.state.counters
    done = int(counters[st.PERIOD])
    first = min(transient, max(done - 1, 0))
    window = slice(first, done)
    span = max(done - first, 1) * rows.period
    ledger = records.ledger[: done + 1] - records.ledger[first]
    b = len(rows.mass)
    section = records.section[: done + 1]
    harmonic = 2 / span * records.harmonic[window].sum()
    evaluated = {name: float(value) for name, value in zip(st.ENERGIES, ledger[-1], strict=True)}
    peaks = records.peak[window]
    samples = len(records.samples) // scene.time.periods
    return Response(
        status=status,
        frequency=scene.excitation.frequency,
        amplitude_max=float(peaks.max(initial=0.0)),
        amplitude_mean=float(peaks.mean()) if len(peaks) else 0.0,
        amplitude_mean_confidence=mean_confidence(peaks),
        amplitude_rms=float(np.sqrt(max(records.square[window].sum() / span, 0.0))),
        amplitude_harmonic=float(abs(harmonic)),
        phase=float(np.angle(1j * harmonic)),
        impacts_per_period=float(records.impacts[window].sum() / max(done - first, 1)),
        events=int(counters[st.EVENTS]),
        classification=classify(section[first:], records.impacts[window], evaluated["friction"]),
        energy=evaluated,
        energy_residual=_residual(records.ledger[: done + 1], _energy_scale(rows, section, run.state.fastest[0])),
        attached_mass_fraction=_attached(rows, section, records.momentum[window].sum(), harmonic, first, span),
        wall_time_s=time.perf_counter() - started,
        periods=done,
        transient=first,
        counters={
            "impacts": int(counters[st.IMPACTS]),
            "segments": int(counters[st.SEGMENTS]),
            "evaluations": int(counters[st.EVALUATIONS]),
            "subsystems": int(np.count_nonzero(run.flows.modes)),
        },
        peak=records.peak[:done].copy(),
        section=section[:, :2].copy(),
        slip=section[:, 3 : 3 + b].copy(),
        slip_velocity=section[:, 3 + b :].copy(),
        event_list=_events(rows, run.log.chunks),
        time=np.arange(done * samples) * (rows.period / max(samples, 1)),
        displacement=records.samples[: done * samples, 0].copy(),
        body_displacement=records.samples[: done * samples, 1:].copy(),
    )


def _residual(ledger: np.ndarray, scale: float) -> float:
    """Imbalance of the energy ledger (periods + 1, 6), relative to its largest term.

    At least to `scale`, J: what comes and goes within a period.
    """
    change = ledger[-1] - ledger[0]
    imbalance = change[st.EXCITATION] - change[st.VISCOUS : st.STORED].sum() - change[st.STORED]
    largest = max(np.abs(change).max(), np.abs(ledger[:, st.STORED]).max(), scale)
    return float(abs(imbalance) / largest) if largest > 0 else 0.0


def _energy_scale(rows: Rows, section: np.ndarray, fastest: float) -> float:
    """An energy below which all is round-off, J.

    That of the bodies at the structure's speed or at the largest of their own at the periods' starts, or that of the
    structure under its loads at rest.
    """
    own = section[:, 3 + len(rows.mass) :] ** 2 @ rows.mass
    static = (np.abs(rows.force) ** 2 / rows.stiffness).sum() if len(rows.force) else 0.0
    return float(max(rows.mass.sum() * fastest**2, own.max(), static) / 2)


def _attached(
    rows: Rows, section: np.ndarray, momentum: complex, harmonic: complex, first: int, span: float
) -> float | None:
    """Share of the bodies' mass that the structure feels: Re(F / (omega^2 X)) / sum m, F all contact forces on it."""
    if not len(rows.mass) or abs(harmonic) == 0 or len(section) <= first + 1:
        return None
    change = section[-1, 2] - section[first, 2]
    on_bodies = 2 / span * (change + 1j * rows.omega * momentum) - rows.inertia.sum()
    return float((-on_bodies / (rows.omega**2 * harmonic)).real / rows.mass.sum())


def _events(rows: Rows, chunks: list[np.ndarray]) -> list[Event]:
    events = []
    entries = np.concatenate(chunks) if chunks else np.zeros((0, 6))
    _complete(rows, entries)
    for entry in entries:
        row = int(entry[2])
        body, side = _place(rows, row)
        # speeds of the gap, turned into speeds of the body relative to what it meets
        sign = -1.0 if side in ("right", "body") else 1.0
        before, after, impulse = sign * float(entry[3]) + 0.0, sign * float(entry[4]) + 0.0, float(entry[5])
        events.append(Event(float(entry[0]), st.KINDS[int(entry[1])], body, side, before, after, impulse))
    return events


def _complete(rows: Rows, entries: np.ndarray) -> None:
    """Give impacts on compliant contacts, logged as they begin, the speed and the impulse that their end brought."""
    begun: dict[int, np.ndarray] = {}
    for entry in entries:
        kind, row = int(entry[1]), int(entry[2])
        if not np.isfinite(rows.spring[row]):
            continue
        if kind == st.IMPACT:
            begun[row] = entry
        elif kind == st.DETACHES and row in begun:
            begun[row][4:6] = entry[4:6]


def _place(rows: Rows, row: int) -> tuple[int, str]:
    """Number of the body (or of the friction damper, side "casing") and the side on which a row acts."""
    if len(rows.mass) <= row < rows.friction_rows:
        return row - len(rows.mass), "casing"
    bodies = np.flatnonzero(rows.bodies[row])
    if row < rows.friction_rows:
        return int(bodies[0]), "floor"
    if len(bodies) == 2:
        return int(bodies[0]), "body"
    return int(bodies[0]), "left" if rows.bodies[row, bodies[0]] > 0 else "right"
