"""Facts of an input file or a result: values by keys of the JSON output, with unit and meaning for the printed one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from vanedamp.files.store import Variable
from vanedamp.studies.hot_spots import plus_minus

#: entries of a list that are shown
MOST = 10


class Fact(NamedTuple):
    """A value under its key in the JSON results, with unit and meaning."""

    key: str
    value: Any
    unit: str = ""
    text: str = ""


class Found(NamedTuple):
    """The content of a file, with JSON texts decoded."""

    path: str
    variables: Mapping[str, Variable]
    attributes: Mapping[str, Any]


def level_fact(level: Mapping[str, Any] | None) -> Iterator[Fact]:
    """Yield the amplitude at the fatigue strength, if there is one."""
    if level:
        error = level["error"] if "error" in level else level.get("hot_spot", {}).get("error")
        note = f"at {level['share']:.0%} of the fatigue strength{plus_minus(error)}"
        yield Fact("fatigue_amplitude", level["amplitude"], "m", note)


def plain_facts(record: Found) -> Iterator[Fact]:
    """Yield the numbers and words of a record of another kind."""
    for name, value in record.attributes.items():
        if isinstance(value, str | int | float) and name not in ("kind", "schema_version"):
            yield Fact(name, value)


def fact_lines(head: str, found: Iterable[Fact]) -> Iterator[str]:
    """Yield printed lines of facts below a heading."""
    yield head
    for key, value, unit, text in found:
        if key == "warnings":
            for warning in value:
                yield f"warning: {warning}"
        elif _known(value):
            yield f"  {key:21} {f'{word(value)} {unit}':26} {text}".rstrip()


def _known(value: Any) -> bool:
    """Whether a value is worth printing."""
    return any(map(_known, value)) if isinstance(value, list) else value not in ({}, None)


def word(value: Any) -> str:
    """Return a value as printed text."""
    if isinstance(value, dict):
        return "; ".join(f"{key}: {word(entry)}" for key, entry in value.items())
    if isinstance(value, list):
        return ", ".join(map(word, value))
    if value is None:
        return "unknown"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
