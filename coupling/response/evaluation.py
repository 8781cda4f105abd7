"""From the records of a run to its response: means, harmonic, energies, attached mass, list of events.

Every method leaves the same records, so that results of different methods have the same meaning.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.numerics import codes
from vanedamp.coupling.response.at_rest import at_rest
from vanedamp.coupling.response.event_log import Rows, events_of
from vanedamp.coupling.response.records import ENERGIES, EXCITATION, STORED, VISCOUS, Records
from vanedamp.coupling.response.response import PlanarSamples, Response, Status, classify
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.static_deflection import about_mean
from vanedamp.coupling.response.steadiness import judge
from vanedamp.coupling.response.steady_state import mean_confidence, transient_length
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.transient import Transient

#: periods between two checks of whether the response is steady
_CHUNK = 100
#: relaxations within the longest run below which an open one ends
_HOPELESS = 3.0
#: fraction of the energy there is that counts as flow in any case
_CARRIED = 1e-3
#: fraction of the largest order's load below which order 1 counts as unexcited
_NO_SHARE = 1e-9
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
}


class Run(Protocol):
    """A run of any method that can be continued."""

    def advance_to(self, periods: int) -> Status:
        """Continue to the end of the given number of periods, or to the run's end before. Returns its status."""

    def outcome(self) -> Outcome:
        """Return the records of the run so far, and its results."""

    def final(self) -> RestartState | None:
        """Return the state that another run can begin with; None if the run ended within a period, or keeps none."""


class Plane(NamedTuple):
    """Further results of a run with bodies in the plane, of all its periods; b bodies.

    tilt: (periods, b) largest tilt in the cavity, rad; lifted: (periods, b) time off the floor, s; neglected: (b,)
    shortening of a body over the smallest play, per square of its tilt, nan for sliders; bound: of that for a status
    ok; samples: in the plane, from the response's samples; walls: (periods, b) impacts on walls.
    """

    tilt: np.ndarray
    lifted: np.ndarray
    neglected: np.ndarray
    bound: float
    samples: Callable[[np.ndarray], PlanarSamples]
    walls: np.ndarray


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


def run_scene(run: Run, scene: Scene, progress: Callable[[int, int], None] | None = None) -> Ended:
    """Run all periods; where their number is open, until the response is steady; with steady = "auto", until its mean
    is known well enough.

    progress: called with the number of periods done and of those to do.
    """  # fmt: skip
    transient = Transient(scene, run.outcome().system)
    dropped, periods, most = transient.length()
    if scene.time.steady == "auto":
        return _run_until_known(run, transient, periods, progress)
    done = 0
    while True:
        while done < periods:
            # compiled functions hear of no interrupt before they return
            done = min(done + _CHUNK, periods)
            ended = run.advance_to(done)
            if ended is not Status.OK:
                return Ended(ended, dropped)
            if progress is not None:
                progress(done, periods)
        found = judge(transient, run.outcome().records, dropped, periods)
        if found.steady or not dropped:
            return Ended(Status.OK, dropped, found.confidence)
        if 2 * periods > most or found.rate * most < _HOPELESS:
            return Ended(Status.NOT_STEADY, dropped, found.confidence)
        dropped, periods = periods, 2 * periods


def _run_until_known(
    run: Run, transient: Transient, periods: int, progress: Callable[[int, int], None] | None
) -> Ended:
    """Run until the mean amplitude is known well enough, at most some periods."""
    tolerance, ended = transient.scene.time.tolerance, Ended(Status.NOT_STEADY, transient.scene.time.dropped)
    for done in [*range(_CHUNK, periods, _CHUNK), periods]:
        status = run.advance_to(done)
        if status is not Status.OK:
            return Ended(status, ended.transient)
        if progress is not None:
            progress(done, periods)
        outcome = run.outcome()
        records, (_, peaks) = outcome.records, about_mean(outcome.records, slice(0, done), outcome.system.period)
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


def evaluate(scene: Scene, run: Outcome, ended: Ended, started: float) -> Response:
    """Return the response of a run that began at `started` (time.perf_counter)."""
    system, records, done, status = run.system, run.records, run.periods, ended.status
    first = min(ended.transient, max(done - 1, 0))
    window = slice(first, done)
    span = max(done - first, 1) * system.period
    ledger = records.ledger[: done + 1] - records.ledger[first]
    section = records.section[: done + 1]
    harmonic = 2 / span * records.harmonic[window].sum()
    evaluated = {name: float(value) for name, value in zip(ENERGIES, ledger[-1], strict=True)}
    peaks = records.peak[window]
    static, dynamic = about_mean(records, window, system.period)
    scale = _state_scale(system, section[first:])
    balance = residual(
        records.ledger[: done + 1], records.parts[: done + 1], exchanged_energy(system, records.collided)
    )
    if not balance <= run.open_ledger and status in _USABLE:
        status = Status.ENERGY
    extent: dict[str, Any] = {}
    if run.plane is not None:
        extent, tilted = _in_plane(run.plane, window, span)
        status = Status.TILTED if tilted and status in _USABLE else status
        if records.samples_per_period:
            extent["in_plane"] = run.plane.samples(records.samples[: done * records.samples_per_period, 0])
    return Response(
        status=status,
        frequency=scene.frequency,
        amplitude_max=float(peaks.max(initial=0.0)),
        amplitude_mean=float(peaks.mean()) if len(peaks) else 0.0,
        amplitude_mean_confidence=mean_confidence(peaks) if ended.confidence is None else ended.confidence,
        static_deflection=static,
        amplitude_max_dynamic=float(dynamic.max(initial=0.0)),
        amplitude_mean_dynamic=float(dynamic.mean()) if len(dynamic) else 0.0,
        amplitude_rms=float(np.sqrt(max(records.square[window].sum() / span, 0.0))),
        amplitude_harmonic=float(abs(harmonic)),
        phase=float(np.angle(1j * harmonic)),
        impacts_per_period=float(records.impacts[window].sum() / max(done - first, 1)),
        events=run.events,
        classification=classify(
            section[first:],
            scale,
            records.impacts[window],
            not evaluated["friction"] > 0.0 and at_rest(scene, system, section[first:], scale),
        ),
        energy=evaluated,
        energy_residual=balance,
        attached_mass_fraction=(
            None
            if _without_first_order(scene, system)
            else _attached(system, section, records.momentum[window].sum(), harmonic, first, span)
        ),
        wall_time_s=time.perf_counter() - started,
        periods=done,
        transient=first,
        counters=run.counters,
        event_list=events_of(run.rows, run.log),
        penetration=run.penetration,
        **_series(system, records, done),
        **extent,
    )


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


