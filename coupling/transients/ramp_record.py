"""The record of run-ups and run-downs, in memory and on disk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.quantities.amplitude import amplitude_max, amplitude_max_dynamic
from vanedamp.coupling.quantities.energy import energy_residual
from vanedamp.coupling.quantities.impacts import impacts_per_period
from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, labels_along, table
from vanedamp.coupling.quantities.stress import MEASURES
from vanedamp.coupling.quantities.sums import ENERGIES
from vanedamp.coupling.response.scene_record import SceneField
from vanedamp.coupling.response.spot_stress import scalars, stress_axes
from vanedamp.coupling.scene.ramp import Ramp as Table
from vanedamp.coupling.transients.no_meaning import NOT_IN_RAMPS
from vanedamp.files.display import Plotted
from vanedamp.files.record import Own, Record, joined
from vanedamp.files.store import Variable, frozen

if TYPE_CHECKING:
    import xarray

DIRECTIONS = ("up", "down")
#: entries of a run's energies, J: `rotation` is the work of a speed that changes stiffness and loads
WORKS = (*ENERGIES[:-1], "rotation", ENERGIES[-1])
#: series of a run, an entry per period, and their units
SERIES = {"time": "s", "frequency": "Hz", "speed": "rad/s"}
#: numbers of a run, and their units ("rate": of the ramp's quantity per second), and texts
NUMBERS = {
    "rate": "1", "peak": "m", "peak_frequency": "Hz", "peak_speed": "rad/s", energy_residual.name: energy_residual.unit
}  # fmt: skip
TEXTS = ("direction", "status")
#: quantities of a period that files have by names of their own
NAMED = {
    amplitude_max.name: "amplitude", amplitude_max_dynamic.name: "amplitude_dynamic", impacts_per_period.name: "impacts"
}  # fmt: skip
#: states at both ends of every period, and their units
STATES = {"displacement": "m", "velocity": "m/s"}
#: curves of the linear structure in steady state, and their units
CURVES = {"frequency": "Hz", "speed": "rad/s", "undamped": "m", "fixed": "m"}


@dataclass(frozen=True, eq=False)
class RampRun(QuantityRecord):
    """A run through p excitation periods with b bodies.

    rate             change of the ramp's quantity per second, below zero where it falls
    status           "ok", or another response.response.Status that ended the run early or spoils its results
    time             (p,) s, at the start of each period
    frequency, speed  (p,) Hz and rad/s in it: the means of the ramp over the period
    stuck            (p, b) whether a body stays at rest in its cavity over the period
    displacement, velocity  (p + 1,) m and m/s at the start of each period, and at the end
    energy           J by the names of WORKS, over the run
    energy_residual  imbalance of the run's energies, relative to the largest term
    stress           (p, s, 8) Pa, amplitudes of stress in it at s hot spots, by response.spot_stress.MEASURES; None
                     without any
    strength         utilisation and damage of the run, by hot spot (strength.assessment); those without data left out
    quantities       (p, ...) of each period, by name, attributes as well (results.md), such as `amplitude_rms`
                     or `wear_volume_rate`; unknown ones are left out
    amplitude, amplitude_dynamic, impacts  (p,) those of NAMED by their names in files
    """

    rate: float
    status: str
    time: np.ndarray
    frequency: np.ndarray
    speed: np.ndarray
    stuck: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    energy: Mapping[str, float]
    energy_residual: float
    stress: np.ndarray | None = None
    strength: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    quantities: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        """Return a quantity: also by its name in files."""
        for quantity, named in NAMED.items():
            if name == named:
                return self.quantities.get(quantity, np.full(len(self.time), np.nan))
        return super().__getattr__(name)

    @property
    def largest(self) -> dict[str, Any]:
        """Largest value of each quantity in a period of the run, by name; angles of a wave have none."""
        return {one.name: np.fmax.reduce(self.quantities[one.name]) for one in self._ordered}

    @property
    def mean(self) -> dict[str, Any]:
        """Mean of each quantity over the time of the run, by name: of rates, the run's total per time."""
        return {one.name: self._mean(self.quantities[one.name]) for one in self._ordered}

    def _mean(self, values: np.ndarray) -> Any:
        """Return the mean over the time of the periods that are known; nan without any."""
        known = np.isfinite(values)
        spans = known / self.frequency.reshape(-1, *[1] * (values.ndim - 1))
        total = spans.sum(axis=0)
        return np.where(known, values, 0.0).T @ (1.0 / self.frequency) / np.where(total > 0.0, total, np.nan).T

    @property
    def limits(self) -> list[tuple[Quantity, float, float]]:
        """Limited quantities, such as wear, with largest value in a period and mean; stress is in `strength`."""
        largest, mean = self.largest, self.mean
        known = (one for name, one in table().items() if name in largest)
        return [(one, float(largest[one.name]), float(mean[one.name])) for one in known if one.limited and not one.dims]

    @property
    def _ordered(self) -> list[Quantity]:
        """Quantities whose values have an order."""
        return [one for name in self.quantities if (one := table()[name]).unit != "rad" or one.dims]

    @property
    def direction(self) -> str:
        """ "up" or "down"."""
        return DIRECTIONS[int(self.rate < 0.0)]

    @property
    def top(self) -> int:
        """Number of the period with the largest amplitude."""
        return int(np.argmax(self.amplitude))

    @property
    def peak(self) -> float:
        """Largest amplitude, m; nan for a run that ended in its first period."""
        return float(self.amplitude[self.top]) if len(self.amplitude) else np.nan

    @property
    def peak_frequency(self) -> float:
        """Frequency there, Hz."""
        return self.at_peak("frequency")

    @property
    def peak_speed(self) -> float:
        """Speed there, rad/s."""
        return self.at_peak("speed")

    def at_peak(self, name: str) -> float:
        """Return the value of a series in the period with the largest amplitude."""
        return float(getattr(self, name)[self.top]) if len(self.amplitude) else np.nan


