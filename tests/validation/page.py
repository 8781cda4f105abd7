"""Cases that others have published, as the rows of docs/validation.md."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation.md"
HEADER = ("case", "source", "quantity", "reference", "here", "deviation", "test")


class Figure(NamedTuple):
    """One quantity: its reference, what is computed here, and the largest deviation that a test lets pass.

    reference: as printed where it was published ("0.98093"; "< 1" is a bound), or the value of a closed form
    tolerance: relative to the reference; absolute where that is zero; not used for a bound
    """

    quantity: str
    reference: str | float
    here: float
    tolerance: float = 0.0

    @property
    def bound(self) -> bool:
        """Whether the reference is one side of the number line."""
        return isinstance(self.reference, str) and self.reference[0] in "<>"

    @property
    def deviation(self) -> float:
        """Relative to the reference; absolute where that is zero."""
        reference = float(self.reference)
        return self.here / reference - 1.0 if reference else self.here

    @property
    def holds(self) -> bool:
        """Whether the bound is kept, or the deviation within the tolerance."""
        if self.bound:
            limit = float(str(self.reference)[1:])
            return self.here < limit if str(self.reference)[0] == "<" else self.here > limit
        return abs(self.deviation) <= self.tolerance

    def cells(self) -> tuple[str, str, str, str]:
        """The figure's cells of the table, with as many digits as tell it from its reference."""
        if self.bound:
            return self.quantity, str(self.reference), f"{self.here:.3g}", ""
        digits = min(max(2 - math.floor(math.log10(abs(self.deviation) or 1e-16)), 4), 10)
        shown = self.reference if isinstance(self.reference, str) else f"{self.reference:.{digits}g}"
        return self.quantity, shown, f"{self.here:.{digits}g}", f"{self.deviation:.1e}"


class Case(NamedTuple):
    """A published case: title, source, the test that goes into it, and the function that computes its figures."""

    title: str
    source: str
    test: str
    compute: Callable[[], list[Figure]]

    @property
    def name(self) -> str:
        """Name of the function, by which a test is chosen."""
        return self.compute.__name__

    def lines(self) -> list[str]:
        """Rows of the table; title, source and test stand in the first."""
        rows = [("", "", *figure.cells(), "") for figure in self.compute()]
        rows[0] = (self.title, self.source, *rows[0][2:-1], self.test)
        return [_line(row) for row in rows]


def case(title: str, source: str, test: str) -> Callable[[Callable[[], list[Figure]]], Case]:
    """Make a case of the function that computes its figures. test: "file::function" in tests/."""
    return lambda compute: Case(title, source, f"`{test}`", compute)


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


class Page:
    """The tables of docs/validation.md: each stands between `<!-- NAME -->` and `<!-- end -->`."""

    def __init__(self, path: Path = PAGE) -> None:
        self.path = path
        self.text = path.read_text(encoding="utf-8")

    @cached_property
    def figures(self) -> dict[tuple[str, str], tuple[str, str]]:
        """(reference, here) as printed, by title and quantity."""
        found, title = {}, ""
        for line in self.text.splitlines():
            cells = line[2:-2].split(" | ")
            if len(cells) == len(HEADER):
                title = cells[0] or title
                found[title, cells[2]] = (cells[3], cells[4])
        return found

    def check(self, case: Case, figure: Figure) -> None:
        """Assert that the page shows a figure: its reference as printed, and what was computed within the tolerance."""
        reference, here = self.figures[case.title, figure.quantity]
        if figure.bound:
            assert reference == figure.reference
            assert figure._replace(here=float(here)).holds
            return
        scale = abs(float(figure.reference)) or 1.0
        # ten digits are printed at most
        assert abs(float(reference) - float(figure.reference)) <= 1e-4 * scale
        assert abs(float(here) - figure.here) <= max(figure.tolerance, 1e-9) * scale

    def write(self, name: str, cases: Iterable[Case]) -> None:
        """Compute a table and put it in its place."""
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        start = self.text.index(begin) + len(begin)
        stop = self.text.index(end, start)
        lines = [_line(HEADER), _line(["---"] * len(HEADER))]
        for each in cases:
            lines += each.lines()
        self.text = self.text[:start] + "\n".join(lines) + "\n" + self.text[stop:]
        self.path.write_text(self.text, encoding="utf-8")
