"""`vanedamp calibrate`: a case fitted to measurements."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from functools import partial
from typing import Any

from vanedamp.studies.case.calibrated_files import save_calibration
from vanedamp.studies.case.calibration import calibrate
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.messages import print_cavities, print_warnings, write_result


def run(arguments: Namespace, case: Case) -> None:
    """Update the model, and find damping, rigid model and excitation."""
    calibration = calibrate(case)
    result = calibration.to_json()
    files = partial(
        save_calibration, arguments.input, calibration, arguments.output, arguments.case, arguments.scene
    )  # fmt: skip
    write_result(arguments.json, result, files)
    print_warnings(arguments.input, calibration.warnings)
    if arguments.json != "-":
        _print_summary(result)


def _print_summary(result: Mapping[str, Any]) -> None:
    """Print what was tuned, the rigid model and the excitation."""
    tuning = result["tuning"]
    if tuning:
        print("target/Hz      before         after          MAC")
        rows = zip(tuning["target_hz"], tuning["before_hz"], tuning["after_hz"], tuning["mac_after"], strict=True)
        for target, before, after, mac in rows:
            print(
                f"{target:9.2f}  {before:9.2f} ({before / target - 1:+.2%})  {after:9.2f} ({after / target - 1:+.2%})  "
                f"{mac:.3f}"
            )
        for name, factor in tuning["factor"].items():
            print(f"{name}: times {factor:.5g} (+- {tuning['deviation'][name]:.1%} for 0.1 % of the frequencies)")
    rigid, damping, excitation = result["rigid"], result["damping"], result["excitation"]
    deviation = f" +- {damping['deviation']:.1g}" if "deviation" in damping else ""
    print(f"damping ratio: {damping['ratio']:.4g}{deviation}, from the {damping['source']}")
    print(
        f"rigid model at {rigid['at']}: {rigid['frequency_hz']:.2f} Hz, mass {rigid['mass']:.5g} kg, "
        f"stiffness {rigid['stiffness']:.5g} N/m, damping {rigid['damping']:.4g} N s/m"
        + ("" if rigid["base_mass"] is None else f", base mass {rigid['base_mass']:.5g} kg")
    )
    print_cavities(result)
    if excitation:
        spot = excitation["hot_spot"]
        place = ", ".join(f"{value:.4g}" for value in spot["coordinates"])
        print(
            f"{excitation['share']:.0%} of the fatigue strength at {excitation['amplitude']:.4g} m, force "
            f"{excitation['force']:.4g} N at resonance; hot spot at ({place}) m in {spot['group']}"
        )
