"""`vanedamp run`: one scene at one excitation frequency."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from vanedamp.coupling.exponents.lyapunov import lyapunov
from vanedamp.coupling.response.response import Response, Status, units
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.reference import field_docstrings
from vanedamp.files.toml_input import InputError
from vanedamp.studies.headline import without_round_off
from vanedamp.studies.jobs.budget import check_run
from vanedamp.studies.jobs.job import Job, JobResult, Means, SceneJob, choice_notes
from vanedamp.studies.terminal import progress


@dataclass(frozen=True)
class RunJob(SceneJob):
    """Runs a scene.

    events: keep the list of events; samples: per period that are kept; exponents: periods of Lyapunov exponents;
    moved_start: compare with a second run that starts with bodies slightly displaced.
    """

    events: bool = False
    samples: int = 0
    exponents: int | None = None
    moved_start: bool = True
    TITLE: ClassVar[str] = "run"

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Return the job of a scene, or of all samples of its ranges. Raises InputError for options of a single run."""
        (scene,) = inputs
        if not scene.ranges:
            moved = not arguments.no_moved_start
            return cls(arguments.input, scene, arguments.events, arguments.samples, arguments.exponents, moved)
        # loads pools of processes, which a single run does not use
        from vanedamp.studies.jobs.ensemble import EnsembleJob

        for option in ("events", "samples", "exponents"):
            if getattr(arguments, option):
                raise InputError(
                    f"--{option}: is for a scene without ranges; leave it out, or give numbers in their place"
                )
        return EnsembleJob(arguments.input, replace(scene, sweep={}))

    def check(self, workers: int) -> None:
        """Reject a run that takes a month, or more memory than there is."""
        check_run(self.of, self.samples)

    def work(self, means: Means) -> JobResult:
        """Run it."""
        response = simulate(
            self.of, self.events, self.samples, progress=means.report, moved_start=self.moved_start
        )  # fmt: skip
        if self.exponents is not None:
            response = replace(response, lyapunov=_exponents(self.of, self.exponents, response))
        result = response.to_json(events=self.events)

        def save(path: str) -> None:
            response.save(path, means.provenance | {"scene": self.of.to_dict()})

        return JobResult(
            response, lambda _: _summary(response, result), f"amplitude {response.amplitude_mean:.5g} m",
            tuple(choice_notes(response.estimate, response.advice)), response.warnings, {"output": save}, result,
        )  # fmt: skip


def _summary(response: Response, result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the results of a run, with stresses, exponents, sectors, contacts and wear, and last a status not ok."""
    of = units()
    for name, value in result.items():
        if not isinstance(value, dict | list):
            scale = response.amplitude_max if of.get(name) == "m" else 1.0
            yield f"{name:26} {_format(value, scale)} {of.get(name, '')}".rstrip()
    yield from (f"{'stress':26} {spot.sentence}" for spot in response.stress or ())
    if (facts := response.lyapunov) is not None:
        yield (
            f"{'motion':26} {facts['motion']}: largest exponent {facts['exponent']:.4g} +- {facts['confidence']:.2g} "
            f"1/s, {facts['exponent_per_period']:.4g} per period ({facts['status']}, {facts['periods']} periods)"
        )
    if response.sectors is not None:
        yield f"{'sectors':26} {response.sectors.sentence}"
    yield from (f"{'contact':26} {contact.sentence}" for contact in response.contacts or ())
    for wear in response.wear or ():
        if wear.volume_rate:
            depth = "" if wear.depth_rate is None else f", {1e9 * wear.depth_rate:.4g} nm/h"
            yield f"{'wear':26} {wear.name}: {wear.volume_rate:.4g} m^3/h{depth}, work rate {wear.work_rate:.4g} W"
    yield from (f"{'friction':26} {contact.sentence}" for contact in response.contact_friction or ())
    if response.status is not Status.OK:  # last, where a reader looks
        yield f"status {response.status}: {field_docstrings(Status)[response.status.name]}"


def _exponents(scene: Scene, periods: int, response: Response) -> dict[str, Any]:
    """Return the Lyapunov exponents of the motion from the end of a run. Raises InputError for one that ended early."""
    if response.final is None:
        raise InputError(f"--exponents: the run ends early ({response.status}); leave the option out")
    with progress("exponents") as report:
        return lyapunov(scene, periods, response.final, report).to_json()


def _format(value: Any, scale: float) -> str:
    return f"{without_round_off(value, scale):.6g}" if isinstance(value, float) else str(value)
