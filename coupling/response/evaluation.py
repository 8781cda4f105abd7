"""From the records of a run to its response: means, harmonic, energies, attached mass, list of events.

Every method leaves the same records, so that results of different methods have the same meaning.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.numerics import codes
from vanedamp.coupling.quantities.quantity import evaluated
from vanedamp.coupling.quantities.sums import SUMS, nothing_known, sources_of
from vanedamp.coupling.response.by_sector import response_by_sector
from vanedamp.coupling.response.contact_work import ContactWork
from vanedamp.coupling.response.event_log import Rows, events_of, impact_energies
from vanedamp.coupling.response.figures import (
    NO_CONTACT,
    NON_PERIODIC,
    STUCK,
    imbalance,
    lent_energy,
    measure,
    measured_of,
)
from vanedamp.coupling.response.plane import Plane
from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.static_deflection import about_mean
from vanedamp.coupling.response.steadiness import judge, run_ends
from vanedamp.coupling.response.steady_state import transient_length
from vanedamp.coupling.response.wear import contact_wear, ledger_warning
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.transient import Transient
from vanedamp.files.store import frozen

#: periods between two checks of whether the response is steady
_CHUNK = 100
#: energy that impacts or contacts may have made by round-off, relative to the energy that flowed (figures.contact_gain)
_MADE = 1e-9
#: statuses of runs that came to their end
_USABLE = (Status.OK, Status.NOT_STEADY, Status.UNCERTAIN)

#: status of a run whose compiled part has ended with a code
STATUS_OF = {
    codes.DONE: Status.OK,
    codes.EVENT_BUDGET: Status.EVENT_BUDGET,
    codes.ACCURACY_LOST: Status.ACCURACY_LOST,
    codes.UNDECIDED: Status.UNDECIDED,
    codes.ILL_CONDITIONED: Status.ILL_CONDITIONED,
    codes.DIVERGED: Status.DIVERGED,
    codes.PENETRATION: Status.PENETRATION,
    codes.NOT_STEADY: Status.NOT_STEADY,
}


class Run(Protocol):
    """A run of any method that can be continued."""

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of the given number of periods, or to the run's end before. Returns its status."""

    def outcome(self) -> Outcome:
        """Return the records of the run so far, and its results."""

    def final(self) -> RestartState | None:
        """Return the state that another run can begin with; None if the run ended within a period, or keeps none."""


class Watch(Protocol):
    """What looks at the samples of a run while it advances (registry.respond)."""

    def samples(self, scene: Scene, system: System, asked: int) -> int:
        """Return how many samples of each period the run keeps for it, a multiple of those asked for."""

    def records(self, empty: Records) -> Records:
        """Return the records to which the run writes."""

    def __call__(self, run: Run, dropped: int | None) -> None:
        """Look at the run so far; dropped: periods that will be left out, None if that is open."""

    def close(self, outcome: Outcome) -> Outcome:
        """Look at the rest of a run that has ended. Return its outcome with the samples that were asked for."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run: records of `periods` periods, counters, chunks of its log and the meaning of their rows.

    open_ledger: energy residual above which the method's results are not to be used; penetration: relative to the
    free travel.
    """

    system: System
    records: Records
    periods: int
    events: int
    open_ledger: float
    counters: dict[str, int]
    log: Sequence[np.ndarray]
    rows: Rows
    penetration: float = 0.0
    plane: Plane | None = None


class Ended(NamedTuple):
    """How a run ended: status, periods left out, and the confidence of the mean of the others, m (None: unknown)."""

    status: Status
    transient: int
    confidence: float | None = None


def run_scene(
    run: Run, scene: Scene, progress: Callable[[int, int], None] | None = None, watch: Watch | None = None
) -> Ended:
    """Run all periods; where their number is open, until the response is steady; with steady = "auto", until its mean
    is known well enough.

    progress: called with the number of periods done and of those to do; watch: called before the run, and as it goes.
    """  # fmt: skip
    transient = Transient(scene, run.outcome().system)
    dropped, periods, most = transient.length()
    if scene.time.steady == "auto":
        return _run_until_known(run, transient, periods, progress, watch)
    done, counted = 0, run.outcome().records.counted
    while True:
        counted[0] = dropped
        while done < periods:
            if watch is not None:
                watch(run, dropped)
            # compiled functions hear of no interrupt before they return
            done = min(done + _CHUNK, dropped if done < dropped else periods)
            ended = run.advance_to(done)
            if ended is not Status.OK:
                return Ended(ended, dropped)
            if progress is not None:
                progress(done, periods)
        found = judge(transient, run.outcome().records, dropped, periods)
        code = run_ends(found.steady, found.rate, dropped, periods, most)
        if code != codes.LONGER:
            return Ended(STATUS_OF[code], dropped, found.confidence)
        dropped, periods = periods, 2 * periods


