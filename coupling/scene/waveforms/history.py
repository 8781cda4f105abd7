"""A measured history of the load, from a CSV file, repeated for ever."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.waveform import Waveform
from vanedamp.files.csv_input import read_csv
from vanedamp.files.store import file_stamp, frozen
from vanedamp.files.toml_input import LARGEST, STRICT, InputError

_COLUMNS = ("time", "value")


@dataclass(frozen=True, config=STRICT)
class History(Waveform):
    """A history from a file, straight between its rows, repeated for ever.

    The time from the first row to the last is the period. A value of the last row other than that of the first is a
    jump at the period's end.
    """

    file: str
    """CSV file beside the scene, with the columns time (s) and value, relative to the level"""
    shape: Literal["history"] = "history"
    """"history": a measured history"""
    timed: ClassVar[bool] = True

    def values(self, angle: np.ndarray) -> np.ndarray:
        """Return the values (k,) at angles (k,). Raises InputError for the file."""
        time, value = self._samples
        return np.asarray(np.interp(time[0] + angle / (2 * np.pi) * self.duration, time, value))

    @property
    def duration(self) -> float:
        """Time from the first row to the last, s. Raises InputError for the file."""
        time, _ = self._samples
        return float(time[-1] - time[0])

    @property
    def least_steps(self) -> int:
        """As many steps as there are intervals between rows."""
        return len(self._samples[0]) - 1

    @property
    def _samples(self) -> tuple[np.ndarray, np.ndarray]:
        return _read(self.file, file_stamp(self.file))


@lru_cache(maxsize=8)
def _read(file: str, _stamp: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,), increasing, and values (n,) of a history. Raises InputError."""
    rows = read_csv(file, _COLUMNS, least=3)
    time, value = (np.array([row.number(column) for row in rows]) for column in _COLUMNS)
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if late.size:
        row = rows[late[0] + 1]
        raise InputError(f"{row.place}: time: expected more than {time[late[0]]:g} s, that of the row before")
    if not 1.0 / LARGEST <= time[-1] - time[0] <= LARGEST:
        raise InputError(
            f"{file}: time: expected a period from {1.0 / LARGEST:g} to {LARGEST:g} s, not {time[-1] - time[0]:g}"
        )
    return frozen(time), frozen(value)
