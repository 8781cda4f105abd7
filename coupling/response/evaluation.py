"""From the records of a run to its response: means, harmonic, energies, attached mass, list of events.

Every method leaves the same records, so that results of different methods have the same meaning.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.numerics import codes
from vanedamp.coupling.quantities.quantity import Later, evaluated
from vanedamp.coupling.quantities.stress import LINEAR
from vanedamp.coupling.quantities.sums import SUMS, nothing_known, sources_of
from vanedamp.coupling.response.event_log import Rows
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
from vanedamp.coupling.response.steadiness import LOOK, judge, known_after, run_ends
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.transient import Transient
from vanedamp.files.store import frozen

#: periods between two checks of whether the response is steady
_CHUNK = 100
#: energy that impacts or contacts may have made by round-off, relative to the energy that flowed (figures.contact_gain)
_MADE = 1e-9
#: coordinates of a system that is small
_LARGE = 50
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
    codes.UNCERTAIN: Status.UNCERTAIN,
}


#: fields of a response, by name
Fields = Mapping[str, Any]


class Run(Protocol):
    """A run of any method that can be continued."""

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of the given number of periods, or to the run's end before. Returns its status."""

    def outcome(self) -> Outcome:
        """Return the records of the run so far, and its results."""

    def final(self) -> RestartState | None:
        """Return the state that another run can begin with; None if the run ended within a period, or keeps none."""


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


class Needs(NamedTuple):
    """Records that an observer needs.

    samples: of each period; log: whether to keep it; outputs: whether the largest values of further outputs are wanted;
    exponent: of the energies of impacts, whose sums and numbers are counted by contact then; course: functionals (k, n)
    of the modal coordinates whose course is wanted, as the system's further outputs.
    """

    samples: int = 0
    log: bool = False
    outputs: bool = False
    exponent: float | None = None
    course: np.ndarray | None = None


_NOTHING = Needs()


def together(needs: Iterable[Needs]) -> Needs:
    """Return the records that some observers need."""
    samples, logs, outputs, exponents, courses = zip(_NOTHING, *needs, strict=True)
    course = next((one for one in courses if one is not None), None)
    return Needs(max(samples), any(logs), any(outputs), next(filter(None, exponents), None), course)


@dataclass
class Observer:
    """What a run keeps besides its sums, set before it begins.

    fields: returns fields of the response of a run that has ended, by name, from its scene, its outcome and the fields
    known before; `warnings` are added to those. needs: records of the run.
    """

    fields: Callable[[Scene, Outcome, Fields], Fields]
    needs: Needs = _NOTHING

    def begin(self, scene: Scene, system: System) -> Needs:
        """Return the records for a scene."""
        return self.needs

    def records(self, empty: Records) -> Records:
        """Return the records to which the run writes."""
        return empty

    def linear(self, order: np.ndarray, motions: np.ndarray) -> Sequence[Any]:
        """Return "linear" from the fields known before of f scenes, whose bodies are apart or fixed.

        motions: (2, f, e, n) of harmonics of these orders (LinearResponse.motions). Empty: nothing is wanted.
        """
        return ()

    def look(self, run: Run, dropped: int | None) -> None:
        """Look at a run before it continues; dropped: periods that will be left out, None if that is open."""


class Ended(NamedTuple):
    """How a run ended: status, periods left out, and the confidence of the mean of the others, m (None: unknown)."""

    status: Status
    transient: int
    confidence: float | None = None


def run_scene(
    run: Run, scene: Scene, progress: Callable[[int, int], None] | None = None, observers: Sequence[Observer] = ()
) -> Ended:
    """Run all periods; where their number is open, until the response is steady; with steady = "auto", until its mean
    is known well enough.

    progress: called with periods done and to do; observers: of the run.
    """
    transient = Transient(scene, run.outcome().system)
    dropped, periods, most = transient.length()
    if scene.time.steady == "auto":
        return _run_until_known(run, transient, periods, progress, observers)
    done, counted = 0, run.outcome().records.counted
    while True:
        counted[0] = dropped
        while done < periods:
            # compiled functions hear of no interrupt before they return
            done = min(done + _CHUNK, dropped if done < dropped else periods)
            ended = _advanced(run, done, periods, progress, observers, dropped)
            if ended is not Status.OK:
                return Ended(ended, dropped)
        verdict = judge(transient, run.outcome().records, dropped, periods)
        code = run_ends(verdict.steady, verdict.rate, dropped, periods, most)
        if code != codes.LONGER:
            return Ended(STATUS_OF[code], dropped, verdict.confidence)
        dropped, periods = periods, 2 * periods


def _run_until_known(
    run: Run,
    transient: Transient,
    periods: int,
    progress: Callable[[int, int], None] | None,
    observers: Sequence[Observer],
) -> Ended:
    """Run until the mean amplitude is known well enough, at most some periods."""
    ended = Ended(Status.NOT_STEADY, transient.scene.time.dropped)
    for done in [*range(LOOK, periods, LOOK), periods]:
        status = _advanced(run, done, periods, progress, observers, None)
        if status is not Status.OK:
            return Ended(status, ended.transient)
        code, dropped, confidence = known_after(*transient.numbers, run.outcome().records, done, np.empty(done))
        ended = Ended(STATUS_OF[int(code)], int(dropped), None if np.isnan(confidence) else float(confidence))
        if ended.status is Status.OK:
            break
    return ended