def _in_plane(plane: Plane, window: slice, span: float) -> tuple[dict[str, Any], bool]:
    """Return the results of planar bodies over the evaluated periods, and whether they tilt too far."""
    tilt = plane.tilt[window].max(axis=0, initial=0.0)
    neglected = plane.neglected * tilt**2
    parts = {"tilt_max": tilt, "lift_share": plane.lifted[window].sum(axis=0) / span, "linearisation": neglected}
    slider = np.isnan(plane.neglected)
    figures: dict[str, Any] = {
        name: tuple(None if slider[body] else float(value) for body, value in enumerate(values))
        for name, values in parts.items()
    }
    walls = plane.walls[window]  # none in a run that ended at once
    figures["wall_impacts"] = tuple((walls.sum(axis=0) / max(len(walls), 1)).tolist())
    return figures, bool(np.any(neglected[~slider] > plane.bound))


def residual(ledger: np.ndarray, parts: np.ndarray, exchanged: float = 0.0) -> float:
    """Return the imbalance of the energies (periods + 1, 6), relative to the energy that flowed.

    That flow is the largest term, with stored energy by its parts (periods + 1, 1 + b): energy that moves with a heavy
    body, and no further, is no flow. `exchanged` (J) comes and goes within a period. A thousandth of the stored energy
    always counts: below it the imbalance would measure the round-off of energy that only moves with a body.
    """
    change = ledger - ledger[0]
    imbalance = change[-1, EXCITATION] - change[-1, VISCOUS:].sum()
    swing = np.ptp(parts, axis=0).sum()
    flowed = max(np.abs(change[:, :STORED]).max(), swing, exchanged, _CARRIED * np.abs(parts).sum(axis=1).max())
    return 0.0 if flowed == 0.0 else float(abs(imbalance) / flowed)


def exchanged_energy(system: System, collided: np.ndarray) -> float:
    """Return the energy that comes and goes within a period, J: in collisions (periods,), and lent by the loads."""
    rate = np.maximum(system.frequency, system.omega)[:, None]  # the mean of a waveform counts as a slow load
    modes = np.abs(system.of_structure.load) ** 2 / np.maximum(system.of_structure.stiffness, rate**2)
    bodies = np.abs(system.of_bodies.load) ** 2 / (system.of_bodies.mass * rate**2)
    return float(max(collided.max(), (modes.sum() + bodies.sum()) / 2))


def _state_scale(system: System, section: np.ndarray) -> np.ndarray:
    """Return the scale (states,) of each state of the section.

    A displacement and its velocity have one scale, because either may vanish at the period's start. The scale of the
    bodies' momentum is that at the largest speed: of a heavy body, which almost rests, it is a small difference of
    the slip's speed and the structure's, and its slow drift does not act on the motion in the cavity.
    """
    largest, b = np.abs(section).max(axis=0), system.bodies
    x = max(largest[0], largest[1] / system.omega)
    slips = np.maximum(largest[3 : 3 + b], largest[3 + b :] / system.omega)
    momentum = system.of_bodies.mass.sum() * system.omega * max(x, slips.max(initial=0.0))
    return np.array([x, system.omega * x, momentum, *slips, *(system.omega * slips)]) + np.finfo(float).tiny


def _without_first_order(scene: Scene, system: System) -> bool:
    """Whether a waveform or loads have sines of higher orders only, by which no attached mass is measured."""
    if scene.excitation.waveform is None and not scene.excitation.distributed:
        return False
    sizes = np.abs(np.column_stack([system.load, system.table])).max(axis=1)
    return bool(sizes[0] <= _NO_SHARE * sizes.max())


def _attached(
    system: System, section: np.ndarray, momentum: complex, harmonic: complex, first: int, span: float
) -> float | None:
    """Return the attached mass over the bodies' mass, Re(F / (omega^2 X)) / sum m; F: all contact forces on it.

    Of several harmonics, order 1 counts.
    """
    # a structure that does not move feels no mass: its harmonic is 0, or the remainder of a decayed start
    if not system.bodies or abs(harmonic) <= np.sqrt(np.finfo(float).tiny) or len(section) <= first + 1:
        return None
    change = section[-1, 2] - section[first, 2]
    on_bodies = 2 / span * (change + 1j * system.omega * momentum) - system.of_bodies.load[0].sum()
    return float((-on_bodies / (system.omega**2 * harmonic)).real / system.of_bodies.mass.sum())
