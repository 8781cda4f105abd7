"""Measurements of an identification, in memory and from files (files.formats.lab_table)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from vanedamp.coupling.quantities import amplitude as amplitudes
from vanedamp.coupling.quantities.quantity import Quantity, declared_in
from vanedamp.files.formats.lab_table import Column, LabTable, lab_table
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError
from vanedamp.modal.measurements import check_phase
from vanedamp.studies.identification.tables import DecayTable, ForcedTable, ImpactsTable
from vanedamp.studies.measure import known

#: phase that is in degrees if it is said to be in rad
_TURNS = 4.0 * np.pi
#: rows of one file
_MOST_ROWS = 10_000

Kind = Literal["forced", "decay", "impacts"]
#: what a history of a decay may be of, and units
MOTION = ("displacement", "velocity", "acceleration")
_UNITS = {"amplitude": "m", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
_MEAN, _RMS = amplitudes.amplitude_mean.name, amplitudes.amplitude_rms.name
_OF_ORDER_1 = amplitudes.amplitude_harmonic.name


@dataclass(frozen=True, eq=False)
class Channel:
    """A measured quantity at n places.

    name, unit: of the quantity; values: (n,); compare: how a model's values differ from it: "ratio" (the logarithm of
    their ratio), "difference" or "angle" (a difference within half a turn); deviation: standard deviation of that
    difference, None: from the residuals.
    """

    name: str
    unit: str
    values: np.ndarray
    compare: Literal["ratio", "difference", "angle"]
    deviation: float | None

    @property
    def size(self) -> float:
        """Difference that is as large as the values: of angles a quarter of a turn."""
        return {"ratio": 1.0, "angle": 0.5 * np.pi, "difference": float(np.abs(self.values).max())}[self.compare]

    def difference(self, model: np.ndarray) -> np.ndarray:
        """Return by how much a model's values (n,) differ."""
        if self.compare == "ratio":
            with np.errstate(divide="ignore", invalid="ignore"):
                found: np.ndarray = np.log(model / self.values)
            return found
        found = model - self.values
        return np.angle(np.exp(1j * found)) if self.compare == "angle" else found

    def slope(self, model: np.ndarray, derivative: np.ndarray) -> np.ndarray:
        """Return the derivatives (n, P) of `difference` by those of the model."""
        return derivative / model[:, None] if self.compare == "ratio" else derivative

    def deviations(self, deviation: float) -> np.ndarray:
        """Return standard deviations (n,) of the values, in their unit."""
        return deviation * (self.values if self.compare == "ratio" else np.ones(len(self.values)))


@dataclass(frozen=True, eq=False)
class Measured:
    """A measurement.

    name: for people; changes: of the scene as it was made, by paths; at: (n,) frequencies, Hz, or times, s; channels:
    what was measured there; measure: of a forced response, which quantity (studies.measure); direction: of a forced
    response, (n,) "up", "down" or "": from where each frequency was reached; source: how its file was read, in words;
    levels: numbers of the scene that differ from place to place, (n,) by paths; remarks: what to know before use.
    """

    kind: Kind
    name: str
    changes: Mapping[str, float]
    at: np.ndarray
    channels: tuple[Channel, ...]
    measure: str = _MEAN
    direction: Sequence[str] = field(default_factory=tuple)
    source: str = ""
    levels: Mapping[str, np.ndarray] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @property
    def unit(self) -> str:
        """Unit of `at`."""
        return "Hz" if self.kind == "forced" else "s"


def forced(
    name: str, frequency: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: ForcedTable | None = None, phase: np.ndarray | None = None,
    direction: Sequence[str] = (), noise: float | None = None, measure: str | None = None, source: str = "",
    levels: Mapping[str, np.ndarray] | None = None, remarks: Sequence[str] = (),
) -> Measured:  # fmt: skip
    """Return a forced response: frequencies (n,) Hz, values (n,) of what was measured, phases (n,) rad.

    noise: as in its table; measure: what the values are of (default: the table's, or else amplitude_mean), in its unit
    in results; source, levels, remarks: as of `Measured`. Raises InputError for a measure that is no quantity.
    """
    table = table or ForcedTable("", noise=noise)
    measure = measure or table.measure or _MEAN
    of = known(measure, f"forced '{name}': measure")
    title = "amplitude" if _is_amplitude(of) else measure
    channels = [_sized(title, of.unit, values, table.noise, table.deviation)]
    if phase is not None:
        deviation = table.phase_deviation or table.noise
        channels.append(Channel("phase", "rad", frozen(phase), "angle", deviation))
    frequencies = frozen(frequency)
    return Measured(
        "forced", name, dict(changes), frequencies, tuple(channels), measure,
        tuple(direction) or ("",) * len(frequencies), source, levels or {}, remarks,
    )  # fmt: skip