def _advanced(
    run: Run, done: int, periods: int, progress: Callable[[int, int], None] | None, observers: Sequence[Observer],
    dropped: int | None,
) -> Status:  # fmt: skip
    """Return how a run came to the end of some periods."""
    for observer in observers:
        observer.look(run, dropped)
    status = run.advance_to(done)
    if status is Status.OK and progress is not None:
        progress(done, periods)
    return status


def evaluate(
    scene: Scene, run: Outcome, ended: Ended, started: float, observers: Sequence[Observer] = (),
    final: RestartState | None = None,
) -> Response:  # fmt: skip
    """Return the response of a run that began at `started` (time.perf_counter), with its observers' data."""
    results = _sums(scene, run, ended)
    for observer in observers:
        more = observer.fields(scene, run, results)
        results |= {**more, "warnings": (*results["warnings"], *more.get("warnings", ()))}
    return Response(**results, final=final, wall_time_s=time.perf_counter() - started)


def _sums(scene: Scene, run: Outcome, ended: Ended) -> dict[str, Any]:
    """Return the fields of a response that any run has."""
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
    if run.plane is not None:
        planar = in_plane_of(run.plane, slice(first, done))
        status = levelled_status(status, planar, run.plane.bound)
        sums |= planar
    section, b = records.section[: done + 1], system.bodies
    return {
        "status": status, "frequency": scene.frequency, "events": run.events, "classification": class_name(kind),
        "energy": energy, "periods": done, "transient": first, "counters": run.counters,
        "quantities": evaluated(
            linear_parts(scene, system, sums | {"overlap": run.penetration}), partial(known_value, status)
        ),
        "peak": records.peak[:done].copy(), "section": section[:, :2].copy(),
        "slip": section[:, 3 : 3 + b].copy(), "slip_velocity": section[:, 3 + b :].copy(), "warnings": (),
        "event_list": [], "time": np.zeros(0), "displacement": np.zeros(0), "body_displacement": np.zeros((0, b)),
    }  # fmt: skip


def closed_status(status: Status, imbalance: float, gain: float, bound: float) -> Status:
    """Return the status of a run by its energies, too: imbalance, and gains at impacts and contacts."""
    closed = imbalance <= bound and gain <= _MADE
    return Status.ENERGY if not closed and status in _USABLE else status


def in_plane(tilt: np.ndarray, lifted: np.ndarray, walls: np.ndarray, neglected: np.ndarray) -> dict[str, np.ndarray]:
    """Return inputs of quantities of planar bodies (b, ...), over the evaluated periods; nan for sliders.

    tilt: largest, rad; lifted: time off the floor, s; walls: impacts on walls; neglected: as of a Plane.
    """
    slider = np.where(np.isnan(neglected), np.nan, 1.0)
    return {"tilt": slider * tilt, "lifted": slider * lifted, "walls": walls, "neglected": neglected}


def in_plane_of(plane: Plane, window: slice) -> dict[str, np.ndarray]:
    """Return inputs of quantities of planar bodies (b,), over the evaluated periods."""
    tilt, lifted = plane.tilt[window].max(axis=0, initial=0.0), plane.lifted[window].sum(axis=0)
    return in_plane(tilt, lifted, plane.walls[window].sum(axis=0), plane.neglected)


def levelled_status(status: Status, planar: Mapping[str, np.ndarray], bound: float) -> Status:
    """Return the status of a run by how far planar bodies tilt, too."""
    tilted = bool(np.any(planar["neglected"] * planar["tilt"] ** 2 > bound))
    return Status.TILTED if tilted and status in _USABLE else status


def linear_parts(scene: Scene, system: System | None = None, known: Mapping[str, Any] = {}) -> Mapping[str, Any]:
    """Return the amplitudes without bodies, and with bodies fixed, m; nan under noise.

    They take a part of the time of a short run: found when they are wanted. known: what else quantities need.
    """

    def amplitude(name: str) -> float:
        if scene.excitation.signal is not None:
            return np.nan
        curve = linear_responses(scene, system)[LINEAR.index(name)]
        return float(curve.amplitude(np.array([scene.frequency]))[0])

    linear = Later(LINEAR, amplitude, known)
    # lists of responses must not hold large matrices
    return linear if system is None or len(system.mass) <= _LARGE else dict(linear)


def known_value(status: Status, value: Any) -> Any:
    """Return a quantity as plain data, None where unknown; nan if diverged."""
    if np.ndim(value):
        return frozen(value)
    return None if np.isnan(value) and status is not Status.DIVERGED else float(value)


def residual(ledger: np.ndarray, parts: np.ndarray, exchanged: float = 0.0) -> float:
    """Return the imbalance (figures.imbalance) of the energies (periods + 1, 6) of a whole run."""
    return float(imbalance(ledger, parts, len(ledger) - 1, float(exchanged)))


def exchanged_energy(system: System, collided: np.ndarray) -> float:
    """Return the energy exchanged within a period, J: in collisions (periods,), and by the loads."""
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
