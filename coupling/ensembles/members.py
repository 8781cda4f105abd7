"""The points of an ensemble: a sweep's grid for every sample of the ranges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vanedamp.coupling.ensembles.design import design
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.grid import Chain, Grid, Points, PointTable, grid
from vanedamp.coupling.sweep.sweep import UNFELT, linear_tops
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError


@dataclass(frozen=True, eq=False)
class Members:
    """Points that run like those of a grid, sample by sample.

    scene    the scene with its ranges
    grid     of the scene's own numbers, one point without a [sweep] table
    samples  (s,) values of every range by its path
    """

    scene: Scene
    grid: Grid
    samples: Mapping[str, np.ndarray]

    @property
    def base(self) -> Scene:
        """The scene whose numbers the points change."""
        return self.grid.base

    @property
    def choices(self) -> Any:
        """Choices that suit the scene's own numbers, and are made for all."""
        return self.grid.choices

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(next(iter(self.samples.values())))

    @property
    def size(self) -> int:
        """Number of points."""
        return self.count * self.grid.size

    def values(self, index: int) -> dict[str, Any]:
        """Return a point's changes of the base, by paths."""
        sample, point = divmod(index, self.grid.size)
        return self.grid.values(point) | self.sample(sample)

    def sample(self, number: int) -> dict[str, float]:
        """Return the values of a sample by their paths."""
        return {path: float(values[number]) for path, values in self.samples.items()}

    def table(self, points: Sequence[int]) -> PointTable:
        """Return some points' changes of the base."""
        sample, point = np.divmod(np.asarray(points, np.int64), self.grid.size)
        drawn = {path: values[sample].tolist() for path, values in self.samples.items()}
        return PointTable(self.grid.table(point.tolist()).columns | drawn)

    def chains(self) -> Iterator[Chain]:
        """Yield all points, in chains that can run side by side."""
        if self.grid.along is None:
            yield Chain(range(self.size), False)
            return
        for first in range(0, self.size, self.grid.size):
            for chain in self.grid.chains():
                yield Chain([first + point for point in chain.points], chain.linked)

    def peaks(self) -> dict[str, np.ndarray]:
        """Return the peaks (s, ...) of the linear curves of every sample, as `linear_tops` does of a grid's."""
        felt = [path for path in self.samples if not UNFELT.fullmatch(path)]
        points, known = Points(self.grid.base), dict[tuple[float, ...], dict[str, np.ndarray]]()
        tops = []
        for number in range(self.count):
            sample = self.sample(number)
            key = tuple(sample[path] for path in felt)
            if key not in known:
                known[key] = linear_tops(replace(self.grid, base=points.raw(sample)))
            tops.append(known[key])
        return {name: frozen([each[name] for each in tops]) for name in tops[0]}


def members(scene: Scene) -> Members:
    """Return the points of a scene with ranges. Raises InputError for a sample that is no scene, before any run."""
    if not scene.ranges:
        raise InputError("ranges: missing; give a number as a range, such as friction = [0.2, 0.5]")
    for path in scene.kept:
        raise InputError(f"sweep.{path}: is not kept of an ensemble; leave it out, or give numbers in place of ranges")
    nominal = replace(scene, ranges={})
    if not scene.axes:
        nominal = replace(nominal, continuation=type(scene.continuation)())
    own = grid(nominal, empty=True, more=True)
    columns = design(scene.ranges, scene.sampled).T
    sampled = Members(scene, own, {path: frozen(values) for path, values in zip(scene.ranges, columns, strict=True)})
    points = Points(own.base)
    for number in range(sampled.count):
        for point in {0, own.size - 1}:
            points.raw(sampled.values(number * own.size + point))
    return sampled
