"""Sine sweeps: the response to a slow sweep as amplitude and phase versus frequency, for each run up or down.

The phase phi of the excitation is that of its analytic signal. In windows of a whole number of cycles, excitation and
response are fitted by  (a + b tau) cos phi + (c + d tau) sin phi + e,  tau the time from the middle of the window, with
Hann's weights in phi: harmonics and constants drop out, and to first order the change of the amplitude. The ratio of
both is the response at the frequency dphi/dt (synchronous demodulation, order tracking).

A sweep leaves a linear motion behind its steady state: at the resonance, the relative difference is about s/(2 pi b^2),
s the rate in Hz/s and b = zeta f half of the half-power bandwidth, the first term in s of the integral in F. M. Lewis,
Vibration during acceleration through a critical speed, Trans. ASME 54 (1932) 253-261.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import fft, signal

from vanedamp.files.formats.lab_table import lab_table
from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.data import MOTION, Measured, forced
from vanedamp.studies.identification.tables import ForcedTable, SineSweepTable

#: rows of one file
_MOST_ROWS = 3_000_000
#: fraction of their length by which windows advance, and windows of a run at least
_ADVANCE, _LEAST = 0.25, 20
#: samples of a cycle at least, and the change of a step of time, relative, from which they are not equidistant
_SAMPLES, _UNEVEN = 6, 0.1
#: fraction of the largest excitation below which there is none
_SILENT = 0.05
#: relative error of the response at its peak, by the rate of the sweep, from which on a remark tells it
_FAST = 0.05
#: fraction of the half-power bandwidth that a window may pass
_WIDE = 0.25
#: slope of a response over the steepest of a resonance of its bandwidth from which on it jumps, and the fraction of the
#: bandwidth over which it is taken
_JUMP, _OVER = 2.0, 0.05


class Swept(NamedTuple):
    """Response to one run of a sweep at n frequencies, rising (up) or falling.

    frequency: (n,) Hz; response: (n,) complex, over the excitation; level: (n,) amplitudes of the excitation; time:
    (n,) s; bandwidth: Hz, at half power; rate: Hz/s; error: of the response, by the rate; span: Hz, that a window
    passes; all but the rate nan without a peak; jumps: (k,) Hz, where points between steady states were left out.
    """

    up: bool
    frequency: np.ndarray
    response: np.ndarray
    level: np.ndarray
    time: np.ndarray
    bandwidth: float
    rate: float
    error: float
    span: float
    jumps: np.ndarray

    def remarks(self) -> Iterator[str]:
        """Yield what to know before the response is used."""
        run = f"{'up' if self.up else 'down'} to {self.frequency[-1]:.6g} Hz"
        if self.error > _FAST:
            slow = self.rate * _FAST / self.error
            yield (
                f"{run}: {self.rate:.3g} Hz/s is too fast for the half-power bandwidth {self.bandwidth:.3g} Hz: the "
                f"peak is about {self.error:.0%} off the steady one, mostly in phase; sweep at {slow:.2g} Hz/s or "
                "slower"
            )
        if np.isnan(self.error):
            yield f"{run}: has no peak between half-power points, which would show if {self.rate:.3g} Hz/s is too fast"
        if self.span > _WIDE * self.bandwidth:
            yield (
                f"{run}: a window passes {self.span:.3g} Hz of the half-power bandwidth {self.bandwidth:.3g} Hz; take "
                "fewer cycles"
            )
        if len(self.jumps):
            where = ", ".join(f"{one:.6g}" for one in self.jumps)
            yield f"{run}: jumps at {where} Hz: points there are left out"


def read_sine_sweep(table: SineSweepTable, folder: Path) -> list[Measured]:
    """Return a forced response for each run of the sweep in a table's file. Raises InputError."""
    own = lab_table(folder / table.file, InputError)
    if len(own.rows) > _MOST_ROWS:
        raise InputError(f"{own.path}: has {len(own.rows)} rows; at most {_MOST_ROWS}: take every second sample")
    found = own.taken([("time",), ("force", "base_acceleration"), MOTION])
    (driven,) = found.keys() & {"force", "base_acceleration"}
    (moved,) = found.keys() & set(MOTION)
    if (driven == "base_acceleration") == (table.relative is None):
        need = "is the response relative to the base? Give true or false" if table.relative is None else "is for a base"
        raise InputError(
            f"{own.path}: relative: {need}{'' if table.relative is None else '_acceleration; leave it out'}"
        )
    if (path := f"excitation.{driven}") in table.set:
        raise InputError(f"{own.path}: {path} is a column of the file; leave it out of `set`")
    quantities = {"time": "time", driven: driven.removeprefix("base_"), moved: moved}
    time, excitation, response = (own.si(found[role], of, "s" * (of == "time")) for role, of in quantities.items())
    told = {
        found[role].header: f"{role} in {own.unit_of(found[role], of, 's' * (of == 'time')).text}"
        for role, of in quantities.items()
    }
    stem, source = Path(table.file).stem, own.reading(told)
    noise = ForcedTable("", noise=table.noise, deviation=table.deviation, phase_deviation=table.phase_deviation)
    measured = []
    try:
        runs = track(time, excitation, response, table.cycles)
    except InputError as error:
        raise InputError(f"{own.path}: {error}") from None
    for number, run in enumerate(runs, 1):
        place = _spread(run, table.points)
        frequency, level = run.frequency[place], run.level[place]
        omega = 2.0 * np.pi * frequency
        ratio = run.response[place] / (1j * omega) ** MOTION.index(moved)
        if table.relative is False:
            ratio = ratio + 1.0 / omega**2  # less the base's own displacement
        measured.append(
            forced(
                f"{stem} {number}", frequency, np.abs(ratio) * level, dict(table.set) | {path: float(np.median(level))},
                noise, np.angle(ratio), ["up" if run.up else "down"] * len(place), measure="amplitude_harmonic",
                source=f"{source}; {'up' if run.up else 'down'} at {run.rate:.3g} Hz/s, {len(place)} points",
                levels={path: level}, remarks=[f"{own.path}: {remark}" for remark in run.remarks()],
            )
        )  # fmt: skip
    return measured


