"""A damped curve versus frequency, evaluated for claims: smoothed means, maxima, scatter, onset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.studies.report.forced_response import ForcedResponse, forced_responses

#: standard deviation of the smoothing, in points: frequencies are denser where the curves are steeper
_SMOOTHING = 1.5
#: below this relative difference from the curve without bodies, bodies count as not involved
_UNTOUCHED = 0.01


@dataclass(frozen=True, eq=False)
class CurvePeak:
    """Peak of a curve: frequency (Hz), height over the undamped maximum with 95 % confidence, index of the point.

    start: of the run there, in words, where there were several.
    """

    frequency: float
    height: float
    confidence: float
    index: int
    start: str = ""

    def __str__(self) -> str:
        start = f" {self.start}" if self.start else ""
        return f"{self.height:.3f} ± {self.confidence:.3f} at {self.frequency:.1f} Hz{start}"


@dataclass(frozen=True, eq=False)
class DampedCurve:
    """Arrays (n,) over ascending frequencies (Hz); amplitudes relative to the maximum without bodies X.

    X (m, `reference`) is the resonance's, as the paper has it, whether or not the frequencies reach it; where the scene
    names no level of a resonance, the maximum without bodies over the frequencies.

    largest, mean, confidence  absolute maxima, means of the periods' peaks, half widths of their 95 % confidence
                               intervals (0 where there are too few periods)
    harmonic                   amplitudes at the excitation's frequency, without the offset by a body that leans on a
                               wall
    undamped, fixed            linear curves without bodies and with all fixed
    attached, impacts          attached mass fraction and impacts per period
    periodic                   whether the response repeats
    starts                     of the runs, in words; empty for a single start
    each                       the curves of all starts by these words, if this is the worst of them; else empty
    """

    name: str
    frequency: np.ndarray
    largest: np.ndarray
    mean: np.ndarray
    confidence: np.ndarray
    harmonic: np.ndarray
    undamped: np.ndarray
    fixed: np.ndarray
    attached: np.ndarray
    impacts: np.ndarray
    periodic: np.ndarray
    reference: float
    starts: tuple[str, ...] = ()
    each: tuple[tuple[str, DampedCurve], ...] = ()

    @property
    def smooth(self) -> np.ndarray:
        """The means, smoothed over neighbouring frequencies."""
        return np.asarray(gaussian_filter1d(self.mean, _SMOOTHING, mode="nearest"))

    @property
    def touched(self) -> np.ndarray:
        """Where the bodies hit something, or at least change the response by 1 %."""
        return (self.impacts > 0) | self._changed

    @property
    def onset(self) -> float:
        """The first frequency at which the bodies change the mean by 1 %; nan if they never do."""
        changed = np.flatnonzero(self._changed)
        return float(self.frequency[changed[0]]) if changed.size else float("nan")

    @property
    def _changed(self) -> np.ndarray:
        return np.abs(self.mean - self.undamped) > _UNTOUCHED * self.undamped

    @property
    def scatter(self) -> dict[str, float]:
        """Root mean square distance of maxima and means from their smoothed curves at points with impacts."""
        hit = self.impacts > 0
        if not hit.any():
            return {"largest": 0.0, "mean": 0.0}
        curves = {"largest": self.largest, "mean": self.mean}
        distance = {name: values - gaussian_filter1d(values, _SMOOTHING) for name, values in curves.items()}
        return {name: float(np.sqrt(np.mean(values[hit] ** 2))) for name, values in distance.items()}

    def peak(self, values: np.ndarray | None = None) -> CurvePeak:
        """Return the peak of a curve (n,), by default of the means."""
        values = self.mean if values is None else values
        top = int(np.argmax(values))
        start = self.starts[top] if self.starts else ""
        return CurvePeak(float(self.frequency[top]), float(values[top]), float(self.confidence[top]), top, start)


def curves(sweep: Sweep, name: str) -> list[DampedCurve]:
    """Return a curve for every combination of the axes before the last, the frequency; without points not ok.

    Along an engine order the last axis is the speed, and the frequency the excitation's.
    """
    responses = forced_responses(sweep, name)
    measures = (sweep.amplitude_mean_confidence, sweep.amplitude_harmonic, sweep.classification)
    confidence, harmonic, kinds = (values.reshape(len(responses), -1) for values in measures)
    unit = sweep.scene.excitation.resonance_amplitude
    return [
        _curve(response, confidence[row], harmonic[row], kinds[row], unit or response.reference)
        for row, response in enumerate(responses)
    ]


def worst_of(curves: Sequence[DampedCurve], words: Sequence[str]) -> DampedCurve:
    """Return the curve that has, at each frequency, the run with the highest mean, and the largest amplitude of all.

    words: how the runs of each curve begin. A frequency at which no run is ok is left out.
    """
    frequency = np.unique(np.concatenate([curve.frequency for curve in curves]))
    shown = [np.isin(frequency, curve.frequency) for curve in curves]
    whole: dict[str, np.ndarray] = {}
    for name in (item.name for item in fields(DampedCurve) if isinstance(getattr(curves[0], item.name), np.ndarray)):
        whole[name] = np.full((len(curves), len(frequency)), -np.inf if name in ("mean", "largest") else 0.0)
        for row, (curve, at) in enumerate(zip(curves, shown, strict=True)):
            whole[name][row, at] = getattr(curve, name)
    worst = whole["mean"].argmax(axis=0)
    arrays = {name: values[worst, np.arange(len(frequency))] for name, values in whole.items()}
    arrays |= {"largest": whole["largest"].max(axis=0), "periodic": arrays["periodic"] == 1.0}
    return replace(
        curves[0], **arrays, starts=tuple(words[row] for row in worst), each=tuple(zip(words, curves, strict=True))
    )


def _curve(
    response: ForcedResponse, confidence: np.ndarray, harmonic: np.ndarray, classification: np.ndarray, unit: float
) -> DampedCurve:
    done = np.isfinite(response.damped_mean)

    def relative(values: np.ndarray) -> np.ndarray:
        return np.nan_to_num(values[done] / unit)

    return DampedCurve(
        name=response.name,
        frequency=response.hertz * response.x[done],
        largest=relative(response.damped_max),
        mean=relative(response.damped_mean),
        confidence=relative(confidence),
        harmonic=relative(harmonic),
        undamped=relative(response.undamped),
        fixed=relative(response.fixed),
        attached=response.attached_mass_fraction[done],
        impacts=response.impacts_per_period[done],
        periodic=classification[done] != "non-periodic",
        reference=unit,
    )
