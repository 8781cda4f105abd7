"""The claims that the demonstration tests: rules on results, in our own words.

Where a claim holds in part or not, `why` names the cause in the model. Amplitudes are relative to the undamped
maximum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.report.claims import Claim

Curves = Mapping[str, list[DampedCurve]]
#: reductions that differ by less are the same
_SLACK = 0.02
SHOWN, PARTLY, NOT_SHOWN = "shown", "partly", "not shown"


def claim(said: str, ours: str, word: str, why: str = "", figures: Mapping[str, float | None] | None = None) -> Claim:
    """Return a claim of the paper, the finding here, and plain numbers."""
    plain = {name: None if value is None else float(value) for name, value in (figures or {}).items()}
    if word != SHOWN and not why:
        why = "The figures lie outside of what counts as shown here."
    return Claim(said, ours, word, why, dict(plain))


def verdict(shown: bool | np.bool_, partly: bool | np.bool_ = False) -> str:
    """Return the word for a claim that holds, holds in part or does not."""
    return SHOWN if shown else PARTLY if partly else NOT_SHOWN


def fig9(curves: Curves) -> list[Claim]:
    """Judge gaps: reference, reference/2, reference/10."""
    gaps = dict(zip(("reference", "reference/2", "reference/10"), curves[""], strict=True))
    peaks = {name: curve.peak() for name, curve in gaps.items()}
    tops = {name: float(curve.largest.max()) for name, curve in gaps.items()}
    half = gaps["reference/2"]
    smooth = float(half.smooth.max())
    touched = half.impacts > 0
    irregular = float(np.mean(~half.periodic[touched]))
    heights = [peak.height for peak in peaks.values()]
    return [
        claim(
            "At reference/2 the bodies take about half of the amplitude away, averaged.",
            f"highest mean {peaks['reference/2']}, smoothed {smooth:.3f}: {1 - smooth:.0%} gained",
            verdict(0.4 <= 1 - smooth <= 0.6, 0.3 <= 1 - smooth <= 0.7),
            figures={"peak_mean": peaks["reference/2"].height, "peak_smoothed": smooth, "peak_max": tops["reference/2"],
                     "reduction": 1 - smooth, "confidence": peaks["reference/2"].confidence},
        ),
        claim(
            "The gap decides how much is gained.",
            "highest means (maxima): "
            + ", ".join(f"{name} {peaks[name].height:.3f} ({tops[name]:.3f})" for name in gaps),
            verdict(max(heights) - min(heights) > 0.2),
            "The widest gap leaves the least: its body is not touched below half an amplitude, and above it the "
            "impacts keep the response far below the resonance. A tenth of it comes close to the curve of the fixed "
            "body.",
            {f"peak_{name}": peak.height for name, peak in peaks.items()},
        ),
        claim(
            "Damped curves scatter from point to point, since responses with impacts need not be periodic.",
            f"reference/2: {irregular:.0%} of the {touched.sum()} points with impacts are not periodic; rms scatter "
            f"of the maxima {half.scatter['largest']:.4f}, of the means {half.scatter['mean']:.4f}",
            verdict(irregular > 0.5, irregular > 0.1),
            figures={"non_periodic": irregular}
            | {f"scatter_{name}": value for name, value in half.scatter.items()},
        ),
    ]  # fmt: skip


def fig10(curves: Curves) -> list[Claim]:
    """Judge one body against two."""
    kinds = ("single", "separate", "shared")
    reductions = {name: 1 - float(curves[name][0].smooth.max()) for name in kinds}
    peaks = {name: curves[name][0].peak() for name in kinds}
    figures = {f"reduction_{name}": value for name, value in reductions.items()}
    figures |= {f"peak_{name}": peak.height for name, peak in peaks.items()}
    text = ", ".join(f"{name} {value:.1%} gained" for name, value in reductions.items())
    like_single = reductions["separate"] >= reductions["single"] - _SLACK
    return [
        claim(
            "Two halves in cavities of their own damp no worse than the single body of the same mass.",
            f"reductions of the smoothed means: {text}",
            verdict(like_single),
            "On one mode, halves with equal gaps see the same wall motion and do what the whole body does.",
            figures,
        ),
        claim(
            "Two bodies in cavities of their own damp no worse than in one cavity together.",
            f"reductions: {text}; highest means: separate {peaks['separate']}, shared {peaks['shared']}",
            verdict(reductions["separate"] >= reductions["shared"] - _SLACK, like_single),
            "In one cavity the halves have two steady states near their peak: they move together and damp like the "
            "single body, or lose energy to each other as well and damp better (fig14).",
            figures,
        ),
    ]


def fig12(curves: Curves) -> list[Claim]:
    """Judge undamped, damped and fixed curves."""
    reduced, rigid = curves["reduced"][0], curves["rigid"][0]
    return [
        _level(reduced, rigid),
        onset(reduced),
        drop(reduced),
        resonance_shift(reduced),
        _scatter(reduced, rigid),
    ]


def _level(reduced: DampedCurve, rigid: DampedCurve) -> Claim:
    top, rigid_top = reduced.peak(), rigid.peak()
    return claim(
        "The averaged amplitudes of both models agree, at about half of the maximum without bodies.",
        f"highest means: reduced model {top}, rigid model {rigid_top}",
        verdict(
            abs(top.height - rigid_top.height) < 0.1 and 0.35 < top.height < 0.6,
            abs(top.height - rigid_top.height) < 0.2,
        ),
        figures={"reduced": top.height, "rigid": rigid_top.height, "confidence": top.confidence},
    )


def onset(curve: DampedCurve) -> Claim:
    onsets = [_onset(start, single) for start, single in curve.each or (("", curve),)]
    shown = [apart < 0.01 and points > 5 for _, apart, points in onsets]
    return claim(
        "Up to an onset the damped curve is the one without bodies.",
        "; ".join(text for text, _, _ in onsets),
        verdict(all(shown), any(shown)),
        "The runs begin at rest: their transient brings the body to the walls, and it goes on flying. A motion that "
        "grows slowly hits only from amplitudes of about half of the gap on. A body that hits as the frequency goes "
        "down goes on hitting below the onset.",
        {"onset_hz": (curve.each[0][1] if curve.each else curve).onset, "difference": onsets[0][1]},
    )


def _onset(start: str, curve: DampedCurve) -> tuple[str, float, int]:
    """Return an onset in words, and by how much the curves differ below it, over how many points."""
    below = curve.frequency < curve.onset
    of = f"{start}: " if start else ""
    if not below.any():
        return f"{of}the curves differ from the lowest frequency on, {curve.frequency[0]:.1f} Hz", math.inf, 0
    apart, at = float(np.max(np.abs(curve.mean / curve.undamped - 1)[below])), int(np.argmax(~below))
    onset = f"onset between {curve.frequency[max(at - 1, 0)]:.1f} and {curve.onset:.1f} Hz"
    return (
        f"{of}{onset}; below it the curves differ by at most {apart:.2%} over {below.sum()} points",
        apart,
        below.sum(),
    )


def drop(curve: DampedCurve) -> Claim:
    above = (curve.frequency > curve.peak().frequency) & curve.touched
    ratio = curve.smooth[above] / curve.fixed[above]
    low, median, high = (float(np.quantile(ratio, share)) for share in (0.0, 0.5, 1.0))
    at = curve.peak(curve.undamped).index
    level, fixed = float(curve.mean[at]), float(curve.fixed[at])
    return claim(
        "Above its peak the damped curve drops to that of the fixed body.",
        f"at the undamped resonance {level:.3f} is left (fixed body: {fixed:.3f}); above the peak, wherever the body "
        f"is touched, the smoothed mean is {low:.2f} to {high:.2f} times the fixed curve, in the median {median:.2f}",
        verdict(0.9 < median < 1.1 and high < 1.2, median < 1.1),
        "It drops through the fixed curve: the impacts not only attach mass, they take energy as well, the more the "
        "wider the gap (reference/10 stays close to the fixed curve). Farther up they end, and a body at rest in "
        "the middle leaves the curve without bodies.",
        {"at_resonance": level, "ratio_low": low, "ratio_median": median, "ratio_high": high},
    )


def resonance_shift(curve: DampedCurve) -> Claim:
    top, fixed, free = curve.peak(), curve.peak(curve.fixed), curve.peak(curve.undamped)
    attached = float(curve.attached[top.index])
    share = (free.frequency / fixed.frequency) ** 2 - 1  # the body's mass over the structure's, as its floor feels it
    predicted = free.frequency / math.sqrt(1 + attached * share)
    return claim(
        "Impacts move the resonance to that of the cluster with the body fixed (impact mistuning).",
        f"damped peak at {top.frequency:.1f} Hz, fixed at {fixed.frequency:.1f} Hz, undamped at {free.frequency:.1f} "
        f"Hz; the impacts attach {attached:.2f} times the body's mass, which puts the resonance at {predicted:.1f} Hz",
        verdict(
            abs(top.frequency / fixed.frequency - 1) < 0.005 and abs(predicted / top.frequency - 1) < 0.002,
            top.frequency < free.frequency,
        ),
        "At the peak the impacts attach more than the body's mass, so that it lies somewhat below that of the fixed "
        "body.",
        {
            "peak_hz": top.frequency,
            "fixed_hz": fixed.frequency,
            "undamped_hz": free.frequency,
            "attached": attached,
            "predicted_hz": predicted,
        },
    )


def _scatter(reduced: DampedCurve, rigid: DampedCurve) -> Claim:
    mine, other = reduced.scatter, rigid.scatter
    return claim(
        "Averages of the reduced model scatter less than maxima of the rigid model.",
        f"rms distance from the smoothed curve: averages of the reduced model {mine['mean']:.4f}, maxima of the "
        f"rigid model {other['largest']:.4f}; the other way round {other['mean']:.4f} and {mine['largest']:.4f}",
        verdict(mine["mean"] < other["largest"]),
        "Most of it is the averaging: it calms the rigid model alike.",
        {"reduced_mean": mine["mean"], "reduced_max": mine["largest"], "rigid_mean": other["mean"],
         "rigid_max": other["largest"]},
    )  # fmt: skip
