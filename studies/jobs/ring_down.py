"""`vanedamp ringdown`: free motion after a steady excitation, a hammer blow or a static pull."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.transients.ring_down import ring_down
from vanedamp.coupling.transients.ring_down_record import RingDown
from vanedamp.coupling.transients.ring_down_start import free_scene, table_of
from vanedamp.studies.headline import without_round_off
from vanedamp.studies.hot_spots import plus_minus, strength_lines
from vanedamp.studies.jobs.budget import check_run
from vanedamp.studies.jobs.job import JobResult, Means, SceneJob, choice_notes
from vanedamp.studies.references import ReferenceNames, reference_names
from vanedamp.studies.scene_checks import check_numbers

#: rows of the table that is printed
_ROWS = 10


@dataclass(frozen=True)
class RingDownJob(SceneJob):
    """Lets a scene ring down."""

    TITLE: ClassVar[str] = "ringdown"

    @classmethod
    def check_scene(cls, scene: Scene, source: str) -> None:
        """Raise InputError for a scene without [ring_down]; no other excitation is required."""
        check_numbers(scene, source)
        table_of(scene)

    def check(self, workers: int) -> None:
        """Reject a ring-down, or a run before it, that takes a month."""
        table = table_of(self.of)
        check_run(free_scene(self.of, table))
        if table.start == "steady":
            check_run(self.of)

    def work(self, means: Means) -> JobResult:
        """Let it ring down."""
        result = ring_down(self.of, means.report, means.provenance)
        linear, notes = result.linear, tuple(choice_notes(result.estimate, result.advice))
        sentence = f"mode {linear.mode}, {linear.frequency:.6g} Hz: {len(result.half_cycles.time)} half cycles"
        return JobResult(result, lambda _: _summary(result), sentence, notes, result.warnings)


def _summary(result: RingDown) -> Iterator[str]:
    """Yield the linear mode, and frequency and damping at some amplitudes."""
    linear, half, cycles = result.linear, result.half_cycles, result.cycles
    yield (
        f"mode {linear.mode}: {linear.frequency:.6g} Hz, damping ratio {linear.damping_ratio:.6g}; "
        f"{(reference_names(result.scene) or ReferenceNames()).fixed}: "
        f"{linear.fixed_frequency:.6g} Hz, {linear.fixed_damping_ratio:.6g}"
    )
    yield f"status {result.status.value}: {len(half.time)} half cycles, {result.impacts.sum()} impacts"
    if len(cycles.time):
        yield f"{'time, s':>12} {'amplitude, m':>14} {'frequency, Hz':>14} {'damping ratio':>14} {'by energy':>12}"
    for k in range(0, len(cycles.time), max(-(-len(cycles.time) // _ROWS), 1)):
        frequency = result.table.cycles / (result.time[k + 2 * result.table.cycles] - result.time[k])
        yield (
            f"{cycles.time[k]:12.6g} {cycles.amplitude[k]:14.6g} {frequency:14.8g} {cycles.damping_ratio[k]:14.6g} "
            f"{cycles.damping_ratio_energy[k]:12.6g}"
        )
    if result.stress is not None:
        begin, end = 1e-6 * result.stress[[0, -1], :, MEASURES.index("von_mises")]
        for (spot, facts), first, last in zip(result.provenance["hot_spots"].items(), begin, end, strict=True):
            yield (
                f"{spot}: amplitude of von Mises stress {first:.4g} MPa in the first period, {last:.4g} in the last"
                f"{plus_minus(facts.get('error'))}"
            )
    for quantity, value in (entry for entry in result.numbers if entry[0].limited):
        yield f"{quantity.name}: {value:.4g} {quantity.unit} ({quantity.about})"
    yield from strength_lines(result.strength)
    if result.rest_time is not None:
        position = without_round_off(float(result.displacement[-1]), float(abs(result.displacement).max()))
        yield f"at rest from {result.rest_time:.6g} s on, at {position:.6g} m"
