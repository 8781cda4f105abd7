"""The base of a benchmark: rows that are announced, measured one by one and resumed, files, and a summary."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from benchmarks.rows import Rows
from benchmarks.timing import machine
from vanedamp.files.store import finite, write_csv, write_json

Result = dict[str, Any]


class Row(NamedTuple):
    """A measurement of some seconds or minutes. seconds: about what it takes; tell: what is printed of its value."""

    seconds: float
    measure: Callable[[], Any]
    tell: Callable[[Any], str] | None = None


@dataclass(frozen=True)
class Benchmark:
    """A benchmark. The fields of a derived dataclass are its parameters: "effort" in the results.

    NAME     of its rows, which lie in bench_NAME.partial until all files are written
    FILES    start of the names of its files, if not bench_NAME
    CLOCK    what its times are, if not CPU time of the thread
    COLUMNS  of its CSV file; none without

    A derived class has `rows` and `result`, or `expected` and `measure` where rows depend on each other.
    """

    NAME: ClassVar[str]
    FILES: ClassVar[str | None] = None
    CLOCK: ClassVar[str | None] = None
    COLUMNS: ClassVar[tuple[str, ...]] = ()

    def rows(self, folder: Path) -> dict[str, Row]:
        """Return the rows by their names, in their order. folder: of the results."""
        raise NotImplementedError

    def result(self, values: Mapping[str, Any]) -> Result:
        """Return what the rows' values come to: content of the JSON file."""
        raise NotImplementedError

    def expected(self, folder: Path) -> dict[str, float]:
        """Return the rows in their order, and about what each takes, s."""
        return {name: row.seconds for name, row in self.rows(folder).items()}

    def measure(self, rows: Rows) -> Result:
        """Take the rows, and return what they come to."""
        mine = self.rows(rows.folder).items()
        return self.result({name: rows.take(name, row.measure, tell=row.tell) for name, row in mine})

    def inputs(self) -> dict[str, Any]:
        """Return what rows depend on."""
        return asdict(self)

    def lines(self, result: Mapping[str, Any]) -> Iterable[Sequence[Any]]:
        """Return the lines of the CSV file: by default its columns of every point."""
        return ([point[name] for name in self.COLUMNS] for point in result["points"])

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        """Write figures."""

    def summary(self, result: Mapping[str, Any]) -> Iterable[str]:
        """Return the lines that are printed of a result."""
        raise NotImplementedError

    def print_summary(self, result: Mapping[str, Any]) -> None:
        """Print the summary."""
        print(*self.summary(result), sep="\n")

    def announced(self, folder: Path) -> Rows:
        """Announce the rows. Raises InputError for a folder that cannot be made."""
        return Rows(folder, self.NAME, self.inputs(), self.expected(folder))

    def begun(self) -> Result:
        """Return what every result begins with."""
        return {"machine": machine() | ({"clock": self.CLOCK} if self.CLOCK else {}), "effort": asdict(self)}

    def run(self, folder: Path, rows: Rows | None = None) -> Result:
        """Measure, write the files into a folder, and return the content of the JSON. rows: announced before."""
        rows = rows or self.announced(folder)
        result = self.begun() | self.measure(rows) | {"wall_time_s": rows.seconds}
        self.write(result, folder)
        rows.finish()
        return result

    def write(self, result: Mapping[str, Any], folder: Path) -> None:
        """Write the files of a result into a folder; numbers that are not finite are null in JSON."""
        stem = self.FILES or f"bench_{self.NAME}"
        write_json(folder / f"{stem}.json", finite(result))
        if self.COLUMNS:
            write_csv(folder / f"{stem}.csv", self.COLUMNS, self.lines(result))
        self.draw(result, folder)
