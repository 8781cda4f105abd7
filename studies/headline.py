"""The key results of a damped curve: its peak over that of the curve without bodies, in the same range.

Linear curves are known between the points of a sweep, the damped one only at the points. So the headline reports how
many points are left out, whether the peak lies at an edge of the range, and whether the points are too coarse.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from vanedamp.files.toml_input import plain
from vanedamp.studies.references import ReferenceNames

#: results below this fraction of their scale are round-off
_ROUND_OFF = 1e-12
_NAMES = ReferenceNames()


class _Top(NamedTuple):
    """Maximum of a curve, m, its position on the axis, and whether this is an edge of a range of frequencies."""

    height: float
    at: Any
    at_edge: bool


@dataclass(frozen=True)
class Headline:
    """The results of a damped curve; nan or None for missing ones.

    damped_peak, damped_maximum  m, highest mean of the periods' peaks, and highest absolute maximum
    damped_peak_at               its place on the axis
    undamped_peak, fixed_peak    m, highest amplitudes without bodies and with all fixed, over the same range
    attached_mass_fraction       at the damped peak
    onset                        first position with impacts on walls (of sliders in one cavity, or between them)
    touched_below                first position below it where a body hits only its floor or ceiling, or another body
    peak_at_edge, undamped_at_edge, fixed_at_edge   whether a peak lies at an edge of the frequencies: no resonance's
    spacing, half_power_width    Hz, or units of a speed along an engine order: widest step next to the peaks that are
                                 resonances, and width of the undamped one
    points, points_left_out      of the curve, and how many of them are not ok
    """

    damped_peak: float
    damped_peak_at: Any
    damped_maximum: float
    undamped_peak: float
    undamped_peak_at: Any
    fixed_peak: float
    fixed_peak_at: Any
    attached_mass_fraction: float
    onset: Any
    touched_below: Any
    peak_at_edge: bool
    undamped_at_edge: bool
    fixed_at_edge: bool
    spacing: float
    half_power_width: float
    points: int
    points_left_out: int

    def relative(self, height: float) -> float:
        """Return an amplitude, m, over the maximum without bodies; nan where that is unbounded or zero."""
        return height / self.undamped_peak if 0.0 < self.undamped_peak < math.inf else math.nan

    @property
    def peak_ratio(self) -> float:
        """The damped peak over the undamped one."""
        return self.relative(self.damped_peak)

    @property
    def maximum_ratio(self) -> float:
        """The largest damped amplitude over the undamped peak, which governs high-cycle fatigue."""
        return self.relative(self.damped_maximum)

    @property
    def too_coarse(self) -> bool:
        """Whether a step next to a resonance is wider than the resonance, so that a peak may be missed."""
        return self.spacing > self.half_power_width > 0.0

    @property
    def remarks(self) -> list[str]:
        """Reasons why the ratio does not compare two resonance peaks, along the frequency."""
        return self.remarks_in("Hz")

    def remarks_in(self, units: str, left_out: bool = True, names: ReferenceNames = _NAMES) -> list[str]:
        """Return these reasons; units: of the axis; left_out: points not ok among them; names: of the references."""
        remarks = []
        if self.undamped_at_edge:
            remarks.append(f"no {names.of('resonance')} lies within the range")
        if self.peak_at_edge:
            remarks.append("the damped peak lies at an edge of the range, and may be higher beyond it")
        if self.too_coarse:
            remarks.append(
                f"points {self.spacing:.3g} {units} apart are too coarse for a resonance {self.half_power_width:.3g} "
                f"{units} wide"
            )
        if left_out and self.points_left_out:
            remarks.append(f"{self.points_left_out} of {self.points} points are left out, which are not ok")
        return remarks

    def sentence(
        self, axis: str, units: str, low: Any, high: Any, along_frequency: bool, names: ReferenceNames = _NAMES
    ) -> str:
        """Return the headline for people; low, high: the range along the axis; names: of its references."""
        unit = "" if units == "1" else f" {units}"
        if not math.isfinite(self.damped_peak):
            return f"no damped peak: {self.points_left_out} of {self.points} points are not ok"
        at = f"{axis} = {format_value(self.damped_peak_at)}{unit}"
        if not math.isfinite(self.peak_ratio):
            unbounded = self.undamped_peak == math.inf
            compared = f"that {names.undamped} has no bound" if unbounded else f"none {names.undamped} to compare with"
            text = (
                f"damped peak (mean) {self.damped_peak:.4g} m, at {at}, largest amplitude {self.damped_maximum:.4g} m; "
                f"{compared}"
            )
        elif self.undamped_at_edge or not along_frequency:
            text = (
                f"highest damped mean {self.peak_ratio:.3f}, largest amplitude {self.maximum_ratio:.3f} of the highest "
                f"{names.of('amplitude')} {self.undamped_peak:.4g} m from {format_value(low)} to "
                f"{format_value(high)}{unit}, at {at}"
            )
        else:
            text = (
                f"damped peak (mean) {self.peak_ratio:.3f}, largest amplitude {self.maximum_ratio:.3f} of the "
                f"{names.maximum} {self.undamped_peak:.4g} m, at {at}"
            )
        return "; ".join([text, *self.remarks_in(units, names=names)])

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        ratios = {"peak_ratio": self.peak_ratio, "maximum_ratio": self.maximum_ratio}
        return asdict(self) | ratios | {"too_coarse": self.too_coarse}


def leaves(data: Any, path: str = "") -> dict[str, Any]:
    """Return the values of nested data by dotted paths; tables in lists go by names or indices."""
    items: list[tuple[str, Any]]
    if isinstance(data, Mapping) and data:
        items = list(data.items())
    elif isinstance(data, list | tuple) and data and all(isinstance(entry, Mapping) for entry in data):
        items = [(str(entry.get("name", index)), entry) for index, entry in enumerate(data)]
    else:
        return {path: data} if path else {}
    return {
        key: value for name, inner in items for key, value in leaves(inner, f"{path}.{name}" if path else name).items()
    }


def format_value(value: Any) -> str:
    """Return a value of an axis in a few digits; text as it is."""
    return str(value) if isinstance(value, str) else f"{value:.6g}"


def without_round_off(value: float, scale: float = 1.0) -> float:
    """Return a value, or 0 where it is round-off of numbers of a scale."""
    return 0.0 if abs(value) <= _ROUND_OFF * scale else value


def format_margin(margin: float) -> str:
    """Return the margin of a crossing to the speeds of operation in words."""
    return f"{margin:+.1%}" if margin else "within"


def headline(
    x: np.ndarray,
    damped_mean: np.ndarray,
    damped_max: np.ndarray,
    attached: np.ndarray,
    walls: np.ndarray,
    impacts: np.ndarray,
    undamped: np.ndarray,
    fixed: np.ndarray,
    peaks: Mapping[str, float],
    along_frequency: bool,
) -> Headline:
    """Return the headline of damped curves (n,) over ascending x (n,), nan at points that are not ok.

    walls, impacts: impacts per period (n,) on walls, and of every kind; undamped, fixed: linear curves (n,) at the
    points; peaks: of them between the points, by the names of coupling.sweep.sweep.PEAKS, where they are known.
    """
    ok = np.isfinite(damped_mean)
    free = _linear_top("undamped", x, undamped, peaks, along_frequency)
    fixed_top = _linear_top("fixed", x, fixed, peaks, along_frequency)
    top = _top(x[ok], damped_mean[ok], along_frequency)
    onset = int(np.argmax(np.append(walls > 0.0, True)))
    below = np.flatnonzero(impacts[:onset] > 0.0)
    resonances = [item.at for item in (free, fixed_top, top) if along_frequency and ok.any() and not item.at_edge]
    return Headline(
        damped_peak=top.height,
        damped_peak_at=top.at,
        damped_maximum=_top(x[ok], damped_max[ok], along_frequency).height,
        undamped_peak=free.height,
        undamped_peak_at=free.at,
        fixed_peak=fixed_top.height,
        fixed_peak_at=fixed_top.at,
        attached_mass_fraction=float(attached[ok][np.argmax(damped_mean[ok])]) if ok.any() else math.nan,
        onset=plain(x[onset]) if onset < len(x) else None,
        touched_below=plain(x[below[0]]) if below.size else None,
        peak_at_edge=top.at_edge,
        undamped_at_edge=free.at_edge,
        fixed_at_edge=fixed_top.at_edge,
        spacing=max((_step(x[ok], at) for at in resonances), default=math.nan),
        half_power_width=float(peaks.get("half_power_width", math.nan)),
        points=len(x),
        points_left_out=int(np.count_nonzero(~ok)),
    )


def reference_of(undamped: np.ndarray, peaks: Mapping[str, float]) -> float:
    """Return the divisor of amplitudes in charts, m: the undamped maximum, at the points if the peak is unbounded."""
    peak = float(peaks.get("undamped_peak", math.nan))
    return peak if 0.0 < peak < math.inf else float(np.nan_to_num(undamped).max(initial=0.0)) or math.nan


def _linear_top(name: str, x: np.ndarray, curve: np.ndarray, peaks: Mapping[str, float], along_frequency: bool) -> _Top:
    if f"{name}_peak" not in peaks:
        return _top(x, np.nan_to_num(curve), along_frequency)
    height, at = float(peaks[f"{name}_peak"]), float(peaks[f"{name}_peak_frequency"])
    # a speed comes from the frequency of its engine order
    return _Top(height, at, bool(np.isclose(at, x[[0, -1]] if len(x) else x, rtol=1e-12, atol=0.0).any()))


def _top(x: np.ndarray, curve: np.ndarray, along_frequency: bool) -> _Top:
    if not len(x):
        return _Top(math.nan, None, False)
    index = int(np.argmax(curve))
    return _Top(float(curve[index]), plain(x[index]), along_frequency and index in (0, len(x) - 1))


def _step(x: np.ndarray, at: float) -> float:
    """Return the widest step of ascending points (n,) that contains a position; outside their range, its distance."""
    if not x[0] <= at <= x[-1]:
        return float(np.abs(x - at).min())
    left, right = np.searchsorted(x, at, "left"), np.searchsorted(x, at, "right")
    return float(np.diff(x[max(left - 1, 0) : right + 1]).max(initial=0.0))


def cavity_lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the rigid model's mode moves the cavities, with the keys of [[cavity]]."""
    for label, motion in result["cavity"].items():
        yield (
            f"cavity {label}: moves by {motion['along']:.4g} of {result['rigid']['at']}, normal_motion = "
            f"{without_round_off(motion['normal_motion']):.5g}, rotation = "
            f"{without_round_off(motion['rotation']):.5g} rad/m"
        )
