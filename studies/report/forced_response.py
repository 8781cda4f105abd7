"""Forced responses: curves along one axis of a sweep, and the linear curves of the structure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.quantities.impacts import attached_mass_fraction, impacts_per_period
from vanedamp.coupling.quantities.in_plane import wall_impacts
from vanedamp.coupling.quantities.quantity import QuantityRecord, table
from vanedamp.coupling.scene.paths import assign
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid, Rom
from vanedamp.coupling.sweep.designs import amplitude_known, is_choice
from vanedamp.coupling.sweep.grid import base_scene, resonance_axis
from vanedamp.coupling.sweep.record import PEAKS, Sweep
from vanedamp.coupling.sweep.steady_states import is_start
from vanedamp.coupling.system.linear_response import linear_amplitudes, linear_responses
from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.studies.headline import Headline, format_value, headline, leaves, reference_of
from vanedamp.studies.references import ReferenceNames, reference_names

#: relative difference allowed between a linear amplitude computed again and the sweep's
_SAME = 1e-6
#: no further frequencies
_NOWHERE = np.zeros(0)
#: points of linear curves along an engine order, each of which needs the modes at its speed
_ALONG_ORDER = 201


class LinearCurves(NamedTuple):
    """Amplitudes without bodies and with the bodies fixed, m, each (k,), over ascending x (k,)."""

    x: np.ndarray
    undamped: np.ndarray
    fixed: np.ndarray


@dataclass(frozen=True, eq=False)
class ForcedResponse(QuantityRecord):
    """Curves along an axis of a sweep, each of shape (n,); displacements in m, nan where a point is not ok.

    reference          divisor of amplitudes in charts: the maximum without bodies over the range
    undamped, fixed    linear amplitudes at the points, of all that have any
    damped_max, _mean  absolute maximum of the evaluated periods and mean of the periods' peaks, from the static
                       deflection under the bodies' loads, which linear amplitudes leave out, too
    confidence         half width of the 95 % confidence interval of that mean, nan where it is not known
    quantities         (n, ...) all quantities of the sweep, attributes as well
    headline           results and sentence of the curve
    onset_of           impacts whose first place is the onset
    hertz              frequency of a unit of the axis, Hz: of a speed along an engine order, 1 of a frequency; nan else
    settings           values of the sweep's other axes by path
    source, colour     the file it comes from; its colour on a page
    peak_known         whether the peak is certain: no failed point can be higher
    design, start      identifiers of the parameters that the designer chooses, and of the start of its runs
    names              of its linear references
    """

    name: str
    axis: str
    units: str
    x: np.ndarray
    reference: float
    undamped: np.ndarray
    fixed: np.ndarray
    damped_max: np.ndarray
    damped_mean: np.ndarray
    confidence: np.ndarray
    quantities: Mapping[str, np.ndarray]
    headline: Headline
    names: ReferenceNames
    hertz: float = math.nan
    onset_of: str = "impacts on walls"
    settings: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""
    colour: str = ""
    peak_known: bool = True
    design: Hashable = None
    start: Hashable = None

    @property
    def linear(self) -> LinearCurves:
        """The linear amplitudes at the points."""
        return LinearCurves(self.x, self.undamped, self.fixed)

    @property
    def sentence(self) -> str:
        """The headline in words."""
        low, high, along = self.x[0], self.x[-1], math.isfinite(self.hertz)
        sentence = self.headline.sentence(self.axis, self.units, low, high, along, self.names)
        return f"{self.name}: {sentence}"

    def to_json(self) -> dict[str, Any]:
        """Return the headline as plain data: name and range of the curve, its results and the sentence."""
        ends = [value.item() if isinstance(value, np.generic) else value for value in (self.x[0], self.x[-1])]
        curve = {"name": self.name, "axis": self.axis, "range": ends}
        return curve | self.headline.to_json() | {"sentence": self.sentence}


def model_name(scene: Scene) -> str:
    """Return the structure's model in words."""
    structure = scene.structure
    if isinstance(structure, Rom):
        return "reduced model" if structure.modes is None else f"reduced model, {structure.modes} modes"
    return {Rigid: "rigid model", Prescribed: "prescribed motion"}[type(structure)]


