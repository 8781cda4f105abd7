"""Measurements of an identification, in memory and from CSV files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from vanedamp.files.csv_input import CsvRow, csv_table, read_csv
from vanedamp.files.store import frozen
from vanedamp.files.toml_input import InputError
from vanedamp.studies.identification.tables import DecayTable, ForcedTable, ImpactsTable

#: rows of one file
_MOST_ROWS = 10_000

Kind = Literal["forced", "decay", "impacts"]
#: what a history of a decay may be of, and units
MOTION = ("displacement", "velocity", "acceleration")
_UNITS = {"amplitude": "m", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}


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
    what was measured there; measure: of a forced response, which amplitude; direction: of a forced response, (n,) "up",
    "down" or "": from where each frequency was reached.
    """

    kind: Kind
    name: str
    changes: Mapping[str, float]
    at: np.ndarray
    channels: tuple[Channel, ...]
    measure: str = "amplitude_mean"
    direction: Sequence[str] = field(default_factory=tuple)

    @property
    def unit(self) -> str:
        """Unit of `at`."""
        return "Hz" if self.kind == "forced" else "s"


def forced(
    name: str, frequency: Sequence[float] | np.ndarray, amplitude: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: ForcedTable | None = None, phase: np.ndarray | None = None,
    direction: Sequence[str] = (), noise: float | None = None,
) -> Measured:  # fmt: skip
    """Return a forced response: frequencies (n,) Hz, amplitudes (n,) m, phases (n,) rad; noise as in its table."""
    table = table or ForcedTable("", noise=noise)
    channels = [_sized("amplitude", "m", amplitude, table.noise, table.deviation)]
    if phase is not None:
        deviation = table.phase_deviation or table.noise
        channels.append(Channel("phase", "rad", frozen(phase), "angle", deviation))
    frequencies = frozen(frequency)
    return Measured(
        "forced", name, dict(changes), frequencies, tuple(channels), table.measure,
        tuple(direction) or ("",) * len(frequencies),
    )  # fmt: skip


def decay(
    name: str, time: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: DecayTable | None = None, noise: float | None = None,
    quantity: str = "amplitude",
) -> Measured:  # fmt: skip
    """Return a decay: times (n,) s since its start, amplitudes (n,) m or a history of MOTION; noise as in its table."""
    table = table or DecayTable("", noise=noise)
    if quantity == "amplitude":
        channel = _sized(quantity, "m", values, table.noise, table.deviation)
    else:
        channel = Channel(quantity, _UNITS[quantity], frozen(values), "difference", table.deviation)
    return Measured("decay", name, dict(changes), frozen(time), (channel,))


def impacts(
    name: str, time: Sequence[float] | np.ndarray, speed: Sequence[float] | np.ndarray,
    changes: Mapping[str, float], table: ImpactsTable | None = None, noise: float | None = None,
) -> Measured:  # fmt: skip
    """Return impacts of a steady motion: times (n,) s, speeds (n,) m/s before them; noise as in its table."""
    table = table or ImpactsTable("", noise=noise)
    speeds = _sized("speed", "m/s", speed, table.noise, table.deviation)
    times = Channel("time", "s", frozen(time), "difference", table.time_deviation)
    return Measured("impacts", name, dict(changes), frozen(time), (speeds, times))


def _sized(
    name: str, unit: str, values: Sequence[float] | np.ndarray, noise: float | None, deviation: float | None
) -> Channel:
    if deviation is not None:
        return Channel(name, unit, frozen(values), "difference", deviation)
    return Channel(name, unit, frozen(values), "ratio", noise)


def read_forced(table: ForcedTable, folder: Path) -> Measured:
    """Return the forced response in a table's file. Raises InputError."""
    rows = _rows(folder / table.file, ("frequency_hz", "amplitude_m"), ("phase_rad", "direction"))
    frequency, amplitude = (_positive(rows, column) for column in ("frequency_hz", "amplitude_m"))
    given = rows[0].words
    phase = np.array([row.number("phase_rad") for row in rows]) if "phase_rad" in given else None
    for row in rows if "direction" in given else ():
        if row.words["direction"] not in ("up", "down", ""):
            raise InputError(f"{row.place}: direction: expected up or down (got {row.words['direction']!r})")
    direction = [row.words.get("direction", "") for row in rows]
    return forced(Path(table.file).stem, frequency, amplitude, table.set, table, phase, direction)


def read_decay(table: DecayTable, folder: Path) -> Measured:
    """Return the decay in a table's file. Raises InputError."""
    path = folder / table.file
    columns = {f"{name}_{unit}".replace("/", "_").replace("^", ""): name for name, unit in _UNITS.items()}
    header = next((words for _, words in csv_table(path, InputError)), [])
    given = next((column for column in columns if column in header), "amplitude_m")
    rows, quantity = _rows(path, ("time_s", given), instead=tuple(columns)), columns[given]
    if quantity != "amplitude" and table.noise is not None:
        raise InputError(f"decay '{Path(table.file).stem}': noise is relative; for a history give deviation")
    values = _positive(rows, given) if quantity == "amplitude" else np.array([row.number(given) for row in rows])
    return decay(Path(table.file).stem, _rising(rows, "time_s"), values, table.set, table, quantity=quantity)


def read_impacts(table: ImpactsTable, folder: Path) -> Measured:
    """Return the impacts in a table's file. Raises InputError."""
    rows = _rows(folder / table.file, ("time_s", "speed_m_s"))
    return impacts(Path(table.file).stem, _rising(rows, "time_s"), _positive(rows, "speed_m_s"), table.set, table)


def _rows(path: Path, columns: Sequence[str], further: Sequence[str] = (), instead: Sequence[str] = ()) -> list[CsvRow]:
    """Return the rows of a file with some columns, and further ones if they are there. Raises InputError.

    instead: of which the last column is one.
    """
    table = csv_table(path, InputError)
    header = table[0][1] if table else []
    wrong = [name for name in header if name not in (*columns, *further)]
    if wrong:
        known = ", ".join((*columns, *(f"{name} (if measured)" for name in further)))
        known += "".join(f" or {name}" for name in instead if name not in columns)
        raise InputError(f"{path}: line {table[0][0]}: unknown column '{wrong[0]}'; expected {known}")
    rows = read_csv(path, [*columns, *(name for name in further if name in header)])
    if len(rows) > _MOST_ROWS:
        raise InputError(f"{path}: has {len(rows)} rows; at most {_MOST_ROWS}: leave some out")
    return rows


def _positive(rows: Sequence[CsvRow], column: str) -> np.ndarray:
    values = np.array([row.number(column) for row in rows])
    for row, value in zip(rows, values.tolist(), strict=True):
        if value <= 0.0:
            raise InputError(f"{row.place}: {column}: expected a positive number, not {value:g}")
    return values


def _rising(rows: Sequence[CsvRow], column: str) -> np.ndarray:
    values = np.array([row.number(column) for row in rows])
    for row, value, step in zip(rows, values.tolist(), np.diff(values, prepend=-np.inf).tolist(), strict=True):
        if value < 0.0 or step <= 0.0:
            raise InputError(f"{row.place}: {column}: expected times from 0 that rise, not {value:g}")
    return values
