"""The worst of a device: over draws of what is uncertain of it, over its band, and over starts.

Every draw runs over the band from rest, going up and going down, the worst one again with frequencies that differ by
millionths, since irregular motions never repeat; further runs have random starts, draws and frequencies. What was
missed is estimated by the spacing of the largest amplitudes of each of these.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from scipy.stats import qmc

from vanedamp.coupling.quantities.amplitude import amplitude_max_dynamic, amplitude_mean
from vanedamp.coupling.quantities.stress import damage_per_hour, utilisation_max, von_mises
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.designs import UNSURE
from vanedamp.coupling.sweep.sweep import run_list, sweep
from vanedamp.coupling.system.linear_response import linear_amplitudes
from vanedamp.files.record import Array, Record
from vanedamp.files.toml_input import InputError
from vanedamp.studies.design.scenes import LEVELS, Device, Devices, words_of
from vanedamp.studies.worst_start import STARTS

#: largest amplitudes of random runs whose spacing counts, and spacings that a further run may exceed the largest by:
#: with a probability of 95 % if the density of amplitudes is finite up to their end (Renyi's representation)
_LARGEST, _SPACINGS = 10, 3.0
#: draws by which the devices of a search are compared from all starts
SCREENED = 4
#: points by which the band is refined at its worst point
_REFINED = 9
#: repetitions of the worst draw, and by what fraction the frequencies of the next one are higher
_REPEATS, _HIGHER = 8, 1e-6
#: quantities of hot spots that are kept
STRESS_MAX = f"{von_mises.name}_max"
OF_SPOTS = (STRESS_MAX, utilisation_max.name, damage_per_hour.name)

_Draws = Annotated[np.ndarray, Array(("draw", "number"))]


@dataclass(frozen=True, eq=False, repr=False)
class Confirmation(Record):
    """A device over everything that is uncertain of it: d draws of p numbers, f frequencies, r random runs."""

    KIND: ClassVar[str] = "confirmation"
    device: Mapping[str, Any]
    """number of bodies, mass of each [kg], gap [m]"""
    level: int | None
    """natural modes of the level that decides; None: the whole reduced model"""
    levels: tuple[Mapping[str, Any], ...]
    """of the model hierarchy, cheapest first: `level`, amplitude at the worst draw [m]"""
    frequency: Annotated[np.ndarray, Array(("frequency",), "Hz")]
    """of the band"""
    undamped: Annotated[np.ndarray, Array(("frequency",), "m")]
    """amplitude without bodies"""
    fixed: Annotated[np.ndarray, Array(("frequency",), "m")]
    """amplitude with the bodies fixed"""
    worst: Annotated[np.ndarray, Array(("frequency",), "m")]
    """largest amplitude of all draws, from rest, going up and going down"""
    reference: float
    """maximum without bodies [m]"""
    numbers: tuple[str, ...]
    """paths of what is drawn"""
    draws: _Draws
    """of these numbers, in their units"""
    of_draws: Annotated[np.ndarray, Array(("draw",), "m")]
    """largest amplitude of each draw; nan where all of its runs failed"""
    of_starts: Annotated[np.ndarray, Array(("start",), "m")]
    """amplitudes of the runs with random starts; nan where a run failed"""
    of_repeats: Annotated[np.ndarray, Array(("repeat",), "m")]
    """largest amplitudes of the worst draw, again and again"""
    amplitude: float
    """largest amplitude [m]"""
    missed: float
    """by which runs that were not made may exceed it [m]"""
    at: Mapping[str, Any]
    """frequency [Hz], start, and numbers of the largest amplitude"""
    worst_scene: Mapping[str, Any]
    """the scene of the largest amplitude, with a [sweep] where its start is that of a sweep"""
    spots: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """by hot spot: largest stress [Pa], utilisation, and damage per hour weighted over the band, of the worst draw on
    the whole reduced model"""
    spot_scene: Mapping[str, Any] = field(default_factory=dict)
    """the scene of these, with its [sweep]"""
    runs: int = 0
    """number of runs"""
    failed: int = 0
    """of these, without a result"""
    unsure: int = 0
    """of these, not steady at their end"""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def chosen(self) -> Device:
        """The device."""
        return Device(**self.device)

    @property
    def ratio(self) -> float:
        """Largest amplitude over that without bodies."""
        return self.amplitude / self.reference

    @property
    def level_difference(self) -> float:
        """Amplitude on the whole reduced model less that on the level that decides, m, at the worst draw."""
        known = {entry["level"]: entry["amplitude"] for entry in self.levels}
        return float(known[None] - known[self.level])

    @property
    def expected(self) -> float:
        """Largest amplitude that is to be expected, m: with what runs have missed, and the difference of the levels.

        Infinite where one of these is not known.
        """
        total = self.amplitude + self.missed + abs(self.level_difference)
        return total if math.isfinite(total) else math.inf

    def by_number(self) -> list[tuple[str, float]]:
        """Return by path what a number's range adds to the largest amplitude, m, largest first.

        By least squares over the draws: the change of a draw's largest amplitude over the range of the number.
        """
        known = np.isfinite(self.of_draws)
        draws, spread = self.draws[known], np.ptp(self.draws, axis=0)
        scaled = np.column_stack([np.ones(len(draws)), (draws - draws.mean(axis=0)) / spread])
        slopes = np.linalg.lstsq(scaled, self.of_draws[known], rcond=None)[0][1:]
        return sorted(zip(self.numbers, np.abs(slopes).tolist(), strict=True), key=lambda item: -item[1])


def drawn(ranges: Mapping[str, tuple[float, float]], count: int, seed: int) -> np.ndarray:
    """Return draws (count, p) from ranges: half of them a Latin hypercube, half of them random corners.

    The largest amplitude is often at a corner, which a hypercube does not reach. No corner is drawn twice.
    """
    low, high = np.transpose(list(ranges.values()))
    unit = qmc.LatinHypercube(len(ranges), seed=seed).random(count)
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(ranges))))
    order = np.random.default_rng(seed).permutation(len(corners))[: count // 2]
    unit[1 : 2 * len(order) : 2] = corners[order, ::-1]
    return np.asarray(low + unit * (high - low))


class _Runs:
    """Runs of a device so far: counts, and the largest amplitude with its scene."""

    def __init__(
        self, devices: Devices, device: Device, executor: Executor | None, tell: Callable[[int], None]
    ) -> None:
        self.devices, self.device, self._executor, self._tell = devices, device, executor, tell
        self.ranges = devices.ranges(device)
        self.done = self.failed = self.unsure = 0
        self.curve = np.zeros(len(devices.frequencies))
        self.amplitude, self.at, self.scene = 0.0, dict[str, Any](), dict[str, Any]()

    def over_band(
        self, level: int | None, numbers: Mapping[str, float], frequencies: np.ndarray, stress: bool = False
    ) -> Any:
        """Return the sweep of a draw over frequencies, from rest, going up and down, and its amplitudes, m."""
        scene = self.devices.at(self.device, level, stress).replace(dict(numbers))
        axes = {"continuation.direction": list(STARTS), "excitation.frequency": frequencies.tolist()}
        found = sweep(scene.replace({"sweep": axes}), self._executor)
        heights = self._heights(found.status.ravel(), found.quantities).reshape(found.shape)
        return found, heights

    def draw(self, level: int | None, numbers: Mapping[str, float], frequencies: np.ndarray) -> float:
        """Run a draw over frequencies and keep its largest amplitude; return it, m, nan where all runs have failed."""
        found, heights = self.over_band(level, numbers, frequencies)
        if np.array_equal(frequencies, self.devices.frequencies):
            self.curve = np.fmax(self.curve, np.fmax.reduce(heights, axis=0))
        if not np.isfinite(heights).any():
            return np.nan
        start, index = np.unravel_index(np.nanargmax(heights), heights.shape)
        direction, at, scene = list(STARTS)[int(start)], float(frequencies[index]), found.scene
        if direction == "independent":
            scene = scene.replace({"sweep": {}, "excitation.frequency": at})
        return self._keep(float(heights[start, index]), at, STARTS[direction], numbers, scene)

    def random_starts(self, level: int | None, count: int, seed: int) -> np.ndarray:
        """Run random draws with bodies that begin anywhere, at up to twice the speed of the resonance without bodies.

        Return the amplitudes (count,), m; frequencies are random, too. A reduced model begins at rest: other states of
        it are those from which sweeps go up and down.
        """
        base, frequencies = self.devices.at(self.device, level), self.devices.frequencies
        rng = np.random.default_rng(seed)
        speed = 2.0 * np.pi * self.devices.frequency * self.devices.amplitude
        low, high = np.transpose(list(self.ranges.values())) if self.ranges else np.empty((2, 0))
        numbers = low + rng.random((count, len(low))) * (high - low)
        starts = {f"damper.{body}.velocity": 2.0 * speed for body in range(self.device.bodies)}
        if self.device.bodies <= len(self.devices.cavities):  # one in each: not in a row
            least = self.ranges.get("cavity.gap", (self.device.gap, 0.0))[0]
            starts |= {f"damper.{body}.position": 0.499 * least for body in range(self.device.bodies)}
        sizes = np.array(list(starts.values()))
        kicks = (2.0 * rng.random((count, len(sizes))) - 1.0) * sizes
        at = frequencies[0] + rng.random(count) * (frequencies[-1] - frequencies[0])
        points = [
            {"excitation.frequency": float(f), **dict(zip(self.ranges, row, strict=True)),
             **dict(zip(starts, kick, strict=True))}
            for f, row, kick in zip(at, numbers.tolist(), kicks.tolist(), strict=True)
        ]  # fmt: skip
        table = run_list(base, points, self._executor)
        heights = self._heights(table.text("status"), table.arrays((count,)))
        if np.isfinite(heights).any():
            index = int(np.nanargmax(heights))
            values = {path: points[index][path] for path in self.ranges}
            self._keep(heights[index], at[index], "from a random start", values, base.replace(points[index]))
        return heights

    def _keep(
        self, amplitude: float, frequency: float, start: str, numbers: Mapping[str, float], scene: Scene
    ) -> float:
        """Keep a run if its amplitude, m, is the largest so far; return that amplitude."""
        if amplitude > self.amplitude:
            self.amplitude, self.scene = float(amplitude), scene.to_dict()
            self.at = {"frequency": float(frequency), "start": start, **numbers}
        return amplitude

    def _heights(self, status: np.ndarray, found: Mapping[str, np.ndarray]) -> np.ndarray:
        """Count runs; return their largest amplitudes, m, nan where a run has failed."""
        unsure = np.isin(status, UNSURE) & np.isfinite(found[amplitude_mean.name].ravel())
        known = (status == "ok") | unsure
        self.done += status.size
        self.failed += int((~known).sum())
        self.unsure += int(unsure.sum())
        self._tell(self.done)
        heights: np.ndarray = np.where(known, found[amplitude_max_dynamic.name].ravel(), np.nan)
        return heights


def runs_to_confirm(devices: Devices) -> int:
    """Return the number of runs over the band by which a device is confirmed."""
    return 3 * len(devices.frequencies) * (devices.study.effort.draws + _REPEATS)


def confirm(
    devices: Devices, device: Device, executor: Executor | None, progress: Callable[[int, int], None],
    provenance: Mapping[str, Any],
) -> Confirmation:  # fmt: skip
    """Run a device over what is uncertain of it, on the cheapest level that agrees with the whole reduced model."""
    effort, band = devices.study.effort, devices.frequencies
    total = runs_to_confirm(devices) + 3 * len(band) * (len(LEVELS) + 1) + effort.starts + 2 * 3 * _REFINED
    runs = _Runs(devices, device, executor, lambda done: progress(done, max(done, total)))
    paths = list(runs.ranges)
    draws = drawn(runs.ranges, effort.draws, effort.seed) if paths else np.empty((1, 0))
    rows = [dict(zip(paths, row, strict=True)) for row in draws.tolist()]
    cheap = [runs.draw(LEVELS[0], row, band) for row in rows[: max(len(rows) // 4, 1)]]
    worst_row = rows[int(np.argmax(np.nan_to_num(cheap)))]
    levels, whole = _levels(runs, worst_row)
    level = _level(levels, effort.tolerance)
    first = cheap if level == LEVELS[0] else []
    if not first:  # another level decides: what the cheapest has said does not count
        runs.amplitude, runs.curve = 0.0, np.zeros(len(band))
    of_draws = np.array(first + [runs.draw(level, row, band) for row in rows[len(first) :]])
    of_starts = runs.random_starts(level, effort.starts, effort.seed)
    if not runs.amplitude:
        raise InputError(
            f"{devices.source}: envelope: none of {runs.done} runs of {words_of(device)} has a result; see the status "
            f"of `vanedamp run` of its scene at {band[0]:.6g} Hz"
        )
    _refine(runs, level, band)
    numbers = {path: runs.at[path] for path in paths}
    of_repeats = np.array([runs.draw(level, numbers, band * (1.0 + _HIGHER * k)) for k in range(1, _REPEATS + 1)])
    linear = linear_amplitudes(devices.at(device, level), band)
    spots, spot_scene = _spots(runs, numbers, whole if numbers == worst_row else None)
    return Confirmation(
        device=device._asdict(), level=level, levels=levels, frequency=band, undamped=linear[0], fixed=linear[1],
        worst=runs.curve, reference=devices.amplitude, numbers=tuple(paths), draws=draws, of_draws=of_draws,
        of_starts=of_starts, of_repeats=of_repeats, amplitude=runs.amplitude,
        missed=max(map(_missed, (of_starts, of_draws, of_repeats))), at=runs.at, worst_scene=runs.scene,
        spots=spots, spot_scene=spot_scene, runs=runs.done, failed=runs.failed, unsure=runs.unsure,
        provenance=dict(provenance),
    )  # fmt: skip


def screened(
    devices: Devices, candidates: Sequence[tuple[Device, float]], executor: Executor | None,
    progress: Callable[[int, int], None],
) -> Device:  # fmt: skip
    """Return the best of devices by a few draws over all starts on the cheapest level.

    candidates: with the largest amplitude, m, that their search has found from rest. A device is left out if that is
    above what another one reaches from all starts, since further starts only add to it.
    """
    best, least, done = candidates[0][0], np.inf, 0
    total = 3 * len(devices.frequencies) * SCREENED * len(candidates)
    for device, known in sorted(candidates, key=lambda candidate: candidate[1]):
        if known >= least:
            break
        runs = _Runs(devices, device, executor, lambda more, before=done: progress(before + more, total))  # type: ignore[misc]
        largest = known
        for row in drawn(runs.ranges, SCREENED, devices.study.effort.seed).tolist() if runs.ranges else [[]]:
            largest = np.maximum(
                largest, runs.draw(LEVELS[0], dict(zip(runs.ranges, row, strict=True)), devices.frequencies)
            )
            if not largest < least:  # nor where it is not known
                break
        done += runs.done
        if largest < least:
            best, least = device, largest
    return best


def _levels(runs: _Runs, numbers: Mapping[str, float]) -> tuple[tuple[dict[str, Any], ...], Any]:
    """Return the amplitude of a draw on each level, and its sweep on the whole reduced model."""
    entries, found = [], None
    for level in (*LEVELS, None):
        found, heights = runs.over_band(level, numbers, runs.devices.frequencies, stress=level is None)
        entries.append({"level": level, "amplitude": float(np.fmax.reduce(heights, axis=None))})
    return tuple(entries), found


def _level(levels: Sequence[Mapping[str, Any]], tolerance: float) -> int | None:
    """Return the cheapest level whose amplitude is within a tolerance of the last one's."""
    last = levels[-1]["amplitude"]
    near = (one["level"] for one in levels if abs(one["amplitude"] - last) <= tolerance * last)
    return next(near, None)


