"""Derivatives of random scenes of every kind by all of their numbers, against differences of the engine.

    .venv/bin/python -m tests.tools.sensitivities [FIRST [COUNT]]

Each seed is a scene of one of the kinds, in turn (sensitive_scenes): its run of two periods from its own start, and, if
100 periods end in a motion that repeats after at most 4, that orbit. Of an orbit the differences move the start along
with the number by the derivative to be checked: the end must move by the same, and all other results as they should.
All numbers of a scene change together, each by some part of its size; one by one where that shows an error or finds
no reference.
Errors are relative to derivatives, or to sizes of results over those of numbers. Printed are what is off by more
than 1e-7 with the status "ok", with the error that the differences may have, and a table by kinds: subjects, those
with a derivative, derivatives compared, the largest error, and those without a reference (another sequence of events
on one side however near, a number at a bound).
"""

from __future__ import annotations

import sys
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from tests.tools.differences import MOST_EVENTS, Difference, by_numbers
from tests.tools.sensitive_scenes import KINDS, numbers_of, scene_of
from vanedamp.coupling.orbits.newton import OrbitStatus, PeriodicOrbit
from vanedamp.coupling.orbits.orbits import find_orbit
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.quantities.quantity import table as quantities
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: error that is none; estimates of the differences' errors count so many times
OFF, DOUBT = 1e-7, 20.0
#: periods of a run from its own start; the most of an orbit; the most numbers that are compared one by one
RUN, LONGEST, SINGLY = 2, 4, 8
#: impacts slower than this part of the fastest are not compared: the engine completes chatters among them
SLOW = 1e-4


class Error(NamedTuple):
    """The largest error of a derivative: relative, by which number, of which result; error of the reference."""

    size: float
    path: str
    result: str
    doubt: float

    @property
    def off(self) -> bool:
        """Whether it is larger than allowed and than the reference may miss."""
        return self.size > OFF + DOUBT * self.doubt


@dataclass
class Checked:
    """What was found of a scene's run or orbit: status, numbers compared, errors, numbers without a reference."""

    kind: str
    subject: str
    status: str
    note: str = ""
    compared: int = 0
    errors: list[Error] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    @property
    def worst(self) -> float:
        """The largest error that the reference tells."""
        return max((error.size for error in self.errors if error.doubt * DOUBT <= OFF), default=0.0)


def check(seed: int, folder: Path) -> list[Checked]:
    """Compare the derivatives of a seed's run, and of its orbit if it has one."""
    try:
        kind, scene = scene_of(seed, folder)
    except InputError:
        return []
    found = []
    for of_subject in (_of_run, _of_orbit):
        with suppress(InputError):  # a number without neighbours, or an orbit's table
            found.append(of_subject(kind, scene))
    return [each for each in found if each is not None]


def _of_run(kind: str, scene: Scene) -> Checked | None:
    short = scene.replace({"time": {"periods": RUN, "transient": 0}})
    return _checked(kind, "run", short, short, RUN) if _ends(short, None) else None


def _ends(scene: Scene, start: RestartState | None) -> bool:
    """Whether a run comes to its end without more events than are worth their time."""
    few = scene.replace({"solver": {"max_events": MOST_EVENTS * scene.time.simulated}})
    try:
        return simulate(few, start=start).final is not None
    except InputError:
        return False


def _of_orbit(kind: str, scene: Scene) -> Checked | None:
    try:
        response = simulate(scene)
    except InputError:
        return None
    _, _, periods = response.classification.partition("periodic-")
    if response.final is None or int(periods or LONGEST + 1) > LONGEST:
        return None
    walked = period_map(scene, periods=int(periods))
    orbit = find_orbit(scene.replace({"orbit": {"periods": int(periods)}}), response.final)
    once = scene.replace({"time": {"periods": int(periods), "transient": 0}})
    if orbit.status is not OrbitStatus.OK or not _ends(once, response.final):
        return None
    return _checked(kind, "orbit", _at_rest(walked.scene), orbit, int(periods))


def _at_rest(scene: Scene) -> Scene:
    """Return a scene whose own start leaves room to change its numbers."""
    keys = ("position", "velocity", "lift", "tilt", "lift_velocity", "tilt_rate")
    values = {f"damper.{i}.{key}": 0.0 for i, _ in enumerate(scene.damper) for key in keys}
    return scene.replace(values)


def _checked(kind: str, subject: str, scene: Scene, given: PeriodicOrbit | Scene, periods: int) -> Checked:
    """Compare the derivatives as all numbers change, each by some of its size; one by one if that does not do."""
    numbers = numbers_of(scene, subject == "run")
    found = sensitivity(given, list(numbers))
    checked = Checked(kind, subject, str(found.status), found.note)
    if checked.status != "ok":
        return checked
    walked, part = (
        period_map(scene, periods=periods),
        np.random.default_rng(len(numbers)).uniform(0.3, 1.0, len(numbers)),
    )
    sizes, names = np.array([size for _, size in numbers.values()]), list(numbers)
    told = np.array([f"{path}: no derivative" not in found.note for path in names])

    def compared(weights: np.ndarray, name: str) -> Error | None:
        """Return the error of the derivative by so much of each number."""
        moves = {path: (value, w) for (path, (value, _)), w in zip(numbers.items(), weights.tolist(), strict=True) if w}
        state, way = (found.state, found.state_derivative @ weights) if subject == "orbit" else (None, None)
        for sure in (False, True):
            reference = by_numbers(scene, walked, moves, state, way, sure)
            if reference is None or not reference.same:
                return None
            error = _error(found, weights, reference, name)
            if not error.off:
                break
        return error

    whole = compared(part * sizes * told, "all numbers")
    if whole is not None and not whole.off and whole.doubt * DOUBT <= OFF:
        checked.compared, checked.errors = int(told.sum()), [whole]
        return checked
    for j in np.random.default_rng(len(numbers)).permutation(np.flatnonzero(told))[:SINGLY]:
        path, weights = names[j], sizes[j] * (np.arange(len(numbers)) == j)
        error = compared(weights, path)
        if error is None:
            checked.unknown.append(path)
        else:
            checked.compared += 1
            checked.errors.append(error)
    return checked


