"""The quantities of a motion with their derivatives: the table's formulas on `measures`."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from vanedamp.coupling.quantities.quantity import evaluated, labels, table
from vanedamp.coupling.quantities.sums import SUMS, sources_of
from vanedamp.coupling.response.by_sector import sectors_of_bodies, tuned_amplitude
from vanedamp.coupling.response.figures import measure, measured_of
from vanedamp.coupling.sensitivity.measures import Measures
from vanedamp.coupling.sensitivity.peaks import Swing, joined, top_of
from vanedamp.coupling.tangents.dual import Dual, zeros


class Figures:
    """Inputs of quantities in the periods that count, of some in all, and the quantities.

    kinks: whether largest values have derivatives on one side only.
    """

    def __init__(self, measures: Measures, periods: int) -> None:
        self._measures, self._periods, self._scene = measures, periods, measures.dynamics.frame.scene
        self._system, self._of = measures.dynamics.system, measures.numbers.parts
        self._number, self._count = len(measures.numbers), max(periods - measures.first, 1)
        self._zero, self.kinks = zeros((), self._number), False
        self._span = self._count * self._period

    @property
    def _period(self) -> Dual:
        return Dual(self._system.period, self._of.period)

    def all(self) -> dict[str, Dual]:
        """Return those that are known, by name, of those with a dimension each number, by its label or index."""
        sources, figures = self._sources(), dict[str, Dual]()
        for name, value in evaluated(sources).items():
            figures |= dict(_named(name, value + self._zero if isinstance(value, float) else value))
        for order, wave in zip(self._measures.orders, self._measures.waves[1:], strict=True):
            needed = {"harmonic": wave} | {name: sources[name] for name in ("counted", "period")}
            for one in table().values() if order != 1 else ():
                if set(one.needs) == set(needed):
                    figures[f"harmonic.{order}.{one.name.removesuffix('_harmonic')}"] = one.of(needed)
        return figures | {f"energy.{name}": one for name, one in sources["energy"].items()}

    def _sources(self) -> dict[str, Any]:
        """Return inputs of quantities that have derivatives (quantities.sums)."""
        measures, first, row = self._measures, self._measures.first, np.empty(len(SUMS))
        measure(measured_of(self._scene, self._system), measures.run.records, first, self._periods, np.nan, row)
        known, static = sources_of(row), self._mean(measures.response)
        heights, distances = (self._distances(measures.response, mean, first) for mean in (self._zero, static))
        sources: dict[str, Any] = {
            "counted": self._count, "period": self._period, "omega": measures.omega, "static": static,
            "highest": self._top(heights), "heights": heights.sum(),
            "distance": self._top(distances), "distances": distances.sum(), "square": measures.sums[0],
            "momentum": measures.waves[0], "momentum_change": measures.ends[-1] - measures.ends[0],
            "impacts": float(known["impacts"]) + self._zero, "load": self._load, "energy": measures.energies(),
            "carried": Dual(known["carried"], self._of.mass[:, self._system.along].sum(axis=1)),
        }  # fmt: skip
        if 1 in measures.orders:
            sources["harmonic"] = measures.waves[1 + measures.orders.index(1)]
        if measures.wear is not None:
            sources["wear"] = measures.wear.rates(self._span)
            depths = [one.depth_rate for one in sources["wear"] or () if one.depth_rate is not None]
            self._top(joined(depths, self._number))
        if measures.contacts is not None:
            sources["contacts"], kinks = measures.contacts.worst()
            self.kinks |= kinks
        if measures.outputs:
            sources["sectors"] = self._sectors()
        plane = measures.run.outcome().plane
        if plane is not None:
            sources["tilt"], sources["lifted"] = (
                self._tilts(),
                measures.lifted + np.where(self._system.tilt < 0, np.nan, 0),
            )
            sources["walls"] = plane.walls[first : self._periods].sum(axis=0) + 0.0 * measures.lifted
        return sources

    def _mean(self, swing: Swing) -> Dual:
        """Return the mean from which distances count: zero unless bodies bring a static load.

        By numbers that bring one it jumps.
        """
        if swing.deflected:
            return swing.integral / self._span
        return Dual(0.0, np.where(self._measures.begins, np.nan, 0.0))

    def _distances(self, swing: Swing, mean: Dual, first: int = 0) -> Dual:
        heights, kinks = swing.distances(mean, first)
        self.kinks |= kinks
        return heights

    def _top(self, each: Dual) -> Dual:
        top, kinks = top_of(each)
        self.kinks |= kinks
        return top

    def _sectors(self) -> SimpleNamespace:
        """Return the response of the sectors of a ring, as response.by_sector does."""
        measures, owner = self._measures, np.array(sectors_of_bodies(self._scene, self._system), int)
        sectors = [self._distances(one, self._mean(one)) for one in measures.outputs]
        units = np.flatnonzero(~self._system.without_body)
        units = units[owner[self._system.body[units]] >= 0]
        hits = np.bincount(owner[self._system.body[units]], measures.hits[units], len(sectors)) / self._count
        mean = joined([heights.mean() for heights in sectors], self._number)
        self._top(mean)
        return SimpleNamespace(
            amplitude_mean=mean, amplitude_max=joined([self._top(heights) for heights in sectors], self._number),
            amplitude_undamped=None, amplitude_fixed=None, impacts_per_period=hits + zeros(len(sectors), self._number),
            tuned=self._tuned(),
        )  # fmt: skip

    def _tuned(self) -> Dual | None:
        """Return the amplitude of the tuned ring, m; None without."""
        here = tuned_amplitude(self._scene)
        if here is None:
            return None
        tuned = self._measures.numbers.of_scene(lambda scene: np.array([tuned_amplitude(scene)]), np.array([here]))
        return Dual(here, tuned[0])

    def _tilts(self) -> Dual:
        """Return the largest tilts (b,) of bodies, rad; nan of sliders."""
        extended = np.flatnonzero(self._system.tilt >= 0).tolist()
        tilt = zeros(self._system.bodies, self._number) + np.where(self._system.tilt < 0, np.nan, 0.0)
        tops = [self._top(self._distances(swing, self._zero)) for swing in self._measures.tilts]
        both = dict(zip(extended, tops, strict=True))
        return joined([both.get(body, tilt[body]) for body in range(self._system.bodies)], self._number)

    @property
    def _load(self) -> Dual:
        """Loads of order 1 on the bodies, together, N."""
        dynamics, of = self._measures.dynamics, self._of
        along, e = dynamics.system.along, len(dynamics.system.frequency)
        cosine, sine = dynamics.one + 1, dynamics.one + 1 + e
        root, size = dynamics.root[along], dynamics.size
        value = dynamics.load[along][:, [cosine, sine]] * size * root[:, None]
        turns = of.load[:, along][:, :, [cosine, sine]] * size * root[:, None]
        turns = turns + value * (of.root[:, along] / root)[:, :, None]
        return Dual(dynamics.system.load[0, along].sum(), (turns[:, :, 0] - 1j * turns[:, :, 1]).sum(axis=1))


def _named(name: str, value: Any) -> Iterator[tuple[str, Dual]]:
    """Yield the numbers of a quantity that are known and have derivatives."""
    if isinstance(value, Dual) and value.value.ndim:
        along = labels(table()[name].dims[-1]) or range(len(value.value))
        for label, one in zip(along, value, strict=True):
            yield from _named(f"{name}.{label}", one)
    elif isinstance(value, Dual) and not np.isnan(value.value):
        yield name, value
