"""Derivatives of random scenes of every kind by all of their numbers, against differences of the engine.

    .venv/bin/python -m tests.tools.sensitivities [FIRST [COUNT]]

Each seed is a scene of one of the kinds, in turn (sensitive_scenes): its run of two periods from its own start, and, if
100 periods end in a motion that repeats after at most 4, that orbit. Of an orbit the differences move the start along
with the number by the derivative to be checked: the end must move by the same, and all other results as they should.
Errors are relative to derivatives, or to sizes of results over those of numbers. Printed are what is off by more
than 1e-7 with the status "ok", with the error that the differences may have, and a table by kinds: subjects, those
with a derivative, derivatives compared, the largest error, and those without a reference (another sequence of events
on one side however near, a number at a bound).
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.sensitivity.sensitivity_record import Sensitivity

from tests.tools.differences import ENERGIES, FIGURES, Difference, by_number
from tests.tools.sensitive_scenes import KINDS, numbers_of, scene_of
from vanedamp.coupling.orbits.newton import Orbit, OrbitStatus
from vanedamp.coupling.orbits.orbits import find_orbit
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

#: error that is none; estimates of the differences' errors count so many times
OFF, DOUBT = 1e-7, 20.0
#: periods of a run from its own start; the most of an orbit
RUN, LONGEST = 2, 4


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
    """What was found of a scene's run or orbit: status, error by number, numbers without a reference."""

    kind: str
    subject: str
    status: str
    note: str = ""
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
    return [each for each in (_of_run(kind, scene), _of_orbit(kind, scene)) if each is not None]


def _of_run(kind: str, scene: Scene) -> Checked | None:
    short = scene.replace({"time": {"periods": RUN, "transient": 0}})
    try:
        return _checked(kind, "run", short, short, RUN)
    except InputError:
        return None


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
    if orbit.status is not OrbitStatus.OK:
        return None
    return _checked(kind, "orbit", _at_rest(walked.scene), orbit, int(periods))


def _at_rest(scene: Scene) -> Scene:
    """Return a scene whose own start leaves room to change its numbers."""
    keys = ("position", "velocity", "lift", "tilt", "lift_velocity", "tilt_rate")
    values = {f"damper.{i}.{key}": 0.0 for i, _ in enumerate(scene.damper) for key in keys}
    return scene.replace(values)


def _checked(kind: str, subject: str, scene: Scene, given: Orbit | Scene, periods: int) -> Checked:
    numbers = numbers_of(scene, subject == "run")
    found = sensitivity(given, list(numbers))
    checked = Checked(kind, subject, str(found.status), found.note)
    if checked.status != "ok":
        return checked
    for j, (path, (value, size)) in enumerate(numbers.items()):
        walked = period_map(scene, path, periods)
        state, way = (found.state, found.state_derivative[:, j]) if subject == "orbit" else (None, None)
        reference = by_number(scene, walked, path, size, value, state, way, periods)
        if reference is None or not reference.same:
            checked.unknown.append(path)
            continue
        checked.errors.append(_error(found, j, reference, path))
    return checked


def claimed(found: Sensitivity, j: int) -> dict[str, np.ndarray]:
    """Return the derivatives by a number, by the names of the differences."""
    names = (*FIGURES, *(f"energy.{name}" for name in ENERGIES))
    return {
        "state": found.state_derivative[:, j], "peak": found.peak_derivative[:, j],
        "impact_time": found.impact_time_derivative[:, j],
        "impact_speed": np.sign(found.impact_speed) * found.impact_speed_derivative[:, j],
        **{name: found.derivatives[name][[j]] for name in names if name in found.derivatives},
    }  # fmt: skip


def _error(found: Sensitivity, j: int, reference: Difference, path: str) -> Error:
    worst, base = Error(0.0, path, "", 0.0), reference.base.results
    ours = _in_time(found.impact_time, found.impact_speed)
    theirs = _in_time(base["impact_time"], base["impact_speed"])
    for name, claim in claimed(found, j).items():
        exact = reference.derivative[name]
        if name.startswith("impact") and len(ours) == len(theirs):
            claim, exact = claim[ours], exact[theirs]
        if not exact.size or np.isnan(exact).all():
            continue
        error = np.inf
        if claim.shape == exact.shape and not np.isnan(claim).any():
            error = float(np.abs((claim - exact) / reference.relative[name]).max())
        each = Error(error, path, name, reference.error[name])
        if each.size - DOUBT * each.doubt > worst.size - DOUBT * worst.doubt:
            worst = each
    return worst


def _in_time(time: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the order of impacts by their times, of those at one instant by their speeds."""
    longest = np.abs(time).max(initial=0.0) or 1.0
    return np.lexsort((np.abs(speed), np.round(time / longest, 10)))


def table(found: list[Checked]) -> str:
    """Return counts and largest errors by kinds."""
    lines = [f"{'':22}{'subjects':>10}{'ok':>8}{'compared':>10}{'largest':>10}{'unknown':>10}  others"]
    for kind in KINDS:
        of_kind = [each for each in found if each.kind == kind]
        ok = [each for each in of_kind if each.status == "ok"]
        worst, others = max((each.worst for each in ok), default=0.0), Counter(each.status for each in of_kind)
        del others["ok"]
        compared, unknown = sum(len(each.errors) for each in ok), sum(len(each.unknown) for each in ok)
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
