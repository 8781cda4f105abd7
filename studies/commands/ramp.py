"""`vanedamp ramp`: run-up and run-down through resonance."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.transients.ramp import ramp
from vanedamp.coupling.transients.ramp_course import ramped
from vanedamp.coupling.transients.ramp_record import Ramp
from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.messages import write_timed
from vanedamp.studies.commands.support.scenes import print_resonance
from vanedamp.studies.hot_spots import plus_minus, strength_lines
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress


def run(arguments: Namespace, scene: Scene) -> None:
    """Run the scene up and down."""
    resonance = print_resonance(arguments.input, ramped(scene))
    started = time.perf_counter()
    compile_engine([ramped(scene)])
    with progress("ramp") as report:
        result = ramp(scene, report, {"versions": versions()}, arguments.checkpoint)
    write_timed(arguments, result, started, _summary, result.warnings, resonance)


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
        for one, largest, mean in run.limits:
            yield f"{'':18} {one.name}: at most {largest:.4g} {one.unit}, mean {mean:.4g} {one.unit} ({one.about})"
        for spot, of in result.tops_of_stress(run).items():
            error = plus_minus(result.provenance["hot_spots"][spot].get("error"))
            yield f"{'':18} {spot}: largest amplitude of von Mises stress {of['von_mises'] / 1e6:.4g} MPa{error}"
        yield from strength_lines(result.strength(run))
    tops = result.tops
    for name, what in (("undamped", "without bodies"), ("fixed", "bodies fixed")):
        yield f"steady state, {what}: {tops[f'{name}_peak']:.5g} m at {tops[f'{name}_peak_frequency']:.6g} Hz"
    yield f"{sum(len(run.time) for run in result.runs)} periods in {seconds:.1f} s"