def forced_responses(sweep: Sweep, name: str | None = None) -> list[ForcedResponse]:
    """Return one forced response for every combination of the other axes.

    They run along the excitation frequency if the sweep has it, or else along the speed of rotation, or its longest
    axis of numbers.
    """
    paths = list(sweep.axes)
    along = paths.index(sweep.along)
    order = np.argsort(sweep.axes[paths[along]], kind="stable")
    other_values = [sweep.axes[path] for index, path in enumerate(paths) if index != along]
    labels = [path for index, path in enumerate(paths) if index != along]
    data = sweep.scene.to_dict()
    assign(data, paths[along], None)
    responses = []
    for combination in itertools.product(*(range(len(values)) for values in other_values)):
        point: tuple[Any, ...] = (*combination[:along], order, *combination[along:])
        units = sweep.units()
        settings = {path: axis[index] for path, axis, index in zip(labels, other_values, combination, strict=True)}
        values = [setting(path, value, units[path]) for path, value in settings.items()]
        title = ", ".join([name or model_name(sweep.scene), *values])
        for path, value in settings.items():
            assign(data, path, value)
        of_run = [(path, str(value)) for path, value in leaves(data).items()]
        design, start = (frozenset(leaf for leaf in of_run if of(leaf[0])) for of in (is_choice, is_start))
        response = response_along(sweep, point, paths[along], title, settings)
        responses.append(replace(response, design=design, start=start))
    return responses


def response_along(
    sweep: Sweep, point: tuple[Any, ...], axis: str, name: str, settings: Mapping[str, Any]
) -> ForcedResponse:
    """Return the forced response along an axis of a sweep, at settings of the others by their paths.

    point: indices on each axis, in the axes' order: on `axis` in the order of the curve, on the others
    one index.
    """
    ok, mean = sweep.status[point] == "ok", sweep.amplitude_mean_dynamic[point]
    damped = {
        "damped_max": sweep.amplitude_max_dynamic, "damped_mean": sweep.amplitude_mean_dynamic,
        "confidence": sweep.amplitude_mean_confidence,
    }  # fmt: skip
    cut: dict[str, Any] = {key: frozen(np.where(ok, values[point], np.nan)) for key, values in damped.items()}
    x = sweep.axes[axis][point[list(sweep.axes).index(axis)]]
    undamped, fixed = frozen(sweep.amplitude_undamped[point]), frozen(sweep.amplitude_fixed[point])
    swept, hertz = resonance_axis(sweep.scene, sweep.axes)
    tops = peaks_of(sweep, point) if axis == swept else {}
    numbers = {name: values for name, values in sweep.quantities.items() if values.dtype != object}
    quantities = {
        name: frozen(np.where(ok.reshape(-1, *(1 for _ in values.shape[len(sweep.shape) :])), values[point], np.nan))
        for name, values in numbers.items()
    }
    impacts, on_walls = quantities[impacts_per_period.name], quantities.get(wall_impacts.name)
    counted = on_walls is not None and not np.isnan(on_walls[ok]).any()
    single = not sweep.in_plane and len({damper.cavity for damper in sweep.scene.damper}) == len(sweep.scene.damper)
    walls = on_walls.sum(axis=1) if counted and on_walls is not None else impacts
    return ForcedResponse(
        name=name,
        axis=axis,
        units=sweep.units()[axis],
        x=x,
        reference=reference_of(undamped, tops),
        undamped=undamped,
        fixed=fixed,
        quantities=quantities,
        headline=headline(
            x, cut["damped_mean"], cut["damped_max"], quantities[attached_mass_fraction.name], walls, impacts, undamped,
            fixed, tops, axis == swept,
        ),
        hertz=hertz if axis == swept else math.nan,
        onset_of="impacts on walls" if counted or single else "impacts of any kind",
        settings=settings,
        names=reference_names(sweep.scene) or ReferenceNames(),
        peak_known=bool(ok.any() and amplitude_known(sweep)[point].all() and not (mean[~ok] > mean[ok].max()).any()),
        **cut,
    )  # fmt: skip


