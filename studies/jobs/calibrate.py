"""`vanedamp calibrate`: a case fitted to measurements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from vanedamp.studies.case.calibrated_files import save_rigid_scene, save_tuned_case
from vanedamp.studies.case.calibration import Calibration, calibrate
from vanedamp.studies.headline import cavity_lines
from vanedamp.studies.hot_spots import plus_minus
from vanedamp.studies.jobs.case import CaseJob
from vanedamp.studies.jobs.job import JobResult, Means, Write


@dataclass(frozen=True)
class CalibrateJob(CaseJob):
    """Updates the model of a case, and finds damping, rigid model and excitation."""

    TITLE: ClassVar[str] = "calibrate"

    def work(self, means: Means) -> JobResult:
        """Calibrate."""
        calibration = calibrate(self.case, means.checkpoint)
        result = calibration.to_json()
        files: dict[str, Write] = {
            "case": partial(save_tuned_case, self.source, calibration),
            "scene": partial(save_rigid_scene, self.source, calibration),
        }
        return JobResult(
            calibration, lambda _: _summary(result), _sentence(calibration), (), calibration.warnings, files
        )


def _sentence(calibration: Calibration) -> str:
    """Return frequency, damping and factors of the tuned numbers."""
    rigid, factors = calibration.rigid, ""
    if calibration.tuning is not None:
        pairs = zip(calibration.tuning.names, calibration.tuning.factors.tolist(), strict=True)
        factors = "; " + ", ".join(f"{name} times {factor:.4g}" for name, factor in pairs)
    return f"{rigid.frequency_hz:.6g} Hz, damping ratio {rigid.damping_ratio:.4g}{factors}"


def _summary(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tuned parameters, the rigid model and the excitation."""
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
        position = ", ".join(f"{value:.4g}" for value in spot["coordinates"])
        yield (
            f"{excitation['share']:.0%} of the fatigue strength at {excitation['amplitude']:.4g} m"
            f"{plus_minus(spot['error'])}, force {excitation['force']:.4g} N at resonance; hot spot at "
            f"({position}) m in {spot['group']}"
        )
