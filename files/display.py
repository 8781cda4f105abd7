"""How a record prints: a line per field, arrays by their shape and range, as scipy's results print."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from html import escape
from typing import Any

import numpy as np

#: entries of an array that are shown, and characters of any other value
_ENTRIES, _WIDTH = 6, 88


class Displayed:
    """Base of records, dataclasses with repr=False, that print so that a notebook can show them."""

    def shown(self) -> dict[str, Any]:
        """Return the values that are printed, by name."""
        return {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]

    def printed_units(self) -> Mapping[str, str]:
        """Return the units of the values that have one, by name."""
        return {}

    def __repr__(self) -> str:
        """Return the record's name and a line for each of its fields that has a value."""
        lines = self.lines()
        width = max(map(len, lines))
        return "\n".join([type(self).__name__, *(f"{name:>{width + 2}}: {text}" for name, text in lines.items())])

    def _repr_html_(self) -> str:
        """Return the same as the table that a notebook shows."""
        return html_table((type(self).__name__, ""), self.lines().items())

    def lines(self) -> dict[str, str]:
        """Return the values that are there as short texts with their units, by name."""
        shown, units = {name: _shown(value) for name, value in self.shown().items()}, self.printed_units()
        return {name: f"{text} {units.get(name, '')}".rstrip() for name, text in shown.items() if text is not None}


class Plotted(Displayed):
    """Base of results that have a figure."""

    def plot(self, scene: Any = None) -> Any:
        """Return the interactive figure (plotly) of `vanedamp.plot`. scene: of a response, for its walls."""
        import vanedamp

        return vanedamp.plot(self, scene)


def html_table(heading: Iterable[str], rows: Iterable[Iterable[str]], note: str = "") -> str:
    """Return a table of texts in HTML, with a note below it."""
    head = _row("th", heading)
    body = "".join(_row("td", row) for row in rows)
    return f"<table><thead>{head}</thead><tbody>{body}</tbody></table>" + (f"<p>{escape(note)}</p>" if note else "")


def _row(tag: str, texts: Iterable[str]) -> str:
    cells = "".join(f'<{tag} style="text-align: left">{escape(text)}</{tag}>' for text in texts)
    return f"<tr>{cells}</tr>"


def _shown(value: Any) -> str | None:
    """Return a value as one short line; None for one that is not there."""
    if isinstance(value, Enum):
        return str(value.value)
    if isinstance(value, np.ndarray):
        return _array(value)
    if hasattr(value, "nnz"):
        return f"{'×'.join(map(str, value.shape))} sparse, {value.nnz} entries"
    if value is None or (hasattr(value, "__len__") and len(value) == 0):
        return None
    if isinstance(value, Displayed):
        return type(value).__name__
    if isinstance(value, Mapping):
        return _cut(", ".join(f"{key}: {_shown(item)}" for key, item in value.items()))
    if is_dataclass(value):
        return _cut(f"{type(value).__name__}({_changed(value)})")
    if isinstance(value, list | tuple):
        if len(value) > _ENTRIES:
            return f"{len(value)} of {type(value[0]).__name__}"
        return _cut(", ".join(filter(None, map(_shown, value))))
    return _cut(f"{value:.6g}" if isinstance(value, float) else str(value))


def _changed(record: Any) -> str:
    """Return the fields of a dataclass that have other values than their defaults."""
    values = [(item.name, getattr(record, item.name), item.default) for item in fields(record)]
    return ", ".join(f"{name}={_shown(value)}" for name, value, default in values if value is not default)


def _array(values: np.ndarray) -> str | None:
    if values.size == 0:
        return None
    if values.size <= _ENTRIES:
        return _cut(np.array2string(values, precision=6, separator=", ").replace("\n", ""))
    shape = "×".join(map(str, values.shape))
    if values.dtype.kind not in "fiu":
        kinds = sorted(set(map(str, values.ravel()[:1000]))) if values.dtype.kind in "OU" else [str(values.dtype)]
        return _cut(f"{shape} of {', '.join(kinds)}")
    if not np.isfinite(values).any():
        return f"{shape} without values"
    return f"{shape} from {np.nanmin(values):.6g} to {np.nanmax(values):.6g}"


def _cut(text: str) -> str:
    return text if len(text) <= _WIDTH else text[: _WIDTH - 3] + "..."
