"""What the commands print."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def tell_sweep(result: Any) -> None:
    """Print what a sweep found."""
    from vanedamp.studies.report.forced_response import forced_responses

    for response in forced_responses(result):
        if not response.reference > 0:
            print(f"{response.name}: nothing excites the structure, and there is no undamped maximum to compare with")
            continue
        print(response.sentence)
    bad = [status for status in result.status.ravel() if status != "ok"]
    if bad:
        print(f"{len(bad)} of {result.status.size} points are not ok, such as: {bad[0]}")


def tell_modes(result: Mapping[str, Any]) -> None:
    """Print modes, effective masses and the rigid model."""
    print("mode  frequency/Hz   effective mass x, y, z / kg        residual")
    rows = zip(result["frequency_hz"], result["effective_mass"], result["residual"], strict=True)
    for index, (frequency, masses, residual) in enumerate(rows):
        mark = "  first bending" if index == result["first_bending"] else ""
        print(
            f"{index + 1:4}  {frequency:12.2f}   " + "  ".join(f"{m:9.5f}" for m in masses) + f"   {residual:.1e}{mark}"
        )
    rigid = result["rigid"]
    if rigid:
        print(
            f"rigid model at {rigid['at']}: mass {rigid['mass']:.5g} kg, stiffness {rigid['stiffness']:.5g} N/m, "
            f"damping {rigid['damping']:.4g} N s/m"
        )
    if "fatigue" in result:
        fatigue = result["fatigue"]
        print(f"amplitude at {fatigue['share']:.0%} of the fatigue strength: {fatigue['amplitude']:.4g} m")


def tell_calibration(result: Mapping[str, Any]) -> None:
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
    )
    if excitation:
        spot = excitation["hot_spot"]
        place = ", ".join(f"{value:.4g}" for value in spot["coordinates"])
        print(
            f"{excitation['share']:.0%} of the fatigue strength at {excitation['amplitude']:.4g} m, force "
            f"{excitation['force']:.4g} N at resonance; hot spot at ({place}) m in {spot['group']}"
        )