def _run_until_known(
    run: Run,
    transient: Transient,
    periods: int,
    progress: Callable[[int, int], None] | None,
    watch: Watch | None,
) -> Ended:
    """Run until the mean amplitude is known well enough, at most some periods."""
    tolerance, ended = transient.scene.time.tolerance, Ended(Status.NOT_STEADY, transient.scene.time.dropped)
    for done in [*range(_CHUNK, periods, _CHUNK), periods]:
        if watch is not None:
            watch(run, None)
        status = run.advance_to(done)
        if status is not Status.OK:
            return Ended(status, ended.transient)
        if progress is not None:
            progress(done, periods)
        outcome = run.outcome()
        records, (_, peaks) = outcome.records, about_mean(outcome.records, 0, done, outcome.system.period)
        dropped = transient_length(peaks)
        if dropped is None:
            ended = Ended(Status.NOT_STEADY, transient.scene.time.dropped)
            continue
        found = judge(transient, records, dropped, done)
        if found.confidence is not None and found.confidence <= tolerance * peaks[dropped:].mean():
            if found.steady or not dropped:
                return Ended(Status.OK, dropped, found.confidence)
            ended = Ended(Status.NOT_STEADY, dropped, found.confidence)
        else:
            ended = Ended(Status.UNCERTAIN, dropped, found.confidence)
    return ended


def evaluate(scene: Scene, run: Outcome, ended: Ended, started: float, events: bool = True) -> Response:
    """Return the response of a run that began at `started` (time.perf_counter). events: keep the list of events."""
    system, records, done, status = run.system, run.records, run.periods, ended.status
    first = min(ended.transient, max(done - 1, 0))
    row = np.empty(len(SUMS))
    confidence = np.nan if ended.confidence is None else ended.confidence
    kind = measure(measured_of(scene, system), records, first, done, confidence, row)
    if status is Status.DIVERGED:  # numbers up to the largest double, of no meaning
        nothing_known(row)
    sums = sources_of(row)
    energy = {name: float(value) for name, value in sums["energy"].items()}
    status = closed_status(status, float(sums["unbalanced"]), float(sums["made"]), run.open_ledger)
    extent: dict[str, Any] = {}
    if run.plane is not None:
        in_plane = in_plane_of(run.plane, slice(first, done))
        status = Status.TILTED if _tilted(in_plane, run.plane.bound) and status in _USABLE else status
        sums |= in_plane
        if records.samples_per_period:
            extent["in_plane"] = run.plane.samples(records.samples[: done * records.samples_per_period, 0])
    if scene.wear is not None and records.worn.shape[1]:  # a ring-down does not count it
        extent |= _worn(scene, contact_work(scene, run, first), energy["friction"])
    if records.outputs.shape[1]:
        extent["sectors"] = response_by_sector(scene, system, records, run.rows, slice(first, done))
    return Response(
        status=status,
        frequency=scene.frequency,
        events=run.events,
        classification=class_name(kind),
        energy=energy,
        wall_time_s=time.perf_counter() - started,
        periods=done,
        transient=first,
        counters=run.counters,
        event_list=events_of(run.rows, run.log) if events else [],
        quantities=_known(evaluated(sums | {"overlap": run.penetration} | linear_parts(scene, system)), status),
        **_series(system, records, done),
        **extent,
    )


def _worn(scene: Scene, work: tuple[ContactWork, ...], friction: float) -> dict[str, Any]:
    """Return work and wear of the contacts, and a warning if it does not fit the friction work of the balance, J."""
    if not work or not len(work[0].course):
        return {"contact_work": work}
    return {"contact_work": work, "wear": contact_wear(scene, work), "warnings": ledger_warning(work, friction)}


def contact_work(scene: Scene, run: Outcome, first: int) -> tuple[ContactWork, ...]:
    """Return the work of each contact of a run, exact engine, over its periods from `first` on."""
    records, rows, window = run.records, run.rows, slice(first, run.periods)
    struck = _struck(run)
    found = []
    for row, (number, side, corner) in enumerate(rows.places):
        friction = _friction(scene, run, row)
        sliding = records.worn[window, row] / friction if friction > 0.0 else np.zeros(run.periods - first)
        course = np.stack([sliding, struck[window, row]], axis=1)
        found.append(ContactWork(number, side, corner, friction, int(records.hits[window, row].sum()), course))
    return tuple(found)