def track(time: np.ndarray, excitation: np.ndarray, response: np.ndarray, cycles: int) -> list[Swept]:
    """Return the response in each run of a sweep, in the order of time.

    time: (m,) s, equidistant; excitation and response: (m,); cycles: of a window. Raises InputError for an excitation
    that is no slow sweep, and for too few samples.
    """
    step = (time[-1] - time[0]) / max(len(time) - 1, 1)
    if not step > 0.0 or np.abs(time - time[0] - step * np.arange(len(time))).max() > _UNEVEN * step:
        raise InputError("time: expected equidistant samples that rise")
    analytic = signal.hilbert(excitation - excitation.mean(), fft.next_fast_len(len(time)))[: len(time)]
    loud = np.flatnonzero(np.abs(analytic) > _SILENT * np.abs(analytic).max())
    if not len(loud) or not np.any(response):
        raise InputError("the excitation or the response is zero")
    own = slice(loud[0], loud[-1] + 1)
    turned = np.unwrap(np.angle(analytic[own]))
    windows = list(_windows(time[own], turned, excitation[own], response[own], cycles))
    frequency, ratio, driven, middle = np.array(windows, complex).reshape(-1, 4).T
    runs = [
        _swept(frequency.real[k], ratio[k], np.abs(driven[k]), middle.real[k], cycles) for k in _runs(frequency.real)
    ]
    if not runs:
        raise InputError(
            f"no run up or down of {_LEAST} windows of {cycles} cycles; sweep slower, or take fewer cycles"
        )
    return runs


