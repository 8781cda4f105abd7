"""`vanedamp ramp`: run-up and run-down through resonance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.transients.ramp import ramp
from vanedamp.coupling.transients.ramp_course import ramped
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.studies.hot_spots import plus_minus, strength_lines
from vanedamp.studies.jobs.job import JobResult, Means, SceneJob
from vanedamp.studies.references import ReferenceNames, reference_names


@dataclass(frozen=True)
class RampJob(SceneJob):
    """Runs a scene up and down."""

    TITLE: ClassVar[str] = "ramp"

    @classmethod
    def check_scene(cls, scene: Scene, source: str) -> None:
        """Raise InputError for a scene without [ramp]."""
        super().check_scene(scene, source)
        ramped(scene)

    def compiled(self) -> Iterable[Scene]:
        """Return the scene with a phase of its own, as ramps run it."""
        return (ramped(self.of),)

    def work(self, means: Means) -> JobResult:
        """Run it."""
        result = ramp(self.of, means.report, means.provenance, means.checkpoint)
        return JobResult(result, partial(_summary, result), _sentence(result), warnings=result.warnings)


def _sentence(result: Ramp) -> str:
    """Return the largest peak of all runs."""
    top = max(result.runs, key=lambda run: run.peak)
    return f"largest peak {top.peak:.5g} m at {top.at_peak('frequency'):.6g} Hz, {top.direction}"


def _summary(result: Ramp, seconds: float) -> Iterator[str]:
    """Yield the peak of every run, and its ratio to the steady state without bodies."""
    yield (
        f"{f'rate, {result.table.unit}/s':>18} direction {'peak, m':>12} {'at, Hz':>10} "
        f"{'of the steady-state peak':>24}  status"
    )
    for run in result.runs:
        yield (
            f"{abs(run.rate):18.6g} {run.direction:9} {run.peak:12.5g} {run.at_peak('frequency'):10.6g} "
            f"{result.share(run):24.4f}  {run.status}"
        )
        for item, largest, mean in run.limits:
            yield f"{'':18} {item.name}: at most {largest:.4g} {item.unit}, mean {mean:.4g} {item.unit} ({item.about})"
        for spot, of in result.tops_of_stress(run).items():
            error = plus_minus(result.provenance["hot_spots"][spot].get("error"))
            yield f"{'':18} {spot}: largest amplitude of von Mises stress {of['von_mises'] / 1e6:.4g} MPa{error}"
        yield from strength_lines(result.strength(run))
    tops = result.tops
    names = reference_names(result.scene) or ReferenceNames()
    for name, what in (("undamped", names.undamped), ("fixed", names.fixed)):
        yield f"steady state, {what}: {tops[f'{name}_peak']:.5g} m at {tops[f'{name}_peak_frequency']:.6g} Hz"
    yield f"{sum(len(run.time) for run in result.runs)} periods in {seconds:.1f} s"
