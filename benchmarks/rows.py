"""Rows of a benchmark: announced, printed as they come, kept in the output folder, and gone on from after a stop.

A row is one measurement of some seconds or minutes. A benchmark names its rows with about what each takes, then takes
them one by one:

    rows = Rows(folder, "modal", asdict(effort), {"first": 2.0, "second": 60.0})
    first = rows.take("first", lambda: {"seconds": measured()}, tell=lambda row: f"{row['seconds']:.2f} s")
    rows.leave_out("second", "lost by far")
    rows.finish()  # after the results are written

A row's value is plain data, as JSON takes it. Finished rows lie in `bench_NAME.partial` until the benchmark ends. They
are taken from there where their inputs, the software and the machine are the same, and measured again otherwise.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from benchmarks.timing import machine
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import InputError
from vanedamp.studies.terminal import duration

_PARTS = ("vanedamp.files", "vanedamp.meshes", "vanedamp.modal", "vanedamp.rom", "vanedamp.coupling", "benchmarks")
_FIELDS = {"name", "inputs", "software", "machine", "seconds", "value"}
#: share of the expected time by which rows are taken to be as expected
_PRIOR = 0.05
#: a row that takes longer is announced, s
_PATIENCE = 20.0

#: takes a row by its name: measures it, or has it
Take = Callable[[str, Callable[[], Any]], Any]


def at_once(_row: str, measure: Callable[[], Any]) -> Any:
    """Take a row by measuring it, without a benchmark around it."""
    return measure()


class Rows:
    """Rows of one run of a benchmark."""

    def __init__(self, folder: Path, name: str, inputs: Mapping[str, Any], expected: Mapping[str, float]) -> None:
        """Announce a benchmark.

        folder: of its results, made if need be; inputs: what its rows depend on, plain data; expected: rows in their
        order, and about what each takes, s. Raises InputError for a folder that cannot be made and for a file of rows
        that cannot be read.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--output {folder}: cannot be made ({error.strerror})") from error
        self.folder, self.file, self._inputs = folder, folder / f"bench_{name}.partial", inputs
        self._expected, self._left = dict(expected), dict(expected)
        self._taken: list[dict[str, Any]] = []
        #: what the rows took by the clock, those of before included
        self.seconds = 0.0
        self._weight = 0.0  # what the rows that were measured should have taken
        self._place = {"software": software(), "machine": _identity()}
        self._kept = self._load()
        others = sum(row["name"] in self._left and not self._fits(row) for row in self._kept)
        again = f"; {others} rows of {self.file} are of other software or another machine" if others else ""
        print(
            f"{name}: {len(expected)} rows, about {duration(sum(expected.values()))} where it was tried; "
            f"stopped, the same command goes on from there{again}",
            flush=True,
        )

    def take(
        self,
        name: str,
        measure: Callable[[], Any],
        *,
        inputs: Mapping[str, Any] | None = None,
        tell: Callable[[Any], str] | None = None,
    ) -> Any:
        """Return the value of a row: the one that is kept, or else measured, kept and told of.

        inputs: what this row depends on, if not what the benchmark does; tell: what is printed of the value.
        """
        key = {"name": name, "inputs": _plain(self._inputs if inputs is None else inputs)} | self._place
        found = next((row for row in self._kept if all(row[part] == value for part, value in key.items())), None)
        number = f"[{len(self._expected) - len(self._left) + 1:3}/{len(self._expected)}]"
        if found is None:
            about = self._pace() * self._left[name]
            if about > _PATIENCE:
                print(f"{number} {name}: about {duration(about)} ...", flush=True)
            started = time.perf_counter()
            value = _plain(measure())
            found = key | {"seconds": time.perf_counter() - started, "value": value}
            self._kept = [row for row in self._kept if not _same(row, key)] + [found]
            self._write()
            source = ""
        else:
            source = "kept, "
        self._taken.append(key)
        self.seconds += found["seconds"]
        self._weight += self._left.pop(name)
        text = f": {tell(found['value'])}" if tell else ""
        print(f"{number} {name}{text}  ({source}{duration(found['seconds'])}{self._time_left()})", flush=True)
        return found["value"]

    def leave_out(self, name: str, reason: str) -> None:
        """Tell that a row is not measured, and why."""
        number = f"[{len(self._expected) - len(self._left) + 1:3}/{len(self._expected)}]"
        del self._left[name]
        print(f"{number} {name}: left out, {reason}", flush=True)

    def finish(self) -> None:
        """Forget the rows of this run: its results are written."""
        self._kept = [row for row in self._kept if not any(_same(row, key) for key in self._taken)]
        if self._kept:
            self._write()
        else:
            self.file.unlink(missing_ok=True)

    def _pace(self) -> float:
        """Return time over expected time of the rows so far; the first few do not say it all."""
        prior = _PRIOR * sum(self._expected.values())
        return (self.seconds + prior) / (self._weight + prior) if prior else 1.0

    def _time_left(self) -> str:
        return f", about {duration(self._pace() * sum(self._left.values()))} left" if self._left else ""

    def _fits(self, row: Mapping[str, Any]) -> bool:
        return all(row[part] == value for part, value in self._place.items())

    def _load(self) -> list[dict[str, Any]]:
        if not self.file.is_file():
            return []
        try:
            rows: list[dict[str, Any]] = json.loads(self.file.read_text(encoding="utf-8"))
            if not all(set(row) >= _FIELDS for row in rows):
                raise ValueError
        except (OSError, ValueError, TypeError):
            raise InputError(f"{self.file}: no rows of a benchmark; remove it to begin anew") from None
        return rows

    def _write(self) -> None:
        with replacing(self.file) as temporary:
            temporary.write_text(json.dumps(self._kept, indent=1) + "\n", encoding="utf-8")