def _is_amplitude(of: Quantity) -> bool:
    """Whether a quantity is an amplitude of the displacement, which columns call so."""
    return of.unit == "m" and of.name in [one.name for one in declared_in(amplitudes)]


def decay(
    name: str, time: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: DecayTable | None = None, noise: float | None = None,
    quantity: str = "amplitude", source: str = "",
) -> Measured:  # fmt: skip
    """Return a decay: times (n,) s since its start, amplitudes (n,) m or a history of MOTION; noise as in its table."""
    table = table or DecayTable("", noise=noise)
    if quantity == "amplitude":
        channel = _sized(quantity, "m", values, table.noise, table.deviation)
    else:
        channel = Channel(quantity, _UNITS[quantity], frozen(values), "difference", table.deviation)
    return Measured("decay", name, dict(changes), frozen(time), (channel,), source=source)


def impacts(
    name: str, time: Sequence[float] | np.ndarray, speed: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: ImpactsTable | None = None, noise: float | None = None, source: str = "",
) -> Measured:  # fmt: skip
    """Return impacts of a steady motion: times (n,) s, speeds (n,) m/s before them; noise as in its table."""
    table = table or ImpactsTable("", noise=noise)
    speeds = _sized("speed", "m/s", speed, table.noise, table.deviation)
    times = Channel("time", "s", frozen(time), "difference", table.time_deviation)
    return Measured("impacts", name, dict(changes), frozen(time), (speeds, times), source=source)


def _sized(
    name: str, unit: str, values: Sequence[float] | np.ndarray, noise: float | None, deviation: float | None
) -> Channel:
    if deviation is not None:
        return Channel(name, unit, frozen(values), "difference", deviation)
    return Channel(name, unit, frozen(values), "ratio", noise)


def read_forced(table: ForcedTable, folder: Path) -> Measured:
    """Return the forced response in a table's file. Raises InputError."""
    own = _rows(folder / table.file)
    roles: tuple[str, ...] = ("amplitude", *MOTION)
    of = known(table.measure or _MEAN, f"forced '{Path(table.file).stem}': measure")
    if table.measure is not None and not _is_amplitude(of):
        roles = (table.measure if of.unit == "1" else f"{table.measure} [{of.unit}]",)
    found = own.taken([("frequency",), roles], ("phase", "direction"))
    frequency = _positive(own, found["frequency"], "frequency", "Hz")
    motion = next(column for role, column in found.items() if role in roles)
    if motion.header in roles and table.measure is not None:
        amplitude, measure, told = own.numbers(motion), table.measure, {motion.header: of.name}
        if table.deviation is None:
            _check_positive(own, motion, amplitude, "; or give deviation")
    else:
        amplitude, measure, told = _amplitude(own, motion, table.measure, 2 * np.pi * frequency)
    direction, phase = [""] * len(frequency), None
    if "phase" in found:
        phase = own.si(found["phase"], "phase")
        unit = own.unit_of(found["phase"], "phase").text
        if unit == "rad" and (largest := float(np.abs(phase).max(initial=0.0))) > _TURNS:
            raise InputError(
                f"{own.path}: {found['phase'].header}: {largest:g} rad is more than two turns; "
                "write phase_deg for degrees"
            )
        phase = phase * (-1.0 if table.conjugate else 1.0)
        told[found["phase"].header] = f"phase in {unit}"
        if motion.unit and motion.unit.quantity in MOTION:  # each derivative is a quarter of a turn ahead
            phase = phase - MOTION.index(motion.unit.quantity) * np.pi / 2
    if "direction" in found:
        direction = own.words(found["direction"])
        for row, word in enumerate(direction):
            if word not in ("up", "down", ""):
                raise InputError(f"{own.place(row)}: direction: expected up or down (got {word!r})")
    if phase is not None:
        order = np.lexsort((frequency, np.array(direction)))
        check_phase(own.path, InputError, (amplitude * np.exp(1j * phase))[None, order], table.conjugate)
    told[found["frequency"].header] = f"frequency in {own.unit_of(found['frequency'], 'frequency', 'Hz').text}"
    return forced(
        Path(table.file).stem, frequency, amplitude, table.set, table, phase, direction, measure=measure,
        source=own.reading(told),
    )  # fmt: skip