def claimed(found: Sensitivity, weights: np.ndarray) -> dict[str, np.ndarray]:
    """Return the derivatives as numbers change by some weights (P,), by the names of the differences."""
    moved = weights != 0.0  # others may have no derivative

    def of(turns: np.ndarray) -> np.ndarray:
        return np.asarray(turns[..., moved] @ weights[moved])

    return {
        "state": of(found.state_derivative), "peak": of(found.peak_derivative),
        "impact_time": of(found.impact_time_derivative),
        "impact_speed": np.sign(found.impact_speed) * of(found.impact_speed_derivative),
        **{name: np.atleast_1d(of(turns)) for name, turns in found.derivatives.items()},
    }  # fmt: skip


def _error(found: Sensitivity, weights: np.ndarray, reference: Difference, path: str) -> Error:
    worst, base = Error(0.0, path, "", 0.0), reference.base.results
    ours = _by_instant(found.impact_time, found.impact_speed)
    theirs = _by_instant(base["impact_time"], base["impact_speed"])
    for name, claim in claimed(found, weights).items():
        if name not in reference.derivative or (found.note and (name == "peak" or _of_largest(name))):
            continue  # not of a run; two summits of one height: on one side
        exact = reference.derivative[name]
        if "rests" in found.note and np.isnan(claim).any():
            continue  # there is an orbit for each place of rest
        if np.isnan(claim).all() and "begin to deflect" in found.note:
            continue  # distances count from elsewhere on either side
        if found.values.get(name) == 0.0 and not claim.any() and _of_largest(name):
            continue  # bodies in touch strike at round-off
        if found.values.get(name) == 0.0 and np.isnan(claim).all():
            continue  # a root, such as amplitude_rms, at rest
        if name.startswith("tilt_") and not np.isclose(found.values[name], base[name][0], rtol=1e-9):
            continue  # the engine notes tilts at the nodes of cubics
        if name in ("impact_time", "impact_speed"):
            if not len(ours):  # compliant contacts have none
                continue
            claim, exact = claim[ours], exact[theirs]
        if not exact.size or np.isnan(exact).all():
            continue
        error = np.inf
        if claim.shape == exact.shape and not np.isnan(claim).any():
            error = float(np.abs((claim - exact) / reference.relative[name]).max())
        each = Error(error, path, name, reference.error[name])
        worst = max(worst, each, key=lambda one: (one.off, one.size))
    return worst


def _of_largest(name: str) -> bool:
    """Whether a figure is the largest of some values."""
    one = quantities().get(name.split(".")[0])
    largest = ("peak", "peaks", "highest", "heights", "distance", "distances", "tilt", "sectors", "contacts", "wear")
    return one is not None and not set(one.needs).isdisjoint(largest)


def _by_instant(time: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the order of impacts by their times, without slow ones; of several at one instant the fastest."""
    speed = np.abs(speed)
    instant = np.round(time / (np.abs(time).max(initial=0.0) or 1.0), 10)
    order = np.lexsort((-speed, instant))
    order = order[np.unique(instant[order], return_index=True)[1]]
    return order[speed[order] >= SLOW * speed.max(initial=0.0)]


def table(found: list[Checked]) -> str:
    """Return counts and largest errors by kinds."""
    lines = [f"{'':22}{'subjects':>10}{'ok':>8}{'compared':>10}{'largest':>10}{'unknown':>10}  others"]
    for kind in KINDS:
        of_kind = [each for each in found if each.kind == kind]
        ok = [each for each in of_kind if each.status == "ok"]
        worst, others = max((each.worst for each in ok), default=0.0), Counter(each.status for each in of_kind)
        del others["ok"]
        compared, unknown = sum(each.compared for each in ok), sum(len(each.unknown) for each in ok)
        rest = ", ".join(f"{status} {count}" for status, count in others.items())
        lines.append(f"{kind:22}{len(of_kind):10}{len(ok):8}{compared:10}{worst:10.1e}{unknown:10}  {rest}")
    return "\n".join(lines)


def main(first: int = 0, count: int = 1000) -> None:
    """Print what is off, and the table."""
    found: list[Checked] = []
    with TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            for each in check(seed, Path(folder)):
                found.append(each)
                for error in each.errors:
                    if error.off:
                        print(
                            f"off: {each.kind}, {each.subject} (seed {seed}) {error.path}: {error.result} by "
                            f"{error.size:.1e} (reference: {error.doubt:.0e})", flush=True,
                        )  # fmt: skip
    print(table(found))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