def linear_curves(sweep: Sweep, response: ForcedResponse) -> LinearCurves:
    """Return linear curves of a response, fine enough to resolve all peaks; otherwise at its points only.

    They are computed from the sweep's scene, and used if they agree with the sweep at its points: a reduced
    model may have been moved or replaced since.
    """
    stored = response.linear
    if not math.isfinite(response.hertz) or not np.isfinite(stored.undamped).all():
        return stored
    low, high = response.hertz * float(response.x[0]), response.hertz * float(response.x[-1])
    try:
        scene = base_scene(sweep.scene).replace({**response.settings, response.axis: response.x[0]})
        curves = linear_between(scene, low, high, response.hertz * response.x)
    except (VanedampError, OSError):
        return stored
    at = np.searchsorted(curves.x, response.hertz * response.x)
    if not np.allclose([curves.undamped[at], curves.fixed[at]], [stored.undamped, stored.fixed], rtol=_SAME, atol=0.0):
        return stored
    return curves._replace(x=frozen(curves.x / response.hertz))


def linear_between(scene: Scene, low: float, high: float, further: np.ndarray = _NOWHERE) -> LinearCurves:
    """Return linear curves between two frequencies, Hz, fine enough to resolve all peaks, and at further frequencies.

    Along an engine order, peaks may be missed. Raises InputError as coupling.system.linear_response.linear_responses.
    """
    if scene.excitation.engine_order is None:
        both = linear_responses(scene)
        frequencies = np.unique(np.concatenate([further, *(response.grid(low, high) for response in both)]))
        amplitudes = [response.amplitude(frequencies) for response in both]
    else:
        frequencies = np.unique(np.concatenate([further, np.linspace(low, high, _ALONG_ORDER)]))
        amplitudes = list(linear_amplitudes(scene, frequencies))
    return LinearCurves(*map(frozen, (frequencies, *amplitudes)))


def peaks_of(sweep: Sweep, point: tuple[Any, ...]) -> dict[str, Any]:
    """Return the peaks of the linear curves of a part of a sweep, by the names of coupling.sweep.sweep.PEAKS.

    Positions and widths refer to the axis of the sweep, in its unit.
    """
    swept, hertz = resonance_axis(sweep.scene, sweep.axes)
    if not sweep.peaks or swept is None:
        return {}
    along = list(sweep.axes).index(swept)
    units = {name: 1.0 if table()[name].unit == "m" else hertz for name in PEAKS}
    return {name: values[point[:along] + point[along + 1 :]] / units[name] for name, values in sweep.peaks.items()}


def for_people(units: str) -> tuple[float, str]:
    """Return the factor and unit in which values of a unit are shown."""
    return (1e6, "µm") if units == "m" else (1.0, units)


def quantity(value: Any, units: str) -> str:
    """Return a value with its unit, lengths in micrometres."""
    factor, larger = for_people(units)
    if factor != 1.0 and not isinstance(value, str):
        return f"{value * factor:.4g} {larger}"
    return f"{format_value(value)} {units}".removesuffix(" 1")


def setting(path: str, value: Any, units: str) -> str:
    """Return a key and its value in short, such as "c1.gap = 20 µm"; entries without a name keep their table's."""
    short = path.split(".", 1)[-1]
    return f"{path if short[0].isdecimal() else short} = {quantity(value, units)}"


def resonance_grid(start: float, stop: float, peaks: list[float], width: float, num: int) -> np.ndarray:
    """Return ascending frequencies (num,) from start to stop, half of them evenly and half around the peaks.

    peaks: frequencies, each of which is a point of the grid; width: of a peak, relative to its frequency.
    """
    fine = np.linspace(start, stop, 4001)
    bells = sum(1 / (1 + ((fine - peak) / (width * peak)) ** 2) for peak in peaks)
    share = np.cumsum(1 / len(fine) + bells / np.sum(bells))
    grid = np.interp(np.linspace(share[0], share[-1], num), share, fine)
    for peak in peaks:
        grid[np.argmin(np.abs(grid - peak))] = peak
    return grid