def _windows(
    time: np.ndarray, turned: np.ndarray, excitation: np.ndarray, response: np.ndarray, cycles: int
) -> Iterator[tuple[float, complex, complex, float]]:
    """Yield frequency (Hz), response over excitation, excitation and time of the middle of every window."""
    rising = np.maximum.accumulate(turned)
    if np.max(rising - turned) > np.pi:
        raise InputError("the excitation is no slow sine sweep: its phase runs backwards")
    length = 2.0 * np.pi * cycles
    for middle in np.arange(rising[0] + length / 2.0, rising[-1] - length / 2.0, _ADVANCE * length).tolist():
        begin, end = np.searchsorted(rising, [middle - length / 2.0, middle + length / 2.0]).tolist()
        if end - begin < _SAMPLES * cycles:
            raise InputError(
                f"{(end - begin) / cycles:.2g} samples a cycle at {time[begin]:.6g} s; expected {_SAMPLES} or more"
            )
        own = slice(begin, end)
        half = (time[end - 1] - time[begin]) / 2.0
        tau = (time[own] - time[begin]) / half - 1.0
        weight = np.cos((turned[own] - middle) / (2.0 * cycles)) ** 2  # Hann's
        # harmonics and noise ripple the phase
        smooth = _fitted(np.column_stack([np.ones(len(tau)), tau, tau**2]), weight, turned[own] - middle)
        phi = middle + smooth[0] + tau * (smooth[1] + tau * smooth[2])
        cosine, sine = np.cos(phi), np.sin(phi)
        base = np.column_stack([cosine, sine, tau * cosine, tau * sine, np.ones(len(tau))])
        cosines, sines = _fitted(base, weight, np.column_stack([excitation[own], response[own]]))[:2]
        driven, moved = cosines - 1j * sines
        yield float(smooth[1]) / (2.0 * np.pi * half), moved / driven, driven, float(time[begin] + half)


def _fitted(base: np.ndarray, weight: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the coefficients of columns (m, k) that fit values (m, ...) best with weights (m,) of their squares."""
    weighted = (base * weight[:, None]).T
    return np.asarray(np.linalg.solve(weighted @ base, weighted @ values))


def _runs(frequency: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the places of windows of each run up or down; short ones and rests are left out."""
    if len(frequency) < _LEAST:
        return
    lag = max(len(frequency) // 100, 2)
    ends = np.clip(np.arange(len(frequency)) + np.array([[-lag], [lag]]), 0, len(frequency) - 1)
    change = (frequency[ends[1]] - frequency[ends[0]]) / (ends[1] - ends[0])
    sign = np.where(np.abs(change) > 0.02 * np.abs(change).max(), np.sign(change), 0.0)
    for part in np.split(np.arange(len(frequency)), np.flatnonzero(np.diff(sign)) + 1):
        if len(part) >= _LEAST and sign[part[0]]:
            yield part


def _swept(frequency: np.ndarray, response: np.ndarray, level: np.ndarray, time: np.ndarray, cycles: int) -> Swept:
    """Return the record of one run, without its jumps."""
    size = np.abs(response)
    top, n = int(size.argmax()), len(size)
    low = np.flatnonzero(size < size[top] / np.sqrt(2.0))
    left, right = low[low < top], low[low > top]
    up = bool(frequency[-1] > frequency[0])
    if not len(left) or not len(right):
        rate = abs((frequency[-1] - frequency[0]) / (time[-1] - time[0]))
        return Swept(up, frequency, response, level, time, np.nan, rate, np.nan, np.nan, np.empty(0))
    bandwidth = abs(float(frequency[right[0]] - frequency[left[-1]]))
    near = slice(max(left[-1] - 2, 0), right[0] + 3)
    rate = abs(float(np.polyfit(time[near] - time[top], frequency[near], 1)[0]))
    lag = max(int(_OVER * bandwidth / (abs(frequency[-1] - frequency[0]) / (n - 1))), 1)
    slope = np.abs(response[lag:] - response[:-lag]) / np.abs(frequency[lag:] - frequency[:-lag])
    steep = np.flatnonzero(slope > _JUMP * size[top] * 2.0 / bandwidth)
    settling = 4.0 / (np.pi * bandwidth)
    kept = time > time[0] + settling
    for place in steep.tolist():
        kept &= (time < time[place]) | (time > time[place + lag] + settling)
    first = steep[(np.diff(steep, prepend=-n) > lag) & (time[steep] > time[0] + settling)]
    return Swept(
        up, frequency[kept], response[kept], level[kept], time[kept], bandwidth, rate,
        2.0 * rate / (np.pi * bandwidth**2), rate * cycles / float(frequency[top]), frequency[first],
    )  # fmt: skip


def _spread(run: Swept, points: int) -> np.ndarray:
    """Return places of points, even along the curve of the complex response versus frequency."""
    size, span = np.abs(run.response).max(), abs(run.frequency[-1] - run.frequency[0])
    steps = np.abs(np.diff(run.response)) / size + np.abs(np.diff(run.frequency)) / span
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], points)).clip(0, len(way) - 1))
