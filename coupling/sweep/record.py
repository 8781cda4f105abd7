"""The record of a sweep."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.scene.rotation import FREQUENCY, SPEEDS
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.further import EXPONENTS, SECTIONS, SECTORS, STRESSES, WEARS, WORDS
from vanedamp.coupling.sweep.grid import resonance_axis
from vanedamp.coupling.sweep.worker import IN_PLANE, LOSSES, MEASURES
from vanedamp.files.display import Plotted, html_table
from vanedamp.files.record import Own, Record
from vanedamp.files.store import Variable, frozen
from vanedamp.rom.recovery import COMPONENTS

#: peaks of the linear curves over the swept frequencies and their units, each an array over the other axes
PEAKS = {
    "undamped_peak": "m", "undamped_peak_frequency": "Hz", "half_power_width": "Hz",
    "fixed_peak": "m", "fixed_peak_frequency": "Hz",
}  # fmt: skip
_FURTHER = IN_PLANE | EXPONENTS | PEAKS | dict.fromkeys(WORDS, "1") | STRESSES | WEARS | SECTORS
#: columns of the table in a notebook, beside the axes, and its rows
_SHOWN = (
    "amplitude_mean", "amplitude_mean_dynamic", "amplitude_undamped", "amplitude_fixed", "impacts_per_period", "status",
    "classification",
)  # fmt: skip
_MOST_ROWS = 20


_Own = Annotated[np.ndarray, Own()]
_Owned = Annotated[Mapping[str, np.ndarray], Own()]


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Record, Plotted):
    """Responses over the product of the axes; every array has the shape of the grid, in the axes' order.

    scene                 the scene of the sweep, with its [sweep] table
    axes                  dotted path -> values
    amplitude_*           m, of the displacement at excitation.at; `undamped` and `fixed` belong to the linear
                          structure without bodies and with every body fixed in its cavity; `mean_confidence` is the
                          half width of the mean's 95 % confidence interval, nan where there are too few periods;
                          `max_dynamic` and `mean_dynamic` count from the static deflection under the bodies' loads,
                          as `undamped` and `fixed` do
    attached_mass_fraction  fraction of the bodies' mass that the structure feels; nan without bodies or motion
    penetration           deepest overlap of bodies and rigid walls over the free travel; 0 for the exact engine
    energy_share          (*grid, 4) fraction of viscous, friction, impact and contact loss; nan where nothing is lost
    status                "ok", another response.response.Status, or "error: ..." for a run that broke, without measures
    in_plane              by the names of IN_PLANE, (*grid, bodies): largest tilt (rad), fraction of the time off the
                          floor, what small tilts neglect over the smallest play, nan for sliders; impacts on walls per
                          period; empty for a scene of sliders
    exponents             by the names of EXPONENTS, largest Lyapunov exponent, half width of its 95 % confidence
                          interval, the second, and the largest per excitation period; `motion` in a word,
                          `exponent_status`; empty unless the [sweep] table has `exponents`
    sections              by the names of SECTIONS, (*grid, sections), of bodies (*grid, sections, bodies): states at
                          the start of the last evaluated periods and at their end, nan where there are fewer; empty
                          unless the table has `sections`
    stress                by the names of STRESSES, (*grid, spots) or (*grid, spots, 6) Pa, at a reduced model's hot
                          spots (response.spot_stress): amplitudes and the largest of a period, of the linear curves
                          too, of all components, and static stress; utilisation and damage per hour, nan without data
                          of the material (strength.assessment); empty without hot spots
    wear                  by the names of WEARS, over the grid: fastest depth rate of a contact, volume and work rate of
                          all; empty without [wear]
    sectors               by the names of SECTORS, (*grid, N) of each sector of a ring, over the grid of the whole ring
                          (response.sector_response); empty for other structures
    peaks                 by the names of PEAKS: maxima of `undamped` and `fixed` from the lowest to the highest
                          frequency, between the points as well, their frequencies, and the half-power width of the
                          undamped one, over the axes other than the frequency, or the speed along an engine order;
                          empty for a sweep at one frequency
    provenance            versions and further data of the caller (JSON-able)

    A point of the grid is the same whoever ran it, and whenever: no time is taken.
    """

    KIND: ClassVar[str] = "sweep"
    IN_JSON = ()
    scene: SceneField
    axes: _Owned
    amplitude_max: _Own
    amplitude_mean: _Own
    amplitude_mean_confidence: _Own
    amplitude_max_dynamic: _Own
    amplitude_mean_dynamic: _Own
    amplitude_rms: _Own
    amplitude_harmonic: _Own
    amplitude_undamped: _Own
    amplitude_fixed: _Own
    impacts_per_period: _Own
    attached_mass_fraction: _Own
    energy_share: _Own
    energy_residual: _Own
    penetration: _Own
    status: _Own
    classification: _Own
    in_plane: _Owned = field(default_factory=dict)
    exponents: _Owned = field(default_factory=dict)
    sections: _Owned = field(default_factory=dict)
    stress: _Owned = field(default_factory=dict)
    wear: _Owned = field(default_factory=dict)
    sectors: _Owned = field(default_factory=dict)
    peaks: _Owned = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.status.shape

    @property
    def along(self) -> str:
        """Axis of its curves: the excitation frequency, or the speed of rotation, or the longest one of numbers."""
        usual = [path for path in (FREQUENCY, *SPEEDS) if path in self.axes]
        lengths = {path: len(values) * (values.dtype.kind in "if") for path, values in self.axes.items()}
        return usual[0] if usual else max(lengths, key=lengths.__getitem__)

    @property
    def warnings(self) -> tuple[str, ...]:
        """To be read before results are used."""
        return tuple(self.provenance.get("warnings", ()))

    @property
    def moved_starts(self) -> list[dict[str, Any]]:
        """Of the peak of each curve that has impacts: where it is, what a run from bodies about 1e-9 of their gap aside
        comes to, and whether it `agrees` (response.moved_start); empty if not asked for, and for linked runs."""
        return list(self.provenance.get("moved_starts", ()))

    @property
    def hot_spots(self) -> dict[str, dict[str, Any]]:
        """What is known of the hot spots of `stress`, by name in their order (rom.recovery.hot_spots)."""
        return dict(self.provenance.get("hot_spots", {}))

    def _repr_html_(self) -> str:
        """Return the table of points that a notebook shows, at most _MOST_ROWS of them."""
        units = self.units() | {name: MEASURES.get(name, "") for name in _SHOWN}
        points = itertools.product(*self.axes.values())
        measures = zip(*(getattr(self, name).ravel() for name in _SHOWN), strict=True)
        rows = ([*map(_text, point), *map(_text, values)] for point, values in zip(points, measures, strict=True))
        rest = self.status.size - _MOST_ROWS
        return html_table(
            (f"{name} [{unit}]" if unit not in ("", "1") else name for name, unit in units.items()),
            itertools.islice(rows, _MOST_ROWS),
            f"and {rest} further points" if rest > 0 else "",
        )

    def units(self) -> dict[str, str]:
        """Return the unit of every axis by its path."""
        return {path: unit_of(path) for path in self.axes}

    def derived(self) -> dict[str, Any]:
        """Return axes and units by path, measures as nested lists (nan where there is none)."""
        names = (*MEASURES, "energy_share", "status", "classification")
        notes = {"warnings": list(self.warnings)}
        kept = ("estimate", "advice", "moved_starts")
        notes |= {name: self.provenance[name] for name in kept if self.provenance.get(name)}
        axes = {path: values.tolist() for path, values in self.axes.items()}
        further = {**self.in_plane, **self.exponents, **self.stress, **self.wear, **self.sectors, **self.peaks}
        units = self.units() | MEASURES | {name: _FURTHER[name] for name in further}
        return (
            {"axes": axes, "units": units}
            | {"loss": list(LOSSES)}
            | notes
            | {name: getattr(self, name).tolist() for name in names}
            | {name: values.tolist() for name, values in further.items()}
        )

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file. Dimensions are the axes' paths with _ for dots."""
        dims = tuple(_dimension(axis) for axis in self.axes)
        units = self.units()
        variables = {_dimension(axis): Variable(v, (_dimension(axis),), units[axis]) for axis, v in self.axes.items()}
        variables["loss"] = Variable(np.array(LOSSES, dtype=object), ("loss",))
        variables["energy_share"] = Variable(self.energy_share, (*dims, "loss"))
        for name, unit in (MEASURES | {"status": "1", "classification": "1"}).items():
            variables[name] = Variable(getattr(self, name), dims, unit)
        for name, values in self.in_plane.items():
            variables[name] = Variable(values, (*dims, "damper"), IN_PLANE[name])
        plain = {**self.exponents, **self.wear}
        variables |= {name: Variable(values, dims, _FURTHER[name]) for name, values in plain.items()}
        for name, values in self.sections.items():
            own = (*dims, "section", "damper")
            variables[name] = Variable(values, own[: values.ndim], SECTIONS[name])
        if self.stress:
            variables["hot_spot"] = Variable(np.array(list(self.hot_spots), object), ("hot_spot",))
            variables["stress_component"] = Variable(np.array(COMPONENTS, object), ("stress_component",))
        for name, values in self.stress.items():
            own = (*dims, "hot_spot", "stress_component")
            variables[name] = Variable(values, own[: values.ndim], STRESSES[name])
        for name, values in self.sectors.items():
            variables[name] = Variable(values, (*dims, "sector")[: values.ndim], SECTORS[name])
        swept = resonance_axis(self.scene, self.axes)[0]
        others = tuple(_dimension(axis) for axis in self.axes if axis != swept)
        variables |= {name: Variable(values, others, PEAKS[name]) for name, values in self.peaks.items()}
        return variables

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        return super().attributes() | {"axes": list(self.axes)}

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Sweep:
        """Return the record in the variables and attributes of a file."""
        earlier = {f"{name}_dynamic": values[name] for name in ("amplitude_max", "amplitude_mean")}
        values = earlier | {"penetration": np.full(np.shape(values["status"]), np.nan)} | dict(values)
        axes = {axis: values[_dimension(axis)] for axis in attributes["axes"]}
        given = cls.given(values, attributes, path)
        given |= {name: frozen(values[name]) for name in (*MEASURES, "energy_share")}
        given |= {name: frozen(values[name], object) for name in ("status", "classification")}
        return cls(
            axes={axis: frozen(array, array.dtype) for axis, array in axes.items()},
            in_plane={name: frozen(values[name]) for name in IN_PLANE if name in values},
            peaks={name: frozen(values[name]) for name in PEAKS if name in values},
            exponents={
                name: frozen(values[name], object if name in WORDS else float)
                for name in (*EXPONENTS, *WORDS)
                if name in values
            },
            sections={name: frozen(values[name]) for name in SECTIONS if name in values},
            stress={name: frozen(values[name]) for name in STRESSES if name in values},
            wear={name: frozen(values[name]) for name in WEARS if name in values},
            sectors={name: frozen(values[name]) for name in SECTORS if name in values},
            **given,
        )


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _dimension(path: str) -> str:
    return path.replace(".", "_")