@dataclass(frozen=True, eq=False, repr=False)
class Ramp(QuantityRecord, Record, Plotted):
    """Run-ups and run-downs of a scene with a [ramp] table.

    Quantities of the periods are attributes, all runs in turn.
    """

    KIND: ClassVar[str] = "ramp"
    IN_JSON = ("warnings",)
    scene: SceneField
    """with its [ramp] table"""
    runs: Annotated[tuple[RampRun, ...], Own()]
    """one for each rate, then those in the other direction; in files `run_of_period`, `run_of_start` and series of the
    periods"""
    curves: Annotated[Mapping[str, np.ndarray], Own()]
    """by the names of CURVES, (k,) amplitudes of the linear structure in steady state without bodies and with every
    body fixed in its cavity"""
    tops: Mapping[str, float]
    """the peaks of both from end to end and where they are, `undamped_peak` and `fixed_peak` (m),
    `undamped_peak_frequency` and `fixed_peak_frequency` (Hz); of the resonance without bodies its `half_power_width`
    (Hz), and `detuning_rate`, by which the frequency leaves it for a unit of the quantity (Hz), both 0 where the ramp
    does not pass it"""
    warnings: tuple[str, ...] = ()
    """to be read before results are used"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""

    @cached_property
    def quantities(self) -> dict[str, np.ndarray]:  # type: ignore[override]
        """Quantities of all periods (results.md), run by run, nan where a run knows none."""
        quantities = joined([run.quantities for run in self.runs], [len(run.time) for run in self.runs])
        return {name: frozen(values) for name, values in quantities.items()}

    @property
    def table(self) -> Table:
        """The scene's [ramp] table."""
        assert self.scene.ramp is not None
        return self.scene.ramp

    def share(self, run: RampRun) -> float:
        """Return the dynamic peak of a run over the linear structure's without bodies in steady state."""
        top = self.tops["undamped_peak"]
        return float(run.amplitude_dynamic.max(initial=0.0)) / top if len(run.time) and 0.0 < top < np.inf else np.nan

    def lewis_rate(self, run: RampRun) -> float:
        """Return the rate of a run in the measure of transients.lewis.peak_ratio; nan without a resonance or damping.

        Of a mode with the half-power width 2 zeta f, whose resonance the excitation's frequency leaves at that rate.
        """
        width, leaving = self.tops["half_power_width"], self.tops["detuning_rate"]
        return 2 * abs(run.rate) * leaving / (np.pi * width**2) if width > 0.0 else np.nan

    def derived(self) -> dict[str, Any]:
        """Return peaks, energies and status of each run as plain data (nan where there is none)."""
        runs = [
            {
                **{name: getattr(run, name) for name in (*TEXTS, *NUMBERS)}, "periods": len(run.time),
                "peak_time": run.at_peak("time"), "peak_share": self.share(run),
                "lewis_rate": self.lewis_rate(run), "impacts": int(run.impacts.sum()),
                "stuck_share": run.stuck.mean(axis=0).tolist() if len(run.time) else [], "energy": dict(run.energy),
            } | ({} if run.stress is None else {"stress": self.tops_of_stress(run), "strength": self.strength(run)})
            for run in self.runs
        ]  # fmt: skip
        measured = [{"largest": _plain(run.largest), "mean": _plain(run.mean)} for run in self.runs]
        return {
            "quantity": self.table.quantity, "unit": self.table.unit, "runs": runs, "stationary": dict(self.tops),
            "quantities": measured,
        }  # fmt: skip

    def tops_of_stress(self, run: RampRun) -> dict[str, dict[str, float]]:
        """Return the largest amplitudes of von Mises and principal stress of a run, Pa, by hot spot if it has any."""
        if run.stress is None:
            return {}
        tops = run.stress.max(axis=0)
        return {spot: scalars(top) for spot, top in zip(self.provenance["hot_spots"], tops, strict=True)}

    def strength(self, run: RampRun) -> dict[str, dict[str, Any]]:
        """Return the strength of a run by hot spot, with the life in starts that pass the ramp `table.passes` times."""
        strength = {spot: dict(values) for spot, values in run.strength.items()}
        for values in strength.values():
            if "life_repeats" in values:
                passes = self.table.passes
                values["life_starts"] = {name: life / passes for name, life in values["life_repeats"].items()}
        return strength

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file: the periods of all runs in turn, runs, and linear curves."""
        runs, dampers = self.runs, len(self.scene.damper)

        def series(name: str) -> np.ndarray:
            return np.concatenate([getattr(run, name) for run in runs])

        periods = [len(run.time) for run in runs]
        numbers = NUMBERS | {"rate": f"{self.table.unit}/s"}
        measured = {
            NAMED.get(name, name): Variable(values, ("period", *table()[name].dims), table()[name].unit)
            for name, values in self.quantities.items()
        }
        variables = {
            "run_of_period": Variable(np.repeat(np.arange(len(runs)), periods), ("period",)),
            **{name: Variable(series(name), ("period",), units) for name, units in SERIES.items()},
            **measured,
            "run_of_start": Variable(np.repeat(np.arange(len(runs)), np.add(periods, 1)), ("start",)),
            **{name: Variable(series(name), ("start",), units) for name, units in STATES.items()},
            **{name: Variable([getattr(run, name) for run in runs], ("run",), one) for name, one in numbers.items()},
            **{name: Variable(np.array([getattr(run, name) for run in runs], object), ("run",)) for name in TEXTS},
            "work": Variable(np.array(WORKS, object), ("work",)),
            "energy": Variable([[run.energy[name] for name in WORKS] for run in runs], ("run", "work"), "J"),
            **{f"linear_{name}": Variable(self.curves[name], ("linear",), units) for name, units in CURVES.items()},
        }
        if any(run.stress is not None for run in runs):
            spots, dims = list(self.provenance["hot_spots"]), ("period", "hot_spot", "stress_measure")
            none = np.zeros((0, len(spots), len(MEASURES)))
            stress = np.concatenate([none if run.stress is None else run.stress for run in runs])
            variables |= stress_axes(spots) | {"stress": Variable(stress, dims, "Pa")}
        axes = labels_along(self.quantities).items()
        variables |= {dim: Variable(np.array(names, object), (dim,)) for dim, names in axes}
        if dampers:
            variables["stuck"] = Variable(series("stuck").astype(np.int8), ("period", "damper"))
        return variables

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        strength = {str(number): run.strength for number, run in enumerate(self.runs) if run.strength}
        return super().attributes() | ({"strength": strength} if strength else {})

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Ramp:
        """Return the record in the variables and attributes of a file."""
        given = cls.given(values, attributes, path)
        values = {"amplitude_dynamic": values["amplitude"]} | dict(values)  # all that earlier files have
        runs, strength = [], json.loads(attributes.get("strength", "{}"))
        for number, rate in enumerate(values["rate"]):
            inside, starts = values["run_of_period"] == number, values["run_of_start"] == number
            stuck = values["stuck"][inside] if given["scene"].damper else np.zeros((np.count_nonzero(inside), 0))
            runs.append(
                RampRun(
                    rate=float(rate), status=str(values["status"][number]), stuck=frozen(stuck, bool),
                    energy=dict(zip(WORKS, values["energy"][number].tolist(), strict=True)),
                    energy_residual=float(values["energy_residual"][number]),
                    stress=frozen(values["stress"][inside]) if "stress" in values and inside.any() else None,
                    strength=strength.get(str(number), {}),
                    quantities={
                        name: frozen(values[NAMED.get(name, name)][inside])
                        for name, one in table().items()
                        if inside.any() and NAMED.get(name, name) in values and one.lacking(NOT_IN_RAMPS) is None
                    },
                    **{name: frozen(values[name][inside]) for name in SERIES},
                    **{name: frozen(values[name][starts]) for name in STATES},
                )
            )  # fmt: skip
        return cls(
            runs=tuple(runs), curves={name: frozen(values[f"linear_{name}"]) for name in CURVES},
            **given,
        )  # fmt: skip

    def to_xarray(self) -> xarray.Dataset:
        """Return the data set of xarray, which must be installed, that the file opens as; with the quantity."""
        return super().to_xarray().assign_attrs(quantity=self.table.quantity)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return quantities as plain data."""
    return {name: np.asarray(value, float).tolist() for name, value in values.items()}
