"""`vanedamp calibrate`: a case fitted to measurements."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from vanedamp.studies.case.calibrated_files import save_rigid_scene, save_tuned_case
from vanedamp.studies.case.calibration import calibrate
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.messages import cavity_lines, write_result
from vanedamp.studies.hot_spots import plus_minus


def run(arguments: Namespace, case: Case) -> None:
    """Update the model, and find damping, rigid model and excitation."""
    calibration = calibrate(case, arguments.checkpoint)
    result = calibration.to_json()
    write_result(
        arguments, result, _summary(result), calibration.warnings, output=calibration.record.save,
        case=partial(save_tuned_case, arguments.input, calibration),
        scene=partial(save_rigid_scene, arguments.input, calibration),
    )  # fmt: skip


def _summary(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield what was tuned, the rigid model and the excitation."""
    tuning = result["tuning"]
    if tuning:
        yield "target/Hz      before         after          MAC"
        rows = zip(tuning["target_hz"], tuning["before_hz"], tuning["after_hz"], tuning["mac_after"], strict=True)
        for target, before, after, mac in rows:
            yield (
                f"{target:9.2f}  {before:9.2f} ({before / target - 1:+.2%})  {after:9.2f} ({after / target - 1:+.2%})  "
                f"{mac:.3f}"
            )
        for name, factor in tuning["factor"].items():
            yield f"{name}: times {factor:.5g} (+- {tuning['deviation'][name]:.1%} for 0.1 % of the frequencies)"
    rigid, damping, excitation = result["rigid"], result["damping"], result["excitation"]
    deviation = f" +- {damping['deviation']:.1g}" if "deviation" in damping else ""
    if "reading" in damping:
        yield f"read {damping['reading']}"
    yield f"damping ratio: {damping['ratio']:.4g}{deviation}, from the {damping['source']}"
    yield (
        f"rigid model at {rigid['at']}: {rigid['frequency_hz']:.2f} Hz, mass {rigid['mass']:.5g} kg, "
        f"stiffness {rigid['stiffness']:.5g} N/m, damping {rigid['damping']:.4g} N s/m"
        + ("" if rigid["base_mass"] is None else f", base mass {rigid['base_mass']:.5g} kg")
    )
    yield from cavity_lines(result)
    if excitation:
        spot = excitation["hot_spot"]
        place = ", ".join(f"{value:.4g}" for value in spot["coordinates"])
        yield (
            f"{excitation['share']:.0%} of the fatigue strength at {excitation['amplitude']:.4g} m"
            f"{plus_minus(spot['error'])}, force {excitation['force']:.4g} N at resonance; hot spot at "
            f"({place}) m in {spot['group']}"
        )
