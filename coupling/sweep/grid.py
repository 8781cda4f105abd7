"""The grid of a sweep: its axes, its points as scenes, made when they are wanted, and the chains that runs form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from vanedamp.coupling.engine.columns import columned
from vanedamp.coupling.methods.registry import check_waveform, why_no_restart
from vanedamp.coupling.model_order.choices import NOTHING, Choices, Chosen, choices_of, leaves_open, with_choices
from vanedamp.coupling.scene.paths import assign, axis_values, namesake
from vanedamp.coupling.scene.rotation import FREQUENCY, SPEEDS, hertz_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.modal_basis import structure_basis
from vanedamp.coupling.system.reduced_model_file import ring_in_file
from vanedamp.files.toml_input import InputError, nearest, validate

_DIRECTION, _ALONG = "continuation.direction", "continuation.along"
#: values that cannot change from one run to the next: their states would not fit
_FIXED = ("structure.model", "structure.file", "structure.modes", "structure.natural", "structure.tolerance")
#: tables of other commands, which no run of a sweep uses
_OF_OTHERS = ("orbit", "ramp", "ring_down")


class Points:
    """Scenes of a grid from the values of their axes: little to send to a worker, however large the grid."""

    def __init__(self, base: Scene, choices: Choices = NOTHING) -> None:
        """Take a scene without sweep, and its open choices as made."""
        self.base, self.choices = base, choices
        self._data = base.to_dict()

    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene at a point, without open choices. Raises InputError for a point that is no scene."""
        return self.chosen(values).scene

    def chosen(self, values: Mapping[str, Any]) -> Chosen:
        """Return the scene at a point with its choices. Raises InputError for a point that is no scene."""
        return with_choices(self.raw(values), self.choices)

    def raw(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene at a point with its choices open. Raises InputError for a point that is no scene."""
        try:
            for path, value in values.items():  # each point sets the same entries
                assign(self._data, path, value)
            return validate(Scene, self._data, "scene")
        except InputError as error:
            point = ", ".join(f"{path} = {value!r}" for path, value in values.items())
            raise InputError(f"sweep: at {point}: {str(error).removeprefix('scene: ')}") from None


class PointTable(Sequence[dict[str, Any]]):
    """Values of points by paths, in a column for each path: instead of mappings, of which a task has ten thousands."""

    def __init__(self, columns: Mapping[str, Sequence[Any]]) -> None:
        """Take columns (k,) by path."""
        self.columns: dict[str, Any] = {
            path: np.array(values) if all(type(value) is float for value in values) else list(values)
            for path, values in columns.items()
        }

    @classmethod
    def of(cls, points: Sequence[Mapping[str, Any]]) -> PointTable:
        """Return the table of points that name the same paths."""
        if isinstance(points, PointTable):
            return points
        return cls({path: [point[path] for point in points] for path in (points[0] if points else ())})

    def __len__(self) -> int:
        """Return the number of points."""
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, index: Any) -> Any:
        """Return the values of a point by their paths."""
        items = ((path, values[index]) for path, values in self.columns.items())
        return {path: float(value) if isinstance(value, np.floating) else value for path, value in items}


class Chain(NamedTuple):
    """Points in the order they run; each begins with the state of the one before if they are `linked`."""

    points: Sequence[int]
    linked: bool


class PointSet(Protocol):
    """Points that run as tasks: those of a grid, of a list, of an ensemble."""

    @property
    def base(self) -> Scene:
        """The scene that points change, without sweep."""

    @property
    def choices(self) -> Choices:
        """Choices for its open ones."""

    @property
    def size(self) -> int:
        """Number of points."""

    def table(self, points: Sequence[int]) -> PointTable:
        """Return the values that some points change in the base."""

    def chains(self) -> Iterator[Chain]:
        """Yield all points, in chains that can run side by side."""


@dataclass(frozen=True, eq=False)
class Grid:
    """The product of the axes of a [sweep] table, the last axis fastest.

    scene     the scene with its [sweep] table
    axes      dotted path -> the values as the scene has them
    base      the scene without its sweep
    choices   that suit all points, for their open choices
    estimate  of the model chosen, None where there was no choice
    advice    on the bodies, None where their shapes were given
    warnings  of the scenes of the first and the last point, to be read before results are used
    along     the axis along which runs are linked, None if they are not
    """

    scene: Scene
    axes: Mapping[str, Sequence[Any]]
    base: Scene
    choices: Choices
    estimate: dict[str, Any] | None
    advice: dict[str, Any] | None
    along: str | None
    warnings: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    def values(self, index: int) -> dict[str, Any]:
        """Return the values of the axes at a point, counted from 0 with the last axis fastest."""
        values: dict[str, Any] = dict.fromkeys(self.axes)
        for path in reversed(values):
            index, entry = divmod(index, len(self.axes[path]))
            values[path] = self.axes[path][entry]
        return values

    def table(self, points: Sequence[int]) -> PointTable:
        """Return the values of the axes at some points."""
        if not self.axes:
            return PointTable({})
        places = np.unravel_index(np.asarray(points, np.int64), self.shape)
        axes = zip(self.axes.items(), places, strict=True)
        return PointTable({path: [values[index] for index in indices.tolist()] for (path, values), indices in axes})

    def chains(self) -> Iterator[Chain]:
        """Yield all points, in chains that can run side by side."""
        if self.along is None:
            yield Chain(range(self.size), False)
            return
        numbers = np.arange(self.size).reshape(self.shape)
        lines = np.moveaxis(numbers, list(self.axes).index(self.along), -1)
        rising = np.argsort(self.axes[self.along], kind="stable")
        for line in lines.reshape(-1, len(rising)):
            direction = self.values(int(line[0])).get(_DIRECTION, self.base.continuation.direction)
            order = rising[::-1] if direction == "down" else rising
            yield Chain([int(point) for point in line[order]], direction != "independent")


class PointList:
    """Any points, to be run like those of a grid; `choices` are for open choices of `base`."""

    def __init__(self, base: Scene, points: Sequence[Mapping[str, Any]], choices: Choices = NOTHING) -> None:
        self.base, self.size, self._points = base, len(points), points
        self.choices = choices

    def table(self, points: Sequence[int]) -> PointTable:
        """Return the values that some points change in the base."""
        return PointTable.of([self._points[point] for point in points])

    def chains(self) -> Iterator[Chain]:
        """Yield all points as one chain."""
        yield Chain(range(self.size), False)


def grid(scene: Scene, empty: bool = False, more: bool = False) -> Grid:
    """Return the grid of a scene's [sweep] table. Raises InputError for a point that is no scene, before any run.

    empty: whether a scene without axes is a grid of one point; more: whether open choices are for more runs than the
    grid's.
    """
    for path in scene.ranges:
        raise InputError(f"ranges: {path} is a range, which vanedamp.ensemble samples; give a number")
    axes = {path: axis_values(values) for path, values in scene.axes.items()}
    if not axes and not empty:
        raise InputError(
            'sweep: missing; name a grid, such as "excitation.frequency" = {start = 95, stop = 105, num = 11}'
        )
    for path in axes:
        if path.split(".")[0] in _OF_OTHERS:
            raise InputError(f"sweep: {path} changes no run of a sweep; its table is for another command")
    points = Points(replace(scene, sweep={**scene.kept}))
    first, linked, undecided = points.raw({path: values[0] for path, values in axes.items()}), False, False
    for made in _telling(points, axes):
        linked = linked or made.continuation.direction != "independent"
        undecided = undecided or leaves_open(made)
        _check_method(made)
        _check_ring(made, first, axes)
    along = _along(scene, axes) if linked else None
    base = base_scene(scene)
    points = Points(base)
    _check_speeds(points, axes)
    choices = choices_of((points.raw(values) for values in scene.sweep_points()[1]), more) if undecided else NOTHING
    start = with_choices(first, choices)
    assemble(start.scene)
    advice = None if choices.body is None else choices.body.to_json()
    last = with_choices(points.raw({path: values[-1] for path, values in axes.items()}), choices)
    warnings = tuple(dict.fromkeys(start.warnings + last.warnings))
    return Grid(scene, axes, base, choices, start.estimate, advice, along, warnings)


def base_scene(scene: Scene) -> Scene:
    """Return a scene without the axes of its sweep; its level refers to one resonance for all swept frequencies."""
    axes = {path: axis_values(values) for path, values in scene.axes.items()}
    base = replace(scene, sweep={**scene.kept})
    swept, hertz = resonance_axis(base, axes)
    if swept is None or not _ordered(axes[swept]) or base.excitation.resonance_near is not None:
        return base
    near = (float(min(axes[swept])) * hertz, float(max(axes[swept])) * hertz)
    return replace(base, excitation=replace(base.excitation, resonance_near=near))


def dimension(path: str) -> str:
    """Return the dimension of a file that an axis is: its path with _ for dots."""
    return path.replace(".", "_")


def dimensions(scene: Scene, axes: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the dimensions "grid" of points, and "curves" over all axes but the frequency, or the speed."""
    paths = list(axes)
    swept = resonance_axis(scene, paths)[0]
    return {"grid": tuple(map(dimension, paths)), "curves": tuple(dimension(path) for path in paths if path != swept)}


def resonance_axis(scene: Scene, axes: Iterable[str]) -> tuple[str | None, float]:
    """Return the axis along which a sweep meets resonances, and the frequency of a unit of it, Hz.

    It is the frequency, or the speed along an engine order; None without.
    """
    paths = list(axes)
    order = None if "excitation.engine_order" in paths else scene.excitation.engine_order
    for path in (FREQUENCY, *SPEEDS):
        if path in paths and math.isfinite(hertz := hertz_of(path, order)):
            return path, hertz
    return None, math.nan


def _check_speeds(points: Points, axes: Mapping[str, Sequence[Any]]) -> None:
    """Raise InputError for a speed at which the structure of the first point is unstable, or beyond its model's."""
    for path in SPEEDS:
        if path in axes and _ordered(axes[path]):
            fastest = points.raw({each: values[0] for each, values in axes.items()} | {path: max(axes[path])})
            structure = fastest.structure
            if isinstance(structure, Rom) and structure.modes == "auto":
                structure = replace(structure, modes=None)
            structure_basis(structure, fastest.speed)


def _telling(points: Points, axes: Mapping[str, Sequence[Any]]) -> list[Scene]:
    """Return scenes that decide whether all points are scenes. Raises InputError for a point that is none.

    The frequency, and numbers with a column (engine.columns), have bounds that are linear in all such numbers: where
    the corners of the grid are scenes, so is what lies between.
    """
    known = {path for path in columned(points.base, axes) if _ordered(axes[path])}
    if points.base.excitation.waveform is None and _ordered(axes.get(FREQUENCY, ("",))):
        known.add(FREQUENCY)
    ends = dict(axes) | {path: (min(axes[path]), max(axes[path])) for path in known}
    with suppress(InputError):  # raised below, at the first point that is no scene
        return [points.raw(dict(zip(axes, values, strict=True))) for values in itertools.product(*ends.values())]
    first = {path: values[0] for path, values in axes.items()}
    others = {path: values for path, values in axes.items() if path != FREQUENCY}
    changes = [dict(zip(others, values, strict=True)) for values in itertools.product(*others.values())]
    changes += [{FREQUENCY: frequency} for frequency in axes.get(FREQUENCY, ())]
    return [points.raw(first | values) for values in changes]


def _check_method(scene: Scene) -> None:
    direction = scene.continuation.direction
    if direction != "independent" and (reason := why_no_restart(scene)):
        raise InputError(f'continuation.direction: "{direction}" {reason}; take "independent"')
    check_waveform(scene, scene.solver.method)
    if "exponents" in scene.kept and scene.solver.method != "exact":
        raise InputError(
            f'sweep.exponents: derivatives are those of the exact engine, not of "{scene.solver.method}"; leave it out'
        )


def _check_ring(scene: Scene, first: Scene, axes: Mapping[str, Sequence[Any]]) -> None:
    """Raise InputError where points of a ring have no columns in common."""
    if ring_in_file(scene.structure) != ring_in_file(first.structure):
        raise InputError("sweep.structure.file: rings of different sectors or labels; sweep them one by one")
    changes = [path for path in axes if path.endswith(".sectors")]
    if changes and (scene.planar or "sections" in scene.kept):
        quantity = "results of bodies in the plane" if scene.planar else "sections"
        raise InputError(
            f"sweep.{changes[0]}: changes the number of bodies, and with it that of {quantity}; leave it out"
        )


def _along(scene: Scene, axes: Mapping[str, Sequence[Any]]) -> str:
    """Return the axis along which runs are linked. Raises InputError where none is or states do not fit."""
    along = scene.continuation.along
    if along is None:
        numeric = [path for path, values in axes.items() if _ordered(values)]
        usual = [path for path in (FREQUENCY, *SPEEDS) if path in axes]
        if not usual and len(numeric) != 1:
            raise InputError(f"continuation.along: name the axis of the sweep, one of {', '.join(numeric) or 'none'}")
        along = (usual or numeric)[0]
    along = along if along in axes else namesake(scene.to_dict(), along, axes) or along
    if along not in axes:
        raise InputError(f"continuation.along: the sweep has no axis '{along}'; {nearest(along, list(axes))}")
    if not _ordered(axes[along]):
        raise InputError(f"continuation.along: the values of {along} are no numbers; only numbers have neighbours")
    fixed = isinstance(scene.structure, Rom) and along.startswith("structure.")
    if fixed or along in _FIXED or _ALONG in axes:
        path = _ALONG if _ALONG in axes else along
        raise InputError(f"continuation.along: a run cannot begin with the state of another {path}; take another axis")
    return along


def _ordered(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) for value in values)