def _refine(runs: _Runs, level: int | None, band: np.ndarray) -> None:
    """Run the worst draw again between the neighbours of its worst frequency, twice, ever closer."""
    width = float(band[1] - band[0])
    for _ in range(2):
        at, numbers = runs.at["frequency"], {path: runs.at[path] for path in runs.ranges}
        low, high = max(at - width, float(band[0])), min(at + width, float(band[-1]))
        runs.draw(level, numbers, np.linspace(low, high, _REFINED))
        width /= (_REFINED - 1) / 2


def _missed(amplitudes: np.ndarray) -> float:
    """Return by how much further runs may exceed the largest of some, m."""
    known = np.sort(amplitudes[np.isfinite(amplitudes)])[::-1]
    count = min(_LARGEST, len(known) - 1)
    return float(_SPACINGS * (known[0] - known[count]) / count) if count > 0 else float("inf")


def _spots(runs: _Runs, numbers: Mapping[str, float], known: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what hot spots take of a draw on the whole reduced model, and its scene with its sweep."""
    found = runs.over_band(None, numbers, runs.devices.frequencies, stress=True)[0] if known is None else known
    names = list(found.provenance.get("hot_spots", ()))
    if not names:
        return {}, {}
    dwell = runs.devices.dwell
    spots: dict[str, Any] = {}
    for index, name in enumerate(names):
        values = {key: found.quantities[key][..., index] for key in OF_SPOTS if key in found.quantities}
        spots[name] = dict(_of_spot(values, dwell))
    return spots, found.scene.to_dict()


def _of_spot(values: Mapping[str, np.ndarray], dwell: np.ndarray) -> Iterator[tuple[str, float]]:
    """Yield the largest of quantities (starts, f) of a hot spot, and of damage the worst start's mean over the time."""
    for key, array in values.items():
        if np.isfinite(array).any():
            heights = np.fmax.reduce(array, axis=0)
            yield key, float(dwell @ np.nan_to_num(heights) if key == damage_per_hour.name else np.nanmax(heights))
