"""Records with other values of some quantities."""

from __future__ import annotations

from dataclasses import replace

from vanedamp.coupling.quantities.quantity import table


def changed(record, **values):
    """The record with other fields, or quantities."""
    own = {name: values.pop(name) for name in values.keys() & table().keys()}
    return replace(record, quantities={**record.quantities, **own}, **values)