def _struck(run: Outcome) -> np.ndarray:
    """Return the sums (periods + 1, rows) of the energies of impacts to the power of [wear], J^n."""
    struck, exponent = run.records.struck.copy(), float(run.records.exponent[0])
    struck[:, np.flatnonzero(np.isfinite(run.rows.spring))] = 0.0  # known only as a contact ends
    period, row, energy = impact_energies(run.rows, run.log, run.system.period)
    np.add.at(struck, (np.minimum(period, len(struck) - 1), row), energy**exponent)
    return struck


def _friction(scene: Scene, run: Outcome, row: int) -> float:
    """Return the coefficient of friction of a row of the log; 0: none, and no work of it."""
    number, side, _ = run.rows.places[row]
    if run.rows.without_body[row]:
        return scene.friction_damper[number].friction if side == "casing" else 0.0
    if run.system.in_plane and row < run.system.contacts:
        return float(run.system.friction[row])
    return scene.damper[number].friction if side == "floor" else 0.0


def closed_status(status: Status, imbalance: float, gain: float, bound: float) -> Status:
    """Return the status of a run by its energies, too: their imbalance, and what impacts and contacts have made."""
    closed = imbalance <= bound and gain <= _MADE
    return Status.ENERGY if not closed and status in _USABLE else status


def _series(system: System, records: Records, done: int) -> dict[str, Any]:
    """Return the series of a response: of its periods, and of its samples."""
    section, b, count = records.section[: done + 1], system.bodies, done * records.samples_per_period
    samples, coordinates = records.samples[:count], records.coordinates[:count]
    kept = coordinates.size and np.all(np.isfinite(coordinates))  # not where none were wanted, or the method keeps none
    return {
        "peak": records.peak[:done].copy(), "section": section[:, :2].copy(), "slip": section[:, 3 : 3 + b].copy(),
        "slip_velocity": section[:, 3 + b :].copy(),
        "time": np.arange(count) * (system.period / max(records.samples_per_period, 1)),
        "displacement": samples[:, 0].copy(), "body_displacement": samples[:, 1:].copy(),
        "coordinates": coordinates.copy() if kept else None,
    }  # fmt: skip


def in_plane_of(plane: Plane, window: slice) -> dict[str, np.ndarray]:
    """Return what quantities need of planar bodies (b,), over the evaluated periods; nan for sliders."""
    slider = np.where(np.isnan(plane.neglected), np.nan, 1.0)
    return {
        "tilt": slider * plane.tilt[window].max(axis=0, initial=0.0),
        "lifted": slider * plane.lifted[window].sum(axis=0),
        "walls": plane.walls[window].sum(axis=0),
        "neglected": plane.neglected,
    }


def _tilted(in_plane: Mapping[str, np.ndarray], bound: float) -> bool:
    """Return whether bodies tilt too far."""
    return bool(np.any(in_plane["neglected"] * in_plane["tilt"] ** 2 > bound))


def linear_parts(scene: Scene, system: System | None = None) -> dict[str, float]:
    """Return the amplitudes without bodies, and with every body fixed in its cavity, m; nan under noise."""
    known = scene.excitation.signal is None
    at = np.array([scene.frequency])
    both = [float(one.amplitude(at)[0]) for one in linear_responses(scene, system)] if known else [np.nan, np.nan]
    return dict(zip(("undamped", "fixed"), both, strict=True))


def _known(found: Mapping[str, Any], status: Status) -> dict[str, Any]:
    """Return quantities as plain data, None for what is not known of a motion; of one that has diverged, nan."""

    def plain(value: Any) -> Any:
        if np.ndim(value):
            return frozen(value)
        return None if np.isnan(value) and status is not Status.DIVERGED else float(value)

    return {name: plain(value) for name, value in found.items()}


def residual(ledger: np.ndarray, parts: np.ndarray, exchanged: float = 0.0) -> float:
    """Return the imbalance (figures.imbalance) of the energies (periods + 1, 6) of a whole run."""
    return float(imbalance(ledger, parts, len(ledger) - 1, float(exchanged)))


def exchanged_energy(system: System, collided: np.ndarray) -> float:
    """Return the energy that comes and goes within a period, J: in collisions (periods,), and lent by the loads."""
    lent = lent_energy(system.load, system.along, system.squares, system.mass, system.frequency, system.omega)
    return max(float(collided.max()), float(lent))


def periods_of(classification: str) -> int | None:
    """Return after how many excitation periods a motion of a class repeats; None if it does not."""
    if classification == "non-periodic":
        return None
    return int(classification.removeprefix("periodic-")) if classification.startswith("periodic-") else 1


def class_name(kind: int) -> str:
    """Return "periodic-k", "non-periodic", "no-contact" or "stuck" (figures.repetition)."""
    return {NON_PERIODIC: "non-periodic", NO_CONTACT: "no-contact", STUCK: "stuck"}.get(kind, f"periodic-{kind}")
