"""Tables of summaries: readable on a terminal, and in Markdown as they are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

_UNITS = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown with aligned columns."""
    lines = [list(header), *map(list, rows)]
    widths = [max(3, *(len(line[column]) for line in lines)) for column in range(len(header))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join(
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |" for line in lines
    )


def seconds_text(seconds: float) -> str:
    """Return a time with three digits, in the unit that suits it."""
    unit, size = next((pair for pair in _UNITS if seconds >= pair[1]), ("ps", 1e-12))
    return f"{seconds / size:.3g} {unit}"