def _amplitude(
    table: LabTable, column: Column, measure: str | None, omega: np.ndarray
) -> tuple[np.ndarray, str, dict[str, str]]:
    """Return amplitudes (n,) m at angular frequencies (n,), the measure that they are, and how they were read.

    A root mean square is that of any motion, which a model has, too, or of a sine; one of velocity or acceleration is
    that of a displacement for a sine only. Raises InputError for others.
    """
    quantity = column.unit.quantity if column.unit and column.unit.quantity in MOTION else "displacement"
    values, kind = _positive(table, column, quantity), column.kind or "pk"
    measure = measure or (_RMS if kind == "rms" else _MEAN)
    sine, where = measure == _OF_ORDER_1, f"{table.path}: {column.header!r}: measure"
    if quantity != "displacement" and not sine:
        raise InputError(f'{where}: {quantity} gives the displacement of a sine only; take "{_OF_ORDER_1}"')
    if (kind == "rms") != (measure == _RMS) and not (sine and kind == "rms"):
        raise InputError(f'{where}: "{measure}" is no {kind} value; take "{_OF_ORDER_1}" for that of a sine')
    scale = {"pk-pk": 0.5, "rms": np.sqrt(2.0) if sine else 1.0, "pk": 1.0}[kind]
    text = f"{measure} of {quantity} in {table.unit_of(column, quantity).text}, {kind}"
    return scale * values / omega ** MOTION.index(quantity), measure, {column.header: text}


def read_decay(table: DecayTable, folder: Path) -> Measured:
    """Return the decay in a table's file. Raises InputError."""
    own = _rows(folder / table.file)
    found = own.taken([("time",), tuple(_UNITS)])
    quantity, column = next(item for item in found.items() if item[0] != "time")
    if quantity != "amplitude" and table.noise is not None:
        raise InputError(f"decay '{Path(table.file).stem}': noise is relative; for a history give deviation")
    if column.kind == "rms" or (column.kind == "pk-pk" and quantity != "amplitude"):
        raise InputError(f"{own.path}: {column.header!r}: expected amplitudes or a history, not {column.kind} values")
    values = own.si(column, quantity) if quantity != "amplitude" else _positive(own, column, "displacement")
    told = {
        found["time"].header: f"time in {own.unit_of(found['time'], 'time', 's').text}",
        column.header: f"{quantity} in {column.unit.text if column.unit else ''} {column.kind}".strip(),
    }
    return decay(
        Path(table.file).stem, _rising(own, found["time"]), values * (0.5 if column.kind == "pk-pk" else 1.0),
        table.set, table, quantity=quantity, source=own.reading(told),
    )  # fmt: skip


def read_impacts(table: ImpactsTable, folder: Path) -> Measured:
    """Return the impacts in a table's file. Raises InputError."""
    own = _rows(folder / table.file)
    found = own.taken([("time",), ("speed", "velocity")])
    time, speed = found.pop("time"), next(iter(found.values()))
    speeds = _positive(own, speed, "velocity")
    told = {
        time.header: f"time in {own.unit_of(time, 'time', 's').text}",
        speed.header: f"speed in {own.unit_of(speed, 'velocity').text}",
    }
    return impacts(
        Path(table.file).stem, _rising(own, time), speeds, table.set, table, source=own.reading(told)
    )  # fmt: skip


def _rows(path: Path) -> LabTable:
    """Return the table in a file. Raises InputError."""
    table = lab_table(path, InputError)
    if len(table.rows) > _MOST_ROWS:
        raise InputError(f"{path}: has {len(table.rows)} rows; at most {_MOST_ROWS}: leave some out")
    return table


def _positive(table: LabTable, column: Column, quantity: str, default: str = "") -> np.ndarray:
    values = table.si(column, quantity, default)
    _check_positive(table, column, values)
    return values


def _check_positive(table: LabTable, column: Column, values: np.ndarray, hint: str = "") -> None:
    for row, value in enumerate(values.tolist()):
        if value <= 0.0:
            raise InputError(f"{table.place(row)}: {column.header}: expected a positive number, not {value:g}{hint}")


def _rising(table: LabTable, column: Column) -> np.ndarray:
    values = table.si(column, "time", "s")
    for row, (value, step) in enumerate(zip(values.tolist(), np.diff(values, prepend=-np.inf).tolist(), strict=True)):
        if value < 0.0 or step <= 0.0:
            raise InputError(f"{table.place(row)}: {column.header}: expected times from 0 that rise, not {value:g}")
    return values
