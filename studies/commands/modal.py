"""`vanedamp modal`: natural frequencies, effective masses, rigid model of the first bending."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from vanedamp.studies.case.stages import assemble, modal_analysis
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.headline import cavity_lines
from vanedamp.studies.hot_spots import plus_minus


def run(arguments: Namespace, case: Case) -> None:
    """Compute the modes and the results derived from them."""
    if arguments.solver is not None:
        case = replace(case, modes=replace(case.modes, solver=arguments.solver))
    analysis = modal_analysis(assemble(case))
    result = analysis.to_json()
    write_result(arguments, result, _summary(result), analysis.warnings, output=analysis.save)


def _summary(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield modes, effective masses and the rigid model."""
    if "speed" in result:
        yield f"at {result['speed']:.6g} rad/s ({result['speed'] * 30 / math.pi:.6g} rpm)"
    yield "mode  frequency/Hz   effective mass x, y, z / kg        residual"
    rows = zip(result["frequency_hz"], result["effective_mass"], result["residual"], strict=True)
    for index, (frequency, masses, residual) in enumerate(rows):
        mark = "  first bending" if index == result["first_bending"] else ""
        yield (
            f"{index + 1:4}  {frequency:12.2f}   " + "  ".join(f"{m:9.5f}" for m in masses) + f"   {residual:.1e}{mark}"
        )
    rigid = result["rigid"]
    if rigid:
        yield (
            f"rigid model at {rigid['at']}: mass {rigid['mass']:.5g} kg, stiffness {rigid['stiffness']:.5g} N/m, "
            f"damping {rigid['damping']:.4g} N s/m"
        )
        yield from cavity_lines(result)
    if "gyroscopic" in result:
        whirl = result["gyroscopic"]
        yield "with the gyroscopic coupling, in the rotating frame (whirl 1: with the rotation, -1: against it):"
        yield "mode  frequency/Hz      whirl   residual"
        for index, row in enumerate(zip(whirl["frequency_hz"], whirl["whirl"], whirl["residual"], strict=True)):
            yield "{:4}  {:12.2f}   {:8.4f}   {:.1e}".format(index + 1, *row)
    if "fatigue" in result:
        fatigue = result["fatigue"]
        yield (
            f"amplitude at {fatigue['share']:.0%} of the fatigue strength: {fatigue['amplitude']:.4g} m"
            f"{plus_minus(fatigue['error'])}"
        )