class Contest:
    """Who is still measured: whoever has lost by far at one size takes no part in the next."""

    def __init__(self, ours: str, factor: float = 5.0, limit: float = float("inf")) -> None:
        """Take who always stays, how many times the best's time loses, and the longest time of a measurement, s."""
        self.dropped: dict[str, str] = {}
        self._ours, self._factor, self._limit = ours, factor, limit

    def judge(self, where: str, times: Mapping[str, float], growth: float = 1.0) -> None:
        """Drop losers by the times (s) of a size. where: its name; growth: of the time of one towards the next size."""
        best = min(times.values(), default=0.0)
        for name, seconds in times.items():
            if name == self._ours or name in self.dropped:
                continue
            if seconds > self._factor * best:
                self.dropped[name] = f"{seconds / best:.1f} times the best's time at {where}"
            elif seconds * growth > self._limit:
                self.dropped[name] = (
                    f"{duration(seconds)} at {where}, thus about {duration(seconds * growth)} here; "
                    f"at most {duration(self._limit)}"
                )


@cache
def software() -> dict[str, str]:
    """Return the versions of the libraries, and a digest of our code that results and times depend on."""
    digest = hashlib.sha256()
    for part in _PARTS:
        spec = find_spec(part)
        assert spec is not None and spec.submodule_search_locations is not None
        for path in sorted(Path(next(iter(spec.submodule_search_locations))).resolve().rglob("*.py")):
            digest.update(path.read_bytes())
    versions: dict[str, str] = machine()["versions"]
    return versions | {"code": digest.hexdigest()[:16]}


def _identity() -> dict[str, Any]:
    """Return what tells machines apart whose times must not be mixed."""
    here = machine()
    return {name: here[name] for name in ("processor", "cores")}


def _same(row: Mapping[str, Any], key: Mapping[str, Any]) -> bool:
    """Say whether a row has this name and these inputs, by whatever software and machine."""
    return row["name"] == key["name"] and bool(row["inputs"] == key["inputs"])


def _plain(value: Any) -> Any:
    """Return a value as it comes back from a file: the same in the first run and in one that goes on."""
    return json.loads(json.dumps(value))
